"""Compiled loops of the survey search: ruin, rebuild, shorten, accept.

A tour is an array of nodes with fixed ends; `at` gives each node's place in it, -1 when it is not in it.
`near` (n, K) lists nodes that may be visited, nearest first, -1 as filler. Lengths and prizes are integers.
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]

_SHORTEN = 10  # neighbours looked at by 2-opt and or-opt
_STRING = 16  # longest string taken out
_PROBES = 6  # random places of the tour whose neighbours are offered besides those of the holes
_OFFERED = 8  # neighbours offered at such a place


@numba.njit(cache=True, nogil=True)
def _random(state: Array) -> float:
    """Return a uniform number in [0, 1): splitmix64."""
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
def _better_at(d: Array, tour: Array, size: int, near: Array, at: Array, a: int, ends: Array) -> int:
    """Apply the first improving 2-opt or or-opt move at node a; return the change, nodes touched in ends."""
    i = at[a]
    width = min(_SHORTEN, near.shape[1])
    if i < size - 1:
        b = tour[i + 1]
        ab = d[a, b]
        for q in range(width):
            c = near[a, q]
            if c < 0 or d[a, c] >= ab:
                break
            j = at[c]
            if j < 0 or j >= size - 1:
                continue
            e = tour[j + 1]
            delta = d[a, c] + d[b, e] - ab - d[c, e]
            if delta < 0:
                _reverse(tour, at, min(i, j) + 1, max(i, j))
                ends[0], ends[1], ends[2], ends[3] = a, b, c, e
                return delta
    if i > 0:
        b = tour[i - 1]
        ab = d[a, b]
        for q in range(width):
            c = near[a, q]
            if c < 0 or d[a, c] >= ab:
                break
            j = at[c]
            if j <= 0:
                continue
            e = tour[j - 1]
            delta = d[a, c] + d[b, e] - ab - d[c, e]
            if delta < 0:
                _reverse(tour, at, min(i, j), max(i, j) - 1)
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
                        ends[0], ends[1], ends[2], ends[3] = before, after, c, e
                        return delta
                if j != hi + 1 and j > 0:  # between the one before c and c: e, other, .., a, c
                    e = tour[j - 1]
                    delta = d[a, c] + d[e, other] - d[e, c] - out
                    if delta < 0:
                        _move(tour, at, lo, hi, j - 1, side == 0)
                        ends[0], ends[1], ends[2], ends[3] = before, after, c, e
                        return delta
    return 0


@numba.njit(cache=True, nogil=True)
def _shorten(
    d: Array, tour: Array, size: int, near: Array, at: Array, queue: Array, waits: Array, count: int
) -> int:
    """Shorten tour[:size] from the `count` nodes in `queue` on; return the change of length."""
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
            delta = _better_at(d, tour, size, near, at, a, ends)
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
def _cheapest(d: Array, tour: Array, size: int, near: Array, at: Array, v: int) -> tuple[int, int]:
    """Return the node behind which v is put in at least cost, and the cost; looks beside v's neighbours."""
    place, extra, seen = -1, 0, 0
    if size <= 12:
        for i in range(size - 1):
            e = d[tour[i], v] + d[v, tour[i + 1]] - d[tour[i], tour[i + 1]]
            if place < 0 or e < extra:
                place, extra = tour[i], e
        return place, extra
    for q in range(near.shape[1]):
        w = near[v, q]
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
        if seen >= 5:
            break
    for i in (0, size - 2):  # the ends are no one's neighbours
        e = d[tour[i], v] + d[v, tour[i + 1]] - d[tour[i], tour[i + 1]]
        if place < 0 or e < extra:
            place, extra = tour[i], e
    return place, extra


@numba.njit(cache=True, nogil=True)
def _rebuild(
    d: Array,
    prize: Array,
    budget: int,
    tour: Array,
    size: int,
    length: int,
    at: Array,
    near: Array,
    offered: Array,
    count: int,
    power: float,
    noise: float,
    small: float,
    state: Array,
    queue: Array,
    waits: Array,
    waiting: int,
) -> tuple[int, int, int, int]:
    """Put offered nodes in, best noisy prize against detour first; return size, length, gain, waiting."""
    after = np.empty(count, np.int64)
    extra = np.empty(count, np.int64)
    appeal = np.empty(count, np.float64)
    for c in range(count):
        v = offered[c]
        appeal[c] = float(prize[v]) ** power * (1.0 + noise * (2.0 * _random(state) - 1.0))
        after[c], extra[c] = _cheapest(d, tour, size, near, at, v)
    won = 0
    while True:
        best, best_score = -1, 0.0
        for c in range(count):
            v = offered[c]
            if at[v] >= 0 or length + extra[c] > budget:
                continue
            score = appeal[c] / (max(extra[c], 0) + small)
            if score > best_score:
                best, best_score = c, score
        if best < 0:
            return size, length, won, waiting
        v, a = offered[best], after[best]
        i = at[a]
        b = tour[i + 1]
        for k in range(size, i + 1, -1):
            tour[k] = tour[k - 1]
            at[tour[k]] = k
        tour[i + 1] = v
        at[v] = i + 1
        size += 1
        length += extra[best]
        won += prize[v]
        for w in (a, v, b):
            if not waits[w]:
                waits[w] = True
                queue[waiting] = w
                waiting += 1
        for c in range(count):
            w = offered[c]
            if at[w] >= 0:
                continue
            if after[c] == a:  # its place is gone
                after[c], extra[c] = _cheapest(d, tour, size, near, at, w)
            else:
                one = d[a, w] + d[w, v] - d[a, v]
                two = d[v, w] + d[w, b] - d[v, b]
                if one < extra[c]:
                    after[c], extra[c] = a, one
                if two < extra[c]:
                    after[c], extra[c] = v, two


