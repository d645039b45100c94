"""Straight runs of a plan, as F Prime's text, seq-json and PlanDev's plans."""

from __future__ import annotations

import json
import re
from dataclasses import fields
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from executive.crl import parse
from executive.crl.nodes import Block, Branch, ConcurrentBlock, Task
from neighbours.flight.errors import ForeignDictionaryError, SequenceError
from neighbours.flight.flight_map import FlightMap, Sent
from neighbours.flight.foreign import (
    Argument,
    Choice,
    Flag,
    ForeignCommand,
    ForeignDictionary,
    Group,
    Number,
    Series,
    Text,
    Unsaid,
    leaves,
)
from neighbours.flight.fprime_dictionary import read_fprime
from neighbours.flight.plandev import plandev_plan
from neighbours.flight.sequence import sent_commands, seq_json, seq_text, unsaid_times
from neighbours.flight.straight_run import NOMINAL, straight_run, straight_runs, unsaid
from rover_iface.profile import load_profile
from tests.npm import npm_packages

PLAN = parse("""
(plan :id day :budgets ((time 4000) (energy 90000)) :node
 (block :id root :maintain-conditions ((database (:energy-used < 90000))) :node-list (
  (task :id go :action navigate :parameters (target = T1) :expectations ((time 300 30) (energy -6000 100)))
  (branch :id late :options (
    (option :id short :eligible-conditions ((database (:time >= 400))) :node
     (task :id look :action cam.SHOOT
           :parameters (mode = FAST n = 3 to.0 = 1 to.1 = -2.5 roi.w = 7 say = "it's" on = t)
           :expectations ((time 60 5) (energy -900 10))))
    (option :id go-on :node
     (block :id rest :node-list (
      (task :id pause :action wait :parameters (duration_s = 12.5))
      (block :id noon :start-temporal-conditions ((600 1200)) :node-list (
       (task :id long :action cam.SHOOT
             :parameters (mode = SLOW n = 9 to.0 = 0 to.1 = 0 roi.w = 1 say = "" on = nil)
             :retries 2 :expectations ((time 500 50) (energy -4000 100)))))))))))))
""")
CAMERA = ForeignCommand(
    "cam.SHOOT",
    (
        Argument("mode", Choice(("SLOW", "FAST"))),
        Argument("n", Number(0, 255, whole=True)),
        Argument("to", Series(Number(), 2)),
        Argument("roi", Group((("w", Number(0, 9, whole=True)),))),
        Argument("say", Text(5)),
        Argument("on", Flag()),
    ),
)
DRIVE = ForeignCommand("mob.GO", (Argument("goal", Text(20)), Argument("v", Number(0, 1))))
FOREIGN = ForeignDictionary("R", "1", "test", (CAMERA, DRIVE), ())
MAP = FlightMap(sent={"navigate": Sent("mob.GO", {"goal": "$target", "v": 0.5})})
START = datetime(2030, 1, 2, 3, 4, 5, tzinfo=UTC)


def test_each_way_through_the_branches_is_a_run() -> None:
    runs = {run.name: run for run in straight_runs(PLAN)}
    assert list(runs) == [NOMINAL, "short"]
    assert [s.task.id for s in runs["short"].steps] == ["go", "look"]
    assert [(s.task.id, s.start_s) for s in runs[NOMINAL].steps] == [("go", 0), ("pause", 300), ("long", 600)]
    assert runs[NOMINAL].end_s == 1100
    assert straight_run(PLAN, ["short"]) == runs["short"]
    with pytest.raises(SequenceError, match='no option "shrot"; it has go-on, short'):
        straight_run(PLAN, ["shrot"])


def test_what_a_sequence_cannot_say_is_named() -> None:
    assert unsaid(PLAN) == (
        "budget of time: 4000",
        "budget of energy: 90000",
        'maintain conditions of "root"',
        'branch "late": options short, go-on',
        'conditions of option "short"',
        'window of "noon" closes at 1200 s',
        '2 retries of "long"',
    )


