"""Plans without branches for problems that no table holds: routes on mean values, thinned out by Monte Carlo.

The table of the optimal policy holds about ten observations; a long day among many targets makes more. A
route on mean values with less than the whole budgets leaves room for what goes wrong; how much less, and
which of its observations are better left out, is settled on common random numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

from planner.contingency.reduction import mean_route_of, only
from planner.contingency.seeding import route_steps, track_steps
from planner.evaluate.model import MAX_BITS, Model
from planner.evaluate.monte_carlo import simulate
from planner.plan_tree import OnFail, Plan
from planner.problem import ObservationId, Problem

SHARES = (1.0, 0.85, 0.7)
FUTURES = 4_000
ROUNDS = 12
"""Observations that are left out at most, one after the other."""


@dataclass(frozen=True, eq=False)
class LongRoute:
    """A plan for the part of a problem that its route makes."""

    problem: Problem
    plan: Plan
    value: float


def best_long_route(
    problem: Problem, *, seed: int, should_stop: Callable[[], bool] = lambda: False
) -> LongRoute | None:
    """Return the best plan found that follows a route on mean values; None if there is no route."""
    best: LongRoute | None = None
    for share in SHARES:
        if should_stop():
            break
        route = mean_route_of(problem, share)
        if not 0 < len(route) <= MAX_BITS:
            continue
        found = _thinned(problem, route, seed, should_stop)
        if best is None or found.value > best.value:
            best = found
    return best


def _thinned(
    problem: Problem, route: tuple[ObservationId, ...], seed: int, should_stop: Callable[[], bool]
) -> LongRoute:
    """Return the route without the observations that it is worth more without."""
    best = _valued(problem, route, seed)
    for _ in range(ROUNDS):
        if len(route) < 2 or should_stop():
            break
        shorter = [
            (rest, _valued(problem, rest, seed))
            for rest in (route[:k] + route[k + 1 :] for k in range(len(route)))
            if _drivable(problem, rest)
        ]
        if not shorter:
            break
        rest, found = max(shorter, key=lambda pair: pair[1].value)
        if found.value <= best.value:
            break
        route, best = rest, found
    return best


def _drivable(problem: Problem, route: tuple[ObservationId, ...]) -> bool:
    """Return whether a way leads from each stop to the next, and nothing lacks what must go before it."""
    legs = {(leg.origin, str(leg.to)) for leg in problem.legs}
    target = {o.id: str(o.target) for o in problem.observations}
    stops = ["start", *(target[name] for name in route)]
    if any(a != b and (a, b) not in legs for a, b in pairwise(stops)):
        return False
    return all(first in route for first, second in problem.precedence if second in route)


def _valued(problem: Problem, route: tuple[ObservationId, ...], seed: int) -> LongRoute:
    part = only(problem, set(route))
    model = Model.of(part)
    order = tuple(model.number_of[name] for name in route)
    plan = (*track_steps(model, set(order)), *route_steps(model, order, 0, OnFail.SKIP))
    return LongRoute(part, plan, float(simulate(model, plan, FUTURES, seed=seed).utility.mean()))
