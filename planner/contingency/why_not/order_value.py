"""The value of an order without sampling, in one compiled pass.

The plan of an order has no branches, so what `propagate.Evaluator` works out row by row and state by state
is worked out here layer by layer: the states that each step may be met in are listed first, from the start
on, and their values are filled in from the end, on the same two grids. The values are those of the evaluator;
they take a fifth of the time.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numba import njit

from planner.contingency.order_in_futures import Order
from planner.contingency.why_not.order_layers import DRIVES, OBSERVES, PASSES, layers_of
from planner.contingency.why_not.order_run import OBSERVE, steps_of, ways_of
from planner.evaluate.model import Floats, Ints, Model
from planner.evaluate.propagate import COARSE, FINE
from planner.evaluate.rollout import Costs, World

NOTHING = 1e-15
"""Weight below which a node is left out of a kernel: fewer than a thousand make a value."""

COLUMNS = 8
"""Columns are a multiple of so many, as many as a processor takes at once: the rest would take as long as all
the others. Those past the last node are worth nothing.
"""

Nodes = tuple[int, int]
"""How many of time and of drive energy."""

QUICK = (33, 21), (49, 29)
"""Nodes of the two grids that are tried first where orders are compared: a quarter of the work of the
evaluator's.
"""

SETTLED = 1e-3
"""Share of a value by which the finer of the quick grids may be off, as both tell; where it is off by more,
the evaluator's finer grid is asked. About half of it is left after the extrapolation. On one day in eight
(seed 442739731) quick values alone were off by 1 %.
"""

SAME_ENDS = 1e-5
"""Share of a value within which two orders are worth the same and grids are off by the same: they differ in
what hardly any day comes to.
"""

HALF = 0.5
"""Share of what the quick grids may be off that is left after the extrapolation."""

Kinds = list[tuple[float, Costs, World, Floats]]
"""Chance, costs, world and windows of each kind of sol."""


class OrderValues:
    """Values of the orders of one model, kept once asked for."""

    def __init__(self, model: Model, *, quick: bool = False) -> None:
        """With `quick`, smaller grids are tried first."""
        self.model, self.quick = model, quick
        self._ways = ways_of(model)
        self._known: dict[Order, float] = {}
        self._roughly: dict[Order, tuple[float, float]] = {}
        self._kinds: Kinds = [
            (chance, Costs.of(known), World.of(known, known.utility * known.p_success), known.window)
            for chance, known in model.by_kind
        ]

    def __getitem__(self, order: Order) -> float:
        """Return the expected utility of the plan of an order, as the evaluator gives it."""
        known = self._known.get(order)
        if known is None:
            known = self._known[order] = self._settled(order, self._kinds, *self._rough(order))
        return known

    def best(self, orders: Iterable[Order]) -> Order:
        """Return the best of orders. Larger grids are asked of those only that may be, as far as the smaller
        ones are off, and not where these leave one alone.
        """
        rough = {order: self._rough(order) for order in orders}
        ranked = sorted(rough, key=lambda order: -rough[order][0])
        best = ranked[0]
        for order in ranked[1:]:
            if self._may_be_better(rough[order], rough[best]) and self[order] > self[best]:
                best = order
        return best

    @staticmethod
    def _may_be_better(one: tuple[float, float], other: tuple[float, float]) -> bool:
        """Return whether larger grids may put one order before another, by what smaller ones tell of both.

        Grids are off by nearly the same for orders whose ends alone differ.
        """
        apart = abs((one[0] - one[1]) - (other[0] - other[1]))
        if apart <= SAME_ENDS * abs(other[0]) and abs(one[0] - other[0]) <= SAME_ENDS * abs(other[0]):
            return one[0] > other[0]
        return one[0] + max(apart, HALF * abs(one[0] - one[1])) >= other[0]

    def off(self, order: Order) -> float:
        """Return by how much the smaller grids may be off for an order; 0 where larger ones were asked."""
        value, fine = self._rough(order)
        return 0.0 if order in self._known else abs(value - fine)

    def roughly(self, order: Order) -> float:
        """Return the value as smaller grids tell it, where larger ones were not asked."""
        return self._known.get(order, self._rough(order)[0])

    def behind(self, order: Order, best: Order) -> float:
        """Return by what share of its value an order is behind a better one, as far as grids tell."""
        one, other = self.roughly(order), self.roughly(best)
        return (other - one - HALF * max(self.off(order), self.off(best))) / max(abs(other), 1e-9)

    def chance(self, order: Order, asked: int) -> float:
        """Return the chance that an order makes an observation."""
        kinds = [
            (chance, costs._replace(penalty=0.0), world._replace(worth=only_one), windows)
            for chance, costs, world, windows in self._kinds
            for only_one in [np.eye(self.model.m)[asked]]
        ]
        return self._settled(order, kinds, *self._extrapolated(order, kinds))

    def _rough(self, order: Order) -> tuple[float, float]:
        """Return the value as the first two grids tell it, and as the finer of them alone does."""
        known = self._roughly.get(order)
        if known is None:
            known = self._roughly[order] = self._extrapolated(order, self._kinds)
        return known

    def _extrapolated(self, order: Order, kinds: Kinds) -> tuple[float, float]:
        grids = QUICK if self.quick else (COARSE, FINE)
        coarse, fine = (self._on(nodes, order, kinds) for nodes in grids)
        return _towards(grids, coarse, fine), fine

    def _settled(self, order: Order, kinds: Kinds, value: float, fine: float) -> float:
        """Return the value, with the evaluator's finest grid where smaller ones have not settled."""
        if not self.quick or abs(value - fine) <= SETTLED * abs(value):
            return value
        return _towards((QUICK[1], FINE), fine, self._on(FINE, order, kinds))

    def _on(self, nodes: Nodes, order: Order, kinds: Kinds) -> float:
        numbers = np.array(order, np.int64)
        return sum(
            chance * value_on(numbers, self._ways, costs, world, windows, *nodes)
            for chance, costs, world, windows in kinds
        )


