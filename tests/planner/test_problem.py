"""Reading and writing planning problems."""

from __future__ import annotations

import copy
import dataclasses
import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings

from planner.errors import ProblemError
from planner.problem import Problem, load_problem, problem_from_dict, problem_to_dict
from tests.planner.examples import observation, problem_document, problems
from tests.shared import ROOT, shared


@given(problems())
@settings(max_examples=40, deadline=None)
def test_a_problem_survives_being_written_and_read(problem: Problem) -> None:
    assert problem_from_dict(json.loads(json.dumps(problem_to_dict(problem)))) == problem


def test_the_public_instances_survive_being_written_and_read() -> None:
    files = sorted(shared("contingency/instances").glob("*.json"))
    assert len(files) == 12
    for file in files:
        problem = load_problem(file)
        assert problem_from_dict(problem_to_dict(problem)) == problem
        assert problem.source_format == "contingency/1"


def test_the_digest_depends_on_what_is_planned() -> None:
    a, b = problem_document(), problem_document(time_s=6001.0)
    assert problem_from_dict(a).digest() == problem_from_dict(copy.deepcopy(a)).digest()
    assert problem_from_dict(a).digest() != problem_from_dict(b).digest()


def test_a_changed_problem_keeps_what_its_first_format_cannot_say() -> None:
    """`contingency/1` has no deadline pairs, volumes or second observations: they were dropped in silence."""
    problem = load_problem(shared("contingency/instances/dev-windows-4.json"))
    first, second = problem.observations[:2]
    changes: dict[str, Any] = {
        "precedence": ((first.id, second.id),),
        "max_overrun_probability": 0.05,
        "budget": dataclasses.replace(problem.budget, data_mbit=2.0),
        "targets": (
            dataclasses.replace(problem.targets[0], observations=(dataclasses.replace(first, must_do=True),)),
            *problem.targets[1:],
        ),
    }
    digests = {problem.digest()}
    for name, value in changes.items():
        changed = dataclasses.replace(problem, **{name: value})
        again = problem_from_dict(problem_to_dict(changed))
        assert dataclasses.replace(again, source_format="") == dataclasses.replace(changed, source_format="")
        digests.add(changed.digest())
    assert len(digests) == 1 + len(changes)


def _changed(path: tuple[Any, ...], value: Any) -> dict[str, Any]:
    document = problem_document()
    place: Any = document
    for key in path[:-1]:
        place = place[key]
    if value is _GONE:
        del place[path[-1]]
    else:
        place[path[-1]] = value
    return document


_GONE = object()


def test_digests_are_those_that_stored_plans_hold() -> None:
    """Plans and packages name their problem by its digest: what writes documents must not change it."""
    assert load_problem(shared("contingency/instances/dev-windows-4.json")).digest() == (
        "d6fb79e8dab977c532546153af41e5cb7fd7a1afcda520496850998ea6d8396e"
    )
    document = problem_document(
        observations=[
            [observation("A", "place", must_do=True, window_s=[0, 900]), observation("B", data_mbit=3.0)],
            [observation("C", refs={"request": "r1"})],
            [observation("D", instrument="mi", tracked=True)],
        ],
        precedence=[["A", "B"]],
        max_overrun_probability=0.05,
        start={"east_m": 0, "north_m": 0, "heading_rad": 0.1},
        refs={"mission": "m"},
    )
    assert problem_from_dict(document).digest() == (
        "7154b90cbd55e40cc440c5ae25b68295538c9f7ec65858f162fb6fdea33a47c6"
    )


LEGACY: list[tuple[tuple[Any, ...], Any, str]] = [
    (("targets", 0, "p_success"), None, r"p_success must be a number, found null"),
    (("targets", 0, "must_do"), True, r"must_do is not a known member"),
    (("targets", 0, "observations"), [], r"observations is not a known member"),
    (("budget", "data_mbit"), 1.0, r"budget.data_mbit is not a known member"),
    (("precedence",), [], r"precedence is not a known member"),
    (("targets", 0, "target_m"), [1.0], r"target_m has 1 entries; it needs at least 2"),
]


