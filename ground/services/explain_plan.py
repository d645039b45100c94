"""Say why a request is not in a plan, and which of two plans is better."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sqlalchemy.orm import Session

from ground.errors import InvalidInputError
from ground.gdr import models as m
from ground.gdr import values as v
from ground.gdr.repository import Repository
from ground.services.actor import Actor
from ground.services.read_plan import computed_plan
from ground.work.what_if import begun

if TYPE_CHECKING:
    from planner.evaluate.model import Floats
    from planner.plan_tree import Plan, PlanTree
    from planner.problem import Problem

FUTURES = 20_000
"""Enough for a standard error of about a hundredth of a plan's value, in about a second."""
BINS = 32
"""Bars of a histogram."""


def _stored(session: Session, plan: m.PlanRow) -> tuple[Problem, PlanTree]:
    from planner.plan_tree import plan_tree_from_dict
    from planner.problem import problem_from_dict

    assert plan.problem_id is not None
    problem = problem_from_dict(session.get_one(m.ProblemRow, plan.problem_id).document)
    return problem, plan_tree_from_dict(plan.tree, problem)


def explain_request(repo: Repository, actor: Actor, plan_id: str, request_id: str) -> v.WhyNot:
    """Return why a request is not in a plan: the reason, what it would displace, what would let it in.

    A request that base placement or the path network refused has that as its reason.

    Raises
    ------
    InvalidInputError
        If the request is in the plan, or was not asked of it.
    """
    from planner.errors import PlannerError
    from planner.explain import why_not

    with repo.database.read() as session:
        plan = computed_plan(session, actor, plan_id)
        problem, tree = _stored(session, plan)
        refused = plan.left_out.get(request_id)
    if refused is not None and all(str(o.id) != request_id for o in problem.observations):
        return v.WhyNot(request_id, refused, "reachability", 0.0, 0.0, [], None)
    try:
        found = why_not(problem, tree.plan, request_id, futures=FUTURES, seed=plan.seed)
    except PlannerError as err:
        raise InvalidInputError(str(err), pointer="request_id") from err
    relaxation = found.relaxation
    return v.WhyNot(
        request_id=request_id,
        reason=found.reason,
        limit=found.limit,
        change=found.change,
        standard_error=found.standard_error,
        displaced=[str(o) for o in found.displaced],
        relaxation=None
        if relaxation is None
        else v.Relaxation(relaxation.what, relaxation.factor, relaxation.value),
    )


def compare_plans(repo: Repository, actor: Actor, plan_id: str, other_id: str) -> v.PlanComparison:
    """Return how two plans of one mission do on the same futures of the first one's problem.

    Raises
    ------
    InvalidInputError
        If they are of different missions, or the second visits what the first one's problem does not have.
    """
    from planner.errors import PlannerError
    from planner.explain import compare_plans as compare
    from planner.plan_tree import plan_tree_from_dict

    with repo.database.read() as session:
        a, b = computed_plan(session, actor, plan_id), computed_plan(session, actor, other_id)
        if a.mission_id != b.mission_id:
            raise InvalidInputError(f"plans {a.id} and {b.id} are of different missions", pointer="other_id")
        problem, tree_a = _stored(session, a)
        try:
            tree_b = plan_tree_from_dict(b.tree, problem)
        except PlannerError as err:
            raise InvalidInputError(f"plan {b.number} does not fit: {err}", pointer="other_id") from err
    found = compare(problem, tree_a.plan, tree_b.plan, futures=FUTURES, seed=a.seed)
    futures_a, begun_a = _flown(problem, tree_a.plan, a.seed)
    futures_b, begun_b = _flown(problem, tree_b.plan, a.seed)
    in_a, in_b = set(a.planned_request_ids), set(b.planned_request_ids)
    return v.PlanComparison(
        plan_a=a.id,
        plan_b=b.id,
        value_a=found.value_a,
        value_b=found.value_b,
        difference=found.difference,
        standard_error=found.standard_error,
        a_beats_b=found.a_beats_b,
        b_beats_a=found.b_beats_a,
        worst_a=found.worst_a,
        worst_b=found.worst_b,
        overrun_a=found.overrun_a,
        overrun_b=found.overrun_b,
        only_in_a=sorted(in_a - in_b),
        only_in_b=sorted(in_b - in_a),
        futures=FUTURES,
        histogram=_pair_histogram(futures_a, futures_b),
        difference_histogram=_histogram(futures_a - futures_b),
        begun_a=begun_a,
        begun_b=begun_b,
    )


def _flown(problem: Problem, plan: Plan, seed: int) -> tuple[Floats, dict[str, float]]:
    """Return the utility of a plan in each future, and how often each of its observations was begun."""
    from planner.evaluate.model import Model
    from planner.evaluate.monte_carlo import simulate
    from planner.evaluate.program import compile_plan

    model = Model.of(problem)
    program = compile_plan(model, plan)
    flown = simulate(model, program, FUTURES, seed=seed, count_visits=True)
    return flown.utility, begun(program, plan, flown.row_visits, FUTURES)


def _edges(low: float, high: float) -> Floats:
    import numpy as np

    if high - low < 1e-9:
        low, high = low - 0.5, high + 0.5
    return np.linspace(low, high, BINS + 1)


def _histogram(values: Floats) -> v.Histogram:
    import numpy as np

    counts, edges = np.histogram(values, _edges(float(values.min()), float(values.max())))
    return v.Histogram(_rounded(edges), _rounded(counts / len(values)))


def _pair_histogram(a: Floats, b: Floats) -> v.PairHistogram:
    import numpy as np

    edges = _edges(float(min(a.min(), b.min())), float(max(a.max(), b.max())))
    shares = (np.histogram(values, edges)[0] / len(values) for values in (a, b))
    return v.PairHistogram(_rounded(edges), *map(_rounded, shares))


def _rounded(values: Floats) -> list[float]:
    return [round(float(value), 6) for value in values]
