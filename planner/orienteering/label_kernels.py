"""Compiled loops of the exact engine: the table of optimistic completions and the expansion of labels.

Shapes: G groups of experiments (a site, or part of a crowded one), X experiments sorted by group, S states
(group, subset of its experiments done), K time buckets, M lanes. A lane is a multiplier of energy: within it,
energy is paid for instead of limited, and the least bound of all lanes counts. Times and energies: int64, in
the units of the problem (seconds and joules, or finer).
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]

NEVER = -(2**29)  # value of a state from which the end cannot be reached; far below any real value


@numba.njit(cache=True, nogil=True)
def lay_moves(
    road_s: Array,
    road_j: Array,
    first: Array,
    duration: Array,
    energy: Array,
    opens: Array,
    latest: Array,
    e_budget: int,
    step: int,
    price: Array,
    slack: int,
) -> tuple[Array, Array, Array, Array]:
    """Return every move from a group to the end of an experiment, the same for every time.

    Shapes: (G, X) buckets of time it takes; (G, X) last bucket in which it can begin, -1 for never; (X,)
    first bucket in which an experiment can be over; (G, X, M) what its energy costs. Rounding is optimistic.

    Taken: `road_s` (time, -1 for no way) and `road_j` (energy) [G, G]; `first` [G + 1], where the experiments
    of each group begin; `duration`, `energy`, `opens` and `latest` [X]; `price` [M], what a unit of energy
    costs in each lane.
    """
    groups, count, lanes = len(road_s), len(duration), len(price)
    ahead = np.zeros((groups, count), np.int64)
    last = np.full((groups, count), -1, np.int64)
    soonest = np.zeros(count, np.int64)
    paid = np.zeros((groups, count, lanes), np.int64)
    for h in range(groups):
        for x in range(first[h], first[h + 1]):
            soonest[x] = (opens[x] + duration[x]) // step
            for g in range(groups):
                road, cost = 0, energy[x]
                if g != h:
                    road, cost = road_s[g, h], road_j[g, h] + energy[x]
                latest_start = latest[x] - duration[x] - road
                if road < 0 or latest_start < 0 or cost > e_budget or opens[x] + duration[x] > latest[x]:
                    continue
                ahead[g, x] = (road + duration[x]) // step
                last[g, x] = latest_start // step
                for m in range(lanes):
                    paid[g, x, m] = math.floor(cost * price[m]) - slack
    return ahead, last, soonest, paid


@numba.njit(cache=True, nogil=True)
def _raise_to(
    here: Array, from_bucket: int, until: int, there: Array, ahead: int, soonest: int, worth: Array
) -> None:
    """Raise the row of `here` for bucket k to the row of `there` where a move from k on ends plus `worth`.

    Row 0 of `here` is bucket `from_bucket`; buckets from there to before `until` are raised.
    """
    for k in range(from_bucket, until):
        row, end = here[k - from_bucket], there[max(k + ahead, soonest)]
        for m in range(len(worth)):
            row[m] = max(row[m], here.dtype.type(end[m] + worth[m]))


@numba.njit(cache=True, nogil=True)
def fill_table(
    table: Array,
    worth: Array,
    ahead: Array,
    last: Array,
    soonest: Array,
    first: Array,
    base: Array,
    end_s: Array,
    end_paid: Array,
    step: int,
    budget: int,
    since: int,
) -> None:
    """Fill `table` (S, K, M) backwards in time with the most that can still be gained.

    Bucket k stands for every time from `k * step` on; each move starts at the bucket's lower end and its
    result is rounded down again, so an entry is never below the truth. Experiments done at the present group
    are remembered, others are not. Buckets before `since` are left as they are. `worth` (G, X, M) is gain
    less energy paid for, `end_s` (G,) the time to the end, negative for no way, and `end_paid` (G, M) the
    energy paid for it. As many buckets as the shortest move takes are filled together.

    `ahead` and `last` [G, X] and `soonest` [X] are those of `lay_moves`; `first` [G + 1] tells where the
    experiments of each group begin, `base` [G] where its states do.
    """
    groups = len(base)
    buckets, lanes = table.shape[1:]
    block = buckets
    for g in range(groups):
        for h in range(groups):
            for x in range(first[h], first[h + 1]):
                if g != h and last[g, x] >= 0:
                    block = min(block, ahead[g, x])
    away = np.empty((block, lanes), table.dtype)
    until = buckets
    while until > since:
        start = max(since, until - block)
        for g in range(groups):
            away[:] = NEVER
            for k in range(start, until):
                if end_s[g] >= 0 and k * step + end_s[g] <= budget:
                    for m in range(lanes):
                        away[k - start, m] = -end_paid[g, m]
            for h in range(groups):
                if h == g:
                    continue
                for x in range(first[h], first[h + 1]):
                    there = table[base[h] + (1 << (x - first[h]))]
                    stop = min(until, last[g, x] + 1)
                    _raise_to(away, start, stop, there, ahead[g, x], soonest[x], worth[g, x])
            count = first[g + 1] - first[g]
            for mask in range((1 << count) - 1, -1, -1):
                here = table[base[g] + mask, start:until]
                here[:] = away[: until - start]
                for b in range(count):
                    if mask >> b & 1:
                        continue
                    x = first[g] + b
                    there = table[base[g] + (mask | 1 << b)]
                    stop = min(until, last[g, x] + 1)
                    _raise_to(here, start, stop, there, ahead[g, x], soonest[x], worth[g, x])
        until = start


@numba.njit(cache=True, nogil=True)
def trace_table(
    table: Array,
    worth: Array,
    ahead: Array,
    last: Array,
    soonest: Array,
    first: Array,
    base: Array,
    road_j: Array,
    energy: Array,
    group: int,
    mask: int,
    k: int,
    m: int,
) -> tuple[Array, int]:
    """Return how often a best walk of lane m does each experiment [X], and the energy it uses.

    `table` [S, K, M] is that of `fill_table`, and so are `worth` [G, X, M], `ahead` and `last` [G, X],
    `soonest` [X], `first` [G + 1] and `base` [G]; `road_j` [G, G] and `energy` [X] are energies. The walk
    begins in bucket k at `group`, with the experiments of `mask` done there.
    """
    counts = np.zeros(first[-1], np.int64)
    used = 0
    while True:
        value = table[base[group] + mask, k, m]
        found = False
        for h in range(len(base)):
            for x in range(first[h], first[h + 1]):
                bit = 1 << (x - first[h])
                if (h == group and mask & bit) or k > last[group, x]:
                    continue
                onward = mask | bit if h == group else bit
                kk = max(k + ahead[group, x], soonest[x])
                if table[base[h] + onward, kk, m] + worth[group, x, m] == value:
                    counts[x] += 1
                    used += energy[x] + (0 if h == group else road_j[group, h])
                    group, mask, k = h, onward, kk
                    found = True
                    break
            if found:
                break
        if not found:
            return counts, used


@numba.njit(cache=True, nogil=True)
def expand(
    n: int,
    sets: Array,
    place: Array,
    time: Array,
    fuel: Array,
    worth: Array,
    prize: Array,
    bound: Array,
    new_sets: Array,
    new_place: Array,
    new_time: Array,
    new_fuel: Array,
    new_worth: Array,
    new_prize: Array,
    new_bound: Array,
    parent: Array,
    what: Array,
    chain: Array,
    heads: Array,
    table: Array,
    probe: Array,
    lane: int,
    road_s: Array,
    road_j: Array,
    first: Array,
    base: Array,
    gain: Array,
    value: Array,
    duration: Array,
    energy: Array,
    opens: Array,
    latest: Array,
    needs: Array,
    open_end: bool,
    end_s: Array,
    end_j: Array,
    home_s: Array,
    home_j: Array,
    step: int,
    budget: int,
    e_budget: int,
    price: Array,
    slack: int,
    amounts: Array,
    capacity: Array,
    offset: int,
    scale: int,
    incumbent: int,
) -> tuple[int, int, int]:
    """Expand n labels by one experiment each; return (new labels, best prize seen, its index).

    A label is dropped when its bound does not beat the incumbent, or another with the same experiments at
    the same group is no later and has used no more. New labels count -1 when the arrays are full. `sets`
    has one row of 64-bit words a label. Bounds, worths and gains are in scaled prize units. `probe` (S, K) is
    a copy of one `lane` of the table: small enough for the cache, it settles nine candidates of ten.

    Shapes, with L labels at most now, N new ones and W words: `sets` [L, W], `place`, `time`, `fuel`,
    `worth`, `prize` and `bound` [L]; `new_sets` [N, W], the other `new_` arrays, `parent`, `what` and `chain`
    [N]; `heads` [H], H a power of two; `table` [S, K, M]; `road_s` and `road_j` [G, G]; `first` [G + 1];
    `base`, `end_s` and `end_j` (straight to the end, negative for no way), `home_s` and `home_j` (the least,
    by way of others too) [G]; `gain`, `value`, `duration`, `energy`, `opens` and `latest` [X]; `needs`
    [X, W]; `price` [M]; `amounts` [limits, X]; `capacity` [limits].
    """
    size = len(new_place)
    cells = len(heads)
    words, lanes = sets.shape[1], len(price)
    heads[:] = -1
    made, best, best_at = 0, incumbent, -1
    row = np.empty(words, np.uint64)
    one = np.uint64(1)
    used = np.zeros(len(capacity), np.int64)
    needed = (best + 1) * scale - offset - slack
    for i in range(n):
        if bound[i] < (best + 1) * scale:
            continue
        g = place[i]
        for m in range(len(capacity)):
            used[m] = 0
            for x in range(first[-1]):
                if sets[i, x >> 6] >> np.uint64(x & 63) & one:
                    used[m] += amounts[m, x]
        for h in range(len(base)):
            if h == g:
                road, cost_h = 0, 0
            else:
                road, cost_h = road_s[g, h], road_j[g, h]
                if road < 0:
                    continue
            arrive = time[i] + road
            if arrive > budget:
                continue
            inside = 0
            for x in range(first[h], first[h + 1]):
                if sets[i, x >> 6] >> np.uint64(x & 63) & one:
                    inside |= 1 << (x - first[h])
            for x in range(first[h], first[h + 1]):
                bit = 1 << (x - first[h])
                if inside & bit:
                    continue
                done = max(arrive, opens[x]) + duration[x]
                if done > latest[x]:
                    continue
                burnt = fuel[i] + cost_h + energy[x]
                if burnt > e_budget:
                    continue
                if not open_end and (done + home_s[h] > budget or burnt + home_j[h] > e_budget):
                    continue  # no way to the end, not even by way of others
                ends = open_end or (
                    end_s[h] >= 0 and done + end_s[h] <= budget and burnt + end_j[h] <= e_budget
                )
                gained = worth[i] + gain[x]
                state, k, left = base[h] + (inside | bit), int(done / step), e_budget - burnt
                spare = not ends or prize[i] + value[x] <= best
                if spare:
                    most = probe[state, k] + math.ceil(left * price[lane])
                    if most + gained < needed:
                        continue
                limit = NEVER
                for m in range(lanes):
                    most = table[state, k, m] + math.ceil(left * price[m])
                    limit = most if m == 0 else min(limit, most)
                if limit + gained < needed and spare:
                    continue
                limit += offset + gained + slack
                ready = True
                for w in range(words):
                    row[w] = sets[i, w]
                    if needs[x, w] & ~row[w]:
                        ready = False
                for m in range(len(capacity)):
                    if used[m] + amounts[m, x] > capacity[m]:
                        ready = False
                if not ready:
                    continue
                row[x >> 6] |= one << np.uint64(x & 63)
                mix = np.uint64(h + 1) * np.uint64(0x9E3779B97F4A7C15)
                for w in range(words):
                    mix = (mix ^ row[w]) * np.uint64(0xBF58476D1CE4E5B9)
                    mix ^= mix >> np.uint64(29)
                cell = np.int64(mix & np.uint64(cells - 1))
                slot = -1
                beaten = False
                at = heads[cell]
                while at >= 0:
                    same = new_place[at] == h
                    if same:
                        for w in range(words):
                            if new_sets[at, w] != row[w]:
                                same = False
                                break
                    if same and new_bound[at] != NEVER:
                        if new_time[at] <= done and new_fuel[at] <= burnt:
                            beaten = True
                            break
                        if new_time[at] >= done and new_fuel[at] >= burnt:
                            if slot < 0:
                                slot = at
                            else:
                                new_bound[at] = NEVER
                    at = chain[at]
                if beaten:
                    continue
                if slot < 0:
                    if made == size:
                        return -1, best, best_at
                    slot = made
                    made += 1
                    chain[slot] = heads[cell]
                    heads[cell] = slot
                    for w in range(words):
                        new_sets[slot, w] = row[w]
                    new_place[slot] = h
                new_time[slot] = done
                new_fuel[slot] = burnt
                new_worth[slot] = gained
                new_prize[slot] = prize[i] + value[x]
                new_bound[slot] = limit
                parent[slot] = i
                what[slot] = x
                if ends and new_prize[slot] > best:
                    best = new_prize[slot]
                    best_at = slot
                    needed = (best + 1) * scale - offset - slack
    return made, best, best_at
