"""The smallest changes of budgets and windows that let an observation in: each alone, and all together.

The best order that makes the observation and the best without it are sought at the factor at which the former
begins to be worth more; one run of an order says what it is worth at all factors on time and energy
(`orders_by_budget`). The orders found are compared in more and other futures, and the factor is put right by
values without sampling.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from planner.contingency.order_in_futures import Order
from planner.contingency.seeding import route_plan
from planner.contingency.why_not.contests import BudgetContest, Contest, WindowContest
from planner.contingency.why_not.limits import OF_ENERGY, OF_TIME, VOLUME, WINDOW, widened
from planner.contingency.why_not.order_lanes import BOTH, ENERGY, TIME
from planner.contingency.why_not.order_value import OrderValues
from planner.contingency.why_not.orders_by_budget import AHEAD, LEAST_CHANCE, Widened
from planner.contingency.why_not.question import Question
from planner.evaluate.model import Model
from planner.plan_tree import Plan

PUT_RIGHT, TRUSTED = 10, 3
"""Times that a factor is put right at most, and those in which futures tell where. Two are usual."""

POOR, NEARBY = 0.005, 9
"""Share of a value behind which an order is not valued again, and numbers of factors, 2 % in all, within
which. By hand.
"""

FURTHER = 2
"""Numbers of factors, half a per cent, by which one is tried that is larger."""


@dataclass(frozen=True, slots=True)
class Relaxation:
    """The smallest change found that lets something in: what, by which factor, and the value then.

    A window is made so many times as long, about its middle. `plan` makes the observation with the change.
    """

    what: str
    factor: float
    value: float
    plan: Plan = ()


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
    poor: dict[Order, int] = {}
    off: dict[int, float] = {}
    best: tuple[float, Order] | None = None
    at = contest.least(np.zeros(len(numbers)))
    while at is not None and at not in leads and len(leads) < PUT_RIGHT:
        leads[at] = -math.inf
        valued = _valued(question, kinds, contest, at, poor)
        if valued is None:  # made too seldom: a little further on it may be made
            at = at + FURTHER if at + FURTHER < len(numbers) else None
            continue
        leads[at], told = valued
        if leads[at] > 0.0 and (best is None or told < best):
            best = told
        off[at] = leads[at] - contest.lead(at)
        at = _next(leads, contest.least(np.interp(numbers, sorted(off), [off[k] for k in sorted(off)])))
    return None if best is None else _relaxation(question, kinds, *best)


def _relaxation(question: Question, kinds: Collection[str], factor: float, order: Order) -> Relaxation:
    model = Model.of(widened(question.problem, question.what, kinds, factor))
    return Relaxation(" and ".join(kinds), factor, OrderValues(model)[order], route_plan(model, order))


def _next(leads: dict[int, float], told: int | None) -> int | None:
    """Return the number of the factor to be valued next, where futures tell one; None where the least is
    known. From `TRUSTED` factors on it halves what lies between those behind and ahead.
    """
    ahead = min((at for at, lead in leads.items() if lead > 0.0), default=None)
    if ahead is None:
        return told
    behind = max((at for at in leads if at < ahead), default=0)
    if told is None or told >= ahead - 1 or len(leads) >= TRUSTED:
        return (behind + ahead) // 2 if len(leads) >= TRUSTED and ahead - behind > 2 else None
    return told


def _valued(
    question: Question, kinds: Collection[str], contest: Contest, at: int, poor: dict[Order, int]
) -> tuple[float, tuple[float, Order]] | None:
    """Return the lead at a factor as values without sampling tell it, and the factor with its best order.

    None where all orders that more futures take for the best make the observation too seldom. `poor` are
    orders far behind the best of their side, with the number of the factor where they were; it is added to.
    """
    factor = math.ceil(1e3 * question.orders.factors[at]) / 1e3
    model = Model.of(widened(question.problem, question.what, kinds, factor))
    values = OrderValues(model, quick=True)
    with_it, without = (
        [o for o in side if abs(poor.get(o, -NEARBY) - at) >= NEARBY] for side in contest.pair(at)
    )
    with_it = [
        o for o in with_it
        if not contest.seldom(o, at) or values.chance(o, question.asked) >= LEAST_CHANCE
    ]  # fmt: skip
    if not with_it:
        return None
    other = values[values.best(without)] if without else 0.0
    best = values.best(with_it)
    for side, most in ((with_it, values[best]), (without, other)):
        poor.update((o, at) for o in values.poor(side, most - POOR * abs(most)))
    lead = values[best] - AHEAD * abs(values[best]) - max(0.0, other)
    return lead, (factor, best)
