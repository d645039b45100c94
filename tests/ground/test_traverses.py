"""Stops adjusted together by a job: new solutions that wait to be chosen, pictures, archives and copies."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from ground.gdr.repository import Repository
from ground.resources.backups.check_files import check_files
from ground.resources.missions.value import Mission
from ground.resources.runs.row import RunRow
from studies.common.localization_legs import look, make_leg, stereo_points
from tests.ground.conftest import PLANNER, Api, yard
from tests.ground.test_missions_api import problem, upload
from tests.ground.test_site_chain import choose, frames
from tests.rover_iface.localization.test_site_frames import UPRIGHT

OFF = np.array([0.9, -0.8, 0.0])
"""How far the second stop is believed off, east, north, up."""


@pytest.fixture(scope="module")
def seen() -> tuple[list[bytes], list[Any]]:
    """Two stops of a leg as point files, the second believed off, and where each is believed."""
    leg = make_leg(1011, 26.0, rock_cover=0.06)
    files, eyes = [], []
    for end, error in ((0, np.zeros(3)), (1, OFF)):
        points = stereo_points(look(leg, end), np.random.default_rng([1, end]))
        out = io.BytesIO()
        np.savez(out, points=points.points + error, eye=points.eye + error)
        files.append(out.getvalue())
        eyes.append(points.eye + error)
    return files, eyes


def stops(api: Api, mission: str, seen: tuple[list[bytes], list[Any]]) -> list[dict[str, Any]]:
    """File site 0 and two drives where the rover believes them, and upload what was seen."""
    landing = api.post(f"/missions/{mission}/frames", {"name": "SITE_FRAME", "counter": [0]})["id"]
    made = []
    for k, (content, eye) in enumerate(zip(*seen, strict=True)):
        frame = api.post(f"/missions/{mission}/frames", {"name": "ROVER_FRAME", "counter": [0, 10 * k]})["id"]
        body = {
            "label": "telemetry",
            "reference_id": landing,
            "offset_m": [eye[1], eye[0], -(eye[2] - 1.5)],
            "quaternion": list(UPRIGHT),
        }
        choose(api, frame, api.post(f"/frames/{frame}/solutions", body)["id"])
        made.append({"frame_id": frame, "upload_id": upload(api, f"stop{k}.npz", content)})
    return made


def adjusted(api: Api, mission: str, order: dict[str, Any]) -> Any:
    job = api.post(f"/missions/{mission}/traverses", order, 202)
    assert api.jobs() == 1
    job = api.get(f"/jobs/{job['id']}")
    assert job["state"] == "succeeded", job["problem"]
    return api.get(job["result_url"].removeprefix("/api/v1"))


def test_stops_are_adjusted_and_the_new_solution_moves_the_frame_once_it_is_chosen(
    api: Api, mission: Mission, seen: tuple[list[bytes], list[Any]]
) -> None:
    order = {"name": "sol 7 to 8", "stops": stops(api, mission.id, seen)}
    traverse = adjusted(api, mission.id, order)
    document = traverse["document"]
    assert document["format"] == "localization/1"
    assert [stop["name"] for stop in traverse["stops"]] == ["ROVER_FRAME 0.0", "ROVER_FRAME 0.10"]
    (leg,) = document["legs"]
    assert leg["accepted"]
    assert len(leg["pairs"]) >= 4
    assert all(set(pair) == set(leg["pairs"][0]) for pair in leg["rejected"])

    (solution,) = [api.get(f"/solutions/{i}") for i in traverse["solution_ids"]]
    assert (solution["label"], solution["in_use"]) == ("adjusted", False)
    assert solution["source"]["traverse_id"] == traverse["id"]
    before = frames(api, mission.id)["ROVER_FRAME 0.10"]["place"]
    choose(api, order["stops"][1]["frame_id"], solution["id"])
    after = frames(api, mission.id)["ROVER_FRAME 0.10"]["place"]
    moved = np.array([after[k] - before[k] for k in ("east_m", "north_m")])
    assert moved == pytest.approx(-OFF[:2], abs=0.4)
    adjusted_m, believed_m = (np.array(document["stops"][1][k]) for k in ("adjusted_m", "believed_m"))
    assert moved == pytest.approx((adjusted_m - believed_m)[:2], abs=0.05)
    spread, told = (
        np.array(m) for m in (after["covariance_m2"], document["stops"][1]["adjusted_covariance_m2"])
    )
    assert np.trace(spread[:2, :2]) == pytest.approx(np.trace(told[:2, :2]), rel=0.1)


def test_the_pictures_show_each_pair_where_its_rock_is(
    sqlite_api: Api, terrain_folder: Path, seen: tuple[list[bytes], list[Any]]
) -> None:
    api, mission = sqlite_api, yard(sqlite_api.repo, terrain_folder).id
    order = {"name": "sol 7 to 8", "stops": stops(api, mission, seen)}
    traverse = adjusted(api, mission, order)
    document = traverse["document"]
    for k, (stop, side) in enumerate(zip(document["stops"], ("first_m", "second_m"), strict=True)):
        sent = api("GET", f"/traverses/{traverse['id']}/pictures/{k}")
        image = cv2.imdecode(np.frombuffer(sent.content, np.uint8), cv2.IMREAD_GRAYSCALE)
        picture = stop["picture"]
        assert image.shape == (picture["height"], picture["width"])
        for pair in document["legs"][0]["pairs"]:
            east, north, up = np.array(pair[side]) - stop["believed_m"]
            right = (np.arctan2(east, north) - picture["left_azimuth_rad"]) % (2 * np.pi)
            down = picture["top_elevation_rad"] - np.arctan2(up, np.hypot(east, north))
            x, y = (v / picture["rad_per_px"] for v in (right, down))
            assert -2 <= x <= picture["width"] + 2
            assert -2 <= y <= picture["height"] + 2
    answer = api("GET", f"/traverses/{traverse['id']}/pictures/2")
    assert "has 2 pictures" in problem(answer, 404, "not-found")["detail"]

    assert check_files(api.repo).unnamed == []
    archive = zipfile.ZipFile(io.BytesIO(api("GET", f"/missions/{mission}/archive").content))
    assert f"files/{document['stops'][0]['picture']['sha256']}" in archive.namelist()
    copy = api.post(f"/missions/{mission}/copy", {"name": "What if"})["id"]
    assert {k: f["place"] for k, f in frames(api, copy).items()} == {
        k: f["place"] for k, f in frames(api, mission).items()
    }
    answer = api("DELETE", f"/traverses/{traverse['id']}", headers={"If-Match": "*"})
    assert answer.status_code == 204
    assert api.get(f"/solutions/{traverse['solution_ids'][0]}")["label"] == "adjusted"


def test_what_cannot_be_adjusted_says_why(
    sqlite_api: Api, terrain_folder: Path, seen: tuple[list[bytes], list[Any]]
) -> None:
    api, mission = sqlite_api, yard(sqlite_api.repo, terrain_folder).id
    listed = stops(api, mission, seen)
    url = f"/missions/{mission}/traverses"

    def order(*chosen: dict[str, Any]) -> dict[str, Any]:
        return {"name": "T", "stops": list(chosen)}

    answer = problem(api("POST", url, order(listed[0], listed[0])), 422, "invalid-input")
    assert answer["errors"][0]["pointer"] == "/stops/1/frame_id"
    answer = problem(
        api("POST", url, order(listed[0], {"frame_id": listed[1]["frame_id"]})), 422, "invalid-input"
    )
    assert "either a run_id or an upload_id" in answer["detail"]
    absent = {"frame_id": listed[1]["frame_id"], "run_id": "run-x"}
    assert (
        "no run run-x" in problem(api("POST", url, order(listed[0], absent)), 422, "invalid-input")["detail"]
    )
    swapped = [{**a, "upload_id": b["upload_id"]} for a, b in zip(listed, listed[::-1], strict=True)]
    words = {"name": "T", "stops": [listed[0], {**listed[1], "upload_id": upload(api, "x.csv", b"nothing")}]}
    for body, message in ((order(*swapped), "m from its frame; the limit is 5 m"), (words, "cannot be read")):
        job = api.post(url, body, 202)
        api.jobs()
        ended = api.get(f"/jobs/{job['id']}")
        assert ended["state"] == "failed"
        assert message in ended["problem"]["detail"]
    assert [t["document"] for t in api.get(url)["items"]] == [None, None]


def test_a_run_is_asked_for_its_panorama_by_name(
    sqlite_api: Api, sqlite_repo: Repository, terrain_folder: Path
) -> None:
    from ground.errors import InvalidInputError
    from ground.resources.traverses.adjust_traverse import _source
    from ground.resources.traverses.bodies import StopBody

    mission = yard(sqlite_repo, terrain_folder).id
    for name in ("a", "b"):
        (sqlite_repo.run_dir("run-1") / name).mkdir(parents=True)
        (sqlite_repo.run_dir("run-1") / name / "panorama.json").write_text("{}")

    class Rows:
        def get(self, _row: Any, _identifier: Any) -> Any:
            return RunRow(id="run-1", mission_id=mission)

    rows: Any = Rows()
    assert (
        _source(
            sqlite_repo, rows, PLANNER, mission, StopBody(frame_id="f", run_id="run-1", panorama="b"), ""
        )[1]
        == "b"
    )
    with pytest.raises(InvalidInputError, match="has no panorama ''; it has a, b"):
        _source(sqlite_repo, rows, PLANNER, mission, StopBody(frame_id="f", run_id="run-1"), "")