def test_options_that_differ_in_a_window_are_two_and_the_last_of_equals_is_the_main_line() -> None:
    def option(name: str, what: str, window: str = "") -> str:
        return f"(option :id {name} :node (task :id {name}-t {window} :action {what}))"

    early, late = (f":start-temporal-conditions (({w}))" for w in ("0 100", "5000 6000"))
    two = parse(
        "(plan :id p :node (branch :id b :options "
        f"({option('early', 'image', early)} {option('late', 'image', late)})))"
    )
    assert [run.name for run in straight_runs(two)] == [NOMINAL, "early"]
    assert 'branch "b": options early, late' in unsaid(two)
    equal = parse(
        "(plan :id p :node (branch :id b :options "
        f"({option('first', 'image')} {option('other', 'heat')} {option('last', 'image')})))"
    )
    runs = {run.name: [s.task.id for s in run.steps] for run in straight_runs(equal)}
    assert runs == {NOMINAL: ["last-t"], "other": ["other-t"]}


def test_what_is_asked_of_one_option_and_of_failures_is_named() -> None:
    plan = parse(
        "(plan :id p :resources ((arm :unit)) :node (block :id r :node-list ((branch :id b :if-none :skip "
        ":options ((option :id o :eligible-conditions ((database (:time <= 5))) "
        ":node (task :id t :uses (arm) :continue-on-failure t :action image)))))))"
    )
    assert unsaid(plan) == (
        'conditions of option "o"',
        'branch "b" without an option: skip',
        'resources of "t"',
        '"t" may fail, and the plan goes on',
    )


def test_every_field_of_a_node_is_carried_told_or_without_meaning_for_a_sequence() -> None:
    carried = {
        "id",
        "action",
        "parameters",
        "node_list",
        "options",
        "start_temporal_conditions",
        "expectations",
    }
    told = {
        *("start_conditions", "wait_for_conditions", "maintain_conditions", "end_conditions"),
        *("end_temporal_conditions", "duration", "continue_on_failure", "uses", "requires", "retries"),
        *("if_none", "on_option_failure"),
    }
    of_runs_alone = {  # names and worth, and what matters while the executive holds, retries or chooses
        *("name", "priority", "reward", "probability", "metadata", "source"),
        *("retry_delay_ms", "interruptible", "on_resume"),
    }
    known = {f.name for kind in (Task, Block, ConcurrentBlock, Branch) for f in fields(kind)}
    assert known == carried | told | of_runs_alone


def test_waits_and_windows_that_a_form_cannot_say_are_named() -> None:
    commands = sent_commands(straight_run(PLAN, [NOMINAL]), FOREIGN, MAP)
    assert unsaid_times(commands, "seq-json", None) == ('wait of 12.5 s before "long"',)
    assert unsaid_times(commands, "seq", START) == ('wait of 12.5 s before "long"',)
    (told,) = unsaid_times(commands, "seq", None)
    assert told.startswith('window of "long" opens at 600 s: without --epoch')


def test_a_run_is_the_text_of_a_sequence() -> None:
    commands = sent_commands(straight_run(PLAN, [NOMINAL]), FOREIGN, MAP)
    text = seq_text(commands, "day", (), None)
    assert [line for line in text.splitlines() if not line.startswith(";")] == [
        'R00:00:00 mob.GO "T1" 0.5',
        'R00:05:00 cam.SHOOT SLOW 9 [0.0, 0.0] {w: 1} "" False',
    ]
    dated = seq_text(commands, "day", (), START)
    assert "A2030-002T03:14:05.000 cam.SHOOT" in dated
    short = seq_text(sent_commands(straight_run(PLAN, ["short"]), FOREIGN, MAP), "day", (), None)
    assert 'R00:00:00 cam.SHOOT FAST 3 [1.0, -2.5] {w: 7} "it\'s" True' in short


