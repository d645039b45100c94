"""A recorded traverse in a mission: a run made elsewhere, with its poses, pictures and no rights."""

from __future__ import annotations

import multiprocessing
import os
import random
import secrets
import shutil
import time
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin

from ground.durable import DRAFT, SUMS, damaged_in
from ground.errors import ForbiddenError, NotFoundError
from ground.jobs.queue import WorkStoppedError
from ground.jobs.row import JobRow
from ground.records.actor import Actor, Role
from ground.resources.backups.check_files import sweep_files
from ground.resources.downlinks import import_recording as import_recording_module
from ground.resources.downlinks import work as recording_work
from ground.resources.downlinks.import_recording import import_recording
from ground.resources.downlinks.order import ORDERS
from ground.resources.missions.value import Mission
from ground.uplink.execute import execute_package
from ground.uplink.mcap_export import export_mcap
from neighbours.robots.bag_files import files_of
from neighbours.robots.recording import Mapping, read_recording
from tests.ground.conftest import Api
from tests.ground.planning import PlannedDay, plan_day
from tests.ground.signed import small_site
from tests.ground.test_missions_api import problem, upload
from tests.neighbours.robots.test_recording import POSES, pixels, write

OPERATOR = Actor("Operator", Role.OPERATOR)


@pytest.fixture
def api(planned_day: PlannedDay) -> Api:
    return planned_day.api


@pytest.fixture
def mission(planned_day: PlannedDay) -> Mission:
    return planned_day.mission


def plan_of(api: Api, mission: Mission) -> dict[str, Any]:
    """Return the plan of a mission, made here for an empty one."""
    plans: list[dict[str, Any]] = api.get(f"/missions/{mission.id}/plans")["items"]
    return plans[0] if plans else plan_day(api, mission).plan


def test_a_bag_becomes_a_run_that_nothing_here_vouches_for(api: Api, mission: Any, tmp_path: Path) -> None:
    plan = plan_of(api, mission)
    before = api.get(f"/missions/{mission.id}/observation-requests")["items"]
    bag = write(tmp_path / "bag", StoragePlugin.MCAP)
    mapping = Mapping(east_m=1.0, north_m=2.0, capacity_j=1e6)
    made, _ = import_recording(api.repo, OPERATOR, plan["id"], bag, mapping)
    run = api.get(f"/runs/{made.id}")
    assert (run["elsewhere"], run["outcome"], run["rover"]) == (True, "RECORDED", "recording")
    assert "no executive of this installation vouches for it" in run["notes"]
    assert "/words of type std_msgs/msg/String is left out" in run["notes"]
    told = api.get(f"/runs/{made.id}/telemetry")
    assert told["t_s"] == [float(n) for n in range(len(POSES))]
    assert told["east_m"] == pytest.approx([1.0 + x for x, _, _ in POSES], abs=1e-6)
    assert told["north_m"] == pytest.approx([2.0 + y for _, y, _ in POSES], abs=1e-6)
    assert told["battery_j"][:10] == pytest.approx([9e5] * 10)
    products = api.get(f"/missions/{mission.id}/products?run_id={made.id}&limit=100")["items"]
    assert len(products) == 8
    assert all(p["orphan"] for p in products)
    for product in products:
        number = round(product["t_s"])
        x, y, _ = POSES[number]
        label = product["label"]
        assert (label["east_m"], label["north_m"]) == pytest.approx((1.0 + x, 2.0 + y), abs=1e-9)
        data = api("GET", product["file_url"].removeprefix("/api/v1")).content
        seen = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
        wanted = pixels(number)[..., ::-1] if label["topic"] == "/raw" else pixels(number)
        assert np.array_equal(seen, wanted)
    assert api.get(f"/missions/{mission.id}/observation-requests")["items"] == before
    assert api.get(f"/plans/{plan['id']}")["state"] == plan["state"] == "computed"
    refused = problem(api("POST", f"/runs/{made.id}/next-sol"), 409, "wrong-state")
    assert f"run {made.id} on 'recording' was made elsewhere" in refused["detail"]
    assert len(api.get(f"/missions/{mission.id}/sols")["items"]) == 1
    given = {"run_ids": [made.id]}
    refused = problem(api("POST", f"/missions/{mission.id}/calibrate", given), 422, "invalid-input")
    assert f"run {made.id} was made elsewhere" in refused["detail"]
    problem(api("POST", f"/plans/{plan['id']}/statement"), 409, "wrong-state")


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt, OSError])
def test_an_import_that_fails_in_whatever_way_leaves_no_folder(
    api: Api, mission: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: type[BaseException]
) -> None:
    plan = plan_of(api, mission)
    runs = api.repo.run_dir("any").parent
    before = set(runs.glob("*"))
    bag = write(tmp_path / "bag", StoragePlugin.SQLITE3)

    def fail(*_: object) -> None:
        assert set(runs.glob("*")) > before, "the folder is in its place before the rows"
        raise error

    monkeypatch.setattr(import_recording_module, "record_run", fail)
    with pytest.raises(error):
        import_recording(api.repo, OPERATOR, plan["id"], bag, Mapping())
    assert set(runs.glob("*")) == before
    assert api.get(f"/missions/{mission.id}/runs")["items"] == []


