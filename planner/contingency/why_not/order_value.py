"""The value of an order without sampling, in one compiled pass.

The plan of an order has no branches, so what `propagate.Evaluator` works out row by row and state by state
is worked out here layer by layer: the states that each step may be met in are listed first, from the start
on, and their values are filled in from the end, on the same two grids. The values are those of the evaluator;
they take a fifth of the time.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planner.contingency.order_in_futures import Order
from planner.contingency.why_not.order_layers import OBSERVES, PASSES, Layers, layers_of, wider
from planner.contingency.why_not.order_run import OBSERVE, steps_of, ways_of
from planner.evaluate.model import Floats, Ints, Model
from planner.evaluate.propagate import COARSE, FINE
from planner.evaluate.rollout import Costs, World

NOTHING = 1e-15
"""Weight below which a node is left out of a kernel: fewer than a thousand make a value."""

HARDLY, FAINT = 1e-8, 1e-18
"""The same where numbers are short, and what is taken for nothing there: products of less and of two such
weights are too small to be held as usual, and take ten times as long.
"""

COLUMNS = 8
"""Columns are a multiple of so many, as many as a processor takes at once: the rest would take as long as all
the others. Those past the last node are worth nothing.
"""

Reals = NDArray[np.float32] | NDArray[np.float64]

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

HALF, QUARTER = 0.5, 0.25
"""Share of what the quick grids may be off that is left after the extrapolation, of a value and of what two
orders of one side are apart: of 128 pairs of those (from the days of seeds 515253, 616263 and 388904330) 93
of 100 are off by less than the latter.
"""

COARSELY = 0.015
"""Share of the best value behind which, on the smallest grid, no order is the best: it was on one of 358
choices (of the same days), by less than what is told apart on the others.
"""

SHORT, LONG = np.empty(0, np.float32), np.empty(0, np.float64)
"""Types of the numbers on grids. A processor takes twice as many of the former at once; they are for the
quick grids, of which half a per mille is asked, as sums of them are off by a millionth of a value.
"""

SHORT_BYTES = 4

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
        self._coarsely: dict[Order, float] = {}
        self._fine: dict[Order, float] = {}
        self._grids = QUICK if quick else (COARSE, FINE)
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

    def evaluated(self, order: Order) -> float:
        """Return the value on the evaluator's two grids, to a millionth of it where this is quick."""
        fine = self._fine.get(order)
        if fine is None:
            fine = self._fine[order] = self._on(FINE, order, self._kinds)
        return _towards((COARSE, FINE), self._on(COARSE, order, self._kinds), fine)

    def best(self, orders: Iterable[Order]) -> Order:
        """Return the best of orders. Larger grids are asked of those only that may be, as far as the smaller
        ones are off, and not where these leave one alone.
        """
        rough = {order: self._rough(order) for order in self._near_on_coarse(list(orders))}
        ranked = sorted(rough, key=lambda order: -rough[order][0])
        best = ranked[0]
        for order in ranked[1:]:
            if self._may_be_better(rough[order], rough[best]) and self[order] > self[best]:
                best = order
        return best

    def _near_on_coarse(self, orders: list[Order]) -> list[Order]:
        """Return the orders that may be the best, as the smallest grid tells them."""
        if not self.quick or len(orders) < 2:
            return orders
        first = {order: self._coarse(order) for order in orders}
        best = max(first.values())
        return [order for order in orders if first[order] >= best - COARSELY * abs(best)]

    def _coarse(self, order: Order) -> float:
        """Return the value on the first grid."""
        known = self._coarsely.get(order)
        if known is None:
            known = self._coarsely[order] = self._on(self._grids[0], order, self._kinds)
        return known

    @staticmethod
    def _may_be_better(one: tuple[float, float], other: tuple[float, float]) -> bool:
        """Return whether larger grids may put one order before another, by what smaller ones tell of both.

        Grids are off by nearly the same for orders whose ends alone differ.
        """
        apart = abs((one[0] - one[1]) - (other[0] - other[1]))
        if apart <= SAME_ENDS * abs(other[0]) and abs(one[0] - other[0]) <= SAME_ENDS * abs(other[0]):
            return one[0] > other[0]
        return one[0] + max(apart, QUARTER * abs(one[0] - one[1])) >= other[0]

    def off(self, order: Order) -> float:
        """Return by how much the smaller grids may be off for an order; 0 where larger ones were asked."""
        value, fine = self._rough(order)
        return 0.0 if order in self._known else HALF * abs(value - fine)

    def roughly(self, order: Order) -> float:
        """Return the value as smaller grids tell it, where larger ones were not asked."""
        return self._known.get(order, self._rough(order)[0])

    def behind(self, order: Order, best: Order) -> float:
        """Return by what share of its value an order is behind a better one, as far as grids tell."""
        scale = max(abs(self.roughly(best)), 1e-9)
        if order not in self._roughly:
            return (self._coarse(best) - self._coarse(order)) / scale - COARSELY
        return (self.roughly(best) - self.roughly(order) - max(self.off(order), self.off(best))) / scale

    def chance(self, order: Order, asked: int, least: float) -> float:
        """Return the chance that an order makes an observation; where smaller grids tell whether it is more
        than `least`, as these do.
        """
        kinds = [
            (chance, costs._replace(penalty=0.0), world._replace(worth=only_one), windows)
            for chance, costs, world, windows in self._kinds
            for only_one in [np.eye(self.model.m)[asked]]
        ]
        coarse, fine = (self._on(nodes, order, kinds) for nodes in self._grids)
        value = _towards(self._grids, coarse, fine)
        if abs(value - least) > abs(value - fine):
            return value
        return self._settled(order, kinds, value, fine)

    def _rough(self, order: Order) -> tuple[float, float]:
        """Return the value as the first two grids tell it, and as the finer of them alone does."""
        known = self._roughly.get(order)
        if known is None:
            fine = self._on(self._grids[1], order, self._kinds)
            known = self._roughly[order] = _towards(self._grids, self._coarse(order), fine), fine
        return known

    def _settled(self, order: Order, kinds: Kinds, value: float, fine: float) -> float:
        """Return the value, with the evaluator's finest grid where smaller ones have not settled."""
        if not self.quick or abs(value - fine) <= SETTLED * abs(value):
            return value
        finest = self._on(FINE, order, kinds)
        if kinds is self._kinds:
            self._fine[order] = finest
        return _towards((QUICK[1], FINE), fine, finest)

    def _on(self, nodes: Nodes, order: Order, kinds: Kinds) -> float:
        numbers = np.array(order, np.int64)
        like = SHORT if self.quick else LONG
        return sum(
            chance * value_on(numbers, self._ways, costs, world, windows, *nodes, like)
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
def _weights(
    row: Floats, nodes: int, base: float, step: float, mu: float, sigma: float, least: float
) -> tuple[int, int]:
    """Write the mass of so many nodes `base` + k * `step` (`grid.weights_from`, the mean kept) into `row`;
    return the first node that has more than `least`, and past which there is none. Others get nothing.
    """
    one, two = _mean_above(base - step, mu, sigma), _mean_above(base, mu, sigma)
    begin, end = nodes, 0
    for k in range(nodes):
        three = _mean_above(base + (k + 1) * step, mu, sigma)
        row[k] = max((one - 2.0 * two + three) / step, 0.0)
        if row[k] > least:
            begin, end = min(begin, k), k + 1
        else:
            row[k] = 0.0
        one, two = two, three
    return min(begin, end), end


class Kernels(NamedTuple):
    """Weights of the amounts of actions, and from which nodes on the states of a plan may be met.

    Rows of `along_t` [rows, nt] and `along_g` [rows, ng + 4] are the weights of an action; of row k those
    from `span_t[k, 0]` or `span_g[k, 0]` up to `span_t[k, 1]` or `span_g[k, 1]` count. `uses` [states, 2] are
    the rows of the action of a state, and `reach` [states, 2] the least nodes of time and energy at which the
    state may be met; those of energy are multiples of `COLUMNS`. `early` [steps] are how many nodes lie
    before the window opens, and `at_opening` [steps, nt] the weights of an observation that begins then.
    """

    along_t: Floats
    along_g: Floats
    span_t: Ints
    span_g: Ints
    uses: Ints
    reach: Ints
    early: Ints
    at_opening: Floats


@njit(cache=True, nogil=True)
def _kernels(
    plan: Layers, steps: Ints, costs: Costs, world: World, windows: Floats, nt: int, ng: int, at: Floats,
    least: float,
) -> Kernels:  # fmt: skip
    """Return the weights on a grid of a plan of such steps [steps, 2] that begins at node `at` [2].

    Weights below `least` are left out.
    """
    length, n1, most = steps.shape[0], world.n + 1, steps.shape[0] * (world.n + 1)
    step_t, step_g = costs.t_max / (nt - 1), costs.e_max / (ng - 1)
    along_t, span_t = np.zeros((4 * length, nt)), np.zeros((4 * length, 2), np.int64)
    along_g, span_g = np.zeros((most, ng + 4)), np.zeros((most, 2), np.int64)
    count = plan.first[length + 1]
    uses, reach = np.zeros((count, 2), np.int64), np.empty((count, 2), np.int64)
    reach[:, 0], reach[:, 1] = nt, ng // COLUMNS * COLUMNS
    reach[0, 0], reach[0, 1] = min(int(at[0]), nt - 2), min(int(at[1]), ng - 2) // COLUMNS * COLUMNS
    early, at_opening = np.zeros(length, np.int64), np.zeros((length, nt))
    rows_t, rows_g = 0, 0
    for k in range(length):
        known_t, known_g = np.full(n1 * n1, -1), np.full(n1, -1)
        observes, i, opening = steps[k, 0] == OBSERVE, steps[k, 1], 0
        if observes and windows[i, 0] > 0.0:
            early[k] = min(nt, math.ceil(windows[i, 0] / step_t))
            ln = world.obs_ln[i]
            opening = _weights(at_opening[k], nt, -windows[i, 0], step_t, ln[0], ln[1], least)[0]
        for s in range(plan.first[k], plan.first[k + 1]):
            r, c, link = reach[s, 0], reach[s, 1], plan.out[s]
            if plan.what[s] == PASSES:
                after = plan.to[link]
                reach[after, 0], reach[after, 1] = min(reach[after, 0], r), min(reach[after, 1], c)
                continue
            place, tracks = 0, 0
            if not observes:
                place = plan.states[s, 0]
                for p in range(1, n1):
                    tracks += (plan.states[s, 2] >> p) & 1
            ln = world.obs_ln[i] if observes else world.leg_ln[place, i]
            if known_t[place * n1 + tracks] < 0:
                if rows_t == along_t.shape[0]:
                    along_t, span_t = wider(along_t), wider(span_t)
                along_t[rows_t] = 0.0
                span_t[rows_t] = _weights(
                    along_t[rows_t], nt, -tracks * costs.track_leg, step_t, ln[0], ln[1], least
                )  # fmt: skip
                known_t[place * n1 + tracks] = rows_t
                rows_t += 1
            if known_g[place] < 0:
                span_g[rows_g] = _weights(along_g[rows_g], ng, 0.0, step_g, ln[2], ln[3], least)
                known_g[place] = rows_g
                rows_g += 1
            uses[s, 0], uses[s, 1] = known_t[place * n1 + tracks], known_g[place]
            then_r = max(r, early[k]) + span_t[uses[s, 0], 0]
            if r < early[k]:
                then_r = min(then_r, opening)
            then_c = (c + span_g[uses[s, 1], 0]) // COLUMNS * COLUMNS
            last = link + 1 if observes else plan.out[s + 1]
            for way in range(link, last):
                after = plan.to[way]
                reach[after, 0] = min(reach[after, 0], then_r)
                reach[after, 1] = min(reach[after, 1], then_c)
            if observes and windows[i, 1] < costs.t_max:
                after = plan.to[link + 1]
                shut_r = max(r, int(max(windows[i, 1] / step_t - 0.5, 0.0)))
                reach[after, 0], reach[after, 1] = min(reach[after, 0], shut_r), min(reach[after, 1], c)
    return Kernels(along_t, along_g, span_t, span_g, uses, reach, early, at_opening)


@njit(cache=True, nogil=True, fastmath={"contract"})
def _correlate(
    gain: Floats, ends: Ints, along_t: Floats, along_g: Floats, spans: tuple[int, int, int, int], early: int,
    at_opening: Floats, between: Floats, value: Floats, first: int, left: int,
) -> None:  # fmt: skip
    """Write the mean of `gain` [nt, width] after an action whose amounts have these weights, those of time
    from the first to the second of `spans` and those of energy from the third to the last, into rows `first`
    on of `value`, from column `left` on, a multiple of `COLUMNS`.

    Rows before `early` wait, and all begin with the weights `at_opening` of the nodes. Rows of `gain` are
    zero from `ends` [nt] on, multiples of `COLUMNS` that do not rise, and so are columns of `between`
    [nt, 2 * width + 4] past the width. Four weights at a time halve the time.
    """
    nt, width = gain.shape
    begin_t, end_t, begin_g, end_g = spans
    begin = (left + begin_g) // COLUMNS * COLUMNS  # columns before are not met after the action
    for r in range(max(first, min(early, nt - 1)), nt):
        row = between[r, begin:]
        for c in range(width - begin):
            row[c] = 0.0
        end, d = min(end_t, nt - r), begin_t
        while d + 4 <= end:
            one, two, three, four = along_t[d], along_t[d + 1], along_t[d + 2], along_t[d + 3]
            g1, g2 = gain[r + d, begin:], gain[r + d + 1, begin:]
            g3, g4 = gain[r + d + 2, begin:], gain[r + d + 3, begin:]
            for c in range(ends[r + d] - begin):
                row[c] += one * g1[c] + two * g2[c] + three * g3[c] + four * g4[c]
            d += 4
        for rest in range(d, end):
            one, g1 = along_t[rest], gain[r + rest, begin:]
            for c in range(ends[r + rest] - begin):
                row[c] += one * g1[c]
    if first < early:
        row = between[first, begin:]
        for c in range(width - begin):
            row[c] = 0.0
        for j in range(nt):
            one, g1 = at_opening[j], gain[j, begin:]
            if one > 0.0:
                for c in range(ends[j] - begin):
                    row[c] += one * g1[c]
    for r in range(first, nt):
        row, out = between[r, left:], value[r, left:]
        if first < r < early:
            out[:] = value[first, left:]
            continue
        for c in range(width - left):
            out[c] = 0.0
        for d in range(begin_g, min(end_g, ends[r]), 4):  # weights past the last node are zero
            one, two, three, four = along_g[d], along_g[d + 1], along_g[d + 2], along_g[d + 3]
            g1, g2, g3, g4 = row[d:], row[d + 1 :], row[d + 2 :], row[d + 3 :]
            for c in range((ends[r] - d + COLUMNS - 1) // COLUMNS * COLUMNS - left):
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
def value_on(
    order: Ints, ways: Ints, costs: Costs, world: World, windows: Floats, nt: int, ng: int, like: Reals
) -> float:
    """Return the value of the plan of an order [n] on a grid of so many nodes of time and drive energy.

    `ways` [places, places] as `ways_of` gives them, `windows` [m, 2]; numbers on the grid are of the type of
    those of `like`. Nodes at which a state cannot be met are left out.
    """
    steps = steps_of(order, world.obs_place, world.is_place, ways)
    length = steps.shape[0]
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
    x, y = t / step_t, g / step_g
    short = like.itemsize == SHORT_BYTES
    least, faint = (HARDLY, FAINT) if short else (NOTHING, 0.0)
    kernels = _kernels(plan, steps, costs, world, windows, nt, ng, np.array([x, y]), least)
    along_t, along_g = kernels.along_t.astype(like.dtype), kernels.along_g.astype(like.dtype)
    at_opening, odds = kernels.at_opening.astype(like.dtype), plan.odds.astype(like.dtype)
    width = -(-ng // COLUMNS) * COLUMNS
    share_within = _alive(costs, nt, ng, width, step_t, step_g)
    alive = share_within.astype(like.dtype)
    gain, between = np.zeros((nt, width), like.dtype), np.zeros((nt, 2 * width + 4), like.dtype)
    ends, widest = np.zeros(nt, np.int64), 1
    for r in range(nt - 1, -1, -1):
        ends[r] = ends[r + 1] if r + 1 < nt else 0
        for c in range(ends[r], ng):
            if share_within[r, c] > 0.0:
                ends[r] = (c // COLUMNS + 1) * COLUMNS
    for k in range(length + 1):
        widest = max(widest, plan.first[k + 1] - plan.first[k])
    room = np.empty((2, widest, nt, width), like.dtype)
    some = np.zeros(4, like.dtype)  # numbers of its type
    some[1], some[2] = penalty, faint
    faintest = some[2]
    later = room[length % 2]
    later[: plan.first[length + 1] - plan.first[length]] = 0.0
    for k in range(length - 1, -1, -1):
        begin, next_one = plan.first[k], plan.first[k + 1]
        values = room[k % 2]
        i, early = steps[k, 1], kernels.early[k]
        for s in range(begin, next_one):
            value, link = values[s - begin], plan.out[s]
            first, left = kernels.reach[s]
            if plan.what[s] == PASSES:
                value[first:, left:] = later[plan.to[link] - next_one, first:, left:]
                continue
            won, last = penalty, plan.out[s + 1]
            if plan.what[s] == OBSERVES:
                last = link + 1
                much = world.worth[i]
                before = plan.states[s, 1] & world.target_bits[world.obs_place[i]]
                if world.diminishing[world.obs_place[i]] != 1.0:
                    while before:
                        much *= world.diminishing[world.obs_place[i]]
                        before &= before - 1
                won += much
            row_t, row_g = kernels.uses[s]
            begin_g = (left + kernels.span_g[row_g, 0]) // COLUMNS * COLUMNS
            some[0] = won
            for r in range(first + (kernels.span_t[row_t, 0] if early == 0 else 0), nt):
                row, within, count = gain[r, begin_g:], alive[r, begin_g:], ends[r] - begin_g
                row[:count] = some[0]
                for at in range(link, last):
                    odd, after = odds[at], later[plan.to[at] - next_one, r, begin_g:]
                    for c in range(count):
                        row[c] += odd * after[c]
                for c in range(count):
                    much_here = row[c] * within[c]
                    row[c] = much_here if abs(much_here) > faintest else 0.0
            spans = (
                kernels.span_t[row_t, 0], kernels.span_t[row_t, 1],
                kernels.span_g[row_g, 0], kernels.span_g[row_g, 1],
            )  # fmt: skip
            _correlate(
                gain, ends, along_t[row_t], along_g[row_g], spans, early, at_opening[k], between, value,
                first, left,
            )  # fmt: skip
            shut = plan.what[s] == OBSERVES and windows[i, 1] < costs.t_max
            if not shut and penalty == 0.0:
                continue
            for r in range(first, nt):
                share = 1.0
                if shut:
                    share -= min(max((r * step_t - windows[i, 1]) / step_t + 0.5, 0.0), 1.0)
                some[2], some[3] = share, 1.0 - share
                open_, closed, off, row = some[2], some[3], some[1], value[r, left:]
                for c in range(width - left):
                    row[c] = open_ * (row[c] - off)
                if share < 1.0:
                    after = later[plan.to[link + 1] - next_one, r, left:]
                    for c in range(width - left):
                        row[c] += closed * after[c]
        later = values
    r, c = min(int(x), nt - 2), min(int(y), ng - 2)
    fx, fy = x - r, y - c
    low = (1.0 - fy) * later[0, r, c] + fy * later[0, r, c + 1]
    high = (1.0 - fy) * later[0, r + 1, c] + fy * later[0, r + 1, c + 1]
    return (1.0 - fx) * low + fx * high