@pytest.mark.parametrize(
    ("member", "value", "words"),
    [
        ("mode", "SLWO", "argument mode of cam.SHOOT is 'SLWO'; it must be one of SLOW, FAST"),
        ("n", 2.5, "it must be a whole number"),
        ("n", 256.0, "it must be at most 255"),
        ("say", "too long", "it has 8 bytes and may have 5"),
        ("say", "a\nb", "it has line ends"),
        ("on", "yes", "it must be true or false"),
    ],
)
def test_a_value_that_the_command_does_not_take_is_named(member: str, value: Any, words: str) -> None:
    from dataclasses import replace

    run = straight_run(PLAN, ["short"])
    step = run.steps[1]
    task = replace(step.task, parameters={**step.task.parameters, member: value})
    wrong = replace(run, steps=(run.steps[0], replace(step, task=task)))
    with pytest.raises(SequenceError, match=re.escape(words)):
        sent_commands(wrong, FOREIGN, MAP)


def test_an_action_without_a_command_is_named() -> None:
    with pytest.raises(SequenceError, match=r'task "go": action "navigate" has no command: sent\.navigate'):
        sent_commands(straight_run(PLAN, ["short"]), FOREIGN, FlightMap())


def test_seq_json_keeps_to_the_schema_of_plandev() -> None:
    schema = json.loads((npm_packages() / "@nasa-jpl/seq-json-schema/schema.json").read_text())
    validator = jsonschema.Draft202012Validator(schema)
    for name in (NOMINAL, "short"):
        for epoch in (None, START):
            commands = sent_commands(straight_run(PLAN, [name]), FOREIGN, MAP)
            document = json.loads(json.dumps(seq_json(commands, "day", unsaid(PLAN), epoch)))
            assert [e.message for e in validator.iter_errors(document)] == []
            assert [s["stem"] for s in document["steps"]] == ["mob.GO", "cam.SHOOT"]
    broken = {**document, "steps": [{**document["steps"][0], "type": "comand"}]}
    assert not validator.is_valid(broken)


def faults_of_plandev(document: dict[str, Any]) -> list[str]:
    """Return in what a document breaks the rules of PlanDev's importer.

    Written from what `plan-transfer.ts`, its schema and `non-executable-import.ts` of
    NASA-AMMOS/plandev-gateway ask for; PlanDev itself cannot be had here.
    """
    faults = []
    wanted = {"version", "name", "start_time", "duration", "simulation_arguments", "activities"}
    faults += [f"{m} is missing" for m in wanted - document.keys()]
    faults += [
        f"{m} is unknown" for m in document.keys() - wanted - {"tags", "model", "results", "id", "model_id"}
    ]
    if document["version"] != "3":
        faults.append("version")
    types = {t["name"]: t for t in document["model"]["activity_types"]}
    for activity in document["activities"]:
        members = {
            "id",
            "anchor_id",
            "anchored_to_start",
            "arguments",
            "metadata",
            "name",
            "start_offset",
            "type",
        }
        if activity.keys() != members or type(activity["id"]) is not int:
            faults.append(f"activity {activity}")
        if activity["type"] not in types or not re.fullmatch(
            r"\d+:\d\d:\d\d(\.\d+)?", activity["start_offset"]
        ):
            faults.append(f"activity {activity['name']}: type or offset")
        declared = {p["name"] for p in types[activity["type"]].get("parameters", [])}
        if declared and not activity["arguments"].keys() <= declared:
            faults.append(f"activity {activity['name']}: arguments")
    ids = {a["id"] for a in document["activities"]}
    for span in document["results"]["spans"]:
        whole = all(type(span[m]) is int for m in ("span_id", "start_offset", "duration", "directive_id"))
        if not whole or span["duration"] < 0 or span["directive_id"] not in ids or span["type"] not in types:
            faults.append(f"span {span}")
    hours, minutes, seconds = document["duration"].split(":")
    length_us = round(1e6 * (3600 * int(hours) + 60 * int(minutes) + float(seconds)))
    schemas = {r["name"]: r["schema"] for r in document["model"]["resource_types"]}
    for name, profile in document["results"]["profiles"].items():
        if list(profile) != ["type", "schema", "segments"] or profile["schema"] != schemas.get(name):
            faults.append(f"profile {name}: order of members or schema")
        if sum(s["duration"] for s in profile["segments"]) != length_us:
            faults.append(f"profile {name}: does not cover the plan")
        if any("dynamics" not in s or type(s["duration"]) is not int for s in profile["segments"]):
            faults.append(f"profile {name}: gaps")
    return faults


