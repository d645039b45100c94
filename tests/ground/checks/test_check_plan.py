"""`outcrop plan ci` on a small plan and world: what passes, what fails, and what its three forms say."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
import typer
from typer.testing import CliRunner

from ground.checks.flight_rules import CHECKS, Facts, UndecidedError, flight_rules
from ground.checks.report import CHECKED, Mark
from ground.cli.plan import register
from tests.ground.campaigns.small import CRL, write_small

GOOD = CRL.replace("(time 2300)", "(time 2550)")


def ci(plan: Path, world: Path, *more: str) -> tuple[int, str]:
    app = typer.Typer()
    register(app)
    app.command("other")(lambda: None)
    result = CliRunner().invoke(app, ["plan", "ci", str(plan), "--world", str(world), "--runs", "200", *more])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.output


@pytest.fixture
def small(tmp_path: Path) -> tuple[Path, Path]:
    plan, world = write_small(tmp_path)
    plan.write_text(GOOD)
    return plan, world


def item(report: Path, name: str) -> Any:
    return next(i for i in json.loads(report.read_text())["items"] if i["name"] == name)


def test_a_good_plan_passes_with_a_report_in_all_forms(small: tuple[Path, Path], tmp_path: Path) -> None:
    out = {kind: tmp_path / f"report.{kind}" for kind in ("json", "html", "junit")}
    named = [text for kind, path in out.items() for text in (f"--{kind}", str(path))]
    code, told = ci(*small, "--approved", str(small[0]), "--not-worse", "--second", "abstract", *named)
    assert code == 0, told
    assert "PASSED" in told.splitlines()[-1]
    found = CHECKED.read(out["json"].read_text())
    assert found.passed
    assert found.difference is not None
    assert found.difference.same
    assert {i.stage for i in found.items} == {
        "validator",
        "difference",
        "futures",
        "flight rules",
        "second rover",
    }
    assert "200 futures" in item(out["json"], "utility")["said"]
    assert item(out["json"], "not worse")["mark"] == "passed"
    assert item(out["json"], "FR-TILT")["mark"] == "undecided"  # the world has no terrain
    assert "src=" not in out["html"].read_text()
    suite = ElementTree.parse(out["junit"]).getroot()[0]
    assert suite.get("failures") == "0"
    assert len(suite) == len(found.items) == int(suite.get("tests", ""))
    assert len(suite.findall("testcase/skipped")) == found.count(Mark.UNDECIDED) > 0


def test_facts_that_are_not_given_fail_only_a_strict_check(small: tuple[Path, Path]) -> None:
    assert ci(*small)[0] == 0
    code, told = ci(*small, "--strict")
    assert code == 1
    assert "FR-TILT" in told


@pytest.mark.parametrize(
    ("old", "new", "stage", "said"),
    [
        (":action navigate", ":action navigat", "validator", "E050"),
        ("(time 2550)", "(time 900)", "flight rules", "FR-OVERRUN"),
        (":time <= 2600", ":time <= 100", "second rover", "FAILED after"),
    ],
)
def test_a_planted_fault_is_found_by_its_stage(
    small: tuple[Path, Path], tmp_path: Path, old: str, new: str, stage: str, said: str
) -> None:
    plan, world = small
    assert old in GOOD
    plan.write_text(GOOD.replace(old, new))
    code, told = ci(plan, world, "--second", "abstract", "--json", str(tmp_path / "r.json"))
    assert code == 1
    failed = [i for i in json.loads((tmp_path / "r.json").read_text())["items"] if i["mark"] == "failed"]
    assert any(i["stage"] == stage and said in i["name"] + i["said"] for i in failed), told
    assert told.splitlines()[-1].startswith("FAILED")


def test_a_plan_that_earns_less_than_the_approved_one_fails_if_asked(
    small: tuple[Path, Path], tmp_path: Path
) -> None:
    poorer = tmp_path / "poorer.crl"
    poorer.write_text(GOOD.replace(":reward 5 :metadata (observation = T1-img)", ":reward 1"))
    code, told = ci(poorer, small[1], "--approved", str(small[0]))
    assert code == 0
    assert "task look-T1 :reward: 5 -> 1" in told
    code, told = ci(poorer, small[1], "--approved", str(small[0]), "--not-worse")
    assert code == 1
    assert "not worse" in told


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (("--not-worse",), "--approved"),
        (("--second", "nobody"), "nobody"),
        (("--second-runs", "0"), "--second-runs is 0"),
        (("--runs", "0"), "--runs is 0"),
    ],
)
def test_what_cannot_be_asked_is_refused_in_one_line(
    small: tuple[Path, Path], more: tuple[str, ...], said: str
) -> None:
    code, told = ci(*small, *more)
    assert code == 2
    assert said in told
    code, told = ci(small[0].with_name("absent.crl"), small[1])
    assert code == 2
    assert "absent.crl" in told


def facts(**given: Any) -> Facts:
    target = {
        "id": "T1",
        "observation_point": {"east_m": 0.0, "north_m": 0.0, "heading_rad": 0.0},
        "point_m": [1.0, 0.0, 0.0],
        "observations": [{"id": "o", "kind": "place", "instrument": "mi"}],
    }
    known: dict[str, Any] = {
        "problem": {"targets": [target], "budget": {"time_s": 3600.0, "energy_j": 100.0}},
        "planned": frozenset({"o"}),
        "errors": (),
        "instruments": frozenset({"mi"}),
        "slope": lambda e, n: 0.1,
        "battery_j": 300.0,
        "energy_floor_j": 100.0,
        "start_lmst_h": 10.0,
        "overrun": 0.0,
        "campaign": None,
        "least_runs": 0,
    }
    return Facts(**{**known, **given})


@pytest.mark.parametrize(
    ("rule", "broken", "absent"),
    [
        ("tilt", {"slope": lambda e, n: 0.5}, {"slope": None}),
        ("tilt", {"slope": lambda e, n: float("nan")}, {"slope": None}),
        ("energy_floor", {"battery_j": 150.0}, {"battery_j": None}),
        ("energy_floor", {"energy_floor_j": 250.0}, {"energy_floor_j": None}),
        ("time_of_day", {"start_lmst_h": 17.0}, {"start_lmst_h": None}),
        ("instrument", {"instruments": frozenset({"apxs"})}, None),
        ("crl", {"errors": ("E050 unknown",)}, None),
        ("overrun", {"overrun": 0.2}, None),
        ("overrun", {"overrun": None}, None),
    ],
)
def test_a_rule_holds_is_broken_or_undecided(
    rule: str, broken: dict[str, Any], absent: dict[str, Any] | None
) -> None:
    limit = next(r.limit for r in flight_rules() if r.check == rule)
    assert CHECKS[rule](facts(), limit)[0]
    assert not CHECKS[rule](facts(**broken), limit)[0]
    if absent is not None:
        with pytest.raises(UndecidedError):
            CHECKS[rule](facts(**absent), limit)


BARE = re.sub(r" :metadata \(observation = [\w-]+\)", "", GOOD)
USES = {"FR-TILT", "FR-ARM", "FR-INSTRUMENT"}


def rules(plan: Path, world: Path, folder: Path) -> dict[str, tuple[str, str]]:
    out = folder / "rules.json"
    ci(plan, world, "--json", str(out))
    items = json.loads(out.read_text())["items"]
    return {i["name"]: (i["mark"], i["said"]) for i in items if i["stage"] == "flight rules"}


def changed_world(world: Path, change: Callable[[Any], None]) -> None:
    document = json.loads(world.read_text())
    change(document)
    world.write_text(json.dumps(document))


def test_rules_look_at_tasks_that_name_no_observation(small: tuple[Path, Path], tmp_path: Path) -> None:
    plan, world = small
    named = rules(plan, world, tmp_path)
    assert "farthest is" in named["FR-ARM"][1]
    assert "observation" not in BARE
    plan.write_text(BARE)
    assert rules(plan, world, tmp_path) == named


def test_a_far_target_breaks_the_rule_of_the_arm_without_metadata_too(
    small: tuple[Path, Path], tmp_path: Path
) -> None:
    plan, world = small
    plan.write_text(BARE)
    changed_world(world, lambda w: w["problem"]["targets"][1].update(point_m=[50.0, 4.0, 0.2]))
    assert rules(plan, world, tmp_path)["FR-ARM"][0] == "failed"


@pytest.mark.parametrize("named", ["", " :metadata (observation = T1-mi)"])
def test_a_task_whose_observation_is_open_leaves_the_rules_undecided(
    small: tuple[Path, Path], tmp_path: Path, named: str
) -> None:
    plan, world = small
    plan.write_text(
        BARE.replace(":id touch-T2", ":id touch-T2" + named)
    )  # that of another target does not count

    def twice(document: Any) -> None:
        made = document["problem"]["targets"][1]["observations"]
        made.append({**made[0], "id": "T2-again"})

    changed_world(world, twice)
    found = rules(plan, world, tmp_path)
    assert {name for name in USES if found[name][0] == "undecided"} == USES
    assert "task touch-T2 does not say which observation it makes: T2-mi or T2-again" in found["FR-ARM"][1]


def test_the_arm_at_a_target_without_such_an_observation_is_undecided(
    small: tuple[Path, Path], tmp_path: Path
) -> None:
    plan, world = small
    plan.write_text(BARE)
    changed_world(world, lambda w: w["problem"]["targets"][1]["observations"][0].update(kind="image"))
    found = rules(plan, world, tmp_path)["FR-ARM"]
    assert found[0] == "undecided"
    assert "task touch-T2 uses the arm, and the world has no such observation of T2" in found[1]


@pytest.mark.parametrize(
    ("member", "held"), [("battery_j", "abc"), ("battery_j", -1), ("sun", "noon"), ("profile", 3)]
)
def test_a_world_that_cannot_be_used_is_refused_by_the_member(
    small: tuple[Path, Path], member: str, held: object
) -> None:
    plan, world = small
    changed_world(world, lambda w: w.update({member: held}))
    code, told = ci(plan, world)
    assert code == 2
    assert member in told
    assert len(told.splitlines()) == 1