@pytest.mark.parametrize(("path", "value", "message"), LEGACY, ids=[m for _, _, m in LEGACY])
def test_an_old_document_may_not_hold_what_its_form_does_not(
    path: tuple[Any, ...], value: Any, message: str
) -> None:
    document = json.loads(shared("contingency/instances/dev-windows-4.json").read_text(encoding="utf-8"))
    place: Any = document
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    with pytest.raises(ProblemError, match=message):
        problem_from_dict(document)


def test_an_old_leg_says_what_is_lost_on_it() -> None:
    document = json.loads(shared("contingency/instances/dev-windows-4.json").read_text(encoding="utf-8"))
    del document["legs"][0]["p_lose"]
    with pytest.raises(ProblemError, match=r"legs\[start -> T\d\].p_lose is missing"):
        problem_from_dict(document)


BAD: list[tuple[tuple[Any, ...], Any, str]] = [
    (("format",), "problem/9", r'has the format "problem/9", newer than this program; it reads conting'),
    (("format",), "day/1", r'has the format "day/1"; it must be "problem/2" or older'),
    (("budget", "time_s"), -1, r"budget.time_s is -1; it must be at least 0"),
    (("budget", "time_s"), "soon", r'budget.time_s must be a number, found "soon"'),
    (("budget", "energy_j"), _GONE, r"budget.energy_j is missing"),
    (
        ("budget", "energy_floor_j"),
        1e9,
        r"energy_floor_j is 1e\+09; it must be at most energy_j, 600000",
    ),
    (("hotel_w",), float("nan"), r"problem hotel_w is NaN; it must be finite"),
    (("hotel_w",), True, r"problem hotel_w must be a number, found true"),
    (("colour",), "red", r"problem colour is not a known member"),
    (("targets", 0, "id"), "start", r'target id "start" is kept for the place where the rover starts'),
    (("targets", 0, "id"), "a b", r'id "a b" holds a blank'),
    (("targets", 1, "id"), "T1", r'id "T1" is used twice'),
    (
        ("targets", 0, "normal"),
        [0.0, 0.0, 1.0],
        r"targets\[T1\].normal is \[0\.0, 0\.0, 1\.0\]; normals need the format problem/2",
    ),
    (("targets", 0, "diminishing"), 1.5, r"targets\[T1\].diminishing is 1.5; it must be at most 1"),
    (
        ("targets", 0, "observations", 0, "utility"),
        -2,
        r"targets\[T1\].observations\[O1\].utility is -2; it must be at least 0",
    ),
    (("targets", 0, "observations", 0, "utility"), _GONE, r"observations\[O1\].utility is missing"),
    (("targets", 0, "observations", 0, "p_success"), 0, r"p_success is 0; it must be more than 0"),
    (("targets", 0, "observations", 0, "kind"), "dig", r"kind is \"dig\"; it must be 'place' or 'image'"),
    (
        ("targets", 0, "observations", 0, "window_s"),
        [9, 3],
        r"observation O1: window_s opens at 9 s after it closes at 3 s",
    ),
    (("targets", 0, "observations", 0, "observe", "time_s", "sd"), -1, r"observe.time_s.sd is -1"),
    (("targets", 0, "observations", 0, "must_do"), 1, r"must_do must be true or false, found 1"),
    (("targets", 0, "observations", 0, "tracked"), "yes", r'tracked must be true or false, found "yes"'),
    (("targets",), {}, r"targets must be an array, found {}"),
    (("legs", 0, "time_s", "mean"), 0, r"legs\[start -> T1\].time_s.mean is 0; it must be more than 0"),
    (("legs", 0, "to"), "T9", r'leg start -> T9: "to" names no target'),
    (("legs", 0, "from"), "T1", r"a leg must join two different places"),
    (("legs", 0, "p_lose"), {"T1": 1.5}, r"p_lose.T1 is 1.5; it must be at most 1"),
    (("legs", 0, "p_lose"), {"X": 0.5}, r'leg start -> T1: p_lose names the unknown target "X"'),
    (("legs", 1), problem_document()["legs"][0], r"leg start -> T1 is given twice"),
    (("precedence",), [["O1", "O9"]], r'precedence names the unknown observation "O9"'),
    (("precedence",), [["O1", "O2"], ["O2", "O1"]], r"the cycle O[12] -> O[12] -> O[12]"),
    (("precedence",), [[["O1"], "O2"]], r"precedence\[0\]\[0\] must be a string, found \[\"O1\"\]"),
    (("max_overrun_probability",), 2, r"max_overrun_probability is 2; it must be at most 1"),
]


