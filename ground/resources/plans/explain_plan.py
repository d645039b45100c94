"""Say why a request is not in a plan, which of two plans is better, and what differs between them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from ground.errors import InvalidInputError
from ground.gdr.repository import Repository
from ground.records.actor import Actor
from ground.records.show import value_of
from ground.resources.plans.plan_futures import FUTURES, bin_edges, fly, histogram, rounded, stored
from ground.resources.plans.read_plan import computed_plan, parsed_plan, tree_of
from ground.resources.plans.study_value import PairHistogram, PlanComparison, Relaxation, WhyNot

if TYPE_CHECKING:
    from executive.crl import Plan
    from ground.versions.difference import PlanDifference
    from planner.evaluate.model import Floats


def explain_request(repo: Repository, actor: Actor, plan_id: str, request_id: str) -> WhyNot:
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
        problem, tree = stored(session, plan)
        refused = plan.left_out.get(request_id)
    if refused is not None and all(str(o.id) != request_id for o in problem.observations):
        return WhyNot(request_id, refused, "reachability", False, 0.0, 0.0, [], None)
    try:
        found = why_not(problem, tree.plan, request_id, futures=FUTURES, seed=plan.seed)
    except PlannerError as err:
        raise InvalidInputError(str(err), pointer="request_id") from err
    relaxation = found.relaxation
    return value_of(
        WhyNot,
        found,
        request_id=request_id,
        attempted=bool(found.forced),
        displaced=[str(o) for o in found.displaced],
        relaxation=None if relaxation is None else value_of(Relaxation, relaxation),
    )


def compare_plans(repo: Repository, actor: Actor, plan_id: str, other_id: str) -> PlanComparison:
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
        problem, tree_a = stored(session, a)
        try:
            tree_b = plan_tree_from_dict(tree_of(b), problem)
        except PlannerError as err:
            raise InvalidInputError(f"plan {b.number} does not fit: {err}", pointer="other_id") from err
    found = compare(problem, tree_a.plan, tree_b.plan, futures=FUTURES, seed=a.seed)
    flown_a, begun_a = fly(problem, tree_a.plan, a.seed)
    flown_b, begun_b = fly(problem, tree_b.plan, a.seed)
    futures_a, futures_b = flown_a.utility, flown_b.utility
    in_a, in_b = set(a.planned_request_ids), set(b.planned_request_ids)
    return value_of(
        PlanComparison,
        found,
        plan_a=a.id,
        plan_b=b.id,
        only_in_a=sorted(in_a - in_b),
        only_in_b=sorted(in_b - in_a),
        futures=FUTURES,
        histogram=_pair_histogram(futures_a, futures_b),
        difference_histogram=histogram(futures_a - futures_b),
        begun_a=begun_a,
        begun_b=begun_b,
    )


def differ_plans(repo: Repository, actor: Actor, plan_id: str, other_id: str) -> PlanDifference:
    """Return what the second plan says that the first does not, by meaning.

    Raises
    ------
    InvalidInputError
        If they are of different missions.
    """
    from ground.versions.difference import difference

    with repo.database.read() as session:
        a, b = computed_plan(session, actor, plan_id), computed_plan(session, actor, other_id)
        if a.mission_id != b.mission_id:
            raise InvalidInputError(f"plans {a.id} and {b.id} are of different missions", pointer="other_id")
        return difference(_unnamed(parsed_plan(a)), _unnamed(parsed_plan(b)))


def _unnamed(plan: Plan) -> Plan:
    """Return a plan without the id that its row gave it, which differs between any two and says nothing."""
    kept = {key: value for key, value in plan.metadata.items() if key != "plan"}
    return replace(plan, id="plan", metadata=kept)


def _pair_histogram(a: Floats, b: Floats) -> PairHistogram:
    import numpy as np

    edges = bin_edges(float(min(a.min(), b.min())), float(max(a.max(), b.max())))
    shares = (np.histogram(values, edges)[0] / len(values) for values in (a, b))
    return PairHistogram(rounded(edges), *map(rounded, shares))
