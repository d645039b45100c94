"""The smallest changes of budgets and windows that let an observation in: each alone, and all together.

The best order that makes the observation and the best without it are sought at the factor at which the former
begins to be worth more; one run of an order says what it is worth at all factors on time and energy
(`orders_by_budget`). The orders found are compared in more and other futures, and the factor is put right by
values without sampling.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from planner.contingency.order_in_futures import Order
from planner.contingency.seeding import route_plan
from planner.contingency.why_not.contests import BudgetContest, Contest, WindowContest
from planner.contingency.why_not.limits import OF_ENERGY, OF_TIME, VOLUME, WINDOW, widened
from planner.contingency.why_not.order_lanes import BOTH, ENERGY, TIME
from planner.contingency.why_not.order_value import OrderValues
from planner.contingency.why_not.orders_by_budget import AHEAD, Widened
from planner.contingency.why_not.question import Question
from planner.evaluate.model import Floats, Ints
from planner.plan_tree import Plan

PUT_RIGHT, TRUSTED = 14, 3
"""Times that a factor is put right at most, and those in which futures tell where. Two are usual; where
futures are wrong thrice, halving what is left of the factors takes nine more.
"""

FASTER = 6e-4
"""Share of a value by which one order may gain on another from one number of a factor to the next; one that
is further behind the best of its side at a factor near by is not valued again. By hand: leads at eight
targets change by as much at most.
"""

FURTHER = 2
"""Numbers of factors, half a per cent, by which one is tried that is larger."""

ROOMS = 16
"""How many times as much smaller than the least known the third factor is at most."""

CLOSE, ALL_BUT_EVEN = 3, 4
"""Numbers of factors to which the least is told: three quarters of the 1 % that is asked, and 1 % where a
lead is no larger than what it must be at least, which matters to nobody. That nothing is ahead at a factor so
much smaller is never left to futures: over a tenth of a budget some leads change by less than futures are off
by (day 3 of seed 388904330, 3 % late).
"""


@dataclass(frozen=True, slots=True)
class Relaxation:
    """The smallest change found that lets something in: what, by which factor, and the value then.

    A window is made so many times as long, about its middle. `plan` makes the observation with the change.
    """

    what: str
    factor: float
    value: float
    plan: Plan = ()


@dataclass(frozen=True, slots=True)
class _Found:
    """The best order with the observation at a factor, and the values there."""

    factor: float
    order: Order
    values: OrderValues

    def relaxation(self, kinds: Collection[str]) -> Relaxation:
        """Return the change that lets the order in."""
        plan = route_plan(self.values.model, self.order)
        return Relaxation(" and ".join(kinds), self.factor, self.values.evaluated(self.order), plan)


def smallest_relaxations(question: Question) -> tuple[Relaxation, ...]:
    """Return, least first, the smallest changes found with which the best order makes the observation.

    Time and energy, and where they are limited the downlink volume and the observation's window, each alone;
    all together where none is enough alone.
    """
    kinds = [OF_TIME, OF_ENERGY]
    kinds += [VOLUME] if question.problem.budget.data_mbit is not None else []
    kinds += [WINDOW] if question.what.window_s is not None else []
    found = [one for kind in kinds if (one := _least(question, [kind])) is not None]
    if not found and (jointly := _least(question, kinds)) is not None:
        found = [jointly]
    return tuple(sorted(found, key=lambda relaxation: relaxation.factor))


def _least(question: Question, kinds: Collection[str]) -> Relaxation | None:
    """Return the change at the least factor at which, without sampling, an order with the observation is
    ahead.

    The lead in futures is moved by what it is off at the factors valued so far, until it tells one of them.
    """
    rows = {(True, False): TIME, (False, True): ENERGY, (True, True): BOTH}
    how = Widened(rows.get((OF_TIME in kinds, OF_ENERGY in kinds)), VOLUME in kinds)
    contest: Contest = WindowContest(question, how) if WINDOW in kinds else BudgetContest(question, how)
    numbers = np.arange(len(question.orders.factors))
    leads: dict[int, float] = {}
    behind: dict[Order, dict[int, float]] = {}
    off: dict[int, float] = {}
    best: _Found | None = None
    room = CLOSE
    at = contest.least(np.zeros(len(numbers)))
    while at is not None and at not in leads and len(leads) < PUT_RIGHT:
        leads[at] = -math.inf
        valued = _valued(question, kinds, contest, at, behind)
        if valued is None:  # made too seldom: a little further on it may be made, if futures do not say where
            again = contest.least(_interpolated(off, numbers))
            if best is None:
                at = again if again is not None and again not in leads else at + FURTHER
                at = at if at < len(numbers) else None
            else:
                at = _next(leads, again, room, trusted=True)
            continue
        leads[at], small, found = valued
        if leads[at] > 0.0 and (best is None or found.factor < best.factor):
            best = found
        off[at] = leads[at] - contest.lead(at)
        room = ALL_BUT_EVEN if 0.0 < leads[at] <= small else CLOSE
        at = _next(leads, contest.least(_interpolated(off, numbers)), room, trusted=len(leads) < TRUSTED)
    return None if best is None else best.relaxation(kinds)


def _interpolated(off: Mapping[int, float], numbers: Ints) -> Floats:
    """Return what is known at some numbers of factors at all, [factors]; 0 where it is known at none."""
    known = sorted(off)
    return np.interp(numbers, known, [off[k] for k in known]) if known else np.zeros(len(numbers))


def _next(leads: Mapping[int, float], told: int | None, room: int, *, trusted: bool) -> int | None:
    """Return the number of the factor to be valued next; None where the least is known: where one not more
    than `room` smaller was valued, and was behind.

    Futures tell one where they are `trusted`: for the first `TRUSTED`, and where they were just put right on
    how seldom it is made. Without one, a factor is valued that is `room` smaller than the
    least known, which most often is behind, and four times as much smaller each time that it is not.
    """
    ahead = min((at for at, lead in leads.items() if lead > 0.0), default=None)
    if ahead is None:
        return told
    behind = max((at for at in leads if at < ahead), default=0)
    if ahead - behind <= room:
        return None
    line = _where_a_line_ends(leads, ahead) if not behind else None
    if line is not None:
        return max(min(line, ahead - room), ahead - ROOMS * room, 1)
    if told is not None and behind < told < ahead - room and trusted:
        return told
    won = sum(lead > 0.0 for lead in leads.values())
    return max((behind + ahead) // 2, ahead - room * 4 ** (won - 1))


def _where_a_line_ends(leads: Mapping[int, float], ahead: int) -> int | None:
    """Return where a straight line through the only two leads known, both positive, comes to nothing; None
    where there are others or it does not.
    """
    if len(leads) != 2:
        return None
    (further,) = (at for at in leads if at != ahead)
    slope = (leads[further] - leads[ahead]) / (further - ahead)
    return math.floor(ahead - leads[ahead] / slope) if slope > 0.0 else None


def _valued(
    question: Question,
    kinds: Collection[str],
    contest: Contest,
    at: int,
    behind: dict[Order, dict[int, float]],
) -> tuple[float, float, _Found] | None:
    """Return the lead at a factor as values without sampling tell it, how much of a lead is none to speak of,
    and the best order.

    None where all orders that more futures take for the best make the observation too seldom. `behind` says
    by what share of its value orders are behind the best of their side, by the number of the factor; it is
    added to.
    """
    factor = math.ceil(1e3 * question.orders.factors[at]) / 1e3
    model = question.model.with_limits_of(widened(question.problem, question.what, kinds, factor))
    values = OrderValues(model, quick=True)
    with_it, without = (_that_may_lead(side, behind, at) for side in contest.pair(at))
    with_it = [o for o in with_it if not contest.seldom(o, at, values)]
    if not with_it:
        return None
    best = values.best(with_it)
    rival = values.best(without) if without else None
    lead = _lead(values, best, rival)
    for side, one in ((with_it, best), (without, rival or best)):
        for order in side:
            behind.setdefault(order, {})[at] = values.behind(order, one)
    return lead, AHEAD * abs(values.roughly(best)), _Found(factor, best, values)


def _that_may_lead(side: list[Order], behind: Mapping[Order, Mapping[int, float]], at: int) -> list[Order]:
    """Return the orders of a side that may be its best; all where leads changed faster than thought."""
    return [order for order in side if _may_lead(behind.get(order, {}), at)] or side


def _may_lead(behind: Mapping[int, float], at: int) -> bool:
    """Return whether an order that is so far behind at other factors may be the best of its side."""
    return all(share <= FASTER * abs(at - number) for number, share in behind.items())


def _lead(values: OrderValues, best: Order, rival: Order | None) -> float:
    """Return by how much more than `AHEAD` one order is worth than another, or than nothing; as smaller grids
    tell it where these say which is ahead.
    """
    sides = [best] if rival is None else [best, rival]
    lead = _ahead(*(values.roughly(order) for order in sides))
    if abs(lead) > sum(values.off(order) for order in sides):
        return lead
    return _ahead(*(values[order] for order in sides))


def _ahead(worth: float, other: float = 0.0) -> float:
    return worth - AHEAD * abs(worth) - max(0.0, other)
