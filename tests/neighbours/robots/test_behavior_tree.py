"""Plans as BehaviorTree.CPP 4: the form, equal traces on the common subset, and what does not fit."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
import typer
from typer.testing import CliRunner

from executive.crl import CrlValidationError, load
from executive.crl.nodes import Task, walk_plan
from executive.ports import Operation, Operator
from executive.runtime.codec import trace_line
from executive.runtime.loading import load_plan
from executive.runtime.scenario import Scenario, load_scenario, play
from ground.cli import crl
from neighbours.robots.behavior_tree import behavior_tree
from tests.neighbours.robots.bt_format import complaints
from tests.neighbours.robots.bt_runner import run_tree
from tests.shared import ROOT, SHARED

FILES = sorted((ROOT / "tests/executive/scenarios").glob("*.json")) + sorted(
    (SHARED / "executive_scenarios").rglob("*.json")
)
OWN = ROOT / "tests/executive/scenarios"


def foreign_to_trees(scenario: Scenario) -> str | None:
    """Return what a world does that is no matter of the plan and that no tree can answer as we do."""
    if scenario.crashes:
        return "the executive crashes"
    asked = [event.operation for event in scenario.script if isinstance(event, Operator)]
    if any(operation is not Operation.ABORT for operation in asked):
        return "an operator pauses the plan or sends another"
    slow = [task for task, script in scenario.actions.items() if any(b.abort_delay_ms for b in script)]
    if len(slow) > 1 or (slow and ("*" in slow or asked)):
        return "several actions take time to stop, and `halt` stops one after the other"
    return None


Told = tuple[Any, ...]


def of_commands(trace: list[list[Any]], tasks: set[str]) -> list[Told]:
    """Return starts, retries and ends of commands; a task that was stopped before its start had none."""
    told = [tuple(e) for e in trace if e[1] in ("start", "retry", "end") and e[2] in tasks]
    begun = {e[2] for e in told if e[1] == "start"}
    return [(round(e[0] * 1000), *e[1:4]) for e in told if e[2] in begun or e[3] != "ABORTED"]


def events_of(events: list[Told], task: str) -> list[Told]:
    return [event for event in events if event[2] == task]


def common(path: Path) -> Scenario | None:
    """Return the scenario of a file if its plan and world are in the common subset."""
    scenario = load_scenario(path)
    try:
        plan = load(scenario.plan)
    except CrlValidationError:
        return None
    if foreign_to_trees(scenario) or behavior_tree(plan).lacking:
        return None
    return scenario


def differences(scenario: Scenario) -> list[str]:
    """Return how the exported tree runs otherwise than our executive."""
    plan = load(scenario.plan)
    tasks = {node.id for node in walk_plan(plan) if isinstance(node, Task)}
    ours = play(scenario, load_plan(scenario.plan))
    wanted = of_commands([trace_line(record) for record in ours.trace], tasks)
    outcome, end_ms, events = run_tree(behavior_tree(plan).xml, scenario)
    out = []
    for task in sorted(tasks):
        found, expected = events_of(events, task), events_of(wanted, task)
        if found != expected:
            out.append(f"{task}: {found}, ours {expected}")
    if (outcome, end_ms) != (ours.outcome, ours.end_ms):
        out.append(f"outcome {outcome} at {end_ms}, ours {ours.outcome} at {ours.end_ms}")
    return out


BATCHES = 8


@pytest.mark.parametrize("batch", range(BATCHES))
def test_a_tree_commands_as_the_executive_does(batch: int) -> None:
    """Equal starts, retries and ends of every command, equal outcome and end, on the whole common subset."""
    found = {}
    for path in FILES[batch::BATCHES]:
        scenario = common(path)
        if scenario is not None and (different := differences(scenario)):
            found[path.stem] = different
    assert not found


def test_the_common_subset_has_at_least_150_scenarios() -> None:
    assert sum(common(path) is not None for path in FILES if path.parent == OWN) >= 150


def test_every_export_has_the_form_of_version_4_also_where_something_is_left_out() -> None:
    for path in FILES:
        try:
            plan = load(load_scenario(path).plan)
        except CrlValidationError:
            continue
        assert not complaints(behavior_tree(plan).xml), path.stem


@pytest.mark.parametrize(
    ("broken", "complaint"),
    [
        ("<root BTCPP_format='4' main_tree_to_execute='a'/>", "names no tree"),
        ("<Timeout><AlwaysSuccess/></Timeout>", "msec is missing"),
        ("<Timeout msec='2.5'><AlwaysSuccess/></Timeout>", "whole number"),
        ("<Sequence/>", "0 children"),
        ("<Fly/>", "unknown element"),
        ("<Action ID='fly'/>", "not in the TreeNodesModel"),
        ("<Script code='a := := 1'/>", "unexpected"),
    ],
)
def test_the_checker_of_the_form_finds_what_is_wrong(broken: str, complaint: str) -> None:
    if not broken.startswith("<root"):
        tree = f"<BehaviorTree ID='a'>{broken}</BehaviorTree>"
        broken = f"<root BTCPP_format='4' main_tree_to_execute='a'>{tree}</root>"
    assert any(complaint in found for found in complaints(broken)), complaints(broken)


NOTHING_FITS = """(plan :id p
 :resources ((energy :consumable :key :battery-energy) (arm :unit))
 :floating ((floating-contingency :id recharge :trigger-conditions ((database (:battery-energy < 5)))
   :node (task :id charge :action recharge)))
 :node (concurrent-block :id root :node-list
  ((task :id one :action image :requires ((energy 3)) :on-resume :restart)
   (task :id two :action image :requires ((energy 4)) :start-temporal-conditions ((one end (-5 0))))
   (branch :id next :if-none :skip :on-option-failure :next :options
     ((option :id late :utility ((0 5) (10 0)) :eligible-conditions ((database (:reason one = resource)))
       :node (task :id three :action image :parameters (camera = "{mast}"))))))))
