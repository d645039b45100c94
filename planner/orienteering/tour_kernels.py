"""Compiled moves on one tour: put in, reverse, shorten; and the work that they count.

A tour is an array of nodes with fixed ends; `at` gives each node's place in it, -1 when it is not in it.
`near` (n, K) lists nodes that may be visited, nearest first, -1 as filler. Lengths and prizes are integers.
`work` (KINDS,) counts what is done by kind, so that a limit can be reckoned from it alone.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]

SHORTEN = 10
"""Neighbours looked at by 2-opt and or-opt: more are hardly ever the end of an improving move."""
PLACES = 5
"""Neighbours on the tour beside which a node may be put in."""

KINDS = 6
PLACE, OFFER, NEIGHBOUR, MOVED, PRICED, LABEL = range(KINDS)
"""Kinds of work: places looked at for a node, offered nodes gone through, neighbours looked at while a tour
is shortened, nodes moved or copied, pairs of nodes looked at for a penalty on length, ways on of a label."""


@numba.njit(cache=True, nogil=True)
def random(state: Array) -> float:
    """Return a uniform number in [0, 1) of a state (1,), which moves on: splitmix64."""
    state[0] += np.uint64(0x9E3779B97F4A7C15)
    z = state[0]
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z ^= z >> np.uint64(31)
    return float(z >> np.uint64(11)) / 9007199254740992.0


@numba.njit(cache=True, nogil=True)
def _reverse(tour: Array, at: Array, lo: int, hi: int) -> None:
    while lo < hi:
        tour[lo], tour[hi] = tour[hi], tour[lo]
        at[tour[lo]] = lo
        at[tour[hi]] = hi
        lo += 1
        hi -= 1


@numba.njit(cache=True, nogil=True)
def _move(tour: Array, at: Array, lo: int, hi: int, place: int, flip: bool) -> None:
    """Move tour[lo..hi] behind the node at `place` (< lo - 1 or > hi)."""
    if flip:
        _reverse(tour, at, lo, hi)
    if place > hi:  # rotate [lo..hi][hi+1..place] by three reversals
        _reverse(tour, at, lo, place)
        middle = lo + place - hi
        _reverse(tour, at, lo, middle - 1)
        _reverse(tour, at, middle, place)
    else:  # rotate [place+1..lo-1][lo..hi]
        _reverse(tour, at, place + 1, hi)
        middle = place + 1 + hi - lo + 1
        _reverse(tour, at, place + 1, middle - 1)
        _reverse(tour, at, middle, hi)


@numba.njit(cache=True, nogil=True)
def _better_at(
    d: Array, tour: Array, size: int, near: Array, at: Array, a: int, ends: Array, work: Array
) -> int:
    """Apply the first improving 2-opt or or-opt move at node a; return the change, nodes touched in ends."""
    i = at[a]
    width = min(SHORTEN, near.shape[1])
    if i < size - 1:
        b = tour[i + 1]
        ab = d[a, b]
        for q in range(width):
            c = near[a, q]
            work[NEIGHBOUR] += 1
            if c < 0 or d[a, c] >= ab:
                break
            j = at[c]
            if j < 0 or j >= size - 1:
                continue
            e = tour[j + 1]
            delta = d[a, c] + d[b, e] - ab - d[c, e]
            if delta < 0:
                _reverse(tour, at, min(i, j) + 1, max(i, j))
                work[MOVED] += abs(i - j)
                ends[0], ends[1], ends[2], ends[3] = a, b, c, e
                return delta
    if i > 0:
        b = tour[i - 1]
        ab = d[a, b]
        for q in range(width):
            c = near[a, q]
            work[NEIGHBOUR] += 1
            if c < 0 or d[a, c] >= ab:
                break
            j = at[c]
            if j <= 0:
                continue
            e = tour[j - 1]
            delta = d[a, c] + d[b, e] - ab - d[c, e]
            if delta < 0:
                _reverse(tour, at, min(i, j), max(i, j) - 1)
                work[MOVED] += abs(i - j)
                ends[0], ends[1], ends[2], ends[3] = a, b, c, e
                return delta
    if i == 0 or i == size - 1:
        return 0
    for side in range(2):  # the string runs from a onwards or up to a; a will be next to c
        for run in range(1, 4):
            lo = i if side == 0 else i - run + 1
            hi = i + run - 1 if side == 0 else i
            if lo < 1 or hi > size - 2 or (side == 1 and run == 1):
                break
            before, after = tour[lo - 1], tour[hi + 1]
            other = tour[hi] if side == 0 else tour[lo]
            out = d[before, tour[lo]] + d[tour[hi], after] - d[before, after]
            if out <= 0:
                continue
            for q in range(width):
                c = near[a, q]
                work[NEIGHBOUR] += 1
                if c < 0 or d[a, c] >= out:
                    break
                j = at[c]
                if j < 0 or lo <= j <= hi:
                    continue
                if j != lo - 1 and j < size - 1:  # between c and the one behind it: c, a, .., other, e
                    e = tour[j + 1]
                    delta = d[c, a] + d[other, e] - d[c, e] - out
                    if delta < 0:
                        _move(tour, at, lo, hi, j, side == 1)
                        work[MOVED] += 2 * abs(i - j)
                        ends[0], ends[1], ends[2], ends[3] = before, after, c, e
                        return delta
                if j != hi + 1 and j > 0:  # between the one before c and c: e, other, .., a, c
                    e = tour[j - 1]
                    delta = d[a, c] + d[e, other] - d[e, c] - out
                    if delta < 0:
                        _move(tour, at, lo, hi, j - 1, side == 0)
                        work[MOVED] += 2 * abs(i - j)
                        ends[0], ends[1], ends[2], ends[3] = before, after, c, e
                        return delta
    return 0


@numba.njit(cache=True, nogil=True)
def shorten(
    d: Array,
    tour: Array,
    size: int,
    near: Array,
    at: Array,
    queue: Array,
    waits: Array,
    count: int,
    work: Array,
) -> int:
    """Shorten a tour by 2-opt and or-opt from some nodes on; return the change of length.

    Parameters
    ----------
    d, near, at, work
        Lengths (n, n), neighbours (n, K), places (n,) and counted work (KINDS,), as in the module.
    tour, size
        Nodes (m,), of which the first `size` are the tour; changed in place.
    queue, waits, count
        Ring (q,) whose first `count` nodes wait, and whether a node waits (n,); both empty afterwards.
    """
    ends = np.empty(4, np.int64)
    room = len(queue)
    head, change = 0, 0
    while count > 0:
        a = queue[head]
        head = (head + 1) % room
        count -= 1
        waits[a] = False
        if at[a] < 0:
            continue
        while True:
            delta = _better_at(d, tour, size, near, at, a, ends, work)
            if delta == 0:
                break
            change += delta
            for v in ends:
                if v != a and not waits[v]:
                    waits[v] = True
                    queue[(head + count) % room] = v
                    count += 1
    return change


@numba.njit(cache=True, nogil=True)
def cheapest(
    d: Array, tour: Array, size: int, near: Array, at: Array, v: int, work: Array
) -> tuple[int, int]:
    """Return the node behind which v is put in at least cost, and the cost; looks beside v's neighbours.

    Parameters
    ----------
    d, near, at, work
        Lengths (n, n), neighbours (n, K), places (n,) and counted work (KINDS,), as in the module.
    tour, size
        Nodes (m,), of which the first `size` are the tour.
    """
    place, extra, seen = -1, 0, 0
    if size <= 12:
        work[PLACE] += size
        for i in range(size - 1):
            e = d[tour[i], v] + d[v, tour[i + 1]] - d[tour[i], tour[i + 1]]
            if place < 0 or e < extra:
                place, extra = tour[i], e
        return place, extra
    for q in range(near.shape[1]):
        w = near[v, q]
        work[PLACE] += 1
        if w < 0:
            break
        i = at[w]
        if i < 0:
            continue
        seen += 1
        if i > 0:
            b = tour[i - 1]
            e = d[b, v] + d[v, w] - d[b, w]
            if place < 0 or e < extra:
                place, extra = b, e
        if i < size - 1:
            b = tour[i + 1]
            e = d[w, v] + d[v, b] - d[w, b]
            if place < 0 or e < extra:
                place, extra = w, e
        if seen >= PLACES:
            break
    for i in (0, size - 2):  # the ends are no one's neighbours
        e = d[tour[i], v] + d[v, tour[i + 1]] - d[tour[i], tour[i + 1]]
        if place < 0 or e < extra:
            place, extra = tour[i], e
    return place, extra
