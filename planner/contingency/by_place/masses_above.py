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

import numpy as np

from planner.contingency.by_place.kernels import Masses
from planner.contingency.priced_relaxation import SURE, TAIL, Weights
from planner.evaluate.grid import probability_below
from planner.evaluate.model import Floats

FINE = 8192
"""Cells of the whole resource in which amounts are rounded down: 2 s of a day of 4 h. By hand."""

LEAST_FINE = 4
"""Cells to a node at least. By hand."""


def fine_cells(ln: Floats, weights: Weights, steps: int) -> Floats:
    """Return the chances that an action takes 0, 1, ... fine cells of the resource, (cells + 1,).

    `ln` are its log-normal parameters, as in `Model.leg_ln`; what takes more than all is left out.
    """
    cells = steps * max(LEAST_FINE, FINE // steps)
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


def masses_above(actions: list[Floats], nodes: int, *, drives: bool) -> Masses:
    """Return the masses of actions from their fine cells, (cells + 1,) each."""
    rows = [_above(cells, nodes, drives) for cells in actions]
    hat, bulge, within = (np.array([row[k] for row in rows]).reshape(-1, nodes) for k in range(3))
    some = hat > 0.0
    return Masses(
        hat=hat.astype(np.float32),
        low=np.argmax(some, axis=1),
        high=np.where(some.any(axis=1), nodes - np.argmax(some[:, ::-1], axis=1), 0),
        bulge=bulge.astype(np.float32),
        within=within.astype(np.float32),
        summed=np.cumsum(hat, axis=1).astype(np.float32),
        quick=np.array([row[3] for row in rows], float),
    )


def _above(cells: Floats, nodes: int, drive: bool) -> tuple[Floats, Floats, Floats, float]:
    each = (len(cells) - 1) // (nodes - 1)
    mass, quick = cells.copy(), 0.0
    if drive:
        quick = float(mass[:each].sum())
        mass[each] = mass[each : 2 * each].sum()
        mass[each + 1 : 2 * each] = 0.0
    else:
        mass[0] = mass[:each].sum()
    mass[0 if drive else 1 : each] = 0.0
    kept = min(nodes - 1, int(np.count_nonzero(mass[::-1].cumsum() > TAIL)) // each + 1) * each
    mass[kept] += mass[kept + 1 :].sum()
    mass[kept + 1 :] = 0.0
    at, share = np.arange(len(mass)) // each, np.arange(len(mass)) % each / each
    hat = np.bincount(at, mass * (1.0 - share), nodes + 1) + np.bincount(at + 1, mass * share, nodes + 1)
    more = np.append(mass[::-1].cumsum()[::-1], 0.0)[1:]  # P(X > x)
    excess = np.append(more[::-1].cumsum()[::-1], 0.0)[: len(mass)] / each  # E max(X - x, 0), in nodes
    below = mass.cumsum()  # P(X <= x)
    over = _over_chords(below, each)
    within = below[::each] + np.maximum(np.append(over, 0.0), np.append(0.0, over))
    bulge = np.append(_over_chords(-excess, each), 0.0)
    return np.asarray(hat[:nodes], float), np.asarray(bulge, float), np.asarray(within, float), quick


def _over_chords(values: Floats, each: int) -> Floats:
    """Return by how much a function at fine cells (cells + 1,) passes its chord between two nodes at most."""
    left, right = values[:-1:each], values[each::each]
    share = np.arange(each + 1) / each
    inner = np.column_stack([values[:-1].reshape(-1, each), right])
    chords = np.outer(left, 1.0 - share) + np.outer(right, share)
    return np.asarray(np.maximum((inner - chords).max(axis=1), 0.0))
