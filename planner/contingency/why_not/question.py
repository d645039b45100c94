"""One observation in question: the orders that make it and the others, in few futures and in more."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from functools import cached_property

from planner.constraints.registry import columns_of
from planner.contingency.order_in_futures import MOST_ENUMERATED, Order
from planner.contingency.seeding import route_plan
from planner.contingency.why_not.limits import VOLUME, WINDOW, widened
from planner.contingency.why_not.order_value import OrderValues
from planner.contingency.why_not.orders_by_budget import OrdersByBudget, Widened
from planner.contingency.why_not.tabled_futures import TabledFutures
from planner.evaluate.model import Floats, Model
from planner.evaluate.program import compile_plan
from planner.evaluate.propagate import run_in
from planner.plan_tree import Plan
from planner.problem import Observation, Problem

WIDEST = 3.0
"""Largest factor tried. By hand: a day hardly has three times its budgets."""

SEARCHED, COMPARED = 512, 2_048
"""Futures in which orders are sought, and in which the best are compared: values are off by about 1 % and
half a per cent in them, differences of orders by less. With 256 and 4,096 three of 150 questions with six
observations had a better order, with these none.
"""

SCREENED = 32, 128
"""Futures after which an order far behind is given up."""

NEAR = 12
"""Values of each side whose orders are compared in more futures. By hand."""

TIED, TIED_WITHIN = 6, 0.03
"""Orders that earn the same in the first futures of which so many are compared in more, where they are within
this share of the best: twice what those futures are off by.
"""

ALIKE, VALUED = 0.016, 6
"""Share of its value by which the best in more futures may be better than one that is valued without
sampling, and how many values are at most. Differences of two orders may be off by 2 % in those futures: with
0.008 and 4 one relaxation in 110 came 1.3 % too late (day 25 of seed 944287893). Where a value is small
beside what a day may earn or lose, they are off by more: a standard error of what varies as much as possible
between these ends is taken there.
"""

DOUBT = 1.5
"""How many times as often as more futures tell an order may make the observation, where the least chance that
counts is in question: two standard errors of 2,048 futures at 1 % are 0.44 %.
"""


class Question:
    """An observation in question, and what orders of observations are worth with it and without it."""

    def __init__(self, problem: Problem, what: Observation, begin: Iterable[Order]) -> None:
        """`begin` are orders to begin from."""
        self.problem, self.what, self.begin = problem, what, tuple(begin)
        self.model = Model.of(problem)
        self.asked = self.model.number_of[what.id]
        self._windows: dict[int, Floats] = {}

    @cached_property
    def orders(self) -> OrdersByBudget:
        """The orders looked at: all where there are few observations."""
        orders = self._orders(SEARCHED, 0, SCREENED)
        numbers = range(self.model.m)
        if self.model.m <= MOST_ENUMERATED:
            every = (itertools.permutations(numbers, count) for count in range(1, self.model.m + 1))
            orders.look_at(itertools.chain.from_iterable(every))
            return orders
        short = [order for count in (1, 2) for order in itertools.permutations(numbers, count)]
        short += [order for order in itertools.permutations(numbers, 3) if self.asked in order]
        orders.look_at((*self.begin, *dict.fromkeys(map(self._all_before, short))))
        return orders

    @cached_property
    def closer(self) -> OrdersByBudget:
        """The best of them, in more and other futures."""
        return self._orders(COMPARED, 1, doubt=DOUBT)

    def windows(self, at: int) -> Floats:
        """Return the windows of all observations, [m, 2], with that of the one in question made as many times
        as long as factor number `at` says.
        """
        found = self._windows.get(at)
        if found is None:
            wide = widened(self.problem, self.what, (WINDOW,), float(self.orders.factors[at]))
            found = self._windows[at] = columns_of(wide)[1].window
        return found

    def _orders(
        self, count: int, seed: int, nested: tuple[int, ...] = (), doubt: float = 1.0
    ) -> OrdersByBudget:
        model = self.model.with_limits_of(widened(self.problem, self.what, (VOLUME,), WIDEST))
        futures = TabledFutures.of(model, count, seed=seed, nested=nested)
        return OrdersByBudget(model, self.asked, WIDEST, futures, doubt=doubt)

    def _all_before(self, order: Order) -> Order:
        """Return an order with all that must precede each observation put in before it."""
        found: dict[int, None] = {}
        ahead = list(reversed(order))
        while ahead:
            m = ahead[-1]
            missing = [k for k in range(self.model.m) if (self.model.predecessors[m] >> k) & 1]
            missing = [k for k in missing if k not in found and k not in ahead]
            if missing:
                ahead += missing
            else:
                found[ahead.pop()] = None
        return tuple(found)

    def best_plans(self) -> tuple[Plan, Plan]:
        """Return the best plan found that goes for the observation, at whatever cost, and the best of all.

        The former is empty where no order may be made or its tracks alone exceed a budget.
        """
        model, how = self.model, Widened(None, least=0.0)
        if model.t_max_s <= 0.0 or model.e_max_j <= 0.0:
            return (), ()
        self.orders.search(how, 0)
        worth = OrderValues(model, quick=True)
        sides: list[list[Order]] = []
        for holds in (True, False):
            self.closer.look_at(nearest(self.orders, how, 0, holds=holds))
            sides.append(alike(self.closer, how, 0, holds=holds))
        makes = [order for order in sides[0] if self._keeps_to_budgets(order)]
        every = [order for side in sides for order in side]
        best = worth.best(every) if every else ()
        return (
            route_plan(model, worth.best(makes)) if makes else (),
            route_plan(model, best) if every and worth[best] > 0.0 else (),
        )

    def _keeps_to_budgets(self, order: Order) -> bool:
        """Return whether the tracks that an order starts leave something of the budgets."""
        program = compile_plan(self.model, route_plan(self.model, order))
        return not run_in(self.model, program, program.entry).over


def nearest(orders: OrdersByBudget, how: Widened, at: int, *, holds: bool) -> list[Order]:
    """Return the orders of a side that are compared in more futures, at factor number `at`."""
    best = orders.best(how, at, holds=holds, most=NEAR, tied=TIED, within=TIED_WITHIN)
    return [order for _, order in best]


def alike(orders: OrdersByBudget, how: Widened, at: int, *, holds: bool) -> list[Order]:
    """Return the orders of a side that may be the best at factor number `at`.

    Of orders that earn the same in more futures the longest stands for all, where they are not the best: what
    no such future comes to is worth less than is told apart.
    """
    best = orders.best(how, at, holds=holds, most=VALUED)
    if not best:
        return []
    worth = float(orders.model.utility[list(best[0][1])] @ orders.model.p_success[list(best[0][1])])
    value, penalty = best[0][0], orders.model.penalty
    # What lies between two ends has at most this variance (Bhatia and Davis 2000), a difference of two twice.
    most = max(value + penalty, 0.0) * max(worth - value, 0.0)
    least = value - max(ALIKE * abs(value), math.sqrt(2.0 * most / COMPARED))
    near = {value: order for value, order in reversed(best) if value >= least}
    return [order for one, order in best if one == value or near.get(one) == order]
