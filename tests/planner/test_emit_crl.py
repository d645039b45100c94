"""The CRL of a plan means what the evaluators meant: the executive earns the same, future by future."""

from __future__ import annotations

import json
from typing import Any

import pytest

from benchmarks.executive_equality import compare
from executive.crl import canonical_text, parse
from executive.crl.nodes import Block, Branch, Task, walk_plan
from executive.crl.validate import check
from planner.emit_crl import emit
from planner.evaluate.model import Model
from planner.evaluate.monte_carlo import simulate
from planner.plan_tree import (
    Branch as TreeBranch,
)
from planner.plan_tree import (
    Comparison,
    DoneCondition,
    EnergyCondition,
    Navigate,
    Observe,
    OnFail,
    Option,
    Plan,
    PlanTree,
    TimeCondition,
    TrackedCondition,
    TrackStart,
    TrackStop,
    Visit,
    plan_tree_from_dict,
)
from planner.problem import Problem, load_problem, problem_to_dict
from rover_iface.profile import standard_dictionary
from tests.planner.examples import example, observation, visits
from tests.shared import shared

FUTURES = 200
"""Of each plan; all must agree."""


def _problem(**more: Any) -> Problem:
    rows = [
        [observation("A", "place", 6.0, instrument="mi", p_success=0.8, refs={"request": "r-1"})],
        [observation("B", "image", 3.0, window_s=[1500.0, 3600.0])],
        [observation("C", "place", 5.0, window_s=[0.0, 5200.0]), observation("D", "image", 2.0)],
    ]
    return example(observations=rows, overrun_penalty=4.0, spread=0.7, loss=0.3, **more)


TREES = {
    "skip": visits(_problem(), "A", "B", "C", "D"),
    "stop": visits(_problem(), "C", "A", "B", on_fail=OnFail.STOP),
    "visit": (
        TrackStart("T1"),
        TrackStart("T3"),
        Visit("A", "T1", OnFail.SKIP),
        Visit("B", "T2", OnFail.SKIP),
        Visit("C", "T3", OnFail.STOP),
        Observe("D", "T3"),
    ),
    "branches": (
        TrackStart("T1"),
        TrackStart("T3"),
        Navigate("T1", True, OnFail.SKIP),
        TreeBranch(
            (
                Option(
                    (TimeCondition(Comparison.GE, 1200.0), TrackedCondition("T1", False)),
                    (TrackStop("T1"), Navigate("T3", True, OnFail.SKIP), Observe("C", "T3", OnFail.SKIP)),
                ),
                Option((TimeCondition(Comparison.GE, 2500.0),), ()),
                Option(
                    (EnergyCondition(Comparison.LT, 120_000.0), TrackedCondition("T3", True)),
                    (
                        Observe("A", "T1", OnFail.SKIP),
                        TreeBranch(
                            (Option((DoneCondition("A", True),), (Navigate("T3", True), Observe("C", "T3"))),)
                        ),
                        Navigate("T2"),
                        Observe("B", "T2"),
                    ),
                ),
            )
        ),
        Observe("A", "T1", OnFail.SKIP),
        Navigate("T2"),
        Observe("B", "T2", OnFail.STOP),
        Navigate("T3", True),
        Observe("D", "T3"),
    ),
    "empty": (),
}


@pytest.mark.parametrize("name", list(TREES))
def test_the_executive_earns_what_the_evaluator_says(name: str) -> None:
    problem = _problem(time_s=5600.0)
    assert compare(problem_to_dict(problem), PlanTree("example", TREES[name]), FUTURES, seed=11) == []


def test_a_tracked_image_is_taken_while_its_target_is_tracked_only() -> None:
    problem = example(
        observations=[
            [observation("A", "image", tracked=True), observation("D", "image")],
            [observation("B", "image")],
            [observation("C", "place")],
        ],
        loss=0.35,
    )
    plan: Plan = (
        TrackStart("T1"),
        Navigate("T2", False, OnFail.SKIP),
        Observe("B", "T2", OnFail.SKIP),
        Navigate("T1", False, OnFail.SKIP),
        Observe("A", "T1", OnFail.SKIP),
        Observe("D", "T1", OnFail.SKIP),
        Navigate("T3", False, OnFail.SKIP),
        Observe("C", "T3", OnFail.SKIP),
    )
    assert compare(problem_to_dict(problem), PlanTree("example", plan), FUTURES, seed=13) == []
    text = canonical_text(emit(problem, PlanTree("example", plan)))
    assert text.count(":trackerstate T1") == 1
    with_track = simulate(Model.of(problem), plan, 20_000, seed=1).utility.mean()
    without = simulate(Model.of(problem), plan[1:], 20_000, seed=1).utility.mean()
    assert 0.35 * 5.0 < with_track - without < 0.65 * 5.0


