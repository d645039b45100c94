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
from planner.evaluate.model import Floats, Ints, Model
from planner.evaluate.rollout import Costs, World

TIME, ENERGY, BOTH = 0, 1, 2
"""Rows of a curve: which budgets a factor widens."""

DRIVE, DRIVE_FOR_TRACK, OBSERVE = 0, 1, 2
"""Kinds of steps."""

HOPELESS = 2.5
"""Standard errors behind the rival, in the same futures, from which an order is given up. By hand: of a
hundred orders that are as good hardly one is.
"""

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
def steps_of(order: Ints, world: World, ways: Ints) -> Ints:
    """Return the steps of the plan of an order, [steps, 2]: kind, and place or observation."""
    steps = np.empty((order.shape[0] * (world.n + 1), 2), np.int64)
    count, place = 0, np.int64(0)
    for k in range(order.shape[0]):
        target = world.obs_place[order[k]]
        if target != place:
            for_track = True
            for j in range(k, order.shape[0]):
                if world.obs_place[order[j]] != target:
                    break
                for_track = for_track and world.is_place[order[j]]
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


@njit(inline="always")
def _number(x: float, scale: Scale) -> int:
    """Return the number of the least factor that is at least x; how many there are, where none is."""
    if x <= 1.0 + SHADE:
        return 0
    if x > scale.factors[-1] * (1.0 + SHADE):
        return scale.factors.shape[0]
    number = scale.first[int((x - 1.0) * scale.cells)]
    return number + 1 if x > scale.factors[number] * (1.0 + SHADE) else number


@njit(inline="always")
def _gain(gained: Floats, rows: int, by_time: int, by_energy: int, much: float) -> None:
    """Add what is gained from these factors on the budgets on; the last column is that of no factor."""
    if by_energy == 0:
        gained[rows + TIME, by_time] += much
    if by_time == 0:
        gained[rows + ENERGY, by_energy] += much
    gained[rows + BOTH, max(by_time, by_energy)] += much


@njit(cache=True, nogil=True)
def carry_out(
    orders: Ints, sizes: Ints, ways: Ints, costs: Costs, world: World, windows: Floats,
    futures: TabledFutures, scale: Scale, asked: int, row: int, at: int,
) -> tuple[NDArray[np.float32], Ints]:  # fmt: skip
    """Return curves of orders, rows of `orders` [n, most] of which the first `sizes` count, and which orders
    they are of.

    A curve is, by number of a factor, the mean utility in rows 0..2 and the chance that the observation
    `asked` is made in rows 3..5; `costs` has the budgets of the largest factor, [6, factors]. Where `row` is
    not negative, the first order is the rival, whose curve is known: another that is `HOPELESS` behind it
    at factor number `at` on what that row widens, after the futures of an inner level, gets no curve. One
    function: compiled helpers that take the tuples make it nine times as slow. `windows` are [m, 2].
    """
    count, most, n1 = futures.deviates.shape[0], scale.factors.shape[0], world.n + 1
    per_s, per_j = 1.0 / scale.time_s, 1.0 / scale.energy_j
    curves = np.empty((orders.shape[0], 6, most), np.float32)
    kept = np.empty(orders.shape[0], np.int64)
    found = 0
    gained, rival = np.empty((6, most + 1)), np.empty(count)
    t_tight = scale.time_s * (scale.factors[at] if row != ENERGY else 1.0) * (1.0 + SHADE)
    e_tight = scale.energy_j * (scale.factors[at] if row != TIME else 1.0) * (1.0 + SHADE)
    for number in range(orders.shape[0]):
        steps = steps_of(orders[number, : sizes[number]], world, ways)
        gained[:] = 0.0
        starts, started = np.int64(0), np.int64(0)
        for k in range(steps.shape[0]):
            i = steps[k, 1]
            if steps[k, 0] == OBSERVE and world.is_place[i]:
                starts |= 1 << world.obs_place[i]
        for k in range(1, n1):
            started += (starts >> k) & 1
        # with a rival an order runs within the budgets of that factor first, in the futures of inner levels
        few = futures.levels[-2] if row >= 0 else 0
        level, behind, squares = 0, 0.0, 0.0
        for run in range(few + count):
            telling = run >= few
            f = run - few if telling else run
            t_max, e_max = (costs.t_max, costs.e_max) if telling else (t_tight, e_tight)
            if run <= few and run == futures.levels[level]:
                level += 1
                spread = max(squares - behind * behind / run, 0.0) / (run - 1)
                if behind > HOPELESS * math.sqrt(spread * run) + SHADE or (telling and number == 0):
                    break
            hotel = costs.hotel * futures.load[f]
            t, g = started * costs.track_t, started * costs.track_e * futures.load[f]
            over = t > t_max or g + hotel * t > e_max
            tracked, tracks, place, done, closed = starts, started, np.int64(0), np.int64(0), np.int64(0)
            earned = 0.0
            for k in range(steps.shape[0]):
                if over:
                    break
                kind, i = steps[k, 0], steps[k, 1]
                if kind != OBSERVE:
                    if place == i or not world.has_leg[place, i] or (closed >> i) & 1:
                        continue
                    if kind == DRIVE_FOR_TRACK and not (tracked >> i) & 1:
                        continue
                    if not futures.ready[place, i]:
                        work_out_drive(world, futures, place, i)
                    t += futures.leg_s[place, i, f] + costs.track_leg * tracks
                    g += futures.leg_j[place, i, f]
                    over = t > t_max or g + hotel * t > e_max
                    lost = futures.lost[place, i, f]
                    if lost & tracked:
                        tracked &= ~lost
                        tracks = np.int64(0)
                        for p in range(1, n1):
                            tracks += (tracked >> p) & 1
                    if lost & 1:
                        closed |= 1 << i
                    else:
                        place = i
                    continue
                target = world.obs_place[i]
                if (
                    place != target
                    or (done >> i) & 1
                    or t > windows[i, 1]
                    or (world.is_place[i] and not (tracked >> target) & 1)
                    or world.predecessors[i] & ~done
                ):
                    continue
                t = max(t, windows[i, 0]) + futures.obs_s[i, f]
                g += futures.obs_j[i, f]
                over = t > t_max or g + hotel * t > e_max
                if over:
                    break
                won = world.worth[i]
                if world.diminishing[target] != 1.0:
                    before = done & world.target_bits[target]
                    while before:
                        won *= world.diminishing[target]
                        before &= before - 1
                done |= 1 << i
                if world.is_place[i] and (tracked >> target) & 1 and not world.place_bits[target] & ~done:
                    tracked &= ~(1 << target)
                    tracks -= 1
                earned += won
                if telling:
                    by_time, by_energy = _number(t * per_s, scale), _number((g + hotel * t) * per_j, scale)
                    _gain(gained, 0, by_time, by_energy, won)
                    if i == asked:
                        _gain(gained, 3, by_time, by_energy, 1.0)
            if telling:
                if costs.penalty and not over:
                    by_time, by_energy = _number(t * per_s, scale), _number((g + hotel * t) * per_j, scale)
                    _gain(gained, 0, by_time, by_energy, costs.penalty)
                continue
            if over:
                earned -= costs.penalty
            if number == 0:
                rival[f] = earned
            behind += rival[f] - earned
            squares += (rival[f] - earned) ** 2
        else:
            for line in range(6):
                total = -costs.penalty * count if line < 3 else 0.0
                for factor in range(most):
                    total += gained[line, factor]
                    curves[found, line, factor] = total / count
            kept[found] = number
            found += 1
    return curves[:found], kept[:found]
