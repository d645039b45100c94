"""What actions take of one resource, in a form that keeps functions between nodes above the true ones.

An amount is split between the two fine nodes beside it, so that its mean is kept. A value U that is linear
between nodes, which are fine nodes too, has an expectation E[U(t + X)] that is known at the nodes, and may
bulge above its chords between them: by what the concave kinks of U give, each smoothed by X (`bulge`), and by
what the end of the day gives (`within`). Nodes hold the chord and the larger bulge beside them, as in
`planner.evaluate.majorant` for two resources. Splitting raises E[(y - X)+], which is convex in X, by at most
a quarter of a cell times the chance of the cell around y: too much for convex kinks, and what it is too
little for concave ones is added to their bulge.

A node is filled in after all later ones, so a drive may depend on later nodes alone: what takes less than
two nodes is rounded down to one, and what takes less than one is split between the next node and its own
(`quick`), where it is paid for by more than any value there. An observation depends on its own node, since
the states after it are filled in before it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numba import njit

from planner.contingency.by_place.kernels import Masses
from planner.contingency.linear_program import solved
from planner.contingency.priced_relaxation import Weights
from planner.evaluate.grid import Rounding, weights_from
from planner.evaluate.model import Floats

FINE = 8192
"""Fine cells of the whole resource: 2 s of a day of 4 h. By hand."""

TAIL = 1e-5
"""Chance of what takes longest that is put on the last node kept: it loosens the bound by so much of what can
be won later. By hand: a tenth of that leaves a third more nodes of each drive."""

SPLITS = 3
"""Amounts of an action that are split apart at most: seconds, joules and what its tracks take."""

LESS_FINE = 2048
"""The same where nothing is bounded: 7 s of a day of 4 h. By hand: at 30 targets that saves a second."""

LEAST_FINE = 4
"""Cells to a node at least. By hand."""

CERTAIN = 1e-7
"""Chance that is not told from 0, nor from 1, where chances are raised. By hand."""


def fine_cells(ln: Floats, weights: Weights, steps: int, fine: int = FINE) -> Floats:
    """Return the masses at fine nodes of what an action takes of the resource, (cells + 1,).

    `ln` are its log-normal parameters, as in `Model.leg_ln`; what takes more than all is left out. There are
    about `fine` cells, a whole number of them to each of the steps. An amount is split between the nodes
    beside it, those of time and of energy apart.
    """
    cells = steps * max(LEAST_FINE, fine // steps)
    seconds = _one(float(ln[0]), float(ln[1]), weights.per_s, cells)
    if weights.per_j <= 0.0:
        return seconds
    joules = _one(float(ln[2]), float(ln[3]), weights.per_j, cells)
    size = 1 << (2 * cells + 1).bit_length()
    both = np.fft.irfft(np.fft.rfft(seconds, size) * np.fft.rfft(joules, size), size)[: cells + 1]
    return np.asarray(np.maximum(both, 0.0))


def _one(mu: float, sigma: float, scale: float, cells: int) -> Floats:
    at = mu + math.log(scale) if scale > 0.0 else -math.inf
    return weights_from(0.0, cells + 1, 1.0 / cells, at, sigma, 0.0, Rounding.MID)


def later(cells: Floats, share: float) -> Floats:
    """Return fine cells (cells + 1,) of an action that takes a share of the resource more, split as well."""
    moved, part = divmod(share * (len(cells) - 1), 1.0)
    first = min(len(cells), int(moved))
    longer = np.concatenate([np.zeros(first + 1), cells])
    return (1.0 - part) * longer[1 : len(cells) + 1] + part * longer[: len(cells)]


def masses_above(
    actions: Iterable[Floats], count: int, nodes: int, *, drives: bool, above: bool = True
) -> Masses:
    """Return the masses of so many actions from their fine cells, (cells + 1,) each.

    Where functions need not lie `above` the true ones masses keep the mean alone: such a grid bounds nothing,
    but lies nearer on few nodes.
    """
    hat, bulge, within = (np.zeros((count, nodes)) for _ in range(3))
    quick = np.zeros(count)
    raised: dict[bytes, Floats] = {}
    for k, cells in enumerate(actions):
        if not above:
            _near(cells, drives, hat[k], within[k])
            continue
        quick[k], below = _above(cells, drives, hat[k], bulge[k], within[k])
        if not drives:
            key = below.tobytes()  # many observations of a day take the same
            if key not in raised:
                raised[key] = _least_above(below, nodes)
            within[k] = raised[key]
    some = hat > 0.0
    return Masses(
        hat=hat.astype(np.float32),
        low=np.argmax(some, axis=1),
        high=np.where(some.any(axis=1), nodes - np.argmax(some[:, ::-1], axis=1), 0),
        bulge=bulge.astype(np.float32),
        within=within.astype(np.float32),
        summed=np.cumsum(hat, axis=1).astype(np.float32),
        quick=quick,
    )


@njit(cache=True, nogil=True)
def _above(cells: Floats, drive: bool, hat: Floats, bulge: Floats, within: Floats) -> tuple[float, Floats]:
    """Fill in the masses of an action, (nodes,) each.

    Return the chance that is left out, and what is no less than P(X <= x) from each fine node up to the next
    one.
    """
    nodes = len(hat)
    each = (len(cells) - 1) // (nodes - 1)
    mass, first, quick, kinked = cells.copy(), each if drive else 0, 0.0, 0.0
    if drive:
        quick, kinked = _split_first(cells, each)
        mass[each] += mass[:each].sum() - quick
        mass[:each] = 0.0
    together = mass[first : first + each].sum()
    mass[first : first + each] = 0.0
    mass[first] = together
    far, tail = len(mass), 0.0
    while far > 0 and tail + mass[far - 1] <= TAIL:
        far -= 1
        tail += mass[far]
    kept = min(nodes - 1, far // each + 1) * each
    mass[kept] += mass[kept + 1 :].sum()
    mass[kept + 1 :] = 0.0
    below = mass.cumsum()
    cut = 2.0 * SPLITS * mass[-SPLITS - 1 :].max()  # what was split to beyond the day is not known
    below[:-SPLITS] = below[SPLITS:].copy()  # an amount is split to less than so many cells above it
    below[-SPLITS:] = min(1.0, below[-1] + cut)
    if drive:
        own = cells[: each + SPLITS].cumsum()[SPLITS:]
        below[:each] = np.maximum(below[:each], own - quick)
    excess = np.zeros(len(mass) + 1)  # E max(X - x, 0), in nodes
    more = 0.0
    for x in range(len(mass) - 1, -1, -1):
        excess[x] = excess[x + 1] + more / each
        more += mass[x]
    for x in range(kept + 1):
        node, share = x // each, x % each / each
        hat[node] += mass[x] * (1.0 - share)
        if node + 1 < nodes:
            hat[node + 1] += mass[x] * share
    before = 0.0
    for node in range(nodes):
        x = node * each
        over = _over_chord(below, x, each, 1.0) if node + 1 < nodes else 0.0
        within[node] = below[x] + max(over, before)
        around = mass[max(0, x - each - SPLITS) : x + 2 * each + SPLITS].max()
        split = SPLITS / 2.0 * around / each  # a cell holds no more than both its nodes
        bulge[node] = _over_chord(excess, x, each, -1.0) + split if node + 1 < nodes else 0.0
        before = over
    if drive:
        bulge[0] = kinked
    return quick, below


@njit(cache=True, nogil=True)
def _split_first(cells: Floats, each: int) -> tuple[float, float]:
    """Return the mass on its own node of what a drive takes less than a node for, and what a concave kink at
    that node adds in the cell before it.
    """
    share = np.arange(each) / each
    quick = float((cells[:each] * (1.0 - share)).sum())
    most, below, passed = 0.0, 0.0, 0.0
    for y in range(1, each):
        passed += cells[y - 1]
        below += passed / each  # E max(y - X, 0), in nodes
        most = max(most, quick * share[y] - below)
    around = cells[: each + SPLITS].max()
    return quick, min(quick, most + SPLITS / 2.0 * around / each)


def _least_above(below: Floats, nodes: int) -> Floats:
    """Return the chances at nodes, (nodes,), of least sum whose chords are nowhere below those at fine nodes.

    None is above 1: a node above its neighbours would be a time of the day that a policy gains by meeting. By
    that, at 15 targets of seed 8231140, the bound on 160 nodes falls from 82.0 to 80.9, where 768 have 80.7.
    """
    each = (len(below) - 1) // (nodes - 1)
    chance = np.minimum(below[::each] + CERTAIN, 1.0)
    (rising,) = np.nonzero((below > CERTAIN) & (below < below[-1] - CERTAIN))
    if not len(rising):
        return chance
    first, last = int(rising[0]) // each, min(nodes - 1, int(rising[-1]) // each + 1)
    fine = np.arange(first * each, last * each + 1)
    left = np.minimum(fine // each, last - 1)
    row, chord = np.arange(len(fine)), np.zeros((len(fine), last - first + 1))
    chord[row, left - first + 1] = fine / each - left
    chord[row, left - first] = 1.0 - chord[row, left - first + 1]
    found = solved(np.ones(chord.shape[1]), -chord, -below[fine], (0.0, 1.0), math.inf)
    raised = np.ones(chord.shape[1]) if found.status else np.maximum(found.x, chance[first : last + 1])
    missing = max(0.0, float(np.max(below[fine] - chord @ raised)))
    chance[first : last + 1] = raised + missing + CERTAIN
    return chance


@njit(cache=True, nogil=True)
def _near(cells: Floats, drive: bool, hat: Floats, within: Floats) -> None:
    """Fill in the masses of an action, (nodes,) each, that keep its mean; a drive takes a node at least."""
    each = (len(cells) - 1) // (len(hat) - 1)
    for x in range(len(cells)):
        at = max(x, each) if drive else x
        node, share = at // each, at % each / each
        hat[node] += cells[x] * (1.0 - share)
        if node + 1 < len(hat):
            hat[node + 1] += cells[x] * share
        if x % each == 0:
            within[x // each :] += cells[max(0, x - each + 1) : x + 1].sum()
    high = len(hat)
    tail = 0.0
    while high > 2 and tail + hat[high - 1] <= TAIL:
        high -= 1
        tail += hat[high]
    hat[high - 1] += tail
    hat[high:] = 0.0


@njit(cache=True, nogil=True)
def _over_chord(values: Floats, x: int, each: int, sign: float) -> float:
    """Return by how much a function at fine cells, times a sign, passes its chord from x on at most."""
    left, rise, most = values[x], values[x + each] - values[x], 0.0
    for y in range(1, each):
        most = max(most, sign * (values[x + y] - left - rise * (y / each)))
    return most