@pytest.mark.parametrize(
    "budget",
    [{"time_s": 2500.0}, {"energy_j": 200_000.0}, {"time_s": 30.0}],
    ids=["time", "energy", "at once"],
)
def test_the_first_action_over_a_budget_is_the_last(budget: dict[str, float]) -> None:
    problem = _problem(**budget)
    assert compare(problem_to_dict(problem), PlanTree("example", TREES["skip"]), FUTURES, seed=12) == []


def test_diminishing_value_and_precedence_survive_the_emission() -> None:
    rows = [
        [observation("A", "place", 6.0), observation("E", "image", 6.0), observation("F", "image", 6.0)],
        [observation("B")],
    ]
    document = problem_to_dict(
        example(
            places=[(4.0, 1.0), (5.0, -1.0)], observations=rows, precedence=[["A", "F"]], loss=0.4, spread=0.4
        )
    )
    document["targets"][0]["diminishing"] = 0.5
    problem = load_problem(document)
    plan = (
        TrackStart("T1"),
        Navigate("T1", False),
        Observe("A", "T1", OnFail.SKIP),
        Observe("E", "T1", OnFail.SKIP),
        Observe("F", "T1", OnFail.SKIP),
        Navigate("T2"),
        Observe("B", "T2"),
    )
    assert compare(document, PlanTree("example", plan), FUTURES, seed=13) == []
    assert any(isinstance(node, Branch) for node in walk_plan(emit(problem, PlanTree("example", plan))))


@pytest.mark.parametrize("name", ["dev-reserve-5.pico", "dev-windows-6.pico", "dev-mixed-7.unbranched_skip"])
def test_reference_plans_mean_the_same_in_crl(name: str) -> None:
    document = json.loads(shared(f"contingency/plans/{name}.json").read_text(encoding="utf-8"))
    source = json.loads(
        shared(f"contingency/instances/{document['instance']}.json").read_text(encoding="utf-8")
    )
    tree = plan_tree_from_dict(document, load_problem(source))
    assert compare(source, tree, 100, seed=14) == []


def test_references_travel_into_the_metadata_of_the_task() -> None:
    problem = _problem()
    plan = emit(problem, PlanTree("example", TREES["skip"]), metadata={"mission": "m-1"})
    task = next(n for n in walk_plan(plan) if isinstance(n, Task) and n.id == "observe-A")
    assert task.metadata["observation"] == "A"
    assert task.metadata["target"] == "T1"
    assert task.metadata["request"] == "r-1"
    assert task.parameters == {"target": "T1", "instrument": "mi"}
    assert task.continue_on_failure
    assert task.reward == 6
    assert plan.metadata["mission"] == "m-1"
    assert plan.metadata["problem-sha256"] == problem.digest()


def test_the_text_is_read_back_as_the_same_plan_and_names_are_unique() -> None:
    plan = emit(_problem(), PlanTree("example", TREES["branches"]))
    assert parse(canonical_text(plan)) == plan
    names = [node.id for node in walk_plan(plan)]
    assert len(names) == len(set(names))


def test_options_exclude_each_other_and_the_last_one_goes_on() -> None:
    plan = emit(_problem(), PlanTree("example", TREES["branches"]))
    branch = next(n for n in walk_plan(plan) if isinstance(n, Branch))
    assert [o.id for o in branch.options] == [
        "option-1",
        "option-2",
        "option-3",
        "go-on-2",
    ] or branch.options[-1].id.startswith("go-on")
    assert all(o.eligible_conditions for o in branch.options)
    assert isinstance(branch.options[-1].node, Block)


def _findings(problem: Problem, tree: PlanTree) -> list[str]:
    language = standard_dictionary()
    report = check(
        canonical_text(emit(problem, tree)), commands=language.commands, telemetry=language.telemetry
    )
    return [f"{f.code} {f.message}" for f in report.errors]


@pytest.mark.parametrize("name", list(TREES))
def test_an_emitted_plan_is_valid_for_the_rover(name: str) -> None:
    assert _findings(_problem(), PlanTree("example", TREES[name])) == []


def test_every_reference_plan_becomes_valid_crl() -> None:
    for file in sorted(shared("contingency/plans").glob("*.json")):
        document = json.loads(file.read_text(encoding="utf-8"))
        problem = load_problem(shared(f"contingency/instances/{document['instance']}.json"))
        assert _findings(problem, plan_tree_from_dict(document, problem)) == []
