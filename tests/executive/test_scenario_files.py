"""Scenario files: what is wrong with one is said, and the command line compares and writes traces."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from executive.errors import ScenarioError
from executive.runtime.scenario import load_scenario, parse_scenario, run_scenario

GOOD: dict[str, Any] = {
    "id": "T",
    "plan": "(block :id root :node-list ((task :id a :action x)))",
    "world": {"actions": {"a": {"duration": 2}}},
    "expect": {
        "plan_outcome": "SUCCEEDED",
        "end_time": 2.0,
        "events": [
            [0, "start", "a"],
            [0, "start", "root"],
            [2.0, "end", "a", "SUCCEEDED"],
            [2, "end", "root", "SUCCEEDED"],
        ],
        "outcomes": {"root": "SUCCEEDED", "a": "SUCCEEDED"},
    },
}


def changed(**members: Any) -> dict[str, Any]:
    document: dict[str, Any] = json.loads(json.dumps(GOOD))
    document.update(members)
    return document


@pytest.mark.parametrize(
    ("document", "message"),
    [
        ([1], "the document must be an object"),
        ({}, 'member "plan" is missing'),
        (changed(plan=3), 'member "plan" must be CRL text, found 3'),
        (changed(world=[]), '"world" must be an object'),
        (changed(world={"events": {}}), '"world.events" must be a list'),
        (changed(world={"events": [{"set": {}}]}), r'"world.events\[0\]": member "t" is missing'),
        (changed(world={"events": [{"t": -1, "set": {}}]}), "must be a time in seconds, found -1"),
        (changed(world={"events": [{"t": 1}]}), "needs one of set, operator, replace, crash_until"),
        (changed(world={"events": [{"t": 1, "operator": "halt"}]}), "must be pause, resume or abort"),
        (changed(world={"events": [{"t": 9, "crash_until": 3}]}), '"crash_until" lies before "t"'),
        (changed(world={"initial": {"k": [1]}}), "the value of 'k' must be a number"),
        (changed(world={"actions": {"a": []}}), "the list of behaviours is empty"),
        (changed(world={"actions": {"a": {"durations": 3}}}), "unknown member 'durations'"),
        (changed(world={"actions": {"a": {"during": [3]}}}), r"must hold \[offset, updates\]"),
    ],
)
def test_a_broken_scenario_is_refused_with_its_member(document: Any, message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        parse_scenario(document, "t.json")


def test_order_of_nodes_within_an_instant_is_not_compared() -> None:
    assert run_scenario(parse_scenario(GOOD, "t.json")).agrees


def test_differences_are_named() -> None:
    expect = json.loads(json.dumps(GOOD["expect"]))
    expect["events"][2] = [3, "end", "a", "SUCCEEDED"]
    expect["plan_outcome"] = "FAILED"
    expect["end_time"] = None
    expect["outcomes"]["a"] = "FAILED"
    run = run_scenario(parse_scenario(changed(expect=expect), "t.json"))
    assert run.differences == (
        "plan_outcome is SUCCEEDED, expected FAILED",
        "end_time is 2, expected None",
        "at 2: unexpected ['end', 'a', 'SUCCEEDED']",
        "at 3: missing ['end', 'a', 'SUCCEEDED']",
        "outcome of a is SUCCEEDED, expected FAILED",
    )


def test_order_of_the_events_of_one_node_is_compared() -> None:
    plan = "(task :id a :action x :retries 1)"
    world = {"actions": {"a": [{"duration": 0, "result": "no"}, {"duration": 0}]}}
    events = [[0, "retry", "a"], [0, "start", "a"], [0, "end", "a", "SUCCEEDED"]]
    run = run_scenario(parse_scenario({"plan": plan, "world": world, "expect": {"events": events}}, "t"))
    assert run.differences == ("events of a come in another order",)


def test_an_accepted_plan_that_should_be_rejected_and_the_other_way_round() -> None:
    accepted = run_scenario(parse_scenario(changed(expect={"errors": ["E020"]}), "t.json"))
    assert accepted.differences == ("the plan was accepted, expected errors ['E020']",)
    rejected = run_scenario(parse_scenario(changed(plan="(block :id root :node-list ())"), "t.json"))
    assert "the plan was rejected" in rejected.differences[0]


def outcrop(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "ground.cli", "crl", "run", *arguments],
        cwd=cwd,
        capture_output=True,
        text=True,
        check=False,
    )


def test_command_line_agrees_differs_and_complains(tmp_path: Path) -> None:
    (tmp_path / "good.json").write_text(json.dumps(GOOD))
    (tmp_path / "bad.json").write_text(json.dumps(changed(expect={"end_time": 5})))
    (tmp_path / "broken.json").write_text("{")
    (tmp_path / "errors.json").write_text(
        json.dumps(changed(plan="(block :id root :node-list ())", expect={"errors": ["E016"]}))
    )
    good = outcrop("good.json", "errors.json", "--trace-dir", "out", cwd=tmp_path)
    assert (good.returncode, good.stderr) == (0, "")
    trace = json.loads((tmp_path / "out" / "good.json").read_text())
    assert trace["end_time"] == 2
    assert trace["events"][0] == [0, "start", "root"]
    assert trace["outcomes"] == {"root": "SUCCEEDED", "a": "SUCCEEDED"}
    errors = json.loads((tmp_path / "out" / "errors.json").read_text())
    assert "E016" in [e["code"] for e in errors["errors"]]
    bad = outcrop("bad.json", cwd=tmp_path)
    assert bad.returncode == 1
    assert "end_time is 2, expected 5" in bad.stdout
    broken = outcrop("broken.json", cwd=tmp_path)
    assert broken.returncode == 2
    assert broken.stderr.startswith("outcrop: scenario broken.json is not JSON")


def test_scenario_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match="cannot be read"):
        load_scenario(tmp_path / "none.json")