"""


def test_each_construct_that_does_not_fit_is_named_with_its_place() -> None:
    named = {(one.node, one.construct, one.line) for one in behavior_tree(load(NOTHING_FITS)).lacking}
    assert named == {
        ("recharge", "floating-contingency", 3),
        ("one", ":requires", 6),
        ("one", ":on-resume :restart", 6),
        ("two", ":requires", 7),
        ("two", "windows that tie nodes", 7),
        ("late", ":utility table", 9),
        ("late", "condition on :reason", 9),
        ("three", "text in braces", 10),
    }


def test_the_command_writes_all_or_nothing_unless_asked(tmp_path: Path) -> None:
    app = typer.Typer()
    crl.register(app)
    plan, out = tmp_path / "p.crl", tmp_path / "p.xml"
    plan.write_text(NOTHING_FITS, encoding="utf-8")
    order = ["crl", "export", str(plan), "--to", "bt", "--out", str(out)]
    refused = CliRunner().invoke(app, order)
    assert refused.exit_code == 2
    assert not out.exists()
    assert "line 7, column" in refused.output
    assert CliRunner().invoke(app, [*order, "--partial"]).exit_code == 0
    text = out.read_text("utf-8")
    assert text.count("<!-- not said:") == len(behavior_tree(load(NOTHING_FITS)).lacking)
    assert not complaints(text)
    plan.write_text("(task :id a :action image)", encoding="utf-8")
    done = CliRunner().invoke(app, ["crl", "export", str(plan)])
    assert done.exit_code == 0
    assert not complaints(done.output)
    for bad in (
        ["crl", "export", str(plan), "--to", "plexil"],
        ["crl", "export", str(tmp_path / "none.crl")],
    ):
        assert CliRunner().invoke(app, bad).exit_code == 2


def test_characters_that_xml_cannot_hold_are_named_and_leave_the_file_readable() -> None:
    text = (
        '(task :id a :action image :parameters (camera = "m\x01ast" words = "{\x0b}" fine = "a\tb\u2603")'
        ' :start-conditions ((database (:mode = "x\x02"))))'
    )
    made = behavior_tree(load(text))
    forbidden = [one.why for one in made.lacking if one.construct == "text with a forbidden character"]
    assert [why.partition(" has the character ")[::2] for why in forbidden] == [
        ("parameter camera", "U+0001, which XML cannot hold"),
        ("parameter words", "U+000B, which XML cannot hold"),
        ("condition on :mode", "U+0002, which XML cannot hold"),
    ]
    root = ElementTree.fromstring(made.xml)
    (action,) = [e for e in root.iter("Action") if e.get("name") == "a"]
    assert (action.get("camera"), action.get("fine")) == ("m\ufffdast", "a\tb\u2603")
    assert [e.get("when") for e in root.iter("Condition") if e.get("when")] == [
        '((database (:mode = "x\ufffd")))'
    ]
