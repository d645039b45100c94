"""The best orders with an observation against the best without it, over the factor on what is widened."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from planner.constraints.registry import columns_of
from planner.contingency.order_in_futures import Order
from planner.contingency.why_not.limits import WINDOW, widened
from planner.contingency.why_not.order_value import OrderValues
from planner.contingency.why_not.orders_by_budget import (
    AHEAD,
    IN_WINDOW,
    LEAST_CHANCE,
    OrdersByBudget,
    Widened,
)
from planner.contingency.why_not.question import NEAR, Question, alike, nearest
from planner.evaluate.model import Floats

SAME = 4
"""Numbers of factors, 1 % in all, within which what was found at one is not sought again at another."""

PARTS = 4
"""Factors, evenly spread by their logarithms up to the largest, at which orders are sought at first."""

LIKELIEST = 4
"""Orders kept whose worth in a window is told by more futures: a run there takes four times as long."""

SELDOM = 3.0 * LEAST_CHANCE
"""Chances up to which more futures are too few to tell whether an order makes the observation at all."""

Sides = tuple[list[Order], list[Order]]
"""Orders with the observation, and orders without it."""


class Contest(Protocol):
    """Both sides over the numbers of the factors, as futures tell them."""

    def least(self, off: Floats) -> int | None:
        """Return the least factor over 1 at which the side with the observation is ahead, were its lead
        larger by `off` [factors]; None where it is nowhere.
        """

    def lead(self, at: int) -> float:
        """Return by how much more than `AHEAD` the best order with the observation earns than the best
        without it.
        """

    def pair(self, at: int) -> Sides:
        """Return the orders that may be the best of each side there."""

    def seldom(self, order: Order, at: int, values: OrderValues) -> bool:
        """Return whether an order makes the observation too seldom to count, by `values` there where futures
        leave that open; what they tell is put right then.
        """


class BudgetContest:
    """The contest over budgets and the downlink volume: one curve of an order holds for all factors."""

    def __init__(self, question: Question, how: Widened) -> None:
        self.question, self.how = question, how
        self.last = len(question.orders.factors) - 1
        self.sought: list[int] = []

    def least(self, off: Floats) -> int | None:
        """Return the least factor in more futures, `off` [factors]; orders are sought there."""
        if not self.sought:
            self._seek(self.last)
            orders, off_by_none = self.question.orders, np.zeros(len(off))
            if not orders.near_a_lead(self.how):
                return None
            at = self._first(orders, off_by_none)
            for part in range(PARTS - 1, 0, -1):
                if at is None or self.last * part // PARTS < at:
                    self._seek(self.last * part // PARTS)
            at = self._first(orders, off_by_none)
            while at is not None and self._seek(at):
                at = self._first(orders, off_by_none)
            if at is None:
                return None
            self._compare(at)
        while True:
            at = self._first(self.question.closer, off)
            new = self._compare(self.last) if at is None else self._seek(at) or self._compare(at)
            if not new:
                return at

    def _first(self, orders: OrdersByBudget, off: Floats) -> int | None:
        found = np.flatnonzero(orders.lead(self.how)[1:] + off[1:] > 0.0)
        return 1 + int(found[0]) if len(found) else None

    def _seek(self, at: int) -> bool:
        """Seek better orders at a factor where that was not done near by; return whether it was now."""
        if any(abs(at - before) < SAME for before in self.sought):
            return False
        self.sought.append(at)
        self.question.orders.search(self.how, at)
        return True

    def _compare(self, at: int) -> bool:
        """Take the best orders at a factor into more futures; return whether any is new."""
        orders, closer = self.question.orders, self.question.closer
        before = len(closer.number)
        for holds in (True, False):
            closer.look_at(nearest(orders, self.how, at, holds=holds))
        return len(closer.number) > before

    def lead(self, at: int) -> float:
        """Return the lead in more futures."""
        return float(self.question.closer.lead(self.how)[at])

    def pair(self, at: int) -> Sides:
        """Return those that may be the best in more futures."""
        one, other = (alike(self.question.closer, self.how, at, holds=holds) for holds in (True, False))
        return one, other

    def seldom(self, order: Order, at: int, values: OrderValues) -> bool:
        """Return whether it is made too seldom there."""
        return _too_seldom(order, self.question.closer, self.how, at, values)


class WindowContest:
    """The contest over a window, and budgets with it: an order with the observation has another curve for
    each window, and those that were the best in one are kept for all.
    """

    def __init__(self, question: Question, how: Widened) -> None:
        self.question, self.how = question, how
        self.last = len(question.orders.factors) - 1
        self.sought: list[int] = []
        self.held: dict[Order, None] = {}
        self._in_window: dict[tuple[bool, int], OrdersByBudget] = {}

    def least(self, off: Floats) -> int | None:
        """Return the least factor in more futures, `off` [factors], by bisection: a longer window never makes
        an order worse by much.
        """
        if not self.sought:
            self._seek(self.last)
            parts = [self.last * part // PARTS for part in range(1, PARTS + 1)]
            near = next((at for at in parts if self._lead(at, closer=False) > 0.0), self.last)
            at = self._bisected(np.zeros(len(off)), closer=False, near=near)
            while at is not None and self._seek(at):
                at = self._bisected(np.zeros(len(off)), closer=False, near=at)
            if at is None:
                return None
            self.sought.append(at)
        at = self._bisected(off, closer=True, near=self.sought[-1])
        while at is not None and self._seek(at):
            at = self._bisected(off, closer=True, near=at)
        return at

    def _bisected(self, off: Floats, *, closer: bool, near: int) -> int | None:
        """Return the least factor at which the orders kept are ahead; sought from `near` on."""
        step, low, high = 1, 0, self.last + 1
        while high - low > 1:
            if self._lead(near, closer=closer) + off[near] > 0.0:
                high = near
            else:
                low = near
            near = near - step if high == near else near + step
            step *= 2
            if not low < near < high:
                near = (low + high) // 2
        return high if high <= self.last else None

    def _window(self, at: int, *, closer: bool) -> OrdersByBudget:
        """Return the orders in the window of a factor."""
        found = self._in_window.get((closer, at))
        if found is None:
            question = self.question
            usual = question.closer if closer else question.orders
            wide = widened(question.problem, question.what, (WINDOW,), float(usual.factors[at]))
            found = self._in_window[closer, at] = usual.in_windows(columns_of(wide)[1].window)
        return found

    def _seek(self, at: int) -> bool:
        """Seek better orders at a factor where that was not done near by; return whether it was now."""
        if any(abs(at - before) < SAME for before in self.sought):
            return False
        self.sought.append(at)
        how, orders, wide = self.how, self.question.orders, self._window(at, closer=False)
        orders.climb(how, at, holds=False, starts=IN_WINDOW)
        near = orders.best(how, at, holds=False) + orders.best(how, at, holds=True)
        wide.look_at(self.held)
        wide.look_at(new for _, order in near for new in wide.put_in(wide.without(order)))
        wide.climb(how, at, holds=True, starts=IN_WINDOW)
        best = [order for _, order in wide.best(how, at, holds=True, most=2 * IN_WINDOW)]
        orders.look_at(wide.without(order) for order in best)
        orders.climb(how, at, holds=False, starts=IN_WINDOW)
        self.held.update(dict.fromkeys(best))
        return True

    def _lead(self, at: int, *, closer: bool) -> float:
        wide, usual = (
            self._window(at, closer=closer),
            self.question.closer if closer else self.question.orders,
        )
        if closer:
            near = self.question.orders.best(self.how, at, holds=False, most=NEAR)
            usual.look_at(order for _, order in near)
        held = self._likeliest(at) if closer else list(self.held)
        wide.look_at(held)
        best = max(wide.worths(held, self.how, at), default=-np.inf)
        others = usual.best(self.how, at, holds=False)
        return best - AHEAD * abs(best) - max(0.0, others[0][0] if others else 0.0)

    def _likeliest(self, at: int) -> list[Order]:
        """Return those of the orders kept that are best in the window of a factor."""
        few = self._window(at, closer=False)
        few.look_at(self.held)
        held = list(self.held)
        best = np.argsort([-worth for worth in few.worths(held, self.how, at)], kind="stable")
        return [held[k] for k in best[:LIKELIEST]]

    def lead(self, at: int) -> float:
        """Return the lead in more futures."""
        return self._lead(at, closer=True)

    def pair(self, at: int) -> Sides:
        """Return those that may be the best in more futures."""
        wide = self._window(at, closer=True)
        wide.look_at(self._likeliest(at))
        return alike(wide, self.how, at, holds=True), alike(self.question.closer, self.how, at, holds=False)

    def seldom(self, order: Order, at: int, values: OrderValues) -> bool:
        """Return whether it is made too seldom in the window there."""
        return _too_seldom(order, self._window(at, closer=True), self.how, at, values)


def _too_seldom(order: Order, told: OrdersByBudget, how: Widened, at: int, values: OrderValues) -> bool:
    if told.chance(order, how, at) >= SELDOM:
        return False
    chance = values.chance(order, told.asked)
    told.put_right(order, how, at, chance)
    return chance < LEAST_CHANCE
