"""Nodes whose chords are above chances that fall in both axes, as little as that takes."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planner.evaluate.model import Floats

Singles = NDArray[np.float32]

TURNS = 16
"""Rounds in which the nodes of a chance are raised, the last of which may raise some above 1. By hand."""

LITTLE = 1e-6
"""Chance by which a node is not lowered: single precision is not finer. By hand."""

NOISE = 1e-9
"""Chance by which a chord may seem too low: a hundredth of what chances are raised by for rounding."""


@njit(cache=True, nogil=True)
def _chords(nodes: Floats, i: int, j: int, shares: Floats, chords: Floats) -> None:
    """Write what is between the nodes of a cell at `shares` [finer + 1] of either side, 0 to 1, to `chords`
    [finer + 1, finer + 1].
    """
    for q in range(len(shares)):
        low = nodes[i, j] + shares[q] * (nodes[i, j + 1] - nodes[i, j])
        high = nodes[i + 1, j] + shares[q] * (nodes[i + 1, j + 1] - nodes[i + 1, j])
        for p in range(len(shares)):
            chords[p, q] = low + shares[p] * (high - low)


@njit(cache=True, nogil=True)
def _missing(
    nodes: Floats, fine: Singles, bulge: float, shares: Floats, i: int, j: int, chords: Floats
) -> float:
    """Return by how much the chord of a cell of nodes has to rise, at most 0 where it is above everywhere.

    On a fine cell it is above where its upper corner is above the function at the lower one, since both fall,
    or where all corners are above it and its bulge. `shares` and `chords` are as in `_chords`.
    """
    finer = len(shares) - 1
    short = fine[i * finer, j * finer] - min(
        min(nodes[i, j], nodes[i, j + 1]), min(nodes[i + 1, j], nodes[i + 1, j + 1])
    )
    if short <= LITTLE:
        return short
    _chords(nodes, i, j, shares, chords)
    most = -1.0
    for a in range(finer):
        for b in range(finer):
            short = fine[i * finer + a, j * finer + b] - chords[a + 1, b + 1]
            if short <= most:
                continue
            over = -1.0
            for p in range(a, a + 2):
                for q in range(b, b + 2):
                    over = max(over, fine[i * finer + p, j * finer + q] - chords[p, q])
            most = max(most, min(short, over + bulge))
    return most


@njit(cache=True, nogil=True)
def _room(
    nodes: Floats,
    fine: Singles,
    bulge: float,
    shares: Floats,
    cell: tuple[int, int],
    node: tuple[int, int],
    most: float,
    chords: Floats,
) -> float:
    """Return by how much one node of a cell may fall and leave its chord above, by the same conditions; at
    most `most`. `shares` and `chords` are as in `_chords`.
    """
    i, j = cell
    finer, least = len(shares) - 1, most
    above_x, above_y = node[0] > i, node[1] > j
    _chords(nodes, i, j, shares, chords)
    for a in range(finer):
        x = shares[a + 1] if above_x else 1.0 - shares[a + 1]
        for b in range(finer):
            weight = x * (shares[b + 1] if above_y else 1.0 - shares[b + 1])
            spare = chords[a + 1, b + 1] - fine[i * finer + a, j * finer + b] + NOISE
            if spare >= least * weight and spare >= 0.0:
                continue
            by_corner = spare / weight if weight > 0.0 else (np.inf if spare >= 0.0 else -np.inf)
            by_all = np.inf
            for p in range(a, a + 2):
                for q in range(b, b + 2):
                    spare = chords[p, q] - fine[i * finer + p, j * finer + q] - bulge + NOISE
                    share = (shares[p] if above_x else 1.0 - shares[p]) * (
                        shares[q] if above_y else 1.0 - shares[q]
                    )
                    if spare < 0.0:
                        by_all = -np.inf
                    elif share > 0.0:
                        by_all = min(by_all, spare / share)
            least = min(least, max(by_corner, by_all))
    return least


@njit(cache=True, nogil=True)
def _asked_rise(
    nodes: Floats, fine: Singles, bulge: float, finer: int, asked: NDArray[np.bool_]
) -> tuple[Floats, bool]:
    """Return by how much each node, (nt, ng), is asked to rise by the cells beside it, and whether any is.

    A cell, (nt - 1, ng - 1), that is asked no more was found to be high enough.
    """
    rise, chords = np.zeros(nodes.shape), np.empty((finer + 1, finer + 1))
    shares = np.arange(finer + 1) / finer
    some = False
    for i in range(asked.shape[0]):
        for j in range(asked.shape[1]):
            if not asked[i, j]:
                continue
            missing = _missing(nodes, fine, bulge, shares, i, j, chords)
            asked[i, j] = missing > NOISE
            if asked[i, j]:
                some = True
                rise[i : i + 2, j : j + 2] = np.maximum(rise[i : i + 2, j : j + 2], missing)
    return rise, some


@njit(cache=True, nogil=True)
def _lowered(nodes: Floats, fine: Singles, bulge: float, finer: int) -> None:
    """Let each node fall as far as it may, those of the largest chances first."""
    nt, ng = nodes.shape
    shares, chords = np.arange(finer + 1) / finer, np.empty((finer + 1, finer + 1))
    for i in range(nt):
        for j in range(ng):
            room = nodes[i, j] - fine[i * finer, j * finer]
            for p in range(max(0, i - 1), min(nt - 1, i + 1)):
                for q in range(max(0, j - 1), min(ng - 1, j + 1)):
                    if room > LITTLE:
                        room = _room(nodes, fine, bulge, shares, (p, q), (i, j), room, chords)
            if room > LITTLE:
                nodes[i, j] -= room - LITTLE


@njit(cache=True, nogil=True)
def least_above(fine: Singles, bulge: float, finer: int) -> Floats:
    """Return nodes [nt, ng] whose chords are above chances that fall in both axes.

    The chances are given at `finer` fine nodes to each node, [finer nt - finer + 1, finer ng - finer + 1],
    and bulge between them by `bulge` at most. Nodes beside a chord that is too low are raised, none above 1
    while a neighbour can be raised: a node above the others would be a time and an energy that a policy gains
    by meeting. Then each falls as far as it may.
    """
    nt, ng = (fine.shape[0] - 1) // finer + 1, (fine.shape[1] - 1) // finer + 1
    nodes = fine[::finer, ::finer].astype(np.float64)
    asked = np.ones((nt - 1, ng - 1), np.bool_)
    for turn in range(TURNS):
        rise, some = _asked_rise(nodes, fine, bulge, finer, asked)
        if not some:
            break
        more = nodes + rise
        nodes = more if turn == TURNS - 1 else np.minimum(more, np.maximum(nodes, 1.0))
    _lowered(nodes, fine, bulge, finer)
    return nodes
