"""A mission learns from recorded runs, and what is planned from then on stands on what it learned."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from ground.errors import InvalidInputError
from ground.gdr.repository import Repository
from ground.jobs.queue import WorkStoppedError
from ground.resources.calibrations import calibrate_mission as service
from ground.resources.calibrations.bodies import MissionCalibrate
from ground.resources.calibrations.calibrate_from_folders import calibrate_from_folders
from ground.resources.calibrations.calibrate_mission import calibrate_mission
from ground.resources.calibrations.work import work
from ground.resources.missions.row import MissionRow
from ground.resources.missions.value import Mission
from ground.resources.observation_requests.bodies import ObservationRequestCreate
from ground.resources.observation_requests.create_request import create_request
from ground.resources.path_networks.geometry import network_geometry
from ground.resources.problems.inputs_digest import inputs_digest
from ground.resources.problems.mission_day import choose_sol, mission_day, worksite
from ground.resources.targets.bodies import TargetCreate
from ground.resources.targets.create_target import create_target
from planner.problem import problem_to_dict
from tests.ground.conftest import PLANNER, Api


def recorded(folder: Path, number: int, *, lost: bool) -> Path:
    """Write what a rover on terrain records of one drive of 2 to 4 m past a target 3 m aside."""
    return record_drives(folder / f"run{number}", [(2.0 + number % 3, lost)])


def record_drives(
    out: Path, drives: Sequence[tuple[float, bool]], *, short: Sequence[int] = (), slower: float = 1.0
) -> Path:
    """Write what a rover on terrain records of drives of so many metres, each past a target of its own.

    Each begins where the first did; its target is 3 m aside, lost on the way or not, and given up after it.
    The drives numbered in `short`, from 1 on, did not come to where they were to. All take `slower` times as
    long as usual.
    """
    (out / "products").mkdir(parents=True, exist_ok=True)
    journal: list[dict[str, Any]] = []
    odometry, rows = [], []
    for number, (length, lost) in enumerate(drives, start=1):
        begin_s = 2000.0 * (number - 1) + 20.0
        end_s = begin_s + slower * (180.0 + 100.0 * length)
        result = {"e": "result", "t": 1000 * end_s, "command": ["r", "drive", number],
                  "success": number not in short,
                  "values": {"energy_j": 9000.0 * length}}  # fmt: skip
        journal += [
            {"k": "step", "t": 1000 * begin_s, "events": []},
            {
                "k": "send",
                "id": ["r", "drive", number],
                "action": "navigate",
                "parameters": {"target": f"T{number}"},
            },
            {"k": "step", "t": 1000 * end_s, "events": [result]},
        ]
        odometry += [
            {"t_s": t, "believed": [x, 0.0, 0.0, 0.0], "true": [x, 0.0, 0.0, 0.0]}
            for t, x in ((begin_s - 20.0, 0.0), (end_s, length))
        ]
        rows += [
            {"t_s": t, "target": f"T{number}", "state": state, "position_m": [3.0, 3.0, 0.5]}
            for t, state in (
                (begin_s, "tracked"),
                (end_s - 1.0, "failed" if lost else "tracked"),
                (end_s + 1.0, "stopped"),
            )
        ]
    (out / "journal.jsonl").write_text("\n".join(map(json.dumps, journal)))
    (out / "products" / "0001-drive-odometry.json").write_text(json.dumps(odometry))
    (out / "products" / "0002-drive-tracking.json").write_text(json.dumps(rows))
    return out


@pytest.fixture
def folders(tmp_path: Path) -> list[Path]:
    return [recorded(tmp_path, k, lost=k % 4 == 0) for k in range(16)]


def _p_lose(repo: Repository, mission_id: str) -> float:
    with repo.database.read() as session:
        row = session.get_one(MissionRow, mission_id)
        site = worksite(repo, session, row)
        asked = mission_day(repo, session, row, choose_sol(session, mission_id, None))
    day = site.prepare(asked, lambda _share, _what: None)
    return max(p for route in day.network.routes for p in route.p_lose.values())


def test_a_mission_plans_with_what_its_runs_taught(
    repo: Repository, mission: Mission, folders: list[Path]
) -> None:
    target = create_target(repo, PLANNER, mission.id, TargetCreate(east_m=4.0, north_m=1.0))
    create_request(
        repo,
        PLANNER,
        mission.id,
        ObservationRequestCreate(
            target_id=target.id, instrument="microscopic_imager", value=5.0, tracked=True
        ),
    )
    with repo.database.read() as session:
        before = inputs_digest(session, mission.id)
    odds = _p_lose(repo, mission.id)
    assert mission.calibration is None
    done = calibrate_from_folders(repo, PLANNER, mission.id, folders)
    found = done.calibration
    assert found is not None
    assert (found["legs"], found["tracks"], found["losses"]) == (16, 16, 4)
    assert "16 legs of 16 recorded runs of rover profile k9" in found["source"]

    assert 0.02 < max(found["inside_per_m"], found["outside_per_m"]) < 0.5
    assert _p_lose(repo, mission.id) > 1.3 * odds
    with repo.database.read() as session:
        assert inputs_digest(session, mission.id) != before


def test_it_is_shown_set_and_taken_back_over_the_interface(
    api: Api, mission: Mission, folders: list[Path]
) -> None:
    path = f"/missions/{mission.id}"
    refused = api("POST", f"{path}/calibrate", {"run_ids": ["run_missing"]})
    assert refused.status_code == 422
    assert "there is no run run_missing" in refused.text
    calibrate_from_folders(api.repo, PLANNER, mission.id, folders, name="yard")
    shown = api.get(path)["calibration"]
    assert (shown["format"], shown["name"]) == ("calibration/3", "yard")
    assert shown["arrival_rate"] > 0.0  # each track was of the target that its drive led to

    def change(document: dict[str, Any] | None) -> Any:
        etag = api("GET", path).headers["etag"]
        return api("PATCH", path, {"calibration": document}, headers={"If-Match": etag})

    wrong = change({**shown, "inside_per_m": -1.0})
    assert wrong.status_code == 422
    assert "inside_per_m is -1.0" in wrong.text
    assert change({**shown, "name": "by hand"}).json()["calibration"]["name"] == "by hand"
    assert change(None).json()["calibration"] is None


def test_what_holds_no_legs_is_named(
    repo: Repository, mission: Mission, folders: list[Path], tmp_path: Path
) -> None:
    (tmp_path / "abstract").mkdir()
    with pytest.raises(InvalidInputError, match="abstract: no legs"):
        calibrate_from_folders(repo, PLANNER, mission.id, [*folders, tmp_path / "abstract"])
    with pytest.raises(InvalidInputError, match="0 legs"):
        calibrate_from_folders(repo, PLANNER, mission.id)
    with pytest.raises(InvalidInputError, match="there is no run gone"):
        calibrate_mission(repo, PLANNER, mission.id, MissionCalibrate(run_ids=["gone"]))


def test_over_the_interface_it_is_a_job_that_gives_the_mission_its_calibration(
    api: Api, mission: Mission, folders: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(service, "run_folders", lambda *_args: [str(folder) for folder in folders])
    path = f"/missions/{mission.id}"
    job = api.post(f"{path}/calibrate", {"name": "yard"}, 202)
    assert (job["kind"], job["subject_kind"], job["subject_id"]) == (
        "calibrate_mission",
        "mission",
        mission.id,
    )
    assert api.get(path)["calibration"] is None
    assert api.jobs() == 1
    done = api.get(f"/jobs/{job['id']}")
    assert (done["state"], done["result_url"]) == ("succeeded", f"/api/v1{path}")
    found = api.get(path)["calibration"]
    assert (found["name"], found["legs"], found["losses"]) == ("yard", 16, 4)


def test_a_job_that_cannot_learn_says_why_and_leaves_the_mission_as_it_was(
    api: Api, mission: Mission
) -> None:
    job = api.post(f"/missions/{mission.id}/calibrate", {}, 202)
    api.jobs()
    done = api.get(f"/jobs/{job['id']}")
    assert done["state"] == "failed"
    assert "0 legs of at least 0.5 m" in done["problem"]["detail"]
    assert api.get(f"/missions/{mission.id}")["calibration"] is None


def test_the_work_tells_how_far_it_is_and_stops_when_asked(
    repo: Repository, mission: Mission, folders: list[Path]
) -> None:
    with repo.database.read() as session:
        places = [str(folder) for folder in folders]
        order = service.calibration_order(repo, session, mission.id, places, strict=True, name="")
    said: list[float] = []
    work(order, lambda share, _what: said.append(share), lambda: False)
    assert said == sorted(said)
    assert said[0] == 0.0
    assert 0.9 < said[-1] < 1.0
    calls = len(said)
    said.clear()
    with pytest.raises(WorkStoppedError):
        work(order, lambda share, _what: said.append(share), lambda: len(said) >= 20)
    assert len(said) == 20 < calls


def test_drives_that_ended_short_have_odds_and_those_that_lost_their_own_track_do_not(
    repo: Repository, mission: Mission, tmp_path: Path
) -> None:
    drives = [(3.0, number in (2, 5)) for number in range(1, 17)]
    record_drives(tmp_path / "run", drives, short=(2, 7, 9, 11))
    found = calibrate_from_folders(repo, PLANNER, mission.id, [tmp_path / "run"]).calibration
    assert found is not None
    assert (found["format"], found["failures"], found["legs"]) == ("calibration/3", 3, 12)
    assert found["fail_per_m"] == pytest.approx((3 + 0.5) / ((16 + 5) * 3.0))
    target = create_target(repo, PLANNER, mission.id, TargetCreate(east_m=4.0, north_m=1.0))
    asked = ObservationRequestCreate(target_id=target.id, instrument="science_camera", value=5.0)
    create_request(repo, PLANNER, mission.id, asked)
    with repo.database.read() as session:
        site = worksite(repo, session, session.get_one(MissionRow, mission.id))
        wanted = mission_day(
            repo, session, session.get_one(MissionRow, mission.id), choose_sol(session, mission.id, None)
        )
    day = site.prepare(wanted, lambda _share, _what: None)
    (leg,) = day.problem.legs
    assert leg.p_fail == pytest.approx(1.0 - math.exp(-found["fail_per_m"] * leg.length_m), abs=1e-5)
    assert problem_to_dict(day.problem)["format"] == "problem/2"
    geometry: Any = network_geometry(day)
    shown = {one["start"]: one["p_fail"] for one in geometry["segments"]}
    assert shown["start"] == pytest.approx(leg.p_fail, abs=1e-4)


def test_days_that_were_slow_in_all_drives_become_kinds_of_sols(
    repo: Repository, mission: Mission, tmp_path: Path
) -> None:
    drives = [(2.0 + 0.37 * (k * k % 7), k in (2, 5)) for k in range(1, 9)]
    folders = [
        record_drives(tmp_path / f"run{day}", drives, slower=slower)
        for day, slower in enumerate((0.8, 1.0, 1.6, 0.9, 1.1, 0.7, 1.3))
    ]
    found = calibrate_from_folders(repo, PLANNER, mission.id, folders).calibration
    assert found is not None
    assert (found["format"], found["days"]) == ("calibration/3", 7)
    assert found["day_time_sd"] == pytest.approx(0.28, abs=0.05)
    target = create_target(repo, PLANNER, mission.id, TargetCreate(east_m=4.0, north_m=1.0))
    asked = ObservationRequestCreate(target_id=target.id, instrument="science_camera", value=5.0)
    create_request(repo, PLANNER, mission.id, asked)
    with repo.database.read() as session:
        row = session.get_one(MissionRow, mission.id)
        site = worksite(repo, session, row)
        wanted = mission_day(repo, session, row, choose_sol(session, mission.id, None))
    problem = site.prepare(wanted, lambda _share, _what: None).problem
    assert problem_to_dict(problem)["format"] == "problem/2"
    assert [kind.name for kind in problem.sol_kinds] == ["slow", "usual", "quick"]
    slow, _, quick = (kind.drive_time_factor for kind in problem.sol_kinds)
    assert math.log(slow / quick) == pytest.approx(2.0 * math.sqrt(3.0) * found["day_time_sd"], rel=1e-3)
