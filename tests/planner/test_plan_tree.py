"""Plan trees and their JSON forms."""

from __future__ import annotations

import json
from typing import Any

import pytest

from planner.errors import PlanTreeError
from planner.plan_tree import (
    Branch,
    Comparison,
    DoneCondition,
    EnergyCondition,
    Navigate,
    Observe,
    OnFail,
    Option,
    OptionNotes,
    Plan,
    PlanTree,
    StepNotes,
    Stop,
    TimeCondition,
    TrackedCondition,
    TrackStart,
    TrackStop,
    Visit,
    count_branches,
    plan_tree_from_dict,
    plan_tree_to_dict,
    walk,
    with_ids,
)
from planner.problem import TargetId, load_problem
from tests.planner.examples import example
from tests.shared import ROOT, shared

TREE = (
    TrackStart("T1"),  # type: ignore[arg-type]
    Navigate("T1", True),  # type: ignore[arg-type]
    Branch(
        (
            Option(
                (
                    TimeCondition(Comparison.GE, 100.0),
                    TrackedCondition("T1", False),  # type: ignore[arg-type]
                    DoneCondition("O1", False),  # type: ignore[arg-type]
                ),
                (TrackStop("T1"), Visit("O2", "T2"), Branch((Option((), (Stop(),)),))),  # type: ignore[arg-type]
            ),
            Option((EnergyCondition(Comparison.LT, 5.5),), ()),
        )
    ),
    Observe("O1", "T1"),  # type: ignore[arg-type]
)


def test_branches_are_options_in_the_whole_tree() -> None:
    assert count_branches(TREE) == 3
    assert count_branches(()) == 0


def test_options_are_named_in_the_order_of_the_text() -> None:
    names = [o.id for _, s in walk(with_ids(TREE)) if isinstance(s, Branch) for o in s.options]
    assert names == ["option-1", "option-3", "option-2"]


def test_a_tree_survives_being_written_and_read() -> None:
    problem = example()
    tree = PlanTree("example", with_ids(TREE), "by hand")
    document = json.loads(json.dumps(plan_tree_to_dict(tree, problem)))
    assert document["format"] == "plan-tree/2"
    assert plan_tree_from_dict(document, problem) == tree


def test_the_reference_plans_are_read_and_written_as_they_stand() -> None:
    for file in sorted(shared("contingency/plans").glob("*.json")):
        document = json.loads(file.read_text(encoding="utf-8"))
        problem = load_problem(shared(f"contingency/instances/{document['instance']}.json"))
        tree = plan_tree_from_dict(document, problem)
        written = plan_tree_to_dict(tree, problem)
        assert written["format"] == "plan-tree/1"
        assert plan_tree_from_dict(written, problem) == tree


def test_notes_are_written_and_fit_the_published_schema() -> None:
    jsonschema = pytest.importorskip("jsonschema")
    schema = json.loads((ROOT / "docs/formats/plan-tree-2.schema.json").read_text(encoding="utf-8"))
    tree = PlanTree(
        "example",
        with_ids(TREE),
        step_notes={(1,): StepNotes(0.9, (0.05, 0.95), (1.0, 2.0), (3.0, 4.0))},
        option_notes={(2, 1): OptionNotes(0.25, 1.5, ((0.0, 2.0), (10.0, 1.0)))},
    )
    document = plan_tree_to_dict(tree, example())
    jsonschema.validate(document, schema)
    assert document["plan"][1]["quantiles"]["time_s"] == [1.0, 2.0]
    assert document["plan"][2]["options"][1]["p_taken"] == 0.25


BAD: list[tuple[Any, str]] = [
    ([], "plan tree must be an object"),
    ({"format": "plan-tree/9", "plan": []}, 'has the format "plan-tree/9", newer than this program'),
    ({"format": "plan-tree/2", "plan": {}}, "plan must be an array, found {}"),
    (
        {"format": "plan-tree/2", "plan": [{"op": "fly"}]},
        r"plan\[0\] has the op \"fly\"; it must be",
    ),
    ({"format": "plan-tree/2", "plan": [{"to": "T1"}]}, r'plan\[0\] has no "op"'),
    (
        {"format": "plan-tree/2", "plan": [{"op": "navigate", "to": "X"}]},
        r"plan\[0\].to is 'X'; the problem has",
    ),
    (
        {"format": "plan-tree/2", "plan": [{"op": "track_start", "target": ["X"]}]},
        r"plan\[0\].target must be a string",
    ),
    (
        {"format": "plan-tree/2", "plan": [{"op": "navigate", "to": "T1", "on_fail": "cry"}]},
        r"plan\[0\].on_fail is \"cry\"; it must be 'stop' or 'skip'",
    ),
    ({"format": "plan-tree/2", "plan": [{"op": "observe", "observation": "Q"}]}, "has no such observation"),
    (
        {
            "format": "plan-tree/2",
            "plan": [{"op": "branch", "options": [{"when": [{"var": "mood"}], "plan": []}]}],
        },
        r"plan\[0\].options\[0\].when\[0\] has the var \"mood\"; it must be 'time_s', 'ener",
    ),
    (
        {
            "format": "plan-tree/2",
            "plan": [{"op": "branch", "options": [{"when": [{"var": "time_s"}], "plan": []}]}],
        },
        r"when\[0\]: a condition on time_s needs a number in ge or lt",
    ),
]


@pytest.mark.parametrize(("document", "message"), BAD, ids=[m for _, m in BAD])
def test_what_is_wrong_is_named(document: Any, message: str) -> None:
    with pytest.raises(PlanTreeError, match=message):
        plan_tree_from_dict(document, example())


def test_branches_nested_too_deeply_are_refused() -> None:
    for depth in (61, 90, 400):
        plan: list[Any] = []
        for _ in range(depth):
            plan = [{"op": "branch", "options": [{"when": [], "plan": plan}]}]
        with pytest.raises(PlanTreeError):
            plan_tree_from_dict({"format": "plan-tree/2", "plan": plan}, example())


def test_branches_nested_as_deep_as_json_allows_are_read_and_deeper_ones_refused_in_a_sentence() -> None:
    problem = example()
    drive = Navigate(TargetId("T1"), False, OnFail.SKIP)

    def nested(depth: int) -> Plan:
        plan: Plan = (drive,)
        for _ in range(depth):
            plan = (Branch((Option((TimeCondition(Comparison.GE, 1.0),), plan),)), drive)
        return plan

    tree = PlanTree("deep", nested(49))
    assert plan_tree_from_dict(plan_tree_to_dict(tree, problem), problem).plan == tree.plan
    with pytest.raises(PlanTreeError, match="plan tree is nested deeper than 200 lists and objects"):
        plan_tree_from_dict(plan_tree_to_dict(PlanTree("deep", nested(50)), problem), problem)
