"""A recorded traverse in a mission: a run made elsewhere, with its poses, pictures and no rights."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin

from ground.errors import ForbiddenError, NotFoundError
from ground.records.actor import Actor, Role
from ground.resources.downlinks.import_recording import import_recording
from ground.uplink.execute import execute_package
from ground.uplink.mcap_export import export_mcap
from neighbours.robots.recording import Mapping, read_recording
from tests.ground.conftest import Api
from tests.ground.signed import small_site
from tests.ground.test_day_over_rest import file_requests, planned
from tests.ground.test_missions_api import problem, upload
from tests.neighbours.robots.test_recording import POSES, files_of, pixels, write

OPERATOR = Actor("Operator", Role.OPERATOR)


def test_a_bag_becomes_a_run_that_nothing_here_vouches_for(api: Api, mission: Any, tmp_path: Path) -> None:
    file_requests(api, mission)
    plan = planned(api, mission)
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


def test_a_cut_bag_says_so_and_strangers_bring_nothing_in(api: Api, mission: Any, tmp_path: Path) -> None:
    file_requests(api, mission)
    plan = planned(api, mission)
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
    file_requests(api, mission)
    plan = planned(api, mission)
    (file,) = files_of(write(tmp_path / "bag", StoragePlugin.MCAP))
    given = {"plan_id": plan["id"], "mapping": {"pictures": ["/jpg"]}}
    given["upload_id"] = upload(api, "bag.mcap", file.read_bytes(), "Operator")
    run = api.post("/runs/import", given, who="Operator")
    assert run["elsewhere"]
    assert run["notes"].startswith("Recording bag.mcap, made elsewhere")
    assert len(api.get(f"/missions/{mission.id}/products?run_id={run['id']}")["items"]) == 4
    for change, words in (
        ({"mapping": {"pose": "/amcl"}}, "names topic /amcl"),
        ({"upload_id": upload(api, "text.mcap", b"no recording", "Operator")}, "neither MCAP nor sqlite3"),
    ):
        refused = api("POST", "/runs/import", {**given, **change}, who="Operator")
        assert refused.status_code == 422
        assert words in refused.json()["detail"]
    assert api("POST", "/runs/import", given, who="Viewer").status_code in (403, 404)


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
