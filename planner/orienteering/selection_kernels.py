"""Compiled loops that choose what to visit on a tour that is too long.

Local search puts nodes in one by one and hardly ever reaches another cluster or a far corner. A tour through
more than the budget allows, of which the best part is taken, decides on whole strings of nodes at once.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
import numpy.typing as npt

from planner.orienteering.tour_kernels import LABEL, PLACE, PRICED, random, shorten

Array = npt.NDArray[Any]


@numba.njit(cache=True, nogil=True)
def _beside(
    d: Array, near: Array, inside: Array, before: Array, follow: Array, v: int, first: int, work: Array
) -> int:
    """Return the node behind which v is put in at least cost, next to what is nearest or else anywhere."""
    place, extra = -1, 0
    for q in range(near.shape[1]):
        w = near[v, q]
        if w < 0:
            break
        work[PLACE] += 1
        if inside[w]:
            for a in (before[w], w):
                e = d[a, v] + d[v, follow[a]] - d[a, follow[a]]
                if place < 0 or e < extra:
                    place, extra = a, e
    if place < 0:
        a = first
        while follow[a] >= 0:
            work[PLACE] += 1
            e = d[a, v] + d[v, follow[a]] - d[a, follow[a]]
            if place < 0 or e < extra:
                place, extra = a, e
            a = follow[a]
    return place


@numba.njit(cache=True, nogil=True)
def tour_with(d: Array, near: Array, more: Array, route: Array, state: Array, work: Array) -> Array:
    """Return a short tour (k,) of a route and the nodes of `more` that it lacks.

    Parameters
    ----------
    d, near, work
        Lengths (n, n), neighbours (n, K) and counted work (KINDS,), as in `tour_kernels`.
    more, route
        Nodes (m,) to put in next to what is nearest, in a random order, and a tour (r,) with fixed ends.
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
    waiting = np.empty(len(more), np.int64)
    count = 0
    for v in more:
        if not inside[v]:
            waiting[count] = v
            count += 1
    for i in range(count - 1, 0, -1):
        j = int(random(state) * (i + 1))
        waiting[i], waiting[j] = waiting[j], waiting[i]
    last = route[len(route) - 1]
    for k in range(count):
        v = waiting[k]
        place = _beside(d, near, inside, before, follow, v, route[0], work)
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
    shorten(d, tour, size, near, at, queue, waits, size, work)
    return tour[:size].copy()


@numba.njit(cache=True, nogil=True)
def _priced(
    d: Array, prize: Array, tour: Array, penalty: float, best: Array, follow: Array, work: Array
) -> tuple[int, int]:
    """Fill in what is most from each place on (m,) at a penalty on length, and the next place (m,).

    Returns prize and length of the part that is worth most.
    """
    m = len(tour)
    best[m - 1], follow[m - 1] = 0.0, -1
    work[PRICED] += m * m // 2
    for i in range(m - 2, -1, -1):
        row = d[tour[i]]
        top, at = -np.inf, -1
        for k in range(i + 1, m):
            worth = best[k] - penalty * row[tour[k]]
            if worth > top:
                top, at = worth, k
        best[i], follow[i] = top + (prize[tour[i]] if i else 0), at
    value, length, i = 0, 0, 0
    while follow[i] >= 0:
        length += d[tour[i], tour[follow[i]]]
        i = follow[i]
        value += prize[tour[i]]
    return value, length


@numba.njit(cache=True, nogil=True)
def _along(tour: Array, follow: Array) -> Array:
    part, size, i = np.empty(len(tour), np.int64), 0, 0
    while i >= 0:
        part[size] = tour[i]
        size += 1
        i = follow[i]
    return part[:size].copy()


@numba.njit(cache=True, nogil=True)
def part_within(
    d: Array, prize: Array, tour: Array, budget: int, buckets: int, least: int, work: Array
) -> Array:
    """Return the part (k,) of a tour (m,), both ends kept, worth most within the budget.

    Parameters
    ----------
    d, prize
        Lengths (n, n) and prizes (n,), integers; the prize of the last node of the tour is 0.
    buckets
        Of length: of the parts up to a node that fall into the same one, the one worth most is kept, with its
        true length. So the part is within the budget, and nearly the best.
    least
        Prize below which a part is not looked for beyond the first answer of the notes.
    work
        Counted (KINDS,), as in `tour_kernels`.

    Notes
    -----
    The best penalty on length is found first (the Lagrangean dual: the penalty at which a part that is too
    long and one that is not are worth the same, until no other is worth more). The part within the budget at
    that penalty is a first answer, and what is still to be had from each place on bounds every label: only
    labels that could beat the answer are extended. Where clusters lie apart the first answer is poor and the
    labels are many; on other maps they are few.
    """
    m = len(tour)
    end = tour[m - 1]
    best, follow = np.empty(m), np.empty(m, np.int64)
    high_value, high_length = _priced(d, prize, tour, 0.0, best, follow, work)
    if high_length <= budget:
        return _along(tour, follow)
    part = np.array([tour[0], end])
    low_value, low_length, penalty = 0, d[tour[0], end], 0.0
    while True:
        penalty = (high_value - low_value) / (high_length - low_length)
        value, length = _priced(d, prize, tour, penalty, best, follow, work)
        gain = value - penalty * length - (low_value - penalty * low_length)
        if gain <= 1e-9 * (1.0 + value):
            break
        if length <= budget:
            low_value, low_length = value, length
            part = _along(tour, follow)
        else:
            high_value, high_length = value, length
    lower = max(low_value, least - 1)
    work[PRICED] += 2 * m * buckets
    worth = np.full((m, buckets), -1, np.int64)
    run = np.zeros((m, buckets), np.int64)
    came = np.full((m, buckets), -1, np.int64)
    worth[0, 0] = 0
    for i in range(m - 1):
        u, top = tour[i], -1
        own = prize[u] if i else 0
        for b in range(buckets):
            value, length = worth[i, b], run[i, b]
            if value <= top:
                continue
            top = value
            needed = lower + 0.5 - value - penalty * (budget - length)  # prizes are integers
            if best[i] - own <= needed:
                continue
            work[LABEL] += m - i
            for j in range(i + 1, m):
                v = tour[j]
                step = d[u, v]
                full = length + step
                if best[j] - penalty * step <= needed or full + d[v, end] > budget:
                    continue
                k = full * buckets // (budget + 1)
                got = value + prize[v]
                if got > worth[j, k] or (got == worth[j, k] and full < run[j, k]):
                    worth[j, k], run[j, k], came[j, k] = got, full, i * buckets + b
                    if j == m - 1 and got > lower:
                        lower = got
    top = 0
    for b in range(buckets):
        if worth[m - 1, b] > worth[m - 1, top]:
            top = b
    if worth[m - 1, top] <= low_value:
        return part
    part, size = np.empty(m, np.int64), 0
    at = (m - 1) * buckets + top
    while at >= 0:
        part[size] = tour[at // buckets]
        size += 1
        at = came[at // buckets, at % buckets]
    return part[:size][::-1].copy()
