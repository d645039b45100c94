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

SELDOM = 1e-8
"""Chance at either end of the nodes that a state is met at below which they are left out where numbers are
short: of a few hundred states a millionth in all.
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

HALF = 0.5
"""Share of what the quick grids may be off that is left after the extrapolation."""

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

    def chance(self, order: Order, asked: int, least: float | None = None) -> float:
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
        if least is not None and abs(value - least) > abs(value - fine):
            return value
        return self._settled(order, kinds, value, fine)

    def _rough(self, order: Order) -> tuple[float, float]:
        """Return the value as the first two grids tell it, and as the finer of them alone does."""
        known = self._roughly.get(order)
        if known is None:
            coarse, fine = (self._on(nodes, order, self._kinds) for nodes in self._grids)
            known = self._roughly[order] = _towards(self._grids, coarse, fine), fine
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
    """Weights of the amounts of actions, and the nodes at which the states of a plan are met.

    Rows of `along_t` [rows, nt] and `along_g` [rows, ng + 4] are the weights of an action; of row k those
    from `span_t[k, 0]` or `span_g[k, 0]` up to `span_t[k, 1]` or `span_g[k, 1]` count. `uses` [states, 2] are
    the rows of the action of a state. `met` [states, 4] are the first node of time at which a state is met
    and the one past the last, and likewise of energy, multiples of `COLUMNS`. `early` [steps] are how many
    nodes lie before the window opens, `at_opening` [steps, nt] the weights of an observation that begins
    then, and `opening` [steps, 2] which of these count.
    """

    along_t: Floats
    along_g: Floats
    span_t: Ints
    span_g: Ints
    uses: Ints
    met: Ints
    early: Ints
    at_opening: Floats
    opening: Ints


@njit(cache=True, nogil=True)
def _bulk(chances: Floats, seldom: float) -> tuple[int, int]:
    """Return the first of the nodes that have these chances and the one past the last, without as many at
    either end as have the chance `seldom` together at most.
    """
    first, past, left_out = 0, chances.shape[0], 0.0
    while first < past and left_out + chances[first] <= seldom:
        left_out += chances[first]
        first += 1
    left_out = 0.0
    while past > first and left_out + chances[past - 1] <= seldom:
        left_out += chances[past - 1]
        past -= 1
    return first, past


@njit(cache=True, nogil=True)
def _share_open(r: int, step_t: float, closes_s: float) -> float:
    """Return the share of the cell of a node of time in which a window is not over yet."""
    return 1.0 - min(max((r * step_t - closes_s) / step_t + 0.5, 0.0), 1.0)


@njit(cache=True, nogil=True)
def _spread(chances: Floats, first: int, past: int, along: Floats, span: Ints, out: Floats) -> None:
    """Add to `out` [nodes] the chances of nodes `first` to `past` after an action with these weights."""
    for r in range(first, past):
        chance, after = chances[r], out[r:]
        if chance > 0.0:
            for d in range(span[0], min(span[1], after.shape[0])):
                after[d] += chance * along[d]


@njit(cache=True, nogil=True)
def _kernels(
    plan: Layers, steps: Ints, costs: Costs, world: World, windows: Floats, nt: int, ng: int, at: Floats,
    least: float, seldom: float,
) -> Kernels:  # fmt: skip
    """Return the weights on a grid of a plan of such steps [steps, 2] that begins at node `at` [2].

    Weights below `least` are left out, and nodes as `_meet` does.
    """
    length, n1, most = steps.shape[0], world.n + 1, steps.shape[0] * (world.n + 1)
    step_t, step_g = costs.t_max / (nt - 1), costs.e_max / (ng - 1)
    along_t, span_t = np.zeros((4 * length, nt)), np.zeros((4 * length, 2), np.int64)
    along_g, span_g = np.zeros((most, ng + 4)), np.zeros((most, 2), np.int64)
    uses = np.zeros((plan.first[length], 2), np.int64)
    early, at_opening = np.zeros(length, np.int64), np.zeros((length, nt))
    opening = np.zeros((length, 2), np.int64)
    rows_t, rows_g = 0, 0
    for k in range(length):
        known_t, known_g = np.full(n1 * n1, -1), np.full(n1, -1)
        observes, i = steps[k, 0] == OBSERVE, steps[k, 1]
        if observes and windows[i, 0] > 0.0:
            early[k] = min(nt, math.ceil(windows[i, 0] / step_t))
            ln = world.obs_ln[i]
            opening[k] = _weights(at_opening[k], nt, -windows[i, 0], step_t, ln[0], ln[1], least)
        for s in range(plan.first[k], plan.first[k + 1]):
            if plan.what[s] == PASSES:
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
    met = np.zeros((plan.first[length + 1], 4), np.int64)
    kernels = Kernels(along_t, along_g, span_t, span_g, uses, met, early, at_opening, opening)
    _meet(kernels, plan, steps, windows, costs.t_max, ng, at, seldom)
    return kernels


@njit(cache=True, nogil=True)
def _meet(
    kernels: Kernels, plan: Layers, steps: Ints, windows: Floats, t_max: float, ng: int, at: Floats,
    seldom: float,
) -> None:  # fmt: skip
    """Write at which nodes the states of a plan are met that begins at node `at` [2], without those at either
    end that have the chance `seldom` together at most.

    The chances of nodes of time and of energy are carried on from the start, each without regard to the other
    and to the budgets, so that they are no smaller than the truth. A value at a node counts by its chance in
    the whole: what is left out changes that by no more than its chances times what a day may earn.
    """
    length, nt, met = steps.shape[0], kernels.along_t.shape[1], kernels.met
    met[plan.first[length] :, 1], met[plan.first[length] :, 3] = nt, -(-ng // COLUMNS) * COLUMNS
    by_t, by_g = np.zeros((met.shape[0], nt)), np.zeros((met.shape[0], ng))
    then_t, then_g = np.empty(nt), np.empty(ng)
    row_0, column_0 = min(int(at[0]), nt - 2), min(int(at[1]), ng - 2)
    by_t[0, row_0], by_t[0, row_0 + 1] = 1.0 - (at[0] - row_0), at[0] - row_0
    by_g[0, column_0], by_g[0, column_0 + 1] = 1.0 - (at[1] - column_0), at[1] - column_0
    for k in range(length):
        i, early, opening = steps[k, 1], kernels.early[k], kernels.opening[k]
        shuts = steps[k, 0] == OBSERVE and windows[i, 1] < t_max
        for s in range(plan.first[k], plan.first[k + 1]):
            link = plan.out[s]
            first, past = (row_0, row_0 + 2) if s == 0 else _bulk(by_t[s], seldom)
            left, right = (column_0, column_0 + 2) if s == 0 else _bulk(by_g[s], seldom)
            if first >= past or left >= right:
                continue
            met[s] = first, past, left // COLUMNS * COLUMNS, -(-right // COLUMNS) * COLUMNS
            if plan.what[s] == PASSES:
                _add(by_t[s], first, 1.0, by_t[plan.to[link]])
                _add(by_g[s], left, 1.0, by_g[plan.to[link]])
                continue
            if plan.what[s] == OBSERVES and shuts:  # what is too late goes on as it is
                after = plan.to[link + 1]
                _add(by_g[s], left, 1.0, by_g[after])
                for r in range(first, past):
                    share = _share_open(r, t_max / (nt - 1), windows[i, 1])
                    by_t[after, r] += (1.0 - share) * by_t[s, r]
                    by_t[s, r] *= share
            then_t[first:], then_g[left:] = 0.0, 0.0
            if first < early:
                _add(kernels.at_opening[k], opening[0], by_t[s, first : min(past, early)].sum(), then_t)
            row_t, row_g = kernels.uses[s]
            _spread(by_t[s], max(first, early), past, kernels.along_t[row_t], kernels.span_t[row_t], then_t)
            _spread(by_g[s], left, right, kernels.along_g[row_g], kernels.span_g[row_g], then_g)
            for way in range(link, link + 1 if plan.what[s] == OBSERVES else plan.out[s + 1]):
                _add(then_t, first, plan.odds[way], by_t[plan.to[way]])
                _add(then_g, left, plan.odds[way], by_g[plan.to[way]])


@njit(cache=True, nogil=True)
def _add(chances: Floats, first: int, share: float, out: Floats) -> None:
    """Add a share of the chances of nodes [nodes] from the first on to those of `out`."""
    for r in range(first, chances.shape[0]):
        out[r] += share * chances[r]


@njit(cache=True, nogil=True, fastmath={"contract"})
def _correlate(
    gain: Floats, ends: Ints, along_t: Floats, along_g: Floats, spans: tuple[int, int, int, int], early: int,
    at_opening: Floats, opening: Ints, between: Floats, value: Floats, met: Ints,
) -> None:  # fmt: skip
    """Write the mean of `gain` [nt, width] after an action whose amounts have these weights, those of time
    from the first to the second of `spans` and those of energy from the third to the last, into the rows and
    columns of `value` that `met` [4] says.

    Rows before `early` wait, and all begin with the weights `at_opening` of the nodes, of which those that
    `opening` [2] says count. Rows of `gain` are zero from `ends` [nt] on, multiples of `COLUMNS` that do not
    rise, and so are columns of `between` [nt, 2 * width + 4] past the width. Four weights at a time halve the
    time.
    """
    nt, width = gain.shape
    first, past, left, right = met
    begin_t, end_t, begin_g, end_g = spans
    begin = (left + begin_g) // COLUMNS * COLUMNS  # columns before are not met after the action
    stop = min(width, (right + end_g + 4 + COLUMNS - 1) // COLUMNS * COLUMNS)  # nor are those from here on
    for r in range(max(first, early), past):
        row = between[r, begin:]
        for c in range(stop - begin):
            row[c] = 0.0
        end, d = min(end_t, nt - r), begin_t
        while d + 4 <= end:
            one, two, three, four = along_t[d], along_t[d + 1], along_t[d + 2], along_t[d + 3]
            g1, g2 = gain[r + d, begin:], gain[r + d + 1, begin:]
            g3, g4 = gain[r + d + 2, begin:], gain[r + d + 3, begin:]
            for c in range(min(ends[r + d], stop) - begin):
                row[c] += one * g1[c] + two * g2[c] + three * g3[c] + four * g4[c]
            d += 4
        for rest in range(d, end):
            one, g1 = along_t[rest], gain[r + rest, begin:]
            for c in range(min(ends[r + rest], stop) - begin):
                row[c] += one * g1[c]
    if first < early:
        row = between[first, begin:]
        for c in range(stop - begin):
            row[c] = 0.0
        for j in range(opening[0], opening[1]):
            one, g1 = at_opening[j], gain[j, begin:]
            if one > 0.0:
                for c in range(min(ends[j], stop) - begin):
                    row[c] += one * g1[c]
    for r in range(first, past):
        row, out = between[r, left:], value[r, left:]
        if first < r < early:
            for c in range(right - left):
                out[c] = value[first, left + c]
            continue
        for c in range(right - left):
            out[c] = 0.0
        for d in range(begin_g, min(end_g, ends[r]), 4):  # weights past the last node are zero
            one, two, three, four = along_g[d], along_g[d + 1], along_g[d + 2], along_g[d + 3]
            g1, g2, g3, g4 = row[d:], row[d + 1 :], row[d + 2 :], row[d + 3 :]
            for c in range(min((ends[r] - d + COLUMNS - 1) // COLUMNS * COLUMNS, right) - left):
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
    least, faint, seldom = (HARDLY, FAINT, SELDOM) if short else (NOTHING, 0.0, 0.0)
    kernels = _kernels(plan, steps, costs, world, windows, nt, ng, np.array([x, y]), least, seldom)
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
    faintest, nothing = some[2], some[3]
    later = room[length % 2]
    later[: plan.first[length + 1] - plan.first[length]] = 0.0
    for k in range(length - 1, -1, -1):
        begin, next_one = plan.first[k], plan.first[k + 1]
        values = room[k % 2]
        i, early = steps[k, 1], kernels.early[k]
        for s in range(begin, next_one):
            value, link = values[s - begin], plan.out[s]
            first, past, left, right = kernels.met[s]
            if first >= past:
                continue
            if plan.what[s] == PASSES:
                when, after = kernels.met[plan.to[link]], later[plan.to[link] - next_one]
                for r in range(first, past):
                    for c in range(left, right):
                        value[r, c] = nothing
                    if when[0] <= r < when[1]:
                        for c in range(max(left, when[2]), min(right, when[3])):
                            value[r, c] = after[r, c]
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
            spans = (
                kernels.span_t[row_t, 0], kernels.span_t[row_t, 1],
                kernels.span_g[row_g, 0], kernels.span_g[row_g, 1],
            )  # fmt: skip
            from_row, to_row = (
                (nt, 0) if past <= early else (max(first, early) + spans[0], past - 1 + spans[1])
            )
            if first < early:
                from_row = min(from_row, kernels.opening[k, 0])
                to_row = max(to_row, kernels.opening[k, 1])
            from_c = (left + spans[2]) // COLUMNS * COLUMNS
            to_c = (right + spans[3] + 4 + COLUMNS - 1) // COLUMNS * COLUMNS
            some[0] = won
            for r in range(from_row, min(to_row, nt)):
                row, within, count = gain[r, from_c:], alive[r, from_c:], min(ends[r], to_c) - from_c
                for c in range(count):
                    row[c] = some[0]
                for at in range(link, last):
                    when = kernels.met[plan.to[at]]
                    if r < when[0] or r >= when[1]:
                        continue
                    odd, skip = odds[at], max(when[2] - from_c, 0)
                    after, some_of_it = later[plan.to[at] - next_one, r, from_c + skip :], row[skip:]
                    for c in range(min(count, when[3] - from_c) - skip):
                        some_of_it[c] += odd * after[c]
                for c in range(count):
                    much_here = row[c] * within[c]
                    row[c] = much_here if abs(much_here) > faintest else 0.0
            _correlate(
                gain, ends, along_t[row_t], along_g[row_g], spans, early, at_opening[k], kernels.opening[k],
                between, value, kernels.met[s],
            )  # fmt: skip
            shut = plan.what[s] == OBSERVES and windows[i, 1] < costs.t_max
            if not shut and penalty == 0.0:
                continue
            for r in range(first, past):
                share = _share_open(r, step_t, windows[i, 1]) if shut else 1.0
                some[2], some[3] = share, 1.0 - share
                open_, closed, off, row = some[2], some[3], some[1], value[r, left:]
                for c in range(right - left):
                    row[c] = open_ * (row[c] - off)
                if share < 1.0:
                    when = kernels.met[plan.to[link + 1]]
                    if r < when[0] or r >= when[1]:
                        continue
                    after = later[plan.to[link + 1] - next_one, r]
                    for c in range(max(left, when[2]), min(right, when[3])):
                        row[c - left] += closed * after[c]
        later = values
    r, c = min(int(x), nt - 2), min(int(y), ng - 2)
    fx, fy = x - r, y - c
    low = (1.0 - fy) * later[0, r, c] + fy * later[0, r, c + 1]
    high = (1.0 - fy) * later[0, r + 1, c] + fy * later[0, r + 1, c + 1]
    return (1.0 - fx) * low + fx * high
