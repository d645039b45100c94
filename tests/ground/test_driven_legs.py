"""Legs come out of recorded runs as they were driven, and bear out a calibration."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ground.day.prepare import calibration_of
from ground.errors import ArchiveError, InvalidInputError
from ground.resources.calibrations.driven_legs import (
    DrivenLeg,
    WatchedTrack,
    calibrate,
    exposure_m,
    legs_of_run,
)
from ground.resources.calibrations.made_activities import MadeActivity, activities_of_run, fitted
from ground.uplink.flight import fly
from planner.path_network import Calibration
from rover_iface.contract import write_contract_world
from rover_iface.profile import load_profile
from rover_iface.simulator.faults import Fault, FaultKind
from rover_iface.simulator.subframe_rover import make_rover

K9 = load_profile("k9")

PLAN = """
(plan :id approach :node (block :id all :node-list (
  (task :id first :action trackstart :parameters (target = T1))
  (task :id second :action trackstart :parameters (target = T2))
  (task :id drive :action navigate :parameters (target = T1 mode = track)))))
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive to T1 on which the track of T2 is lost by a fault."""
    out = tmp_path_factory.mktemp("recorded")
    world = write_contract_world(tmp_path_factory.mktemp("world"))
    lose = Fault(FaultKind.LOSE_TARGET, at_s=100.0, target="T2")
    fly(PLAN, make_rover(world, seed=4, out=out, faults=[lose]), out, run_id="r", sync=False)
    return out


def test_a_leg_has_its_ends_its_time_and_what_became_of_each_track(run: Path) -> None:
    (leg,) = legs_of_run(run)
    assert (leg.task, leg.arrived) == ("drive", True)
    assert leg.begin[:2] == pytest.approx((0.0, 0.0), abs=0.05)
    assert 2.5 < leg.length_m < 4.0
    assert 300 < leg.duration_s < 4000
    assert leg.energy_j > 1000
    assert {t.target: t.lost for t in leg.tracks} == {"T1": False, "T2": True}
    first = leg.tracks[0]
    assert first.first_seen == pytest.approx(leg.begin[:2])
    assert math.dist(first.point[:2], leg.end[:2]) < 1.3
    inside, outside, hidden = exposure_m(leg, K9, None, calibration_of(K9))[0]
    assert inside + outside == pytest.approx(leg.length_m, rel=0.2)
    assert hidden == 0.0


def test_a_run_without_odometry_is_refused_by_name(tmp_path: Path) -> None:
    folder = tmp_path / "abstract-run"
    folder.mkdir()
    with pytest.raises(ArchiveError, match="abstract-run: no legs"):
        legs_of_run(folder)
    (folder / "journal.jsonl").write_text("")
    with pytest.raises(ArchiveError, match="abstract-run holds no odometry"):
        legs_of_run(folder)


def _drawn(count: int, truth: Calibration) -> list[DrivenLeg]:
    """Return legs drawn from a calibration: the first track ahead, the second to one side."""
    rng = np.random.default_rng(11)
    legs = []
    for k in range(count):
        length = float(rng.uniform(2, 6))
        tracks = []
        for target, point in (("ahead", (length + 0.8, 0.0, 0.3)), ("aside", (1.0, 3.0, 0.3))):
            bare = WatchedTrack(target, point, (0.0, 0.0), False)
            tracks.append(bare)
        leg = DrivenLeg(
            f"r{k}", "drive", (0.0, 0.0, 0.0), (length, 0.0, 0.0),
            90.0 + truth.fixed_s + truth.drive_factor * length / K9.mobility.speed_m_s,
            1000.0 * length, True, tuple(tracks),
        )  # fmt: skip
        rates = np.array([truth.inside_per_m, truth.outside_per_m, truth.occluded_per_m])
        chance = -np.expm1(-np.array(exposure_m(leg, K9, None, truth)) @ rates)
        fate: list[Any] = [
            WatchedTrack(t.target, t.point, t.first_seen, bool(rng.random() < p))
            for t, p in zip(tracks, chance, strict=True)
        ]
        legs.append(
            DrivenLeg(leg.run, leg.task, leg.begin, leg.end, leg.duration_s, leg.energy_j, True, tuple(fate))
        )
    return legs


def test_legs_drawn_from_a_calibration_give_it_back(tmp_path: Path) -> None:
    truth = calibration_of(K9)
    found = calibrate(_drawn(600, truth), K9, name="drawn", source="a test")
    assert abs(found.inside_per_m - truth.inside_per_m) < 3 * found.inside_se_per_m
    assert abs(found.outside_per_m - truth.outside_per_m) < 3 * found.outside_se_per_m
    assert found.fixed_s == pytest.approx(truth.fixed_s, rel=0.02)
    assert found.drive_factor == pytest.approx(truth.drive_factor, rel=0.02)
    assert (found.legs, found.tracks) == (600, 1200)
    assert found.losses > 50


def test_too_few_legs_are_refused_with_their_number() -> None:
    with pytest.raises(InvalidInputError, match=r"3 legs of at least 0\.5 m"):
        calibrate(_drawn(3, calibration_of(K9)), K9, name="few", source="a test")


def _told(folder: Path, states: dict[str, tuple[str, str, str]]) -> Path:
    """Write a run of two drives of 3 m, to T1 and to T2; `states` are those of each target at the start and
    at the end of both.
    """
    (folder / "products").mkdir(parents=True)
    journal: list[dict[str, Any]] = []
    for number, end_s in ((1, 1000.0), (2, 2000.0)):
        command = ["r", f"navigate-T{number}", 1]
        journal += [
            {"k": "step", "t": 1000 * (end_s - 900.0), "events": []},
            {"k": "send", "id": command, "action": "navigate", "parameters": {"target": f"T{number}"}},
            {"k": "step", "t": 1000 * end_s, "events": [
                {"e": "result", "t": 1000 * end_s, "command": command, "success": True, "values": {}}]},
        ]  # fmt: skip
    odometry = [{"t_s": t, "believed": [x, 0.0, 0.0, 0.0]} for t, x in ((0, 0), (1000, 3), (2000, 6))]
    tracking = [
        {"t_s": t, "target": name, "state": state, "position_m": [8.0, 3.0, 0.5]}
        for name, told in states.items()
        for t, state in zip((50.0, 999.0, 1999.0), told, strict=True)
    ]
    (folder / "journal.jsonl").write_text("\n".join(map(json.dumps, journal)))
    (folder / "products" / "0001-odometry.json").write_text(json.dumps(odometry))
    (folder / "products" / "0002-tracking.json").write_text(json.dumps(tracking))
    return folder


@pytest.mark.parametrize("line", ["[]", "3", '{"k": "send"}', '{"k": "step", "events": [{"k": 1}]}', "{"])
def test_a_malformed_journal_is_refused_by_the_name_of_its_run(tmp_path: Path, line: str) -> None:
    out = _told(tmp_path / "run", {"T1": ("tracked",) * 3})
    with (out / "journal.jsonl").open("a") as journal:
        journal.write("\n" + line)
    with pytest.raises(ArchiveError, match=r"^run"):
        legs_of_run(out)
    with pytest.raises(ArchiveError, match=r"^run"):
        activities_of_run(out, K9)


def test_activities_have_their_outcome_time_and_energy_and_drives_are_none(tmp_path: Path) -> None:
    out = _told(tmp_path / "run", {"T1": ("tracked",) * 3})
    sent = [("a", "trackstart", {"target": "T1"}), ("b", "observe", {"instrument": "mi"})]
    lines = [{"k": "step", "t": 3_000_000, "events": []}]
    for name, action, parameters in sent:
        lines.append({"k": "send", "id": ["r", name, 1], "action": action, "parameters": parameters})
    events = [
        {
            "e": "result",
            "t": 3_045_000,
            "command": ["r", "a", 1],
            "success": True,
            "values": {"energy_j": 200.0},
        },
        {"e": "result", "t": 3_600_000, "command": ["r", "b", 1], "success": False, "values": {}},
    ]
    lines.append({"k": "step", "t": 3_600_000, "events": events})
    with (out / "journal.jsonl").open("a") as journal:
        journal.write("\n" + "\n".join(map(json.dumps, lines)))
    assert activities_of_run(out, K9) == [
        MadeActivity("trackstart", True, 45.0, 200.0, "run"),
        MadeActivity("mi", False, 600.0, 0.0, "run"),
    ]


def test_successes_of_one_run_may_go_together_and_starts_of_tracks_are_not_asked() -> None:
    made = [
        MadeActivity(kind, run % 3 != 0, 500.0, 9000.0, f"run{run}")
        for run in range(30)
        for kind in ("mi", "mi", "trackstart", "trackstart")
    ]
    placed, begun = fitted(made, K9)
    assert (placed.name, placed.days) == ("mi", 30)
    assert placed.intraday_correlation > 3.0 * placed.intraday_correlation_se
    assert (begun.name, begun.days, begun.intraday_correlation) == ("trackstart", 0, 0.0)
    nameless = [MadeActivity(one.kind, one.success, one.duration_s, one.energy_j) for one in made]
    assert {one.days for one in fitted(nameless, K9)} == {0}
    assert fitted(nameless, K9)[0].p_success == placed.p_success


@pytest.mark.parametrize(("outcome", "cut"), [("FAILED", 1), ("ABORTED", 0)])
def test_a_drive_that_a_budget_cut_short_counts_as_failed(tmp_path: Path, outcome: str, cut: int) -> None:
    """One that people stopped does not."""
    out = _told(tmp_path / "run", {"T1": ("tracked",) * 3, "T2": ("tracked",) * 3})
    on = {"k": "send", "id": ["r", "navigate-T3", 1], "action": "navigate", "parameters": {"target": "T3"}}
    end = {"k": "end", "t": 9_000_000, "outcome": outcome, "utility": -60.0}
    with (out / "journal.jsonl").open("a") as journal:
        journal.write("\n" + json.dumps(on) + "\n" + json.dumps(end))
    legs = legs_of_run(out)
    assert [(leg.to, leg.duration_s) for leg in legs if leg.failed] == [("T3", 7000.0)] * cut
    assert [leg.to for leg in legs if leg.arrived] == ["T1", "T2"]


def test_a_target_that_was_placed_on_is_watched_no_longer(tmp_path: Path) -> None:
    out = _told(tmp_path / "run", {"T1": ("tracked",) * 3, "T2": ("tracked",) * 3})
    done = {"e": "result", "t": 1_050_000, "command": ["r", "observe-R1", 1], "success": True,
            "values": {"made": True}, "updates": {"trackerstate T1": "idle"}}  # fmt: skip
    lines = (out / "journal.jsonl").read_text().splitlines()
    lines.insert(3, json.dumps({"k": "step", "t": 1_050_000, "events": [done]}))
    (out / "journal.jsonl").write_text("\n".join(lines))
    first, second = legs_of_run(out)
    assert [t.target for t in first.tracks] == ["T1", "T2"]
    assert [t.target for t in second.tracks] == ["T2"]


def test_a_track_that_comes_back_is_not_lost_but_where_the_drive_led_it_is(tmp_path: Path) -> None:
    back = ("tracked", "lost", "tracked")
    gone = ("tracked", "lost", "lost")
    first, second = legs_of_run(_told(tmp_path / "run", {"T1": back, "T2": back, "T3": gone}))
    assert {t.target: t.lost for t in first.tracks} == {"T1": True, "T2": False, "T3": True}
    assert second.tracks == ()
