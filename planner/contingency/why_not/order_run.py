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

from planner.contingency.why_not.order_lanes import (
    EARNED,
    ENERGY,
    GOES,
    LANES,
    LIVE,
    SHADE,
    TIME,
    begin_in,
    drive_in,
    earn_in,
    observe_in,
    tell_in,
)
from planner.contingency.why_not.tabled_futures import TabledFutures, work_out_drive
from planner.evaluate.model import Floats, Ints, Model, Truths
from planner.evaluate.rollout import Costs, World

DRIVE, DRIVE_FOR_TRACK, OBSERVE = 0, 1, 2
"""Kinds of steps."""

HOPELESS = 2.5
"""Standard errors behind the rival, in the same futures, from which an order is given up. By hand: of a
hundred orders that are as good hardly one is.
"""


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
    return steps[: _write_steps(steps, order, obs_place, is_place, ways)]


@njit(cache=True, nogil=True)
def _write_steps(steps: Ints, order: Ints, obs_place: Ints, is_place: Truths, ways: Ints) -> int:
    """Write the steps of an order into the first rows of `steps`; return how many there are."""
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
    return count


@njit(cache=True, nogil=True)
def _work_out_drives(orders: Ints, sizes: Ints, ways: Ints, world: World, futures: TabledFutures) -> None:
    """Work out the drives that orders may take, rows of `orders` [n, most] of which the first `sizes` count.

    `ways` [places, places] as `ways_of` gives them.
    """
    n1, obs_place = world.n + 1, world.obs_place
    missing = np.zeros(n1, np.int64)
    for a in range(n1):
        for b in range(n1):
            if a != b and world.has_leg[a, b] and not futures.ready[a, b]:
                missing[b] |= 1 << a
    if not missing.any():
        return
    for number in range(orders.shape[0]):
        come_to, place = np.int64(1), np.int64(0)
        for k in range(sizes[number]):
            target = obs_place[orders[number, k]]
            while place != target:
                place = ways[place, target]
                if missing[place] & come_to:
                    for a in range(n1):
                        if (missing[place] & come_to) >> a & 1:
                            work_out_drive(world, futures, a, place)
                    missing[place] &= ~come_to
                come_to |= 1 << place


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
def carry_out(
    orders: Ints, sizes: Ints, ways: Ints, costs: Costs, world: World, windows: Floats,
    futures: TabledFutures, scale: Scale, asked: int, row: int, at: int, rivals: Truths,
    curves: NDArray[np.float32],
) -> Ints:  # fmt: skip
    """Write curves [rows, 6, factors] of orders, rows of `orders` [n, most] of which the first `sizes` count;
    return which orders they are of.

    A curve is, by number of a factor, the mean utility in rows 0..2 and the chance that the observation
    `asked` is made in rows 3..5; `costs` has the budgets of the largest factor. Where `row` is
    not negative, `rivals` [n] says which orders are rivals, whose curves are known and of which the first is
    one: another that is `HOPELESS` behind the last rival before it at factor number `at` on what that row
    widens, after the futures of an inner level, gets no curve.
    `windows` are [m, 2]. Drives that orders may take are worked out first; to ask for that apart takes longer
    than most of the runs, as all the tables are handed over again.

    A step is taken in `LANES` futures before the next, in loops without branches: a processor does several
    futures of those at once. What is kept of them lies at fixed places of two flat arrays, so that the
    compiler knows which do not overlap; helpers get neither tuples nor slices, whose counted references take
    longer than the work.
    """
    _work_out_drives(orders, sizes, ways, world, futures)
    count, most, n1 = futures.deviates.shape[0], scale.factors.shape[0], world.n + 1
    kept = np.empty(orders.shape[0], np.int64)
    found, share = 0, 1.0 / count
    gained, rival = np.empty((6, most + 1)), np.empty(count)
    t_tight = scale.time_s * (scale.factors[at] if row != ENERGY else 1.0) * (1.0 + SHADE)
    e_tight = scale.energy_j * (scale.factors[at] if row != TIME else 1.0) * (1.0 + SHADE)
    leg_s, leg_j, lost = futures.leg_s.ravel(), futures.leg_j.ravel(), futures.lost.ravel()
    obs_s, obs_j, load = futures.obs_s.ravel(), futures.obs_j.ravel(), futures.load
    obs_place, is_place, worth, diminishing = world.obs_place, world.is_place, world.worth, world.diminishing
    predecessors, target_bits, place_bits = world.predecessors, world.target_bits, world.place_bits
    time_s, energy_j, factors, first, cells = (
        scale.time_s, scale.energy_j, scale.factors, scale.first, scale.cells
    )  # fmt: skip
    legs = np.zeros(n1, np.int64)
    for a in range(n1):
        for b in range(n1):
            if a != b and world.has_leg[a, b]:
                legs[b] |= 1 << a
    parts = _parts_of(futures.levels, row >= 0)
    real, whole = np.empty(6 * LANES), np.empty(8 * LANES, np.int64)
    steps = np.empty((orders.shape[1] * n1, 2), np.int64)
    for number in range(orders.shape[0]):
        length = _write_steps(steps, orders[number, : sizes[number]], obs_place, is_place, ways)
        starts, started, holds = np.int64(0), np.int64(0), False
        for k in range(length):
            i = steps[k, 1]
            if steps[k, 0] == OBSERVE:
                holds = holds or i == asked
                if is_place[i]:
                    starts |= 1 << obs_place[i]
        for p in range(1, n1):
            started += (starts >> p) & 1
        behind, squares = 0.0, 0.0
        for part in range(parts.shape[0]):
            begin, end, telling = parts[part, 0], parts[part, 1], parts[part, 2] == 1
            if telling and row >= 0 and rivals[number]:
                break
            if telling and begin == 0:
                gained[:] = 0.0
            n = end - begin
            t_max, e_max = (costs.t_max, costs.e_max) if telling else (t_tight, e_tight)
            begin_in(
                real, whole, n, begin, load, costs.hotel, starts, started, costs.track_t, costs.track_e,
                t_max, e_max,
            )  # fmt: skip
            for k in range(length):
                kind, i = steps[k, 0], steps[k, 1]
                if kind != OBSERVE:
                    drive_in(
                        real, whole, n, begin, count, n1, leg_s, leg_j, lost, legs[i], i,
                        kind == DRIVE_FOR_TRACK, costs.track_leg, t_max, e_max,
                    )  # fmt: skip
                    continue
                target = obs_place[i]
                still = observe_in(
                    real, whole, n, i * count + begin, obs_s, obs_j, i, target, target_bits[target],
                    windows[i, 0], windows[i, 1], is_place[i], predecessors[i], place_bits[target], t_max,
                    e_max,
                )  # fmt: skip
                if telling:
                    tell_in(
                        gained, 0, real, whole, n, GOES, worth[i], diminishing[target], time_s, energy_j,
                        factors, first, cells,
                    )  # fmt: skip
                    if i == asked:
                        tell_in(
                            gained, 3, real, whole, n, GOES, 1.0, 1.0, time_s, energy_j, factors, first, cells
                        )
                else:
                    earn_in(real, whole, n, worth[i], diminishing[target])
                if not still:
                    break
            if telling:
                if costs.penalty:
                    tell_in(
                        gained, 0, real, whole, n, LIVE, costs.penalty, 1.0, time_s, energy_j, factors, first,
                        cells,
                    )  # fmt: skip
                continue
            for j in range(n):
                real[EARNED + j] -= 0.0 if whole[LIVE + j] else costs.penalty
            if rivals[number]:
                for j in range(n):
                    rival[begin + j] = real[EARNED + j]
            for j in range(n):
                more = rival[begin + j] - real[EARNED + j]
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
