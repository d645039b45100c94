"""What actions take of one resource, in a form that keeps functions between nodes above the true ones.

Amounts are rounded down to fine cells, and keep their mean there. A value U that is linear between nodes has
an expectation E[U(t + X)] that is known at the nodes, and may bulge above its chords between them: by what
the concave kinks of U give, each smoothed by X (`bulge`), and by what the end of the day gives (`within`).
Nodes hold the chord and the larger bulge beside them, as in `planner.evaluate.majorant` for two resources.

A node is filled in after all later ones, so a drive may depend on later nodes alone: what takes less than
two nodes is rounded down to one, and the chance of less than one is left out (`quick`) and paid for as if it
won everything. An observation depends on its own node, since the states after it are filled in before it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numba import njit

from planner.contingency.by_place.kernels import Masses
from planner.contingency.priced_relaxation import SURE, Weights
from planner.evaluate.grid import probability_below
from planner.evaluate.model import Floats

FINE = 8192
"""Cells of the whole resource in which amounts are rounded down: 2 s of a day of 4 h. By hand."""

TAIL = 1e-5
"""Chance of what takes longest that is put on the last node kept: it loosens the bound by so much of what can
be won later. By hand: a tenth of that leaves a third more nodes of each drive."""

LESS_FINE = 2048
"""The same where nothing is bounded: 7 s of a day of 4 h. By hand: at 30 targets that saves a second."""

LEAST_FINE = 4
"""Cells to a node at least. By hand."""


def fine_cells(ln: Floats, weights: Weights, steps: int, fine: int = FINE) -> Floats:
    """Return the chances that an action takes 0, 1, ... fine cells of the resource, (cells + 1,).

    `ln` are its log-normal parameters, as in `Model.leg_ln`; what takes more than all is left out. There are
    about `fine` cells, a whole number of them to each of the steps.
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
    edges = np.asarray((np.arange(cells + 2) - SURE) / cells, np.float64)
    edges[0] = -1.0
    at = mu + math.log(scale) if scale > 0.0 else -math.inf
    return np.asarray(np.diff(probability_below(edges, at, sigma)))


def later(cells: Floats, share: float) -> Floats:
    """Return fine cells (cells + 1,) of an action that takes a share of the resource more."""
    moved = min(len(cells), math.floor(share * (len(cells) - 1) * (1.0 - SURE)))
    return np.concatenate([np.zeros(moved), cells[: len(cells) - moved]])


def masses_above(
    actions: Iterable[Floats], count: int, nodes: int, *, drives: bool, above: bool = True
) -> Masses:
    """Return the masses of so many actions from their fine cells, (cells + 1,) each.

    Where functions need not lie `above` the true ones masses keep the mean alone: such a grid bounds nothing,
    but lies nearer on few nodes.
    """
    hat, bulge, within = (np.zeros((count, nodes)) for _ in range(3))
    quick = np.zeros(count)
    for k, cells in enumerate(actions):
        if above:
            quick[k] = _above(cells, drives, hat[k], bulge[k], within[k])
        else:
            _near(cells, drives, hat[k], within[k])
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
def _above(cells: Floats, drive: bool, hat: Floats, bulge: Floats, within: Floats) -> float:
    """Fill in the masses of an action, (nodes,) each; return the chance that is left out."""
    nodes = len(hat)
    each = (len(cells) - 1) // (nodes - 1)
    mass, first, quick = cells.copy(), each if drive else 0, 0.0
    if drive:
        quick = mass[:each].sum()
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
    below = mass.cumsum()  # P(X <= x)
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
        bulge[node] = _over_chord(excess, x, each, -1.0) if node + 1 < nodes else 0.0
        before = over
    return quick


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
