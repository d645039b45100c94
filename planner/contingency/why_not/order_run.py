"""Runs of orders of observations in tabled futures: what each gains from each factor on the budgets on.

The kernel does what `rollout.roll` does with the plan of the order (`seeding.route_plan`), whose rows follow
each other whatever fails.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planner.contingency.why_not.tabled_futures import TabledFutures, work_out_drive
from planner.evaluate.model import Floats, Ints, Model, Truths
from planner.evaluate.rollout import Costs, World

TIME, ENERGY, BOTH = 0, 1, 2
"""Rows of a curve: which budgets a factor widens."""

DRIVE, DRIVE_FOR_TRACK, OBSERVE = 0, 1, 2
"""Kinds of steps."""

HOPELESS = 2.5
"""Standard errors behind the rival, in the same futures, from which an order is given up. By hand: of a
hundred orders that are as good hardly one is.
"""

LANES = 128
"""Futures in which a step is taken at once: what is kept of them fills half of a first-level cache."""

SHADE = 1e-11
"""Share by which an amount may be above a limit that it meets."""


class Scale(NamedTuple):
    """The budgets at factor 1, the factors in rising order, and the least factor not below the lower end of
    each of equal cells from 1 on, of which `cells` make 1; a cell holds at most one factor.
    """

    time_s: float
    energy_j: float
    factors: Floats
    first: Ints
    cells: float

    @staticmethod
    def of(time_s: float, energy_j: float, factors: Floats) -> Scale:
        """Return the scale of budgets and `factors` [factors], of which the first is 1."""
        cells = 2.0 / float(np.diff(factors).min())
        edges = 1.0 + np.arange(math.ceil((factors[-1] - 1.0) * cells) + 2) / cells
        return Scale(time_s, energy_j, factors, np.searchsorted(factors, edges - SHADE), cells)


def ways_of(model: Model) -> Ints:
    """Return the first place on the way between two places, [n + 1, n + 1]; the other one where a leg leads
    there, or nothing does.
    """
    n1 = model.n + 1
    ways = np.broadcast_to(np.arange(n1), (n1, n1)).copy()
    for a, b in np.argwhere(~model.has_leg):
        if a != b:
            ways[a, b] = (*model.hops(int(a), int(b)), b)[0]
    return ways


@njit(cache=True, nogil=True)
def steps_of(order: Ints, obs_place: Ints, is_place: Truths, ways: Ints) -> Ints:
    """Return the steps of the plan of an order [n], [steps, 2]: kind, and place or observation.

    `obs_place` [m] and `is_place` [m] are those of `World`, `ways` [places, places] as `ways_of` gives them.
    """
    steps = np.empty((order.shape[0] * ways.shape[0], 2), np.int64)
    count, place = 0, np.int64(0)
    for k in range(order.shape[0]):
        target = obs_place[order[k]]
        if target != place:
            for_track = True
            for j in range(k, order.shape[0]):
                if obs_place[order[j]] != target:
                    break
                for_track = for_track and is_place[order[j]]
            while ways[place, target] != target:
                place = ways[place, target]
                steps[count, 0], steps[count, 1] = DRIVE, place
                count += 1
            steps[count, 0], steps[count, 1] = DRIVE_FOR_TRACK if for_track else DRIVE, target
            count += 1
            place = target
        steps[count, 0], steps[count, 1] = OBSERVE, order[k]
        count += 1
    return steps[:count]


@njit(cache=True, nogil=True)
def work_out_drives(orders: Ints, sizes: Ints, ways: Ints, world: World, futures: TabledFutures) -> None:
    """Work out the drives that orders may take, rows of `orders` [n, most] of which the first `sizes` count.

    `ways` [places, places] as `ways_of` gives them.
    """
    n1 = world.n + 1
    missing = np.zeros(n1, np.int64)
    for a in range(n1):
        for b in range(n1):
            if a != b and world.has_leg[a, b] and not futures.ready[a, b]:
                missing[b] |= 1 << a
    if not missing.any():
        return
    for number in range(orders.shape[0]):
        steps = steps_of(orders[number, : sizes[number]], world.obs_place, world.is_place, ways)
        come_to = np.int64(1)
        for k in range(steps.shape[0]):
            i = steps[k, 1]
            if steps[k, 0] == OBSERVE:
                continue
            for a in range(n1):
                if (missing[i] & come_to) >> a & 1:
                    work_out_drive(world, futures, a, i)
            missing[i] &= ~come_to
            come_to |= 1 << i


@njit(inline="always")
def _number(x: float, factors: Floats, first: Ints, cells: float) -> int:
    """Return the number of the least factor that is at least x; how many there are, where none is."""
    if x <= 1.0 + SHADE:
        return 0
    if x > factors[-1] * (1.0 + SHADE):
        return factors.shape[0]
    number = first[int((x - 1.0) * cells)]
    return number + 1 if x > factors[number] * (1.0 + SHADE) else number


@njit(cache=True, nogil=True)
def _parts_of(levels: Ints, race: bool) -> Ints:
    """Return which futures are run at once, in turn, [parts, 4]: from which to which, whether they tell a
    curve, and whether an order far behind is given up after them.
    """
    parts = np.empty((2 * (levels[-1] // LANES + levels.shape[0]), 4), np.int64)
    count, begin = 0, 0
    if race:
        for level in levels[:-1]:
            while begin < level:
                end = min(begin + LANES, level)
                parts[count] = begin, end, 0, np.int64(end == level)
                count, begin = count + 1, end
    begin = 0
    while begin < levels[-1]:
        end = min(begin + LANES, levels[-1])
        parts[count] = begin, end, 1, 0
        count, begin = count + 1, end
    return parts[:count]


@njit(cache=True, nogil=True)
def _drive(
    t: Floats, g: Floats, hotel: Floats, live: Ints, goes: Ints, place: Ints, tracked: Ints, closed: Ints,
    tracks: Ints, more_s: Floats, more_j: Floats, lost: Ints, leg_s: Floats, leg_j: Floats, lost_of: Ints,
    legs: int, i: int, for_track: bool, starts: int, track_leg: float, t_max: float, e_max: float,
) -> None:  # fmt: skip
    """Take the drive to a place in the futures in which that is done.

    All are [width] but the tables of drives to the place, [places, width]; `legs` are bits of the places from
    which one leads here; `goes`, `tracks`, `more_s`, `more_j` and `lost` are room.
    """
    width, needs = t.shape[0], np.int64(for_track)
    for j in range(width):
        here = np.uint64(place[j])
        more_s[j], more_j[j], lost[j] = leg_s[here, j], leg_j[here, j], lost_of[here, j]
    for j in range(width):
        goes[j] = live[j] & (legs >> place[j]) & ~(closed[j] >> i) & ((tracked[j] >> i) | (1 - needs))
    if track_leg > 0.0:
        tracks[:] = 0
        for p in range(1, leg_s.shape[0]):
            if (starts >> p) & 1:
                for j in range(width):
                    tracks[j] += (tracked[j] >> p) & 1
        for j in range(width):
            more_s[j] += track_leg * tracks[j]
    for j in range(width):
        t[j] = t[j] + more_s[j] if goes[j] else t[j]
    for j in range(width):
        g[j] = g[j] + more_j[j] if goes[j] else g[j]
    for j in range(width):
        live[j] &= np.int64(t[j] <= t_max) & np.int64(g[j] + hotel[j] * t[j] <= e_max)
    for j in range(width):
        tracked[j] &= ~(lost[j] & -goes[j])
    for j in range(width):
        place[j] = i if goes[j] & ~lost[j] else place[j]
    for j in range(width):
        closed[j] |= (goes[j] & lost[j]) << i


@njit(cache=True, nogil=True)
def _observe(
    t: Floats, g: Floats, hotel: Floats, live: Ints, goes: Ints, place: Ints, tracked: Ints, done: Ints,
    obs_s: Floats, obs_j: Floats, i: int, target: int, opens: float, closes: float, placed: bool, must: int,
    all_of_it: int, t_max: float, e_max: float,
) -> int:  # fmt: skip
    """Make observation `i` in the futures in which that is done, and say in `goes` where it was within the
    budgets; all are [width]. Return how many futures are still within them.
    """
    width, without_track, still = t.shape[0], 1 - np.int64(placed), 0
    for j in range(width):
        goes[j] = live[j] & np.int64(place[j] == target) & np.int64(t[j] <= closes) & ~(done[j] >> i)
    for j in range(width):
        goes[j] &= ((tracked[j] >> target) | without_track) & np.int64((must & ~done[j]) == 0)
    for j in range(width):
        t[j] = max(t[j], opens) + obs_s[j] if goes[j] else t[j]
    for j in range(width):
        g[j] = g[j] + obs_j[j] if goes[j] else g[j]
    for j in range(width):
        live[j] &= np.int64(t[j] <= t_max) & np.int64(g[j] + hotel[j] * t[j] <= e_max)
    for j in range(width):
        goes[j] &= live[j]
    for j in range(width):
        done[j] |= goes[j] << i
    if placed:
        for j in range(width):
            tracked[j] &= ~((goes[j] & np.int64((all_of_it & ~done[j]) == 0)) << target)
    for j in range(width):
        still += live[j]
    return still


@njit(cache=True, nogil=True)
def _tell(
    gained: Floats, t: Floats, g: Floats, hotel: Floats, which: Ints, much: float, fewer: float, before: Ints,
    time_s: float, energy_j: float, factors: Floats, first: Ints, cells: float,
) -> None:  # fmt: skip
    """Add what is won in futures to the factors on the budgets from which it is, [3, factors + 1].

    That is `much` in those of `which`, times `fewer` for each of the observations `before` (bits); all are
    [width], and the last are the members of `Scale`.
    """
    width, at_once = t.shape[0], 0
    t_max, e_max = time_s * (1.0 + SHADE), energy_j * (1.0 + SHADE)
    if fewer == 1.0:  # most keep to the budgets at factor 1
        for j in range(width):
            at_once += which[j] & np.int64(t[j] <= t_max) & np.int64(g[j] + hotel[j] * t[j] <= e_max)
        gained[:, 0] += at_once * much
    for j in range(width):
        used_j = g[j] + hotel[j] * t[j]
        if not which[j] or (fewer == 1.0 and t[j] <= t_max and used_j <= e_max):
            continue
        won, bits = much, before[j]
        if fewer != 1.0:
            while bits:
                won *= fewer
                bits &= bits - 1
        by_time = _number(t[j] / time_s, factors, first, cells)
        by_energy = _number(used_j / energy_j, factors, first, cells)
        if by_energy == 0:
            gained[TIME, by_time] += won
        if by_time == 0:
            gained[ENERGY, by_energy] += won
        gained[BOTH, max(by_time, by_energy)] += won


@njit(cache=True, nogil=True)
def _earn(earned: Floats, goes: Ints, much: float, fewer: float, before: Ints) -> None:
    """Add to what is earned in futures what an observation wins, as `_tell` has it; all are [width]."""
    if fewer == 1.0:
        for j in range(earned.shape[0]):
            earned[j] += much if goes[j] else 0.0
        return
    for j in range(earned.shape[0]):
        won, bits = much if goes[j] else 0.0, before[j]
        while bits:
            won *= fewer
            bits &= bits - 1
        earned[j] += won


@njit(cache=True, nogil=True)
def carry_out(
    orders: Ints, sizes: Ints, ways: Ints, costs: Costs, world: World, windows: Floats,
    futures: TabledFutures, scale: Scale, asked: int, row: int, at: int, curves: NDArray[np.float32],
) -> Ints:  # fmt: skip
    """Write curves [rows, 6, factors] of orders, rows of `orders` [n, most] of which the first `sizes` count;
    return which orders they are of.

    A curve is, by number of a factor, the mean utility in rows 0..2 and the chance that the observation
    `asked` is made in rows 3..5; `costs` has the budgets of the largest factor. Where `row` is
    not negative, the first order is the rival, whose curve is known: another that is `HOPELESS` behind it
    at factor number `at` on what that row widens, after the futures of an inner level, gets no curve.
    `windows` are [m, 2]. The drives must be worked out (`work_out_drives`).

    A step is taken in `LANES` futures before the next, in short loops without branches: a processor does
    several futures of those at once. Compiled helpers that take the tuples make it nine times as slow.
    """
    count, most, n1 = futures.deviates.shape[0], scale.factors.shape[0], world.n + 1
    kept = np.empty(orders.shape[0], np.int64)
    found, share = 0, 1.0 / count
    gained, rival = np.empty((6, most + 1)), np.empty(count)
    t_tight = scale.time_s * (scale.factors[at] if row != ENERGY else 1.0) * (1.0 + SHADE)
    e_tight = scale.energy_j * (scale.factors[at] if row != TIME else 1.0) * (1.0 + SHADE)
    legs = np.zeros(n1, np.int64)
    for a in range(n1):
        for b in range(n1):
            if a != b and world.has_leg[a, b]:
                legs[b] |= 1 << a
    parts = _parts_of(futures.levels, row >= 0)
    real, whole = np.empty((6, LANES)), np.empty((9, LANES), np.int64)
    for number in range(orders.shape[0]):
        steps = steps_of(orders[number, : sizes[number]], world.obs_place, world.is_place, ways)
        starts, started, holds = np.int64(0), np.int64(0), False
        for k in range(steps.shape[0]):
            i = steps[k, 1]
            if steps[k, 0] == OBSERVE:
                holds = holds or i == asked
                if world.is_place[i]:
                    starts |= 1 << world.obs_place[i]
        for p in range(1, n1):
            started += (starts >> p) & 1
        behind, squares = 0.0, 0.0
        for part in range(parts.shape[0]):
            begin, end, telling = parts[part, 0], parts[part, 1], parts[part, 2] == 1
            if telling and row >= 0 and number == 0:
                break
            if telling and begin == 0:
                gained[:] = 0.0
            n = end - begin
            t, g, hotel, earned, more_s, more_j = (
                real[0, :n], real[1, :n], real[2, :n], real[3, :n], real[4, :n], real[5, :n]
            )  # fmt: skip
            live, goes, place, tracked, done, closed, tracks, lost, before = (
                whole[0, :n], whole[1, :n], whole[2, :n], whole[3, :n], whole[4, :n], whole[5, :n],
                whole[6, :n], whole[7, :n], whole[8, :n],
            )  # fmt: skip
            t_max, e_max = (costs.t_max, costs.e_max) if telling else (t_tight, e_tight)
            for j in range(n):
                hotel[j] = costs.hotel * futures.load[begin + j]
                g[j] = started * costs.track_e * futures.load[begin + j]
                live[j] = g[j] + hotel[j] * (started * costs.track_t) <= e_max
            if started * costs.track_t > t_max:
                live[:] = 0
            t[:], earned[:] = started * costs.track_t, 0.0
            place[:], tracked[:], done[:], closed[:] = 0, starts, 0, 0
            for k in range(steps.shape[0]):
                kind, i = steps[k, 0], steps[k, 1]
                if kind != OBSERVE:
                    _drive(
                        t, g, hotel, live, goes, place, tracked, closed, tracks, more_s, more_j, lost,
                        futures.leg_s[:, i, begin:end], futures.leg_j[:, i, begin:end],
                        futures.lost[:, i, begin:end], legs[i], i, kind == DRIVE_FOR_TRACK, starts,
                        costs.track_leg, t_max, e_max,
                    )  # fmt: skip
                    continue
                target = world.obs_place[i]
                before[:] = done & world.target_bits[target]
                still = _observe(
                    t, g, hotel, live, goes, place, tracked, done, futures.obs_s[i, begin:end],
                    futures.obs_j[i, begin:end], i, target, windows[i, 0], windows[i, 1], world.is_place[i],
                    world.predecessors[i], world.place_bits[target], t_max, e_max,
                )  # fmt: skip
                if telling:
                    _tell(
                        gained[:3], t, g, hotel, goes, world.worth[i], world.diminishing[target], before,
                        scale.time_s, scale.energy_j, scale.factors, scale.first, scale.cells,
                    )  # fmt: skip
                    if i == asked:
                        _tell(
                            gained[3:], t, g, hotel, goes, 1.0, 1.0, before,
                            scale.time_s, scale.energy_j, scale.factors, scale.first, scale.cells,
                        )  # fmt: skip
                else:
                    _earn(earned, goes, world.worth[i], world.diminishing[target], before)
                if not still:
                    break
            if telling:
                if costs.penalty:
                    _tell(
                        gained[:3], t, g, hotel, live, costs.penalty, 1.0, before,
                        scale.time_s, scale.energy_j, scale.factors, scale.first, scale.cells,
                    )  # fmt: skip
                continue
            for j in range(n):
                earned[j] -= 0.0 if live[j] else costs.penalty
            if number == 0:
                rival[begin:end] = earned
            for j in range(n):
                more = rival[begin + j] - earned[j]
                behind += more
                squares += more**2
            if parts[part, 3]:
                spread = max(squares - behind * behind / end, 0.0) / (end - 1)
                if behind > HOPELESS * math.sqrt(spread * end) + SHADE:
                    break
        else:
            for line in range(6 if holds else 3):
                total = -costs.penalty * count if line < 3 else 0.0
                for factor in range(most):
                    total += gained[line, factor]
                    curves[found, line, factor] = total * share
            if not holds:
                curves[found, 3:] = 0.0
            kept[found] = number
            found += 1
    return kept[:found]
