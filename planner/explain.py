"""Why a plan is as it is: why not a target, what branches and budgets are worth, which plan is better."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planner.constraints.registry import columns_of
from planner.constraints.rule import Obstacle
from planner.contingency.reduction import live_sets_of, only, reachable_targets
from planner.contingency.why_not.question import WIDEST, Question
from planner.contingency.why_not.relaxations import Relaxation, smallest_relaxations
from planner.errors import PlannerError
from planner.evaluate.model import Model
from planner.evaluate.monte_carlo import simulate
from planner.plan_tree import Observe, Plan, planned_observations
from planner.problem import Observation, ObservationId, Problem
from planner.threads import one_blas_thread

FUTURES = 100_000
"""A standard error of 1/316 of the standard deviation of a difference."""

ASKED = 20_000
"""Futures that tell the change in a why-not: as many as the repository asks for."""


@dataclass(frozen=True, slots=True)
class WhyNot:
    """Why an observation is not in the plan.

    `forced` is the best unbranched plan found that must attempt it; `change` its value less that of the best
    unbranched plan without that demand, with `standard_error` over common futures. `displaced` are
    observations of the plan that the forced one gives up. `relaxations` are the smallest found of each kind
    that lets it in alone, least first; where none does alone, of all together. `reason` says it in a
    sentence, and of what was not found no more than that.
    """

    observation: ObservationId
    reason: str
    limit: str
    change: float = 0.0
    standard_error: float = 0.0
    forced: Plan = ()
    displaced: tuple[ObservationId, ...] = ()
    relaxations: tuple[Relaxation, ...] = ()

    @property
    def relaxation(self) -> Relaxation | None:
        """The smallest change that lets it in."""
        return self.relaxations[0] if self.relaxations else None


@dataclass(frozen=True, slots=True)
class Comparison:
    """Plan A against plan B on the same futures; the worst 5 % are means over the worst twentieth of each."""

    value_a: float
    value_b: float
    difference: float
    standard_error: float
    a_beats_b: float
    b_beats_a: float
    worst_a: float
    worst_b: float
    overrun_a: float
    overrun_b: float


def compare_plans(
    problem: Problem, a: Plan, b: Plan, *, other: Problem | None = None, futures: int = FUTURES, seed: int = 0
) -> Comparison:
    """Return how plan A does against plan B on common random numbers.

    With `other`, B is run on that problem instead (a what-if of the same shape).
    """
    model = Model.of(problem)
    one = simulate(model, a, futures, seed=seed)
    same = other is None and a == b
    two = one if same else simulate(model if other is None else Model.of(other), b, futures, seed=seed)
    difference = one.utility - two.utility
    tail = max(1, futures // 20)
    return Comparison(
        value_a=float(one.utility.mean()),
        value_b=float(two.utility.mean()),
        difference=float(difference.mean()),
        standard_error=float(difference.std()) / float(np.sqrt(futures)),
        a_beats_b=float(np.mean(difference > 1e-9)),
        b_beats_a=float(np.mean(difference < -1e-9)),
        worst_a=float(np.partition(one.utility, tail - 1)[:tail].mean()),
        worst_b=float(np.partition(two.utility, tail - 1)[:tail].mean()),
        overrun_a=float(one.overrun.mean()),
        overrun_b=float(two.overrun.mean()),
    )


def why_not(problem: Problem, plan: Plan, observation: str, *, futures: int = ASKED, seed: int = 0) -> WhyNot:
    """Return why an observation is not in a plan.

    Raises
    ------
    PlannerError
        If the problem has no such observation, or the plan holds it.
    """
    by_name = {str(o.id): o for o in problem.observations}
    if observation not in by_name:
        raise PlannerError(f'the problem has no observation "{observation}"')
    what = by_name[observation]
    held = planned_observations(plan)
    if what.id in held:
        raise PlannerError(f'observation "{observation}" is in the plan')
    with one_blas_thread():
        return _why_not(problem, what, plan, futures, seed)


def _why_not(problem: Problem, what: Observation, plan: Plan, futures: int, seed: int) -> WhyNot:
    held = planned_observations(plan)
    obstacle = _obstacle(problem, what)
    if obstacle is not None:
        return WhyNot(what.id, obstacle.sentence, obstacle.limit)
    part = _with_room_for(problem, what, held)
    question = Question(part, what, [_order_of(Model.of(part), plan)])
    forced, free = question.best_plans()
    relaxations = smallest_relaxations(question)
    if not forced:
        return WhyNot(
            what.id,
            f"found no way to make {what.id} within the budgets; {_said(relaxations)}",
            relaxations[0].what if relaxations else "budgets",
            relaxations=relaxations,
        )
    comparison = compare_plans(part, forced, free, futures=futures, seed=seed)
    displaced = tuple(sorted(held - planned_observations(forced)))
    gives_up = f" and gives up {', '.join(displaced)}" if displaced else ""
    return WhyNot(
        observation=what.id,
        reason=(
            f"the best plan found that attempts {what.id} changes the value by {comparison.difference:+.2f}"
            f"{gives_up}; {_said(relaxations)}"
        ),
        limit=relaxations[0].what if relaxations else "value",
        change=comparison.difference,
        standard_error=comparison.standard_error,
        forced=forced,
        displaced=displaced,
        relaxations=relaxations,
    )


def _order_of(model: Model, plan: Plan) -> tuple[int, ...]:
    """Return the observations of a plan's main line, in order and by number."""
    return tuple(model.number_of[step.observation] for step in plan if isinstance(step, Observe))


def _said(relaxations: tuple[Relaxation, ...]) -> str:
    if not relaxations:
        return f"found no way with up to {WIDEST:g} times the budgets and the window, each and all together"
    return "it comes in with " + " or ".join(f"{r.factor:g} times the {r.what}" for r in relaxations)


def _obstacle(problem: Problem, what: Observation) -> Obstacle | None:
    """Return what keeps an observation out whatever the plan."""
    if what.utility <= 0.0:
        return Obstacle("value", f"{what.id} is worth nothing")
    if what.target not in reachable_targets(problem):
        return Obstacle("network", f"no path leads from the start to target {what.target}")
    # Those of packages first: they know more of their matter than the windows that they come to.
    rules, columns = columns_of(problem)
    found = (rule.explain(problem, what) for rule in reversed(rules))
    obstacle = next((obstacle for obstacle in found if obstacle is not None), None)
    m = problem.observations.index(what)
    if obstacle is None and columns.window[m, 1] < 0.0:
        return Obstacle("window", f"no start of {what.id} is within all the windows that it has")
    return obstacle


def _with_room_for(problem: Problem, what: Observation, held: set[ObservationId]) -> Problem:
    """Return a part of the problem that a table holds, with the plan's observations and the one asked for."""
    count = live_sets_of(problem)
    if count is not None and count <= 2_000:
        return problem
    names = set(held) | {what.id}
    for first, second in problem.precedence:
        if second in names:
            names.add(first)
    return only(problem, names)
