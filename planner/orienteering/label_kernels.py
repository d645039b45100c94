"""Compiled loops of the exact engine: the table of optimistic completions and the expansion of labels.

Shapes: G groups of experiments (a site, or part of a crowded one), X experiments sorted by group, S states
(group, subset of its experiments done), K time buckets, J energy buckets. Times and energies are int64.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]

NEVER = -(2**29)  # value of a state from which the end cannot be reached; far below any real value


@numba.njit(cache=True, nogil=True)
def _raise_to(here: Array, there: Array, worth: int) -> None:
    """Raise `here` to `there` + worth where that is more; two slices of one length vectorise."""
    for j in range(len(here)):
        here[j] = max(here[j], here.dtype.type(there[j] + worth))


@numba.njit(cache=True, nogil=True)
def fill_table(
    table: Array,
    road_s: Array,
    road_j: Array,
    first: Array,
    base: Array,
    gain: Array,
    duration: Array,
    energy: Array,
    opens: Array,
    latest: Array,
    open_end: bool,
    end_s: Array,
    end_j: Array,
    begin: int,
    step: int,
    budget: int,
    e_step: int,
    e_budget: int,
) -> None:
    """Fill `table` (S, K, J) backwards in time with the most that can still be gained.

    Bucket k stands for every time from `begin + k * step` on, bucket j for every energy use from
    `j * e_step` on; each move starts at the bucket's lower end and its result is rounded down again, so an
    entry is never below the truth. Experiments done at the present group are remembered, others are not.
    """
    groups = len(base)
    buckets = table.shape[1]
    width = table.shape[2]
    away = np.empty(width, table.dtype)
    for k in range(buckets - 1, -1, -1):
        now = begin + k * step
        for g in range(groups):
            for j in range(width):
                away[j] = 0
            if not open_end:
                reach = 0
                if end_s[g] >= 0 and now + end_s[g] <= budget and end_j[g] <= e_budget:
                    reach = min(width, (e_budget - end_j[g]) // e_step + 1)
                for j in range(reach, width):
                    away[j] = NEVER
            for h in range(groups):
                road = road_s[g, h]
                if h == g or road < 0 or now + road > budget:
                    continue
                for x in range(first[h], first[h + 1]):
                    done = max(now + road, opens[x]) + duration[x]
                    if done > latest[x]:
                        continue
                    cost = road_j[g, h] + energy[x]
                    if cost > e_budget:
                        continue
                    shift = cost // e_step
                    reach = min((e_budget - cost) // e_step + 1, width - shift)
                    row = table[base[h] + (1 << (x - first[h])), (done - begin) // step]
                    _raise_to(away[:reach], row[shift : shift + reach], gain[x])
            count = first[g + 1] - first[g]
            for mask in range((1 << count) - 1, -1, -1):
                here = table[base[g] + mask, k]
                for j in range(width):
                    here[j] = away[j]
                for b in range(count):
                    if mask >> b & 1:
                        continue
                    x = first[g] + b
                    done = max(now, opens[x]) + duration[x]
                    if done > latest[x] or energy[x] > e_budget:
                        continue
                    shift = energy[x] // e_step
                    reach = min((e_budget - energy[x]) // e_step + 1, width - shift)
                    row = table[base[g] + (mask | 1 << b), (done - begin) // step]
                    _raise_to(here[:reach], row[shift : shift + reach], gain[x])


@numba.njit(cache=True, nogil=True)
def trace_table(
    table: Array,
    road_s: Array,
    road_j: Array,
    first: Array,
    base: Array,
    gain: Array,
    duration: Array,
    energy: Array,
    opens: Array,
    latest: Array,
    begin: int,
    step: int,
    budget: int,
    e_step: int,
    e_budget: int,
    group: int,
    mask: int,
    k: int,
    j: int,
) -> Array:
    """Return how often a best walk of the table's relaxation does each experiment, shape (X,)."""
    counts = np.zeros(first[-1], np.int64)
    while True:
        value = table[base[group] + mask, k, j]
        now = begin + k * step
        found = False
        for h in range(len(base)):
            if h == group:
                road, fuel = 0, 0
            else:
                road, fuel = road_s[group, h], road_j[group, h]
            if road < 0:
                continue
            for x in range(first[h], first[h + 1]):
                bit = 1 << (x - first[h])
                if h == group and mask & bit:
                    continue
                done = max(now + road, opens[x]) + duration[x]
                cost = fuel + energy[x]
                if done > latest[x] or now + road > budget or j * e_step + cost > e_budget:
                    continue
                onward = mask | bit if h == group else bit
                kk, jj = (done - begin) // step, j + cost // e_step
                if table[base[h] + onward, kk, jj] + gain[x] == value:
                    counts[x] += 1
                    group, mask, k, j = h, onward, kk, jj
                    found = True
                    break
            if found:
                break
        if not found:
            return counts


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
    begin: int,
    step: int,
    budget: int,
    e_step: int,
    e_budget: int,
    amounts: Array,
    capacity: Array,
    offset: int,
    scale: int,
    incumbent: int,
) -> tuple[int, int, int]:
    """Expand n labels by one experiment each; return (new labels, best prize seen, its index).

    A label is dropped when its bound does not beat the incumbent, or another with the same experiments at
    the same group is no later and has used no more. New labels count -1 when the arrays are full. `sets`
    has one row of 64-bit words a label. Bounds, worths and gains are in scaled prize units.
    """
    size = len(new_place)
    cells = len(heads)
    words = sets.shape[1]
    heads[:] = -1
    made, best, best_at = 0, incumbent, -1
    row = np.empty(words, np.uint64)
    one = np.uint64(1)
    used = np.zeros(len(capacity), np.int64)
    for i in range(n):
        if bound[i] // scale <= best:
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
                if not open_end and (end_s[h] < 0 or done + end_s[h] > budget or burnt + end_j[h] > e_budget):
                    continue
                gained = worth[i] + gain[x]
                limit = (
                    offset + gained + table[base[h] + (inside | bit), (done - begin) // step, burnt // e_step]
                )
                if limit // scale <= best and prize[i] + value[x] <= best:
                    continue
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
                if new_prize[slot] > best:
                    best = new_prize[slot]
                    best_at = slot
    return made, best, best_at
