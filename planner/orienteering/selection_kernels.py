"""Compiled loops that choose what to visit on a tour through everything.

Local search puts nodes in one by one and hardly ever reaches another cluster. A tour of all nodes, of
which the best part is taken for a penalty on length, decides on whole clusters at once.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
import numpy.typing as npt

from planner.orienteering.survey_kernels import _random, _shorten

Array = npt.NDArray[Any]


@numba.njit(cache=True, nogil=True)
def _beside(d: Array, near: Array, inside: Array, before: Array, follow: Array, v: int, first: int) -> int:
    """Return the node behind which v is put in at least cost, next to what is nearest or else anywhere."""
    place, extra = -1, 0
    for q in range(near.shape[1]):
        w = near[v, q]
        if w < 0:
            break
        if inside[w]:
            for a in (before[w], w):
                e = d[a, v] + d[v, follow[a]] - d[a, follow[a]]
                if place < 0 or e < extra:
                    place, extra = a, e
    if place < 0:
        a = first
        while follow[a] >= 0:
            e = d[a, v] + d[v, follow[a]] - d[a, follow[a]]
            if place < 0 or e < extra:
                place, extra = a, e
            a = follow[a]
    return place


@numba.njit(cache=True, nogil=True)
def tour_of_all(d: Array, near: Array, usable: Array, route: Array, state: Array) -> Array:
    """Return a short tour (k,) of a route and all usable nodes that it lacks.

    Parameters
    ----------
    d, near, usable
        Lengths (n, n), neighbours (n, K) and nodes (m,), as in `survey_kernels`.
    route
        Nodes (r,) with fixed ends; the others are put in next to what is nearest, in a random order.
    state
        Of the random numbers (1,); moved on.
    """
    n = len(d)
    follow = np.full(n, -1, np.int64)
    inside = np.zeros(n, np.bool_)
    for i in range(len(route)):
        inside[route[i]] = True
        if i + 1 < len(route):
            follow[route[i]] = route[i + 1]
    before = np.full(n, -1, np.int64)
    for i in range(1, len(route)):
        before[route[i]] = route[i - 1]
    waiting = np.empty(len(usable), np.int64)
    count = 0
    for v in usable:
        if not inside[v]:
            waiting[count] = v
            count += 1
    for i in range(count - 1, 0, -1):
        j = int(_random(state) * (i + 1))
        waiting[i], waiting[j] = waiting[j], waiting[i]
    last = route[len(route) - 1]
    for k in range(count):
        v = waiting[k]
        place = _beside(d, near, inside, before, follow, v, route[0])
        inside[v] = True
        after = follow[place]
        follow[place], before[v], follow[v], before[after] = v, place, after, v
    tour, at = np.empty(n + 1, np.int64), np.full(n, -1, np.int64)
    size, w = 0, route[0]
    while True:
        tour[size] = w
        at[w] = size
        size += 1
        if w == last:
            break
        w = follow[w]
    queue, waits = np.empty(4 * n + 8, np.int64), np.zeros(n, np.bool_)
    for i in range(size):
        queue[i] = tour[i]
        waits[tour[i]] = True
    _shorten(d, tour, size, near, at, queue, waits, size)
    return tour[:size].copy()


@numba.njit(cache=True, nogil=True)
def part_within(d: Array, prize: Array, tour: Array, budget: int, buckets: int) -> tuple[Array, int]:
    """Return the part (k,) of a tour (m,), both ends kept, worth most within the budget; and the work.

    Parameters
    ----------
    d, prize
        Lengths (n, n) and prizes (n,), integers.
    buckets
        Of length: of the parts up to a node that fall into the same one, the one worth most is kept, with its
        true length. So the part is within the budget, and nearly the best.

    Notes
    -----
    The work is the number of labels extended. A penalty on length in place of the buckets is ten times faster
    and fails where clusters lie apart: it jumps from none of them to more than the budget allows.
    """
    m = len(tour)
    end = tour[m - 1]
    worth = np.full((m, buckets), -1, np.int64)
    run = np.zeros((m, buckets), np.int64)
    came = np.full((m, buckets), -1, np.int64)
    worth[0, 0] = 0
    work = 0
    for j in range(1, m):
        v = tour[j]
        most = budget - d[v, end]
        for i in range(j):
            step = d[tour[i], v]
            for b in range(buckets):
                if worth[i, b] < 0:
                    continue
                work += 1
                length = run[i, b] + step
                if length > most:
                    break
                to = length * buckets // (budget + 1)
                value = worth[i, b] + prize[v]
                if value > worth[j, to] or (value == worth[j, to] and length < run[j, to]):
                    worth[j, to], run[j, to], came[j, to] = value, length, i * buckets + b
        top = -1
        for b in range(buckets):
            if worth[j, b] <= top:
                worth[j, b] = -1
            else:
                top = worth[j, b]
    best = 0
    for b in range(buckets):
        if worth[m - 1, b] > worth[m - 1, best]:
            best = b
    part, size = np.empty(m, np.int64), 0
    at = (m - 1) * buckets + best
    while at >= 0:
        part[size] = tour[at // buckets]
        size += 1
        at = came[at // buckets, at % buckets]
    return part[:size][::-1].copy(), work