@numba.njit(cache=True, nogil=True)
def search(
    d: Array,
    prize: Array,
    near: Array,
    budget: int,
    route: Array,
    steps: int,
    heat: float,
    seed: int,
    usable: Array,
) -> tuple[Array, int, Array]:
    """Return the best tour of so many steps, its prize, and the tour at the end.

    Parameters
    ----------
    d, prize
        Lengths (n, n), integers in the unit of `budget`, and prizes (n,); the tour runs from node 0 to node n
        - 1.
    route
        Tour (k,) to begin with, nodes by number, within the budget.
    heat
        Temperature of the annealing, in prize units.
    usable
        Nodes (m,) that may be visited; `near` (n, K) as in the module.
    """
    n, width = len(d), near.shape[1]
    state = np.array([np.uint64(seed)])
    tour, trial, best = np.empty(n + 1, np.int64), np.empty(n + 1, np.int64), np.empty(n + 1, np.int64)
    at = np.full(n, -1, np.int64)
    size, length, value = len(route), 0, 0
    for i in range(size):
        tour[i] = route[i]
        value += prize[route[i]]
        if i:
            length += d[route[i - 1], route[i]]
    best_size, best_value, best_length = size, value, length
    best[:size] = tour[:size]
    offered = np.empty(n, np.int64)
    marked = np.full(n, -1, np.int64)
    queue = np.empty(4 * n + 8, np.int64)
    waits = np.zeros(n, np.bool_)
    gone = np.zeros(n, np.bool_)
    everything = len(usable) <= 60
    worth = value / max(1, length)
    for step in range(steps):
        if step % 64 == 0:
            worth = (0.1 + 0.5 * _random(state)) * max(value, 1) / max(1, budget)
        m = size
        for i in range(m):
            trial[i] = tour[i]
            at[tour[i]] = i
        # take out strings round a random node
        count = waiting = 0
        t_value = value
        if m > 2:
            centre = trial[1 + int(_random(state) * (m - 2))]
            longest = min(_STRING, max(1, (m - 2) // 2))
            for c in range(1 + int(_random(state) * 3)):
                pick = at[centre]
                if c > 0:
                    v = near[centre, int(_random(state) * width)]
                    if v < 0 or at[v] < 0:
                        continue
                    pick = at[v]
                run = 1 + int(_random(state) * longest)
                low = max(1, pick - int(_random(state) * run))
                for i in range(low, min(m - 1, low + run)):
                    gone[trial[i]] = True
            k = 1
            for i in range(1, m):
                v = trial[i]
                if i < m - 1 and gone[v]:
                    gone[v] = False
                    at[v] = -1
                    t_value -= prize[v]
                    if marked[v] != step:
                        marked[v] = step
                        offered[count] = v
                        count += 1
                    for w in (trial[k - 1], trial[i + 1]):
                        if not waits[w] and not gone[w]:
                            waits[w] = True
                            queue[waiting] = w
                            waiting += 1
                    continue
                trial[k] = v
                at[v] = k
                k += 1
            m = k
        t_length = 0
        for i in range(1, m):
            t_length += d[trial[i - 1], trial[i]]
        # offer what was taken out, what is near the holes, and what is near a few random places
        if everything:
            count = 0
            for v in usable:
                if at[v] < 0:
                    offered[count] = v
                    count += 1
        else:
            for p in range(min(waiting, 8) + _PROBES):
                a = queue[p] if p < min(waiting, 8) else trial[int(_random(state) * m)]
                for q in range(min(width, _OFFERED)):
                    v = near[a, q]
                    if v >= 0 and at[v] < 0 and marked[v] != step:
                        marked[v] = step
                        offered[count] = v
                        count += 1
        power, noise = 0.5 + 1.5 * _random(state), 0.4 * _random(state)
        small = 0.02 * budget / m + 1e-9
        for turn in range(4):
            before = m
            m, t_length, won, waiting = _rebuild(
                d,
                prize,
                budget,
                trial,
                m,
                t_length,
                at,
                near,
                offered,
                count,
                power,
                noise,
                small,
                state,
                queue,
                waits,
                waiting,
            )
            t_value += won
            if turn > 0 and m == before:
                break
            change = _shorten(d, trial, m, near, at, queue, waits, waiting)
            waiting = 0
            t_length += change
            if change == 0:
                break
        delta = (t_value - value) - worth * (t_length - length)
        if delta >= 0 or _random(state) < math.exp(delta / heat):
            for i in range(size):
                at[tour[i]] = -1
            size, value, length = m, t_value, t_length
            tour[:m] = trial[:m]
            if value > best_value or (value == best_value and length < best_length):
                best_size, best_value, best_length = m, value, length
                best[:m] = trial[:m]
        else:
            for i in range(m):
                at[trial[i]] = -1
    return best[:best_size].copy(), best_value, tour[:size].copy()
