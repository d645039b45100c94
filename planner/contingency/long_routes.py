"""Plans for problems that no table holds: routes on mean values, thinned out and branched by Monte Carlo.

The table of the optimal policy holds about ten observations; a long day among many targets makes more. A
route on mean values with less than the whole budgets leaves room for what goes wrong; how much less, and
which of its observations are better left out, is settled on common random numbers. Branches are grown from
the best such route (`sampled.branches`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import chain, pairwise, zip_longest

import numpy as np

from planner.constraints.rule import MAX_BITS
from planner.contingency.reduction import mean_route_of, only
from planner.contingency.sampled.beginnings import best_beginnings
from planner.contingency.sampled.branches import Curve
from planner.contingency.sampled.futures import Growth
from planner.contingency.sampled.raced_lines import KEPT, TRIES, raced
from planner.contingency.seeding import route_plan
from planner.contingency.selection import makeable
from planner.evaluate.model import Model
from planner.evaluate.monte_carlo import simulate
from planner.plan_edits import fitted
from planner.plan_tree import Plan, count_branches, planned_observations
from planner.problem import Observation, ObservationId, Problem

SHARES = (1.0, 0.85, 0.7)
"""Shares of the budgets for which a route is looked for: shorter ones overrun less. By hand."""

FUTURES = 4_000
"""A standard error of 1/63 of the standard deviation of a day, on common futures."""

ROUNDS = 12
"""Observations that are left out at most, one after the other."""

VARIED = 0.3
"""Share by which utilities are changed at most, up or down, for a further route. By hand."""

VARIED_SHARES = (1.0, 0.92, 0.85, 0.75)
"""Shares of the budgets for those, in turn. By hand: the best lines of two days of 15 targets had 0.85 and
0.92."""

BEGUN_SHARE, GUIDED_KEPT = 0.3, (3, 2, 2, 1)
"""Share of the time in which lines that a relaxation leads to are polished, and how many of them get a first,
a second option and so on. By hand: at 30 targets a line's first option takes 3 s of 60."""


@dataclass(frozen=True, eq=False)
class LongRoute:
    """A plan for the part of a problem that its route makes."""

    problem: Problem
    plan: Plan
    value: float


@dataclass(frozen=True, eq=False)
class LongPlan:
    """Plans with at most 0, 1, 2, ... branches for a part of a problem that a model can hold."""

    model: Model
    curve: Curve

    def observations(self) -> int:
        """Return how many observations the plan with most branches may make."""
        return len(planned_observations(self.curve[-1][1]))


def plan_long(
    problem: Problem,
    limits: Growth,
    *,
    warm: tuple[Plan, ...] = (),
    guide_s: float = 0.0,
    used: Callable[[], float] = lambda: 0.0,
    should_stop: Callable[[], bool] = lambda: False,
    told: Callable[[Plan, float], None] = lambda plan, value: None,
) -> LongPlan | None:
    """Return plans grown from routes on mean values, or from a warm plan; None if there is neither. `used`
    tells what share of the time is used up.

    With `guide_s` a relaxation is asked for so many seconds, as `planner.tally` reckons them, which targets
    matter: lines other than the best route are among these.
    With no branches allowed the best of route and warm plans is the answer, without polishing.
    """
    routes = long_routes(problem, seed=limits.seed, should_stop=should_stop)
    starts = [plan for plan in (fitted(problem, w) for w in warm) if plan]
    if routes:
        told(routes[0].plan, routes[0].value)
        starts.append(routes[0].plan)
    if not starts:
        return None
    names = set[ObservationId]().union(*(planned_observations(plan) for plan in starts))
    model = Model.of(widened(problem, names))
    valued = [
        (float(simulate(model, plan, FUTURES, seed=limits.seed).utility.mean()), plan) for plan in starts
    ]
    value, start = max(valued, key=lambda pair: pair[0])
    if limits.max_branches == 0 or count_branches(start) > limits.max_branches:
        return LongPlan(model, [(value, start)])
    kept = KEPT
    if guide_s > 0.0 and limits.lines and not len(model.sols.chance):
        lines = _guided(problem, model, start, guide_s, limits, should_stop)
        polishing = _from_now_on(used)
        beginnings = iter(
            best_beginnings(model, lines, limits, lambda: should_stop() or polishing() > BEGUN_SHARE)
        )
        used, kept = _from_now_on(used), GUIDED_KEPT
    else:
        varied = varied_routes(problem, limits.lines, seed=limits.seed, should_stop=should_stop)
        others = (
            route.plan
            for route in chain(routes if limits.lines else (), varied)
            if route.plan != start and planned_observations(route.plan) <= model.number_of.keys()
        )
        beginnings = chain([start], others)
    # where one line is asked for there are several growths, and each has to leave time for the others
    tries = TRIES if limits.lines else 0
    curve = raced(
        model, beginnings, limits, used=used, should_stop=should_stop, told=told, tries=tries, kept=kept
    )
    return LongPlan(model, curve)