def _towards(grids: tuple[Nodes, Nodes], coarse: float, fine: float) -> float:
    """Return what the values on two grids tend to (Richardson)."""
    ratio = (grids[1][0] - 1) / (grids[0][0] - 1)
    return fine + (fine - coarse) / (ratio**2 - 1.0)


@njit(cache=True, nogil=True)
def _mean_above(c: float, mu: float, sigma: float) -> float:
    """Return E[(X - c)+], as `grid.mean_above`."""
    mean = math.exp(mu + sigma * sigma / 2.0)
    if sigma == 0.0 or mean == 0.0 or c <= 0.0:
        return mean - c if c <= 0.0 else max(mean - c, 0.0)
    d2 = (mu - math.log(max(c, 1e-300))) / sigma
    half = math.sqrt(0.5)
    return mean * 0.5 * math.erfc(-(d2 + sigma) * half) - c * 0.5 * math.erfc(-d2 * half)


@njit(cache=True, nogil=True)
def _weights(row: Floats, nodes: int, base: float, step: float, mu: float, sigma: float) -> int:
    """Write the mass of so many nodes `base` + k * `step` (`grid.weights_from`, the mean kept) into `row`;
    return past which node there is none.
    """
    one, two = _mean_above(base - step, mu, sigma), _mean_above(base, mu, sigma)
    end = 0
    for k in range(nodes):
        three = _mean_above(base + (k + 1) * step, mu, sigma)
        row[k] = max((one - 2.0 * two + three) / step, 0.0)
        if row[k] > NOTHING:
            end = k + 1
        one, two = two, three
    return end


