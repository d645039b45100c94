"""The best orders with an observation against the best without it, over the factor on what is widened."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Protocol

import numpy as np

from planner.contingency.order_in_futures import Order
from planner.contingency.why_not.order_value import OrderValues
from planner.contingency.why_not.orders_by_budget import (
    AHEAD,
    FAR_BEHIND,
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
"""Orders kept whose worth in a window is told by more futures where a factor is sought: a run there takes
four times as long. Where one is valued, as many are compared as in budgets: on day 128 of seed 848066986 the
best was fifth in few futures, 1.7 % behind.
"""

ROUGHLY = 3
"""Numbers of factors, three quarters of a per cent, to which futures tell a factor in windows: a factor is
sought anew, and told, within as many.
"""

AT_A_TIME = 4
"""Orders whose worth in a window is told at once, those first that may be worth the most."""

WORSE = 0.005
"""Share of a value by which a longer window may make an order worse, as more is made in it."""

SELDOM = 3.0 * LEAST_CHANCE
"""Chances up to which more futures are too few to tell whether an order makes the observation at all."""

LEEWAY = 1.25
"""How many times as often an order may make the observation as what is known at other factors says: of 2,048
futures at 1 % one to six change between factors near by, and two standard errors of these are 10 to 25 % of
the 20.
"""

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
            orders, off_by_none = self.question.orders, np.zeros(len(off))
            orders.search_with(self.how, self.last)
            if not orders.near_a_lead(self.how):  # without it there may be better orders than are known
                return None
            self._seek(self.last)
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
        closer = self.question.closer
        return alike(closer, _loosely(self.how), at, holds=True), alike(closer, self.how, at, holds=False)

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
        self.likely: dict[Order, None] = {}
        self._in_window: dict[int, OrdersByBudget] = {}
        self._in_window_closer: dict[int, OrdersByBudget] = {}
        self._rivals: dict[tuple[bool, int], tuple[int, float]] = {}

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
        """Return the least factor at which the orders kept are ahead, or one less than `ROUGHLY` larger;
        sought from `near` on.

        Between two factors whose leads are known the next is where a straight line between these says.
        """
        step, low, high = 1, 0, self.last + 1
        leads: dict[int, float] = {}
        while high - low > (1 if high > self.last else ROUGHLY):
            lead = leads[near] = self._lead(near, closer=closer) + off[near]
            if lead > 0.0:
                high = near
            else:
                low = near
            near = near - step if high == near else near + step
            step *= 2
            if not low < near < high:
                near = _between(low, high, leads)
        return high if high <= self.last else None

    def _window(self, at: int, *, closer: bool) -> OrdersByBudget:
        """Return the orders in the window of a factor."""
        known = self._in_window_closer if closer else self._in_window
        found = known.get(at)
        if found is None:
            usual = self.question.closer if closer else self.question.orders
            found = known[at] = usual.in_windows(self.question.windows(at))
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
        if closer:
            wide, held = self._window(at, closer=True), self._likeliest(at)
            wide.look_at(held)
            best = max(wide.worths(held, self.how, at), default=-np.inf)
        else:
            best = max((worth for worth, _ in self._ranked(at, 1)), default=-np.inf)
        return best - AHEAD * abs(best) - self._rival(at, closer=closer)

    def _rival(self, at: int, *, closer: bool) -> float:
        """Return what the best order without the observation earns at a factor; to do nothing is one."""
        orders = self.question.orders
        usual = self.question.closer if closer else orders
        count, worth = self._rivals.get((closer, at), (-1, 0.0))
        if count != len(orders.number):
            if closer:
                near = orders.best(self.how, at, holds=False, most=NEAR)
                usual.look_at(order for _, order in near)
            count, worth = len(orders.number), max(0.0, usual.most(self.how, at, holds=False))
            self._rivals[closer, at] = count, worth
        return worth

    def _ranked(self, at: int, most: int) -> list[tuple[float, Order]]:
        """Return those of the orders kept that are best in the window of a factor, with their worths.

        A longer window never makes an order worse by much: by what they are worth in the next longer one that
        is known, with the budgets of this factor, the likeliest are taken first, and the others are not where
        they cannot be among the best.
        """
        wide = self._window(at, closer=False)
        longer = sorted(other for other in self._in_window if other > at)
        fresh = [order for order in self.held if order not in wide]
        bounds = {order: self._bound(order, at, longer) for order in fresh}
        fresh.sort(key=lambda order: -bounds[order])
        known = [order for order in self.held if order in wide]
        while True:
            worths = wide.worths(known, self.how, at)
            best = np.argsort([-worth for worth in worths], kind="stable")[:most]
            least = worths[best[-1]] if len(best) == most else -np.inf
            new = [order for order in fresh[:AT_A_TIME] if bounds[order] > least]
            if not new:
                return [(worths[k], known[k]) for k in best]
            wide.look_at(new)
            known, fresh = known + new, fresh[len(new) :]

    def _bound(self, order: Order, at: int, longer: list[int]) -> float:
        """Return what an order is worth at most in the window of a factor, by the next of longer ones."""
        for other in longer:
            wide = self._in_window[other]
            if order in wide:
                worth = wide.worth(order, self.how, at)
                return worth + WORSE * abs(worth) if worth > -np.inf else worth
        return np.inf

    def _likeliest(self, at: int, most: int = LIKELIEST) -> list[Order]:
        """Return those of the orders kept that are best in the window of a factor, and those that were
        valued at another.
        """
        ranked = self._ranked(at, most)
        near = [order for worth, order in ranked if worth >= ranked[0][0] - FAR_BEHIND * abs(ranked[0][0])]
        return list(dict.fromkeys((*near, *self.likely)))

    def lead(self, at: int) -> float:
        """Return the lead in more futures."""
        return self._lead(at, closer=True)

    def pair(self, at: int) -> Sides:
        """Return those that may be the best in more futures."""
        wide = self._window(at, closer=True)
        wide.look_at(self._likeliest(at, NEAR))
        best = alike(wide, _loosely(self.how), at, holds=True)
        self.likely.update(dict.fromkeys(best))
        return best, alike(self.question.closer, self.how, at, holds=False)

    def seldom(self, order: Order, at: int, values: OrderValues) -> bool:
        """Return whether it is made too seldom in the window there."""
        return _too_seldom(order, self._window(at, closer=True), self.how, at, values)


def _between(low: int, high: int, leads: Mapping[int, float]) -> int:
    """Return the number of a factor between two, of which the first is behind and the other ahead: where a
    straight line between their leads says, not further than a quarter from the middle; the middle where one
    lead is not known.
    """
    middle, room = (low + high) // 2, (high - low) // 4
    below, above = leads.get(low, -np.inf), leads.get(high, np.inf)
    if not np.isfinite(below) or not np.isfinite(above):
        return middle
    told = low + round((high - low) * -below / (above - below))
    return min(max(told, middle - room), middle + room)


def _loosely(how: Widened) -> Widened:
    """Return the same, where orders count whose chance is to be asked for without sampling."""
    return dataclasses.replace(how, leeway=LEEWAY)


def _too_seldom(order: Order, told: OrdersByBudget, how: Widened, at: int, values: OrderValues) -> bool:
    if told.chance(order, how, at) >= SELDOM:
        return False
    chance = values.chance(order, told.asked, LEAST_CHANCE)
    told.put_right(order, how, at, chance)
    return chance < LEAST_CHANCE
