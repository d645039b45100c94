"""What orders of observations are worth under every budget at once.

Carried out in a future with budgets to spare, an order uses so much time and energy by each of its steps. Use
only grows, so under smaller budgets the same future goes the same way until the first step that exceeds one,
and what it earns under any budget is known from the one run: each step's worth counts from the factor on the
budgets by which it is within them, and an overrun's cost below the factor of the last. One run of an order in
common futures so gives its value for all factors, and the orders that are best with an observation and
without it are compared factor by factor.

A search changes an order as long as that wins. Of a hundred changes all but a few are much worse, which the
first of the futures tell: those get no curve (races: Maron and Moore 1997).
"""

from __future__ import annotations

import copy
import itertools
import math
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from planner.contingency.order_in_futures import Order
from planner.contingency.why_not.chances import Right
from planner.contingency.why_not.order_changes import changes_of
from planner.contingency.why_not.order_lanes import BOTH, ENERGY, TIME
from planner.contingency.why_not.order_run import Scale, carry_out, ways_of
from planner.contingency.why_not.tabled_futures import TabledFutures
from planner.evaluate.model import LEAST, Floats, Ints, Model
from planner.evaluate.rollout import Costs, World

Curves = NDArray[np.float32]
Numbers = NDArray[np.int64]

STEP = 1.0025
"""Ratio of neighbouring factors: a quarter of the 1 % to which a relaxation is told."""

LEAST_CHANCE = 0.01
"""An order that makes an observation in fewer than one future of a hundred does not make it."""

AHEAD = 1e-3
"""Share of its value by which an order must be better: as exact as values are, and less matters to nobody."""

BEYOND = 40
"""Numbers of factors, a tenth more of the budgets, by which orders are told apart that earn the same: what a
rare day comes to with these budgets, a usual one does with more.
"""

STARTS, IN_WINDOW = 5, 3
"""Orders of each side that a search begins from, no two with the same first observation: the best of all
alike ended on one hill. With three one of 24 relaxations at eight targets (seed 442739731) came too early, as
a better order without the observation was not found. The latter are those begun from in each window.
"""

AT_ONCE = 256
"""Orders whose curves are worked out in one go: 3 MB."""

BEGUN = 256
"""Orders for which there is room at first; a question at eight targets looks at 500 to 1,500 closely."""

FAR_BEHIND = 0.05
"""Share of a value behind which, at every factor, no order is sought that makes it up. By hand."""


def _doubled(rows: NDArray[Any], used: int) -> NDArray[Any]:
    """Return an array [2 * rows, ...] that begins with the rows of another that are used; to copy the others,
    too, takes as long as to carry orders out.
    """
    wider = np.empty((2 * len(rows), *rows.shape[1:]), rows.dtype)
    wider[:used] = rows[:used]
    return wider


@dataclass(frozen=True, slots=True)
class Widened:
    """What a factor widens: a row of the curves (None: no budget), and whether the downlink volume. Orders
    that hold the observation asked for count from the chance `least` to make it on; where it is known at
    other factors alone, that is taken as `leeway` times what it comes to by these.
    """

    row: int | None
    volume: bool = False
    least: float = LEAST_CHANCE
    leeway: float = 1.0

    @property
    def widens(self) -> tuple[int | None, bool]:
        """What is widened, whatever counts."""
        return self.row, self.volume

    def column(self, at: int) -> int:
        """Return the number of the factor on the budgets where the factor is number `at`."""
        return 0 if self.row is None else at


class Near(NamedTuple):
    """The orders that one change of an order leads to, as rows of a table [changes, most] with their lengths,
    the factors on the downlink volume that they need, and their numbers as bytes.
    """

    table: Ints
    sizes: Ints
    needs: Floats
    names: list[bytes]