@pytest.mark.parametrize(("path", "value", "message"), BAD, ids=[m for _, _, m in BAD])
def test_what_is_wrong_is_named(path: tuple[Any, ...], value: Any, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        problem_from_dict(_changed(path, value))


def test_a_target_keeps_the_normal_of_its_surface() -> None:
    document: dict[str, Any] = {**problem_document(), "format": "problem/2"}
    document["targets"][0]["normal"] = [0.6, 0.0, 0.8]
    problem = problem_from_dict(document)
    assert problem.targets[0].normal == (0.6, 0.0, 0.8)
    written = problem_to_dict(problem)
    assert written["format"] == "problem/2"
    assert problem_from_dict(json.loads(json.dumps(written))) == problem


@pytest.mark.parametrize("normal", [[0.0, 0.0, 0.0], [0.0, 0.0, 2.0], [0.6, 0.0, 0.9]])
def test_a_normal_that_is_no_direction_is_refused(normal: list[float]) -> None:
    document: dict[str, Any] = {**problem_document(), "format": "problem/2"}
    document["targets"][0]["normal"] = normal
    with pytest.raises(ProblemError, match=r"target T1: its normal \(.*\) has a length of .*; it must be 1"):
        problem_from_dict(document)


@pytest.mark.parametrize("value", [None, [], 3, "text"])
def test_a_document_that_is_no_object_is_refused(value: Any) -> None:
    with pytest.raises(ProblemError, match="problem must be an object"):
        problem_from_dict(value)


def test_files_that_cannot_be_read_are_named(tmp_path: Path) -> None:
    with pytest.raises(ProblemError, match=r"nowhere\.json: cannot be read: No such file"):
        load_problem(tmp_path / "nowhere.json")
    broken = tmp_path / "broken.json"
    broken.write_text('{"format": ', encoding="utf-8")
    with pytest.raises(ProblemError, match=r"is not JSON: .*line 1 column 12"):
        load_problem(broken)
    broken.write_bytes(b'{"name": "\xe9"}')
    with pytest.raises(ProblemError, match="is not JSON: 'utf-8' codec can't decode byte 0xe9"):
        load_problem(broken)


def test_the_published_schema_accepts_what_the_writer_writes() -> None:
    jsonschema = pytest.importorskip("jsonschema")
    schema = json.loads((ROOT / "docs/formats/problem-1.schema.json").read_text(encoding="utf-8"))
    document = problem_document(
        observations=[
            [observation("A", "place", must_do=True, window_s=[0, 900]), observation("B", data_mbit=3.0)],
            [observation("C", refs={"request": "r1"})],
            [observation("D", instrument="mi", tracked=True)],
        ],
        precedence=[["A", "B"]],
        max_overrun_probability=0.05,
        start={"east_m": 0, "north_m": 0, "heading_rad": 0.1},
        refs={"mission": "m"},
    )
    jsonschema.validate(document, schema)
    jsonschema.validate(problem_to_dict(problem_from_dict(document)), schema)