def test_each_run_is_a_plan_that_plandev_imports() -> None:
    commands = load_profile("k9").language.commands
    made = {
        run.name: json.loads(json.dumps(plandev_plan(PLAN, run, commands, START, run.name)))
        for run in straight_runs(PLAN)
    }
    assert {name: faults_of_plandev(document) for name, document in made.items()} == {
        NOMINAL: [],
        "short": [],
    }
    nominal = made[NOMINAL]
    assert nominal["duration"] == "00:18:20.000000"
    assert nominal["start_time"] == "2030-01-02T03:04:05.000000+00:00"
    assert [s["start_offset"] for s in nominal["results"]["spans"]] == [0, 300_000_000, 600_000_000]
    for document, used in ((nominal, 10_000.0), (made["short"], 6_900.0)):
        segments = document["results"]["profiles"]["/outcrop/energy_used_j"]["segments"]
        for before, after in pairwise(segments):
            dynamics = before["dynamics"]
            reached = dynamics["initial"] + dynamics["rate"] * before["duration"] / 1e6
            assert reached == pytest.approx(after["dynamics"]["initial"])
        last = segments[-1]
        assert last["dynamics"]["initial"] + last["dynamics"]["rate"] * last[
            "duration"
        ] / 1e6 == pytest.approx(used)
        left = document["results"]["profiles"]["/outcrop/energy_left_j"]["segments"][0]["dynamics"]["initial"]
        assert left == 90_000.0
    broken = {**nominal, "version": "2"}
    assert faults_of_plandev(broken) == ["version"]


def test_a_plan_of_runs_without_end_is_refused(tmp_path: Path) -> None:
    def option(k: int, inner: str) -> str:
        return (
            f"(branch :id b{k} :options ((option :id o{k} :node (task :id x{k} :action stow))"
            f" (option :id p{k} :node (block :id q{k} :node-list ((task :id y{k} :action turn) {inner})))))"
        )

    flat = " ".join(option(k, "") for k in range(12))
    with pytest.raises(SequenceError, match="more than 1000 runs"):
        straight_runs(parse(f"(plan :id p :node (block :id r :node-list ({flat})))"))


def test_types_that_grow_with_each_level_are_told_and_not_expanded(tmp_path: Path) -> None:
    def part(name: str) -> dict[str, Any]:
        return {"type": {"kind": "qualifiedIdentifier", "name": name}}

    types: list[dict[str, Any]] = [
        {"kind": "enum", "qualifiedName": "S0", "enumeratedConstants": [{"name": "A", "value": 0}]}
    ]
    for level in range(1, 19):
        members = {f"m{k}": {**part(f"S{level - 1}"), "index": k} for k in range(4)}
        types.append({"kind": "struct", "qualifiedName": f"S{level}", "members": members})
    command = {"name": "a.GO", "opcode": 1, "formalParams": [{"name": "v", **part("S18")}]}
    file = tmp_path / "d.json"
    file.write_text(json.dumps({"metadata": {}, "typeDefinitions": types, "commands": [command]}))
    (go,) = read_fprime(file).commands
    (argument,) = go.arguments
    assert leaves("v", argument.type) == [("v", Unsaid("type of more than 1000 values"))]
    types[0]["enumeratedConstants"] = 5
    file.write_text(json.dumps({"metadata": {}, "typeDefinitions": types, "commands": [command]}))
    with pytest.raises(ForeignDictionaryError, match='enum "S0" has no constants'):
        read_fprime(file)
