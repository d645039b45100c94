"""Compiled loops that choose what to visit on a tour that is too long.

Local search puts nodes in one by one and hardly ever reaches another cluster or a far corner. A tour through
more than the budget allows, of which the best part is taken, decides on whole strings of nodes at once.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
import numpy.typing as npt

from planner.orienteering.tour_kernels import (
    BACK,
    BEFORE,
    FOLLOW,
    LABEL,
    PLACE,
    PRICED,
    put_in,
    random,
    route_of,
    shorten,
    tour_of,
)

Array = npt.NDArray[Any]

_FAR = 1e300
"""More than any prize less penalty: below it nothing is known. Infinities would be undefined where NaN is."""


@numba.njit(cache=True, nogil=True)
def _beside(d: Array, near: Array, tour: Array, v: int, work: Array) -> int:
    """Return the node behind which v is put in at least cost, next to what is nearest or else anywhere."""
    place, extra = -1, 0
    row = d[v]
    for q in range(near.shape[1]):
        w = near[v, q]
        if w < 0:
            break
        work[PLACE] += 1
        if tour[w, BEFORE] >= 0:
            b, c = tour[w, BEFORE], tour[w, FOLLOW]
            e = row[b] + row[w] - tour[w, BACK]
            if place < 0 or e < extra:
                place, extra = b, e
            e = row[w] + row[c] - tour[c, BACK]
            if e < extra:
                place, extra = w, e
    if place < 0:
        w = 0
        while tour[w, FOLLOW] >= 0:
            work[PLACE] += 1
            b = tour[w, FOLLOW]
            e = row[w] + row[b] - tour[b, BACK]
            if place < 0 or e < extra:
                place, extra = w, e
            w = b
    return place


@numba.njit(cache=True, nogil=True)
def tour_with(
    d: Array, near: Array, apart: Array, more: Array, route: Array, state: Array, work: Array
) -> Array:
    """Return a short tour (k,) of a route and the nodes of `more` that it lacks.

    Parameters
    ----------
    more, route
        Nodes (m,) to put in next to what is nearest, in a random order, and a tour (r,) with fixed ends.
    state
        Of the random numbers (1,); moved on.
    work
        Counted (KINDS,), as in `tour_kernels`.
    """
    n = len(d)
    tour, was = tour_of(d, route)
    waiting = np.empty(len(more), np.int64)
    count = 0
    for v in more:
        if tour[v, BEFORE] < 0 and tour[v, FOLLOW] < 0:
            waiting[count] = v
            count += 1
    for i in range(count - 1, 0, -1):
        j = int(random(state) * (i + 1))
        waiting[i], waiting[j] = waiting[j], waiting[i]
    for v in waiting[:count]:
        a = _beside(d, near, tour, v, work)
        put_in(tour, was, a, v, d[v, a], d[v, tour[a, FOLLOW]])
    whole, queue, waits = np.empty(n, np.int64), np.empty(4 * n + 8, np.int64), np.zeros(n, np.bool_)
    size = route_of(tour, whole)
    queue[:size] = whole[:size]
    for v in whole[:size]:
        waits[v] = True
    shorten(d, near, apart, tour, was, queue, waits, size, work)
    return whole[: route_of(tour, whole)].copy()


@numba.njit(cache=True, nogil=True)
def _onward(apart: Array, worth: Array, penalty: float, best: Array, top: Array) -> None:
    """Fill in what is most from each place on (m,) at a penalty on length, with its own prize and without."""
    top[:] = -_FAR
    top[-1] = 0.0
    for k in range(len(worth) - 1, -1, -1):
        here = top[k] + worth[k]
        best[k] = here
        for i in range(k):  # place by place, so that one instruction does several: a maximum of a row cannot
            x = here - penalty * apart[k, i]
            top[i] = x if x > top[i] else top[i]


@numba.njit(cache=True, nogil=True)
def _walked(
    apart: Array, worth: Array, penalty: float, best: Array, top: Array, places: Array
) -> tuple[float, float, int]:
    """Return prize, length and size of the part worth most at a penalty, whose places are filled in (m,)."""
    last = len(worth) - 1
    value, length, size, i = 0.0, 0.0, 1, 0
    places[0] = 0
    while i < last:
        k = i + 1
        while k < last and best[k] - penalty * apart[i, k] < top[i]:
            k += 1
        length += apart[i, k]
        value += worth[k]
        places[size] = k
        size += 1
        i = k
    return value, length, size


@numba.njit(cache=True, nogil=True)
def _so_far(apart: Array, worth: Array, penalty: float, most: Array) -> None:
    """Fill in what is most up to each place (m,) at a penalty on length, with its own prize."""
    most[:] = -_FAR
    most[0] = 0.0
    for i in range(len(worth)):
        here = most[i] + worth[i]
        most[i] = here
        road, beyond = apart[i, i + 1 :], most[i + 1 :]
        for k in range(len(road)):
            x = here - penalty * road[k]
            beyond[k] = x if x > beyond[k] else beyond[k]


@numba.njit(cache=True, nogil=True)
def _ways(
    apart: Array, worth: Array, penalty: float, best: Array, least: float, work: Array
) -> tuple[Array, Array]:
    """Return the ways of a part that is worth more than `least` less penalty: first (m + 1,), heads (k,).

    The most up to a place, the way, and the most from its head on bound every part that takes it. The heads
    of the ways from place i are `heads[first[i] : first[i + 1]]`.
    """
    m = len(worth)
    most = np.empty(m)
    _so_far(apart, worth, penalty, most)
    work[PRICED] += m * m // 2
    first, heads, count = np.zeros(m + 1, np.int64), np.empty(m * m // 2, np.int64), 0
    for i in range(m - 1):
        needed = least - most[i]
        if best[i] - worth[i] > needed:
            for k in range(i + 1, m):
                if best[k] - penalty * apart[i, k] > needed:
                    heads[count] = k
                    count += 1
        first[i + 1] = count
    first[m] = count
    return first, heads


@numba.njit(cache=True, nogil=True)
def _along(
    tour: Array, apart: Array, worth: Array, budget: int, work: Array
) -> tuple[Array, float, float, Array]:
    """Return the part within the budget at the best penalty, its prize, the penalty and `best` (m,) there."""
    m = len(tour)
    best, top = np.empty(m), np.empty(m)
    places, chosen, size = np.empty(m, np.int64), np.array([0, m - 1]), 2
    low_value, low_length, high_value, high_length = 0.0, apart[0, m - 1], worth.sum(), 0.0
    for i in range(m - 1):
        high_length += apart[i, i + 1]
    while True:
        penalty = (high_value - low_value) / (high_length - low_length)
        _onward(apart, worth, penalty, best, top)
        work[PRICED] += m * m // 12
        value, length, size = _walked(apart, worth, penalty, best, top, places)
        gain = value - penalty * length - (low_value - penalty * low_length)
        if gain <= 1e-9 * (1.0 + value):
            return tour[chosen], low_value, penalty, best
        if length <= budget:
            low_value, low_length = value, length
            chosen = places[:size].copy()
        else:
            high_value, high_length = value, length


@numba.njit(cache=True, nogil=True)
def part_within(
    d: Array, prize: Array, tour: Array, budget: int, buckets: int, least: int, work: Array
) -> Array:
    """Return the part (k,) of a tour (m,), both ends kept, worth most within the budget.

    Parameters
    ----------
    d, prize
        Lengths (n, n) and prizes (n,), integers; the prize of both ends of the tour is 0.
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
    that penalty is a first answer. What can be had up to a place and from another on bounds every part that
    goes from the one to the other: labels, which carry prize and length, are extended along those ways alone
    that could beat the answer. Where clusters lie apart the first answer is poor and the ways are many; on
    other maps they are few.
    """
    m = len(tour)
    apart, worth, whole = np.empty((m, m)), np.empty(m), 0
    for i in range(m):
        worth[i] = prize[tour[i]]
        for k in range(m):
            apart[i, k] = d[tour[i], tour[k]]
        if i + 1 < m:
            whole += d[tour[i], tour[i + 1]]
    work[PRICED] += m * m
    if whole <= budget:
        return tour.copy()
    part, first_value, penalty, best = _along(tour, apart, worth, budget, work)
    lower = max(first_value, least - 1.0)
    first, heads = _ways(apart, worth, penalty, best, lower + 0.5 - penalty * budget, work)
    if first[m] == 0:
        return part
    work[PRICED] += 2 * m * buckets
    gained = np.full((m, buckets), -1.0)
    run = np.zeros((m, buckets))
    came = np.full((m, buckets), -1, np.int64)
    gained[0, 0] = 0.0
    for i in range(m - 1):
        dominant = -1.0
        for b in range(buckets if first[i] < first[i + 1] else 0):
            value, length = gained[i, b], run[i, b]
            if value <= dominant:
                continue
            dominant = value
            needed = lower + 0.5 - value - penalty * (budget - length)  # prizes are integers
            if best[i] - worth[i] <= needed:
                continue
            work[LABEL] += 1 + first[i + 1] - first[i]
            for j in heads[first[i] : first[i + 1]]:
                full = length + apart[i, j]
                home = full if j == m - 1 else full + apart[j, m - 1]
                if best[j] - penalty * apart[i, j] <= needed or home > budget:
                    continue
                k = int(full) * buckets // (budget + 1)
                got = value + worth[j]
                if got > gained[j, k] or (got == gained[j, k] and full < run[j, k]):
                    gained[j, k], run[j, k], came[j, k] = got, full, i * buckets + b
                    if j == m - 1 and got > lower:
                        lower = got
    last = np.argmax(gained[m - 1])
    if gained[m - 1, last] <= first_value:
        return part
    back, size, at = np.empty(m, np.int64), 0, (m - 1) * buckets + last
    while at >= 0:
        back[size] = tour[at // buckets]
        size += 1
        at = came[at // buckets, at % buckets]
    return back[:size][::-1].copy()