@njit(cache=True, nogil=True, fastmath={"contract"})
def _correlate(
    gain: Floats, ends: Ints, along_t: Floats, end_t: int, along_g: Floats, end_g: int, early: int,
    at_opening: Floats, between: Floats, value: Floats,
) -> None:  # fmt: skip
    """Write the mean of `gain` [nt, ng] after an action whose amounts have these weights into `value`; the
    first `early` rows wait, and all begin with the weights `at_opening` of the nodes. Rows of `gain` are zero
    from `ends` [nt] on, multiples of `COLUMNS` that do not rise, and so are columns of `between`
    [nt, 2 * ng + 4] past `ng`. Four weights at a time halve the time.
    """
    nt, ng = gain.shape
    for r in range(min(early, nt - 1), nt):
        row = between[r]
        for c in range(ng):
            row[c] = 0.0
        end, d = min(end_t, nt - r), 0
        while d < end and along_t[d] <= NOTHING:
            d += 1
        while d + 4 <= end:
            one, two, three, four = along_t[d], along_t[d + 1], along_t[d + 2], along_t[d + 3]
            g1, g2, g3, g4 = gain[r + d], gain[r + d + 1], gain[r + d + 2], gain[r + d + 3]
            for c in range(ends[r + d]):
                row[c] += one * g1[c] + two * g2[c] + three * g3[c] + four * g4[c]
            d += 4
        for rest in range(d, end):
            for c in range(ends[r + rest]):
                row[c] += along_t[rest] * gain[r + rest, c]
    if early > 0:
        for c in range(ng):
            between[0, c] = 0.0
        for j in range(nt):
            if at_opening[j] > NOTHING:
                for c in range(ends[j]):
                    between[0, c] += at_opening[j] * gain[j, c]
    begin = 0
    while begin < end_g and along_g[begin] <= NOTHING:
        begin += 1
    for r in range(nt):
        row, out = between[r], value[r]
        if 0 < r < early:
            out[:] = value[0]
            continue
        for c in range(ng):
            out[c] = 0.0
        for d in range(begin, min(end_g, ends[r]), 4):  # weights past the last node are zero
            one, two, three, four = along_g[d], along_g[d + 1], along_g[d + 2], along_g[d + 3]
            g1, g2, g3, g4 = row[d:], row[d + 1 :], row[d + 2 :], row[d + 3 :]
            for c in range((ends[r] - d + COLUMNS - 1) // COLUMNS * COLUMNS):
                out[c] += one * g1[c] + two * g2[c] + three * g3[c] + four * g4[c]


@njit(cache=True, nogil=True)
def _alive(costs: Costs, nt: int, ng: int, width: int, step_t: float, step_g: float) -> Floats:
    """Return the share of each cell within both budgets, [nt, width] (`Grid.alive`); zeros past column ng."""
    a, b = costs.hotel * step_t, step_g
    half, rest = (a + b) / 2.0, (a - b) / 2.0
    alive = np.zeros((nt, width))
    for r in range(nt):
        for c in range(ng):
            z = a * r + b * c - costs.e_max
            if a <= 1e-9 * b:
                share = z / b + 0.5
            else:
                share = (
                    max(z + half, 0.0) ** 2 - max(z + rest, 0.0) ** 2 - max(z - rest, 0.0) ** 2
                    + max(z - half, 0.0) ** 2
                ) / (2.0 * a * b)  # fmt: skip
            alive[r, c] = (1.0 - min(max(share, 0.0), 1.0)) * (0.5 if r == nt - 1 else 1.0)
    return alive


@njit(cache=True, nogil=True)
def value_on(order: Ints, ways: Ints, costs: Costs, world: World, windows: Floats, nt: int, ng: int) -> float:
    """Return the value of the plan of an order [n] on a grid of so many nodes of time and drive energy.

    `ways` [places, places] as `ways_of` gives them, `windows` [m, 2].
    """
    steps = steps_of(order, world.obs_place, world.is_place, ways)
    length, n1 = steps.shape[0], world.n + 1
    starts, started = np.int64(0), 0
    for k in range(length):
        i = steps[k, 1]
        if steps[k, 0] == OBSERVE and world.is_place[i] and not (starts >> world.obs_place[i]) & 1:
            starts |= 1 << world.obs_place[i]
            started += 1
    t, g = started * costs.track_t, started * costs.track_e
    if t > costs.t_max or g + costs.hotel * t > costs.e_max:
        return -costs.penalty
    if length == 0 or costs.t_max <= 0.0 or costs.e_max <= 0.0:
        return 0.0
    plan = layers_of(steps, starts, world, windows, costs)
    step_t, step_g, penalty = costs.t_max / (nt - 1), costs.e_max / (ng - 1), costs.penalty
    width = -(-ng // COLUMNS) * COLUMNS
    alive = _alive(costs, nt, ng, width, step_t, step_g)
    gain, between, at_opening = np.empty((nt, width)), np.zeros((nt, 2 * width + 4)), np.zeros(nt)
    along_t, along_g = np.zeros((n1 * n1, nt)), np.zeros((n1, ng + 4))
    ends, widest = np.zeros(nt, np.int64), 1
    for r in range(nt - 1, -1, -1):
        ends[r] = ends[r + 1] if r + 1 < nt else 0
        for c in range(ends[r], ng):
            if alive[r, c] > 0.0:
                ends[r] = (c // COLUMNS + 1) * COLUMNS
    for k in range(length + 1):
        widest = max(widest, plan.first[k + 1] - plan.first[k])
    room = np.empty((2, widest, nt, width))
    later = room[length % 2]
    later[: plan.first[length + 1] - plan.first[length]] = 0.0
    for k in range(length - 1, -1, -1):
        begin, next_one = plan.first[k], plan.first[k + 1]
        values = room[k % 2]
        end_t, end_g = np.full(n1 * n1, -1), np.full(n1, -1)
        i, early = steps[k, 1], 0
        ln = world.obs_ln[i] if steps[k, 0] == OBSERVE else world.leg_ln[0, i]
        if steps[k, 0] == OBSERVE and windows[i, 0] > 0.0:
            while early < nt and early * step_t < windows[i, 0]:
                early += 1
            _weights(at_opening, nt, -windows[i, 0], step_t, ln[0], ln[1])
        for s in range(begin, next_one):
            value, link = values[s - begin], plan.out[s]
            if plan.what[s] == PASSES:
                value[:] = later[plan.to[link] - next_one]
                continue
            won, slot, from_place, shift = penalty, 0, 0, 0.0
            if plan.what[s] == DRIVES:
                from_place = plan.states[s, 0]
                ln = world.leg_ln[from_place, i]
                tracks = 0
                for p in range(1, n1):
                    tracks += (plan.states[s, 2] >> p) & 1
                slot, shift = from_place * n1 + tracks, tracks * costs.track_leg
                last = plan.out[s + 1]
            else:
                last = link + 1
                much = world.worth[i]
                before = plan.states[s, 1] & world.target_bits[world.obs_place[i]]
                if world.diminishing[world.obs_place[i]] != 1.0:
                    while before:
                        much *= world.diminishing[world.obs_place[i]]
                        before &= before - 1
                won += much
            if end_t[slot] < 0:
                end_t[slot] = _weights(along_t[slot], nt, -shift, step_t, ln[0], ln[1])
            if end_g[from_place] < 0:
                end_g[from_place] = _weights(along_g[from_place], ng, 0.0, step_g, ln[2], ln[3])
            for r in range(nt):
                row = gain[r]
                row[:] = won
                for at in range(link, last):
                    odd, after = plan.odds[at], later[plan.to[at] - next_one, r]
                    for c in range(width):
                        row[c] += odd * after[c]
                for c in range(width):
                    row[c] *= alive[r, c]
            _correlate(
                gain, ends, along_t[slot], end_t[slot], along_g[from_place], end_g[from_place], early,
                at_opening, between, value,
            )  # fmt: skip
            shut = plan.what[s] == OBSERVES and windows[i, 1] < costs.t_max
            for r in range(nt):
                share = 1.0
                if shut:
                    share -= min(max((r * step_t - windows[i, 1]) / step_t + 0.5, 0.0), 1.0)
                for c in range(width):
                    value[r, c] = share * (value[r, c] - penalty)
                    if share < 1.0:
                        value[r, c] += (1.0 - share) * later[plan.to[link + 1] - next_one, r, c]
        later = values
    x, y = t / step_t, g / step_g
    r, c = min(int(x), nt - 2), min(int(y), ng - 2)
    fx, fy = x - r, y - c
    low = (1.0 - fy) * later[0, r, c] + fy * later[0, r, c + 1]
    high = (1.0 - fy) * later[0, r + 1, c] + fy * later[0, r + 1, c + 1]
    return (1.0 - fx) * low + fx * high