def _guided(
    problem: Problem,
    model: Model,
    start: Plan,
    guide_s: float,
    limits: Growth,
    should_stop: Callable[[], bool],
) -> Iterator[Plan]:
    """Return a plan and other lines among the targets that a relaxation of a model says to matter: what the
    relaxation's policies do, and routes on mean values, in turn.
    """
    # Half of all that planning imports, which a first plan and small problems never need.
    from planner.contingency.by_place.promising import promising

    found = promising(model, limit_s=guide_s)
    made = planned_observations(start)
    matter = {o.id for o in problem.observations if o.target in found.targets and o.id in model.number_of}
    part = only(problem, makeable(problem, matter)) if matter else problem
    names = made.union(o.id for o in part.observations)
    followed = (
        _thinned(problem, line, limits.seed, should_stop)
        for line in found.lines
        if names.issuperset(line) and _drivable(problem, line)
    )
    routes = chain(
        long_routes(part, seed=limits.seed, should_stop=should_stop)[:1],
        varied_routes(part, limits.lines, seed=limits.seed, should_stop=should_stop),
    )
    in_turn = (route.plan for pair in zip_longest(followed, routes) for route in pair if route is not None)
    return chain([start], in_turn)


def _from_now_on(used: Callable[[], float]) -> Callable[[], float]:
    """Return a clock that tells the share used up of what is left now."""
    before = min(used(), 1.0 - 1e-9)
    return lambda: (used() - before) / (1.0 - before)


def widened(problem: Problem, names: set[ObservationId]) -> Problem:
    """Return the part of a problem with these observations and as many others as a model holds.

    Those come first that are worth most for the time of the drive from the nearest of the targets held.
    """
    if len(problem.observations) <= MAX_BITS and len(problem.targets) <= MAX_BITS:
        return problem
    held = {o.target for o in problem.observations if o.id in names}
    nearest: dict[str, float] = {}
    for leg in problem.legs:
        if leg.origin == "start" or leg.origin in held:
            nearest[leg.to] = min(nearest.get(leg.to, math.inf), leg.time_s.mean)
    others = sorted(
        (o for o in problem.observations if o.id not in names and o.target in nearest),
        key=lambda o: (-o.utility * o.p_success / (nearest[o.target] + o.time_s.mean + 1.0), o.id),
    )
    chosen = set(names)
    for o in others:
        if len(chosen) >= MAX_BITS:
            break
        if o.target in held or len(held) < MAX_BITS:
            chosen.add(o.id)
            held.add(o.target)
    return only(problem, names | makeable(problem, chosen))


def long_routes(
    problem: Problem, *, seed: int, should_stop: Callable[[], bool] = lambda: False
) -> list[LongRoute]:
    """Return plans that follow different routes on mean values, the best first."""
    found: list[LongRoute] = []
    for share in SHARES:
        if should_stop():
            break
        route = mean_route_of(problem, share)
        if 0 < len(route) <= MAX_BITS:
            plan = _thinned(problem, route, seed, should_stop)
            if all(plan.plan != other.plan for other in found):
                found.append(plan)
    return sorted(found, key=lambda route: -route.value)


def varied_routes(
    problem: Problem, count: int, *, seed: int, should_stop: Callable[[], bool] = lambda: False
) -> Iterator[LongRoute]:
    """Yield plans that follow routes for which some observations are worth more and others less than they
    are: main lines that differ, of which others may be better to branch from than the best. Those of `count`
    draws that fit are all different.
    """
    rng = np.random.default_rng(seed)
    known: set[Plan] = set()
    for k in range(count):
        if should_stop():
            return
        route = mean_route_of(_varied(problem, rng), VARIED_SHARES[k % len(VARIED_SHARES)])
        if 0 < len(route) <= MAX_BITS:
            found = _thinned(problem, route, seed, should_stop)
            if found.plan not in known:
                known.add(found.plan)
                yield found


def _varied(problem: Problem, rng: np.random.Generator) -> Problem:
    def varied(observation: Observation) -> Observation:
        return replace(observation, utility=observation.utility * rng.uniform(1.0 - VARIED, 1.0 + VARIED))

    targets = tuple(replace(t, observations=tuple(map(varied, t.observations))) for t in problem.targets)
    return replace(problem, targets=targets)


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
    plan = route_plan(model, order)
    return LongRoute(part, plan, float(simulate(model, plan, FUTURES, seed=seed).utility.mean()))
