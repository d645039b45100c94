"""Compiled annealing of one survey tour: take out, put in, shorten, accept.

Length has a penalty in prize: a step takes out strings of neighbouring nodes, puts back what is worth its
detour, and is accepted on prize less penalty times length. The penalty follows the length, so that the tour
stays about as long as the budget and each corner of the map is improved by itself. What is kept is the best
tour within the budget.
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np
import numpy.typing as npt

from planner.orienteering.tour_kernels import KINDS, MOVED, OFFER, cheapest, random, shorten

Array = npt.NDArray[Any]

# Set by hand on the tuning files that docs/results/orienteering.md names, as are the numbers of `survey`.
_STRING = 6  # longest string taken out: of 4 to 16, the least gap after 1 s
_STRINGS = 3  # most strings taken out in a step
_HOLES = 6  # places of the tour beside a hole whose neighbours are offered
_OFFERED = 5  # neighbours offered there: at eight places eight each, eight files were 0.37 % worse after 1 s
_SMALL, _MANY = 50, 8  # nodes up to which a map has more of both, and how many: steps are cheap there
_OVER = 0.05  # of the budget by which a tour may be longer for a while
_FOLLOW = 20.0  # of the penalty to what the tour is longer than the budget, as a share: 1 % longer, 1.2 times
_DRIFT = 0.02  # of the penalty at each of its updates, for the same
_EVERY = 16  # steps between two updates of penalty and temperature
_DOUBT = 0.2  # random part of the penalty at which one node is put in
_NOISE = 0.4  # most random part of the order in which nodes are put in
_LEAST = 1e-9  # penalty on length, in mean prize over budget: where everything fits, length costs nothing


@numba.njit(cache=True, nogil=True)
def _take_out(
    near: Array, tour: Array, at: Array, size: int, state: Array, gone: Array, out: Array
) -> tuple[int, int, int, int]:
    """Take strings round a random node out of a tour; return its size, how many, first and last place."""
    width = near.shape[1]
    centre = tour[1 + int(random(state) * (size - 2))]
    longest = min(_STRING, max(1, (size - 2) // 2))
    first, last = size, 0
    for c in range(1 + int(random(state) * _STRINGS)):
        pick = at[centre]
        if c > 0:
            v = near[centre, int(random(state) * width)]
            if v < 0 or at[v] < 0:
                continue
            pick = at[v]
        run = 1 + int(random(state) * longest)
        low = max(1, pick - int(random(state) * run))
        high = min(size - 1, low + run)
        for i in range(low, high):
            gone[tour[i]] = True
        first, last = min(first, low), max(last, high)
    count, k = 0, first
    for i in range(first, size):
        v = tour[i]
        if gone[v]:
            gone[v] = False
            at[v] = -1
            out[count] = v
            count += 1
        else:
            tour[k] = v
            at[v] = k
            k += 1
    return k, count, first, last


@numba.njit(cache=True, nogil=True)
def _close(
    d: Array, tour: Array, trial: Array, size: int, first: int, last: int, queue: Array, waits: Array
) -> tuple[int, int]:
    """Return the change of length where strings were taken out, and how many nodes beside holes wait."""
    change, waiting, j = 0, 0, first - 1
    for i in range(first - 1, size - 1):
        if j >= last:
            break
        a, b = trial[i], trial[i + 1]
        if tour[j + 1] == b:
            j += 1
            continue
        change += d[a, b]
        while tour[j] != b:
            change -= d[tour[j], tour[j + 1]]
            j += 1
        for w in (a, b):
            if not waits[w]:
                waits[w] = True
                queue[waiting] = w
                waiting += 1
    return change, waiting


@numba.njit(cache=True, nogil=True)
def _rebuild(
    d: Array,
    near: Array,
    limit: int,
    tour: Array,
    at: Array,
    size: int,
    length: int,
    offered: Array,
    count: int,
    appeal: Array,
    most: Array,
    small: float,
    after: Array,
    extra: Array,
    score: Array,
    queue: Array,
    waits: Array,
    waiting: int,
    work: Array,
) -> tuple[int, int, int]:
    """Put offered nodes in, best appeal against detour first, none at more than `most` of it.

    Returns size and length of the tour and how many nodes wait to be shortened.
    """
    for c in range(count):
        v = offered[c]
        score[c] = -1.0
        if at[v] < 0:
            after[c], extra[c] = cheapest(d, tour, size, near, at, v, work)
            score[c] = appeal[c] / (max(extra[c], 0) + small)
    while True:
        best, best_score = -1, 0.0
        work[OFFER] += count
        for c in range(count):
            if score[c] > best_score and extra[c] <= most[c] and length + extra[c] <= limit:
                best, best_score = c, score[c]
        if best < 0:
            return size, length, waiting
        v, a = offered[best], after[best]
        i = at[a]
        b = tour[i + 1]
        work[MOVED] += size - i
        for k in range(size, i + 1, -1):
            w = tour[k - 1]
            tour[k] = w
            at[w] = k
        tour[i + 1] = v
        at[v] = i + 1
        size += 1
        length += extra[best]
        score[best] = -1.0
        for w in (a, v, b):
            if not waits[w]:
                waits[w] = True
                queue[waiting] = w
                waiting += 1
        av, vb = d[a, v], d[v, b]
        for c in range(count):
            if score[c] < 0.0:
                continue
            w = offered[c]
            if after[c] == a:  # its place is gone
                after[c], extra[c] = cheapest(d, tour, size, near, at, w, work)
            else:
                one, two = d[a, w] + d[v, w] - av, d[v, w] + d[b, w] - vb
                if min(one, two) >= extra[c]:
                    continue
                after[c], extra[c] = (a, one) if one <= two else (v, two)
            score[c] = appeal[c] / (max(extra[c], 0) + small)


@numba.njit(cache=True, nogil=True)
def anneal(
    d: Array,
    prize: Array,
    near: Array,
    budget: int,
    route: Array,
    heat: Array,
    penalty: Array,
    state: Array,
    steps: int,
    most: float,
    weight: Array,
) -> tuple[Array, int, float]:
    """Return the best tour within the budget, the steps done and what they cost.

    Parameters
    ----------
    d, prize, near
        Lengths (n, n), integers in the unit of `budget`; prizes (n,); neighbours (n, K) as in `tour_kernels`.
        The tour runs from node 0 to node n - 1.
    route
        Tour (k,) to begin with, nodes by number, within the budget.
    heat
        First and last temperature (2,), in prize units.
    penalty
        Of length (1,), in prize; moved on.
    state
        Of the random numbers (1,); moved on.
    steps, most
        Where it ends: so many steps, or work that costs so much.
    weight
        Cost (KINDS,) of each kind of work.
    """
    n, width = len(d), near.shape[1]
    work = np.zeros(KINDS, np.int64)
    tour, trial, best = np.empty(n + 1, np.int64), np.empty(n + 1, np.int64), np.empty(n + 1, np.int64)
    at = np.full(n, -1, np.int64)
    size, length, value = len(route), 0, 0
    for i in range(size):
        tour[i] = trial[i] = route[i]
        at[route[i]] = i
        value += prize[route[i]]
        if i:
            length += d[route[i - 1], route[i]]
    best_size, best_value, best_length = size, value, length
    best[:size] = tour[:size]
    offered = np.empty(n, np.int64)
    marked = np.full(n, -1, np.int64)
    queue = np.empty(4 * n + 8, np.int64)
    waits, gone = np.zeros(n, np.bool_), np.zeros(n, np.bool_)
    after, extra = np.empty(n, np.int64), np.empty(n, np.int64)
    score, appeal, dearest = np.empty(n), np.empty(n), np.empty(n)
    holes, shown = (_HOLES, _OFFERED) if n > _SMALL else (_MANY, _MANY)
    limit = int(budget * (1.0 + _OVER))
    least = _LEAST * heat[0] / max(1, budget)
    cooling = math.log(heat[1] / heat[0])
    now, warm, spent = penalty[0], heat[0], 0.0
    step = 0
    while step < steps:
        if step % _EVERY == 0:
            spent = 0.0
            for k in range(KINDS):
                spent += work[k] * weight[k]
            if spent >= most:
                break
            warm = heat[0] * math.exp(cooling * max(step / steps, spent / most))
            over = length / max(1, budget) - 1.0
            penalty[0] = max(least, penalty[0] * math.exp(_DRIFT * over))
            now = penalty[0] * math.exp(_FOLLOW * over)
        step += 1
        m, m_length, count, waiting = size, length, 0, 0
        if m > 2:
            m, count, first, last = _take_out(near, trial, at, m, state, gone, offered)
            change, waiting = _close(d, tour, trial, m, first, last, queue, waits)
            m_length += change
        else:  # a tour of nothing has two ends and no hole
            queue[0], queue[1], waiting = 0, n - 1, 2
            waits[0] = waits[n - 1] = True
        for c in range(count):
            marked[offered[c]] = step
        for p in range(min(waiting, holes)):
            for q in range(min(width, shown)):
                v = near[queue[p], q]
                if v >= 0 and at[v] < 0 and marked[v] != step:
                    marked[v] = step
                    offered[count] = v
                    count += 1
        power, noise = 0.5 + 1.5 * random(state), _NOISE * random(state)
        small = 0.02 * budget / m + 1e-9
        for c in range(count):
            worth = float(prize[offered[c]])
            appeal[c] = worth**power * (1.0 + noise * (2.0 * random(state) - 1.0))
            dearest[c] = worth / now * (1.0 + _DOUBT * (2.0 * random(state) - 1.0))
        for turn in range(4):
            before = m
            m, m_length, waiting = _rebuild(
                d,
                near,
                limit,
                trial,
                at,
                m,
                m_length,
                offered,
                count,
                appeal,
                dearest,
                small,
                after,
                extra,
                score,
                queue,
                waits,
                waiting,
                work,
            )
            if turn > 0 and m == before:
                break
            change = shorten(d, trial, m, near, at, queue, waits, waiting, work)
            waiting = 0
            m_length += change
            if change == 0:
                break
        m_value = 0
        for i in range(m):
            m_value += prize[trial[i]]
        if m_length <= budget and (
            m_value > best_value or (m_value == best_value and m_length < best_length)
        ):
            best_size, best_value, best_length = m, m_value, m_length
            best[:m] = trial[:m]
        work[MOVED] += size + m
        delta = (m_value - value) - now * (m_length - length)
        if delta >= 0 or random(state) < math.exp(delta / warm):
            size, value, length = m, m_value, m_length
            tour[:m] = trial[:m]
        else:
            for i in range(m):
                at[trial[i]] = -1
            for i in range(size):
                trial[i] = tour[i]
                at[tour[i]] = i
    spent = 0.0
    for k in range(KINDS):
        spent += work[k] * weight[k]
    return best[:best_size].copy(), step, spent