def test_a_cut_bag_says_so_and_strangers_bring_nothing_in(api: Api, mission: Any, tmp_path: Path) -> None:
    plan = plan_of(api, mission)
    (file,) = files_of(write(tmp_path / "bag", StoragePlugin.SQLITE3))
    cut = tmp_path / "cut.db3"
    cut.write_bytes(file.read_bytes()[: file.stat().st_size * 3 // 4])
    made, read = import_recording(api.repo, OPERATOR, plan["id"], cut, Mapping())
    assert read.poses
    assert "The file is not whole." in made.notes
    with pytest.raises(ForbiddenError):
        import_recording(api.repo, Actor("Viewer", Role.VIEWER), plan["id"], file, Mapping())
    with pytest.raises(NotFoundError):
        import_recording(api.repo, OPERATOR, "pln-none", file, Mapping())
    outside = Actor("Operator", Role.OPERATOR, mission_roles={mission.id: Role.NONE})
    with pytest.raises(NotFoundError, match=f"there is no plan {plan['id']}$"):
        import_recording(api.repo, outside, plan["id"], file, Mapping())
    assert [r["id"] for r in api.get(f"/missions/{mission.id}/runs")["items"]] == [made.id]


def test_an_uploaded_recording_comes_in_over_rest_and_a_wrong_one_is_named(
    api: Api, mission: Any, tmp_path: Path
) -> None:
    given = order_for(api, mission, tmp_path)
    plan_id = given["plan_id"]
    given["mapping"] = {"pictures": ["/jpg"]}
    asked = api.post("/runs/import", given, who="Operator", status=202)
    assert (asked["kind"], asked["subject_id"]) == ("import_recording", plan_id)
    assert api.get(f"/missions/{mission.id}/runs")["items"] == []
    assert api.jobs() == 1
    job = api.get(f"/jobs/{asked['id']}")
    assert (job["state"], job["progress"]) == ("succeeded", 1.0)
    run = api.get(job["result_url"].removeprefix("/api/v1"))
    assert run["elsewhere"]
    assert run["author"] == "Operator"
    assert run["notes"].startswith("Recording bag.mcap, made elsewhere")
    assert len(api.get(f"/missions/{mission.id}/products?run_id={run['id']}")["items"]) == 4
    text = upload(api, "text.mcap", b"no recording", "Operator")
    refused = problem(
        api("POST", "/runs/import", {**given, "upload_id": text}, who="Operator"), 422, "archive-unusable"
    )
    assert "neither MCAP nor sqlite3" in refused["detail"]
    wrong = api.post("/runs/import", {**given, "mapping": {"pose": "/amcl"}}, who="Operator", status=202)
    assert api.jobs() == 1
    job = api.get(f"/jobs/{wrong['id']}")
    assert job["state"] == "failed"
    assert "bag.mcap: the mapping names topic /amcl" in job["problem"]["detail"]
    assert api("POST", "/runs/import", given, who="Viewer").status_code in (403, 404)
    assert api("POST", f"/jobs/{wrong['id']}/retry", who="Planner").status_code == 403
    assert [r["id"] for r in api.get(f"/missions/{mission.id}/runs")["items"]] == [run["id"]]
    assert folders(api) == {run["id"]}


def order_for(api: Api, mission: Any, tmp_path: Path) -> dict[str, Any]:
    """Return the request for an import of an uploaded bag into the plan of a mission."""
    plan = plan_of(api, mission)
    (file,) = files_of(write(tmp_path / "bag", StoragePlugin.MCAP))
    return {"plan_id": plan["id"], "upload_id": upload(api, "bag.mcap", file.read_bytes(), "Operator")}


def folders(api: Api) -> set[str]:
    """Return the names of the folders of runs, drafts among them."""
    return {path.name for path in api.repo.run_dir("any").parent.glob("*")}


def payload_of(api: Api, job_id: str) -> dict[str, Any]:
    with api.repo.database.read() as session:
        return dict(session.get_one(JobRow, job_id).payload)


def test_an_import_that_is_cancelled_while_it_reads_leaves_nothing(
    api: Api, mission: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    job = api.post("/runs/import", order_for(api, mission, tmp_path), who="Operator", status=202)
    order = ORDERS.from_document(payload_of(api, job["id"]))
    monkeypatch.setattr(recording_work, "LOOK_S", 0.0)
    told: list[float] = []
    stop_at = random.Random(seed := secrets.randbits(32)).uniform(0.0, 0.85)
    print("seed", seed, "stop at", stop_at)
    with pytest.raises(WorkStoppedError):
        recording_work.work(order, lambda share, _words: told.append(share), lambda: told[-1] > stop_at)
    assert told == sorted(told)
    assert max(told) > stop_at
    assert folders(api) == set()
    assert api("POST", f"/jobs/{job['id']}/cancel", who="Operator").json()["state"] == "cancelled"
    again = api("POST", f"/jobs/{job['id']}/retry", who="Operator")
    assert again.status_code == 200
    assert api.jobs() == 1
    assert api.get(f"/jobs/{job['id']}")["state"] == "succeeded"
    assert folders(api) == {order.run_id}


def test_an_import_whose_worker_dies_anywhere_comes_in_once_and_whole(
    api: Api, mission: Any, tmp_path: Path
) -> None:
    """Processes at work are killed at random instants; the next attempt finds what lies on the disk."""
    rng = random.Random(seed := secrets.randbits(32))
    print("seed", seed)
    job = api.post("/runs/import", order_for(api, mission, tmp_path), who="Operator", status=202)
    payload = payload_of(api, job["id"])
    order = ORDERS.from_document(payload)
    context = multiprocessing.get_context("fork")
    began = time.monotonic()
    work_once(payload)
    whole_s = time.monotonic() - began
    shutil.rmtree(order.run_dir)
    died = 0
    for _ in range(12):
        process = context.Process(target=work_once, args=(payload,))
        process.start()
        process.join(rng.uniform(0.0, 1.2 * whole_s))
        if process.is_alive():
            process.kill()
            died += 1
        process.join()
        place = Path(order.run_dir)
        assert not place.exists() or ((place / SUMS).exists() and not damaged_in(place))
        if place.exists() and rng.random() < 0.5:
            shutil.rmtree(place)  # else the next finds it
    assert died, "no process was killed at work"
    assert api.jobs() == 1
    job = api.get(f"/jobs/{job['id']}")
    assert job["state"] == "succeeded"
    (run,) = api.get(f"/missions/{mission.id}/runs")["items"]
    assert job["result_url"].endswith(f"/runs/{run['id']}")
    assert len(api.get(f"/runs/{run['id']}/telemetry")["t_s"]) == len(POSES)
    assert len(api.get(f"/missions/{mission.id}/products?run_id={run['id']}")["items"]) == 8
    assert not damaged_in(Path(order.run_dir))
    assert {name for name in folders(api) if not name.startswith(DRAFT)} == {order.run_id}
    for path in place.parent.glob("*"):
        os.utime(path, (0, 0))
    sweep_files(api.repo)
    assert folders(api) == {order.run_id}, "what the dead left is swept"


def work_once(payload: dict[str, Any]) -> None:
    recording_work.work(ORDERS.from_document(payload), lambda _share, _words: None, lambda: False)


def test_an_import_whose_plan_went_meanwhile_fails_by_name_and_leaves_no_folder(
    api: Api, mission: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    job = api.post("/runs/import", order_for(api, mission, tmp_path), who="Operator", status=202)

    def gone(*_: object) -> None:
        assert len(folders(api)) == 1, "the folder is in its place before the rows"
        raise NotFoundError("there is no plan any more")

    monkeypatch.setattr(import_recording_module, "record_run", gone)
    assert api.jobs() == 1
    found = api.get(f"/jobs/{job['id']}")
    assert (found["state"], found["problem"]["detail"]) == ("failed", "there is no plan any more")
    assert folders(api) == set()
    assert api.get(f"/missions/{mission.id}/runs")["items"] == []


def test_our_own_export_comes_in_again_with_the_same_poses_and_pictures(tmp_path: Path) -> None:
    package, place = small_site(tmp_path)
    flight = execute_package(package, place, tmp_path / "run")[1]
    export_mcap(tmp_path / "run", tmp_path / "run.mcap")
    pictures: list[bytes] = []
    read = read_recording(tmp_path / "run.mcap", Mapping(), lambda p: pictures.append(p.data))
    told = [(s.t_s, s.east_m, s.north_m) for s in flight.samples]
    zero = read.poses[0].t_ns
    found = [((p.t_ns - zero) / 1e9, p.east_m, p.north_m) for p in read.poses]
    assert [t for t, _, _ in found] == [t - told[0][0] for t, _, _ in told]
    assert np.allclose(sorted(p[1:] for p in found), sorted(t[1:] for t in told), rtol=0.0, atol=1e-9)
    files = [tmp_path / "run" / p.path for p in flight.outcome.products]
    wanted = [f.read_bytes() for f in files if f.suffix in (".png", ".jpg")]
    assert sorted(pictures) == sorted(wanted)
    assert read.whole
