"""Engines that others wrote solve exported problems; what their plans are worth is reckoned by ours."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from unified_planning.io import ANMLReader, PDDLReader

from neighbours.planning.documents import Language, problem_text
from neighbours.planning.model import foreign_problem, worth
from neighbours.planning.plan_back import plan_of
from planner.evaluate.model import Model
from planner.evaluate.monte_carlo import Estimate, estimate
from planner.plan_tree import Plan, planned_observations
from planner.problem import Problem
from planner.solve import solve
from tests.neighbours.planning.engines import solved
from tests.planner.reference.optimum import optimum
from tests.planner.reference.problems import FAMILIES, generated
from tests.seeds import drawn_seed

FUTURES = 20_000
BEYOND_CHANCE = 5.0
"""Standard errors: once in three million comparisons."""
EXACT = tuple(family for family in FAMILIES if family not in ("fading", "failing"))
"""Where no track is lost, no drive fails and amounts are constant, the files of these say all that bears on
the choice.
"""


def value(problem: Problem, plan: Plan) -> Estimate:
    """Return what a plan earns on futures; with constant amounts and no losses each earns the same."""
    return estimate(Model.of(problem), plan, FUTURES, seed=drawn_seed())


def best(problem: Problem) -> tuple[Plan, set[str]]:
    """Return the plan that tamerlite finds when it may leave goals out, and what it observes."""
    result = solved(foreign_problem(problem), "oversubscription[tamerlite]")
    assert result.plan is not None, result
    plan = plan_of(result.plan, problem)
    return plan, set(planned_observations(plan))


def read_back(problem: Problem, goals: set[str]) -> dict[str, Any]:
    """Return the problem as readers of unified-planning understand its two texts."""
    pddl = dict(problem_text(problem, Language.PDDL, goals).files)
    anml = dict(problem_text(problem, Language.ANML, goals).files)
    return {
        "pddl": PDDLReader().parse_problem_string(pddl["domain.pddl"], pddl["problem.pddl"]),
        "anml": ANMLReader().parse_problem_string(anml["problem.anml"]),
    }


@pytest.mark.parametrize("family", EXACT)
def test_an_engine_earns_what_the_best_of_all_choices_earns(family: str) -> None:
    problem = generated(family, drawn_seed())
    problem = replace(problem, legs=tuple(replace(leg, p_lose={}) for leg in problem.legs))
    plan, held = best(problem)
    most = optimum(problem)
    assert float(sum(worth(o) for o in problem.observations if o.id in held)) == pytest.approx(most)
    assert value(problem, plan).mean == pytest.approx(most)


@pytest.mark.parametrize("family", FAMILIES)
def test_plans_of_two_engines_are_worth_no_more_than_our_certificate(family: str) -> None:
    for spread in (0.0, 0.3):
        problem = generated(family, drawn_seed(), spread=spread)
        ours = solve(problem, time_limit_s=20.0)
        plan, goals = best(problem)
        plans = {"tamerlite": plan}
        texts = read_back(problem, goals)
        for language, engine in (("pddl", "tamerlite"), ("anml", "tamerlite"), ("anml", "aries")):
            result = solved(texts[language], engine)
            assert result.plan is not None, (language, engine, goals, result)
            found = plan_of(result.plan, problem)
            assert goals <= set(planned_observations(found)), (language, engine)
            plans[f"{engine} from {language}"] = found
        for name, foreign in plans.items():
            earned = value(problem, foreign)
            print(
                f"{family} {spread}: {name} {earned.mean:.4f} +- {earned.standard_error:.4f}, "
                f"ours {ours.expected_utility:.4f}, no more than {ours.upper:.4f}"
            )
            assert earned.mean - BEYOND_CHANCE * earned.standard_error <= ours.upper + 1e-9