class OrdersByBudget:
    """Orders of a model's observations, and their curves in common futures; kept once asked for.

    A curve is what an order is worth at each factor, by budgets that it widens, [3, factors], and the chance
    that it makes the observation asked for, likewise.
    """

    def __init__(
        self, model: Model, asked: int, widest: float, futures: TabledFutures, *, doubt: float = 1.0
    ) -> None:
        """`model` has the budgets that factor 1 stands for, but `widest` times the downlink volume: no order
        is left out for it. `asked` is the observation in question and `widest` the largest factor. Chances
        to make it are taken as `doubt` times what futures tell, until they are put right.
        """
        self.model, self.asked, self.futures, self.widest = model, asked, futures, widest
        self.doubt = doubt
        self._right: dict[Order, Right] = {}
        self.factors = np.geomspace(1.0, widest, 1 + math.ceil(math.log(widest) / math.log(STEP)))
        budget = model.problem.budget
        limits = max(budget.time_s, LEAST), max(budget.usable_energy_j, LEAST)
        self._volume = budget.data_mbit / widest if budget.data_mbit is not None else None
        wide = float(self.factors[-1])
        self._costs = Costs.of(model)._replace(t_max=limits[0] * wide, e_max=limits[1] * wide)
        self._world = World.of(model, model.utility * model.p_success)
        self._ways = ways_of(model)
        self._scale = Scale.of(*limits, self.factors)
        self._restricted = bool(model.limits) or bool(np.any(model.predecessors))
        self.windows = model.window
        self._neighbours: dict[Order, Near] = {}
        self._useful = model.utility > 0.0
        self._forget()

    def _forget(self) -> None:
        """Drop all orders."""
        self.number: dict[Order, int] = {}
        self._named: dict[bytes, int] = {}
        self._climbed: set[tuple[Order, int, int, bool]] = set()
        self._orders: list[Order] = []
        self._tops: dict[tuple[Widened, bool], tuple[int, Curves]] = {}
        self._curves = np.empty((BEGUN, 6, len(self.factors)), np.float32)
        self._held = np.empty(BEGUN, np.bool_)
        self._needs = np.empty(BEGUN)
        self._ample = [True, True]  # whether no order exceeds the budget of TIME, of ENERGY, as it is
        self._as_both = np.ones((2, len(self.factors)), np.bool_)  # whether TIME, ENERGY does what BOTH do

    def in_windows(self, windows: Floats) -> OrdersByBudget:
        """Return no orders yet, in the same futures with other windows of the observations, [m, 2]."""
        other = copy.copy(self)
        other.windows = windows
        other._forget()
        return other

    def __contains__(self, order: Order) -> bool:
        return order in self.number

    def curve(self, order: Order) -> Curves:
        """Return what an order is worth and its chance by factor, [6, factors]."""
        number = self._number(order)  # which may replace the array of curves
        return self._curves[number]

    def _number(self, order: Order) -> int:
        known = self.number.get(order)
        if known is not None:
            return known
        self._carry_out([order])
        return self.number[order]

    def _carry_out(self, orders: list[Order], row: int = -1, at: int = 0) -> None:
        """Work out the curves of orders that have none yet, as `_work_out` does."""
        sizes = np.array([len(order) for order in orders])
        table = np.zeros((len(orders), max(1, int(sizes.max()))), np.int64)
        every = itertools.chain.from_iterable(orders)
        table[np.arange(table.shape[1]) < sizes[:, None]] = np.fromiter(every, np.int64, int(sizes.sum()))
        self._work_out(table, sizes, row, at, [0])

    def _work_out(self, table: Ints, sizes: Ints, row: int, at: int, rivals: list[int]) -> None:
        """Work out the curves of orders, rows of a table that have none yet; with a row of the curves those
        that are not far behind the last of the `rivals` before them at factor number `at`. These are rows,
        the first row is one, and they have curves.
        """
        first = len(self._orders)
        while first + len(table) > len(self._held):
            self._curves, self._held, self._needs = (
                _doubled(rows, first) for rows in (self._curves, self._held, self._needs)
            )
        leads = np.zeros(len(table), np.bool_)
        leads[rivals] = True
        kept = carry_out(
            table, sizes, self._ways, self._costs, self._world, self.windows, self.futures, self._scale,
            self.asked, row, at, leads, self._curves[first:],
        )  # fmt: skip
        for line, size in zip(table[kept].tolist(), sizes[kept].tolist(), strict=True):
            order = tuple(line[:size])
            number = self.number[order] = self._named[bytes(order)] = len(self._orders)
            self._orders.append(order)
            self._held[number] = self.asked in order
            self._needs[number] = self.volume(order)
        fresh = self._curves[first : len(self._orders)]
        for k in (TIME, ENERGY):
            self._ample[k] = self._ample[k] and np.array_equal(fresh[:, k, -1], fresh[:, k, 0])
            self._as_both[k] &= (fresh[:, k] == fresh[:, BOTH]).all(axis=0)

    def volume(self, order: Order) -> float:
        """Return the factor on the downlink volume that an order needs."""
        return float(self.model.data_mbit[list(order)].sum()) / self._volume if self._volume else 0.0

    def worth(self, order: Order, how: Widened, at: int) -> float:
        """Return the value of an order at factor number `at`; -inf where it needs more volume, or holds the
        observation asked for and makes it too seldom.
        """
        number, row, column = self._number(order), how.row or TIME, how.column(at)
        if self._needs[number] > (self.factors[at] if how.volume else 1.0) * (1.0 + 1e-9):
            return -math.inf
        chance = self._curves[number, 3 + row, column]
        if self._held[number] and chance * self._times(order, how, slice(at, at + 1))[0] < how.least:
            return -math.inf
        return float(self._curves[number, row, column])

    def worths(self, orders: Collection[Order], how: Widened, at: int) -> list[float]:
        """Return the values of orders that were looked at, as `worth` gives them, in turn."""
        numbers = np.fromiter((self.number[order] for order in orders), np.int64, len(orders))
        found: list[float] = self._worths(how, at, numbers=numbers)[0][:, 0].tolist()
        return found

    def chance(self, order: Order, how: Widened, at: int) -> float:
        """Return the chance that an order makes the observation asked for at factor number `at`, as futures
        tell it.
        """
        number = self._number(order)
        return float(self._curves[number, 3 + (how.row or TIME), how.column(at)])

    def put_right(self, order: Order, how: Widened, at: int, chance: float) -> None:
        """Take the chance of an order for what it is at factor number `at`, and at the others for as much
        more or less than futures tell as at those where it is known, in any windows.
        """
        told = self.chance(order, how, at)
        if told > 0.0:
            before = self._right.get(order)
            known = before.known if before is not None and before.widens == how.widens else {}
            self._right[order] = Right.of(how.widens, {**known, at: chance / told}, len(self.factors))

    def _times(self, order: Order, how: Widened, at: slice) -> Curves:
        """Return how many times as often as futures tell an order may make the observation, [factors]."""
        right = self._right.get(order)
        if right is None:
            return np.full(len(self.factors[at]), self.doubt, np.float32)
        return right.at_most(how.widens, at, how.leeway)

    def _worths(
        self, how: Widened, at: int | slice, *, holds: bool | None = None, numbers: Numbers | None = None
    ) -> tuple[Curves, Numbers]:
        """Return the values of orders at some factors, [orders, factors], and their numbers: of all of one
        side, or of these.
        """
        if numbers is None:
            numbers = np.flatnonzero(self._held[: len(self._orders)] == holds)
        at = at if isinstance(at, slice) else slice(at, at + 1)
        row, column = how.row or TIME, (slice(0, 1) if how.row is None else at)
        values = self._curves[numbers, row, column]
        if self._volume:
            most = (self.factors[at] if how.volume else np.ones(1)) * (1.0 + 1e-9)
            values = np.where(self._needs[numbers][:, None] <= most, values, -np.inf)
        if holds is not False and self._held[numbers].any():
            chances = self._curves[numbers, 3 + row, column]
            if self._right or self.doubt != 1.0:
                chances = chances * np.array([self._times(self._orders[k], how, at) for k in numbers])
            seldom = chances < how.least
            values = np.where(self._held[numbers][:, None] & seldom, -np.inf, values)
        return values, numbers

    def most(self, how: Widened, at: int, *, holds: bool) -> float:
        """Return the value of the best order known of a side at factor number `at`; -inf where there is
        none.
        """
        return float(self._worths(how, at, holds=holds)[0].max(initial=-np.inf))

    def best(
        self, how: Widened, at: int, *, holds: bool, most: int = 1, tied: int = 2, within: float = 0.0
    ) -> list[tuple[float, Order]]:
        """Return the best orders known at factor number `at`, with their values, best first; of those that
        hold the observation asked for, or of the others.

        Of orders worth the same here and with a little more time or energy, whose ends no future comes to,
        the longest and the shortest stand for all: in more futures some may come there. Up to `tied` do of
        those that are within a share of the best value.
        """
        worths, numbers = self._worths(how, at, holds=holds)
        next_to = min(how.column(at) + 1, len(self.factors) - 1)
        found: dict[tuple[float, ...], list[int]] = {}
        for k in np.argsort(-worths[:, 0], kind="stable"):
            value = round(float(worths[k, 0]), 9)
            # Orders that end alike differ there if they begin otherwise and earn as much by chance.
            worth = (value, *self._curves[numbers[k], [TIME, ENERGY], next_to].tolist())
            if value == -math.inf or (len(found) == most and worth not in found):
                break
            found.setdefault(worth, []).append(int(numbers[k]))
        least = max((worth[0] - within * abs(worth[0]) for worth in found), default=0.0)
        return [
            (worth[0], order)
            for worth, alike in found.items()
            for order in self._some_of(alike, how.column(at), tied if worth[0] >= least else 2)
        ]

    def _some_of(self, numbers: list[int], column: int, most: int) -> list[Order]:
        """Return the longest and the shortest of orders, and up to so many in all that are worth the most
        with larger budgets.
        """
        orders = {self._orders[k]: k for k in numbers}
        chosen = dict.fromkeys((max(orders, key=len), min(orders, key=len)))
        if most > 2 and len(orders) > 2:
            beyond = self._curves[numbers, :3, min(column + BEYOND, len(self.factors) - 1)].sum(axis=1)
            best = np.argsort(-beyond, kind="stable")[: most - len(chosen)]
            chosen.update(dict.fromkeys(self._orders[numbers[k]] for k in best))
        return list(chosen)

    def lead(self, how: Widened) -> Floats:
        """Return by how much more than `AHEAD` the best order with the observation earns than the best
        without it, by factor; to do nothing is one without.
        """
        one, other = self._best_worths(how)
        return np.broadcast_to(one - AHEAD * np.abs(one) - other, self.factors.shape)

    def _best_worths(self, how: Widened) -> tuple[Curves, Curves]:
        """Return the worth of the best order with the observation, and of the best without it, by factor."""
        one, other = (self._top(how, holds=holds) for holds in (True, False))
        return one, np.maximum(other, 0.0)

    def _top(self, how: Widened, *, holds: bool) -> Curves:
        """Return the worth of the best order of a side by factor; -inf where there is none."""
        count, top = self._tops.get((how, holds), (0, np.full(1, -np.inf, np.float32)))
        if self._right or self.doubt != 1.0:  # then what was added up may not hold any more
            count, top = 0, np.full(1, -np.inf, np.float32)
        fresh = count + np.flatnonzero(self._held[count : len(self._orders)] == holds)
        top = np.maximum(top, self._worths(how, slice(None), numbers=fresh)[0].max(axis=0, initial=-np.inf))
        self._tops[how, holds] = len(self._orders), top
        return top

    def _told_by(self, how: Widened, at: int) -> tuple[int, int]:
        """Return the row and column of the curves that are searched by; a budget that no order exceeds is
        taken as it is.

        One that none exceeds as the other is may be exceeded where the other is larger.
        """
        row, column = how.row or TIME, how.column(at)
        if row != BOTH:
            return (TIME, 0) if self._ample[row] else (row, column)
        like = [k for k in (ENERGY, TIME) if self._as_both[k, column]]
        return (like[0] if like else BOTH), column

    def near_a_lead(self, how: Widened) -> bool:
        """Return whether the best order with the observation is not far behind everywhere."""
        one, other = self._best_worths(how)
        return bool(np.any(one > (1.0 - FAR_BEHIND) * other))

    def climb(self, how: Widened, at: int, *, holds: bool, starts: int = STARTS) -> None:
        """Change the best orders known, each begun with another observation, as long as that wins at one
        factor.
        """
        worths, numbers = self._worths(how, at, holds=holds)
        begun: dict[int, tuple[float, Order]] = {}
        for k in np.argsort(-worths[:, 0], kind="stable"):
            if worths[k, 0] == -math.inf or len(begun) == starts:
                break
            order = self._orders[numbers[k]]
            if order:
                begun.setdefault(order[0], (float(worths[k, 0]), order))
        self._climb(how, at, list(begun.values()))

    def _climb(self, how: Widened, at: int, begun: list[tuple[float, Order]]) -> None:
        """Change orders, each with its value, as long as that wins; all at once, as handing over the tables
        takes longer than some of the runs.
        """
        row, column = self._told_by(how, at)
        while begun:
            heres = {here: value for value, here in begun}
            heres = {h: v for h, v in heres.items() if (h, row, column, how.volume) not in self._climbed}
            self._climbed.update((here, row, column, how.volume) for here in heres)
            self._race(how, at, sorted(heres, key=lambda here: heres[here]))
            begun = [
                better
                for here, value in heres.items()
                if (better := self._best_change(how, at, here))[0] > value
            ]

    def _best_change(self, how: Widened, at: int, here: Order) -> tuple[float, Order]:
        """Return the best order known that one change of an order leads to, with its value."""
        named = self._named
        numbers = np.array([named[name] for name in self._near(here).names if name in named], np.int64)
        if not len(numbers):
            return -math.inf, here
        worths = self._worths(how, at, numbers=numbers)[0][:, 0]
        best = worths.argmax()
        return float(worths[best]), self._orders[numbers[best]]

    def _race(self, how: Widened, at: int, heres: list[Order]) -> None:
        """Work out the curves of the orders that one change of some leads to, except where they are far
        behind the first of these that leads there after few futures.
        """
        row, column = self._told_by(how, at)
        most = (self.factors[at] if how.volume else 1.0) * (1.0 + 1e-9)
        taken: set[bytes] = set()
        parts: list[Ints] = []
        sizes: list[Ints] = []
        rivals: list[int] = []
        for here in heres:
            near = self._near(here)
            rows = [k for k, name in enumerate(near.names) if name not in self._named and name not in taken]
            if self._volume:
                rows = [k for k in rows if near.needs[k] <= most]
            if rows:
                taken.update(near.names[k] for k in rows)
                rivals.append(sum(len(part) for part in parts))
                parts += [np.array([(*here, 0)]), near.table[rows]]
                sizes += [np.array([len(here)]), near.sizes[rows]]
        if parts:
            table = np.zeros(
                (sum(len(part) for part in parts), max(part.shape[1] for part in parts)), np.int64
            )
            begin = 0
            for part in parts:
                table[begin : begin + len(part), : part.shape[1]] = part
                begin += len(part)
            self._work_out(table, np.concatenate(sizes), row, column, rivals)

    def _near(self, order: Order) -> Near:
        """Return the orders that one change of an order leads to and that can be made, of one side."""
        known = self._neighbours.get(order)
        if known is None:
            table, sizes = changes_of(np.array(order, np.int64), self._useful, self.asked)
            if self._restricted:
                rows = zip(table.tolist(), sizes.tolist(), strict=True)
                can = [self._may_be_made(tuple(line[:size])) for line, size in rows]
                table, sizes = table[can], sizes[can]
            needs = np.zeros(len(table))
            if self._volume:
                inside = np.arange(table.shape[1]) < sizes[:, None]
                needs = np.where(inside, self.model.data_mbit[table], 0.0).sum(axis=1) / self._volume
            width, text = table.shape[1], table.astype(np.uint8).tobytes()
            names = [text[k * width : k * width + size] for k, size in enumerate(sizes.tolist())]
            known = self._neighbours[order] = Near(table, sizes, needs, names)
        return known

    def look_at(self, orders: Iterable[Order]) -> None:
        """Work out the curves of orders, those that can be made."""
        every = dict.fromkeys(orders)
        fresh = [order for order in every if order not in self.number and self._may_be_made(order)]
        for begin in range(0, len(fresh), AT_ONCE):
            self._carry_out(fresh[begin : begin + AT_ONCE])

    def _may_be_made(self, order: Order) -> bool:
        """Return whether all that must precede an observation stands before it, for each of an order."""
        if not self._restricted:
            return True
        made = 0
        for m in order:
            if self.model.predecessors[m] & ~made:
                return False
            made |= 1 << m
        return self.model.admits(made)

    def put_in(self, order: Order) -> list[Order]:
        """Return an order with the observation asked for at each place."""
        return [(*order[:k], self.asked, *order[k:]) for k in range(len(order) + 1)]

    def without(self, order: Order) -> Order:
        """Return an order without the observation asked for."""
        return tuple(m for m in order if m != self.asked)

    def search(self, how: Widened, at: int) -> None:
        """Look for better orders of both sides at a factor, and with the observation just below it."""
        self.climb(how, at, holds=False)
        self.search_with(how, at)
        self.look_at(self.without(order) for _, order in self.best(how, at, holds=True))
        self.climb(how, at, holds=False)

    def search_with(self, how: Widened, at: int) -> None:
        """Look for better orders with the observation just below a factor."""
        put_in = [new for _, order in self.best(how, at, holds=False)[:1] for new in self.put_in(order)]
        self.look_at(put_in)
        below = max(at - 1, 0 if how.row is None else 1)
        self.climb(how, below, holds=True)
        valued = [(self.worth(new, how, below), new) for new in put_in if new in self.number]
        if valued:  # it may be worse than a short order begun alike, which no change leads on from
            self._climb(how, below, [max(valued)])
