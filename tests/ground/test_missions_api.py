"""Missions, targets, requests and keep-outs over REST, on both databases."""

from __future__ import annotations

import io
import struct
import threading
import zipfile
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import select

from ground.gdr.history import verify_chains
from ground.resources.missions.value import Mission
from ground.resources.targets.row import TargetRow
from tests.ground.conftest import Api

TARGET = {"name": "Rock1", "east_m": 4.0, "north_m": 1.0}


def problem(response: Any, status: int, kind: str) -> dict[str, Any]:
    assert response.status_code == status, response.text
    assert response.headers["content-type"] == "application/problem+json"
    document: dict[str, Any] = response.json()
    assert document["type"] == f"urn:outcrop:problem:{kind}"
    return document


def test_a_target_gets_height_normal_and_covariance_from_the_terrain(api: Api, mission: Mission) -> None:
    target = api.post(f"/missions/{mission.id}/targets", TARGET)
    assert target["position"]["up_m"] == pytest.approx(0.12, abs=0.03)
    assert sum(c * c for c in target["normal"]) == pytest.approx(1.0)
    along = target["covariance_m2"]
    # Across the view sigma is R sigma_px / f, along it R^2 sigma_d / (f B), so east is worst.
    assert along[0][0] > along[1][1] > 0
    assert api.get(f"/targets/{target['id']}") == target


def test_targets_without_a_name_are_numbered(api: Api, mission: Mission) -> None:
    names = [
        api.post(f"/missions/{mission.id}/targets", {"east_m": 1.0 + k, "north_m": 1.0})["name"]
        for k in range(3)
    ]
    assert names == ["T1", "T2", "T3"]


def test_a_target_off_the_terrain_is_refused_with_the_extent(api: Api, mission: Mission) -> None:
    answer = api("POST", f"/missions/{mission.id}/targets", {"east_m": 400.0, "north_m": 0.0})
    document = problem(answer, 422, "outside-terrain")
    assert "(400.00, 0.00) lies outside the terrain" in document["detail"]
    assert document["errors"][0]["pointer"] == "/east_m"


def test_an_unknown_mission_is_named(api: Api) -> None:
    for path in ("/missions/nowhere", "/missions/nowhere/targets", "/missions/nowhere/terrain"):
        assert "there is no mission nowhere" in problem(api("GET", path), 404, "not-found")["detail"]


def test_malformed_json_says_where(api: Api, mission: Mission) -> None:
    answer = api(
        "POST",
        f"/missions/{mission.id}/targets",
        content=b'{"east_m": 1,',
        headers={"content-type": "application/json"},
    )
    assert "not JSON" in problem(answer, 400, "malformed-json")["detail"]


def test_unknown_and_wrong_members_are_pointed_at(api: Api, mission: Mission) -> None:
    answer = api("POST", f"/missions/{mission.id}/targets", {"east_m": "1", "north_m": 2.0, "colour": "red"})
    pointers = {e["pointer"] for e in problem(answer, 422, "invalid-input")["errors"]}
    assert pointers == {"/east_m", "/colour"}


def test_two_targets_cannot_have_one_name(api: Api, mission: Mission) -> None:
    api.post(f"/missions/{mission.id}/targets", TARGET)
    answer = api("POST", f"/missions/{mission.id}/targets", {**TARGET, "east_m": 2.0})
    assert problem(answer, 409, "name-taken")["errors"][0]["pointer"] == "/name"


def test_a_request_gets_an_observation_point_from_which_the_arm_reaches(api: Api, mission: Mission) -> None:
    target = api.post(f"/missions/{mission.id}/targets", TARGET)
    request = api.post(
        f"/missions/{mission.id}/observation-requests",
        {"target_id": target["id"], "instrument": "microscopic_imager", "value": 10.0},
    )
    assert request["tracked"] is True
    assert request["state"] == "open"
    point = request["observation_point"]
    assert point["reachable"], point["reason"]
    distance = ((point["pose"]["east_m"] - 4.0) ** 2 + (point["pose"]["north_m"] - 1.0) ** 2) ** 0.5
    assert 0.3 < distance < 1.7


def test_a_request_without_a_reachable_observation_point_says_why(api: Api, mission: Mission) -> None:
    api.post(
        f"/missions/{mission.id}/keep-outs", {"polygon_m": [[1.0, -2.0], [7.0, -2.0], [7.0, 4.0], [1.0, 4.0]]}
    )
    target = api.post(f"/missions/{mission.id}/targets", TARGET)
    request = api.post(
        f"/missions/{mission.id}/observation-requests",
        {"target_id": target["id"], "instrument": "microscopic_imager", "value": 10.0},
    )
    assert request["observation_point"]["reachable"] is False
    assert "Rock1" in request["observation_point"]["reason"]


def test_precedence_cannot_go_in_a_circle(api: Api, mission: Mission) -> None:
    target = api.post(f"/missions/{mission.id}/targets", TARGET)
    order = {"target_id": target["id"], "instrument": "science_camera", "value": 1.0}
    first = api.post(f"/missions/{mission.id}/observation-requests", order)
    second = api.post(f"/missions/{mission.id}/observation-requests", {**order, "after": [first["id"]]})
    answer = api(
        "PATCH", f"/observation-requests/{first['id']}", {"after": [second["id"]]}, headers={"If-Match": "*"}
    )
    assert "before itself" in problem(answer, 422, "invalid-input")["detail"]


def test_a_keep_out_that_crosses_itself_is_refused(api: Api, mission: Mission) -> None:
    bow = {"polygon_m": [[0, 0], [2, 2], [2, 0], [0, 2]]}
    assert (
        "crosses itself"
        in problem(api("POST", f"/missions/{mission.id}/keep-outs", bow), 422, "invalid-input")["detail"]
    )


def test_a_change_needs_the_etag_that_was_read(api: Api, mission: Mission) -> None:
    target = api.post(f"/missions/{mission.id}/targets", TARGET)
    url = f"/targets/{target['id']}"
    assert api("GET", url).headers["etag"].startswith('"1-')
    problem(api("PATCH", url, {"notes": "x"}), 428, "precondition-required")
    changed = api("PATCH", url, {"notes": "x"}, headers={"If-Match": '"1"'})
    assert changed.headers["etag"].startswith('"2-')
    late = problem(api("PATCH", url, {"notes": "y"}, headers={"If-Match": '"1"'}), 412, "stale-revision")
    assert late["current"]["notes"] == "x"
    problem(api("DELETE", url, headers={"If-Match": '"1"'}), 412, "stale-revision")
    problem(api("PATCH", url, {"notes": None}, headers={"If-Match": '"2"'}), 422, "invalid-input")
    problem(api("PATCH", url, {"notes": "y"}, headers={"If-Match": 'W/"2"'}), 422, "invalid-input")


def test_twenty_people_editing_one_mission_lose_no_update(api: Api, mission: Mission) -> None:
    target = api.post(f"/missions/{mission.id}/targets", TARGET)
    url, wins, conflicts = f"/targets/{target['id']}", [], []

    def edit(person: int) -> None:
        for attempt in range(2):
            read = api("GET", url)
            notes = f"{read.json()['notes']} {person}.{attempt}"
            answer = api("PATCH", url, {"notes": notes}, headers={"If-Match": read.headers["etag"]})
            (wins if answer.status_code == 200 else conflicts).append(
                (answer.status_code, f"{person}.{attempt}")
            )

    threads = [threading.Thread(target=edit, args=(k,)) for k in range(20)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    final = api.get(url)
    assert len(wins) + len(conflicts) == 40
    assert {status for status, _ in conflicts} <= {412}
    assert sorted(final["notes"].split()) == sorted(word for _, word in wins)
    assert final["revision"] == 1 + len(wins)
    with api.repo.database.read() as session:
        assert verify_chains(session)[1] == []


def test_pages_go_on_where_the_last_one_ended(api: Api, mission: Mission) -> None:
    made = [
        api.post(f"/missions/{mission.id}/targets", {"east_m": 1.0 + 0.1 * k, "north_m": 0.0})["id"]
        for k in range(7)
    ]
    found: list[str] = []
    cursor = ""
    while True:
        page = api.get(f"/missions/{mission.id}/targets?limit=3{cursor}")
        found += [t["id"] for t in page["items"]]
        if page["next_cursor"] is None:
            break
        cursor = f"&cursor={page['next_cursor']}"
    assert found == made
    problem(api("GET", f"/missions/{mission.id}/targets?cursor=abc"), 422, "invalid-input")


def test_undo_brings_a_deleted_target_back_with_its_requests(api: Api, mission: Mission) -> None:
    target = api.post(f"/missions/{mission.id}/targets", TARGET)
    order = {"target_id": target["id"], "instrument": "science_camera", "value": 1.0}
    request = api.post(f"/missions/{mission.id}/observation-requests", order)
    assert api("DELETE", f"/targets/{target['id']}", headers={"If-Match": "*"}).status_code == 204
    problem(api("GET", f"/observation-requests/{request['id']}"), 404, "not-found")
    undone = api.post(f"/missions/{mission.id}/undo", {}, status=200)
    assert {e["subject_id"] for e in undone} == {target["id"], request["id"]}
    assert api.get(f"/targets/{target['id']}")["name"] == "Rock1"
    assert api.get(f"/observation-requests/{request['id']}")["value"] == 1.0
    api.post(f"/missions/{mission.id}/redo", {}, status=200)
    problem(api("GET", f"/targets/{target['id']}"), 404, "not-found")
    api.post(f"/missions/{mission.id}/undo", {}, status=200)
    assert api.get(f"/targets/{target['id']}")["name"] == "Rock1"


def test_undo_is_per_person_and_steps_back_change_by_change(api: Api, mission: Mission) -> None:
    target = api.post(f"/missions/{mission.id}/targets", TARGET)
    url = f"/targets/{target['id']}"
    for notes in ("one", "two"):
        api("PATCH", url, {"notes": notes}, headers={"If-Match": "*"})
    other = api.post(f"/missions/{mission.id}/targets", {"east_m": 0.0, "north_m": 3.0}, who="Scientist")
    seen = []
    for _ in range(2):
        api.post(f"/missions/{mission.id}/undo", {}, status=200)
        seen.append(api.get(url)["notes"])
    assert seen == ["one", ""]
    api.post(f"/missions/{mission.id}/redo", {}, status=200)
    assert api.get(url)["notes"] == "one"
    assert api.get(f"/targets/{other['id']}")
    problem(api("POST", f"/missions/{mission.id}/undo", {}, who="Operator"), 409, "wrong-state")


def test_undo_refuses_what_somebody_else_changed_since(api: Api, mission: Mission) -> None:
    target = api.post(f"/missions/{mission.id}/targets", TARGET)
    api("PATCH", f"/targets/{target['id']}", {"notes": "mine"}, headers={"If-Match": "*"})
    api("PATCH", f"/targets/{target['id']}", {"notes": "theirs"}, headers={"If-Match": "*"}, who="Scientist")
    answer = api("POST", f"/missions/{mission.id}/undo", {})
    refused = problem(answer, 409, "wrong-state")
    newest = api.get(f"/missions/{mission.id}/history?newest_first=true&limit=1")["items"][0]
    assert refused["event"] == newest["seq"]
    assert f"{target['id']} by Scientist) rests on it" in refused["detail"]


def test_the_history_is_complete_and_shows_any_tampering(api: Api, mission: Mission) -> None:
    target = api.post(f"/missions/{mission.id}/targets", TARGET)
    api("PATCH", f"/targets/{target['id']}", {"notes": "x"}, headers={"If-Match": "*"})
    history = api.get(f"/missions/{mission.id}/history")["items"]
    assert [e["seq"] for e in history] == list(range(1, len(history) + 1))
    assert [(e["kind"], e["action"]) for e in history[-2:]] == [("target", "create"), ("target", "change")]
    assert history[-1]["before"]["notes"] == ""
    from ground.gdr.history import ChainRow, EventRow

    with api.repo.database.write() as session:
        assert verify_chains(session)[1] == []
        row = session.get_one(EventRow, (mission.id, 2))
        row.actor = "Somebody"
    with api.repo.database.write() as session:
        assert [f.seq for f in verify_chains(session)[1]] == [2]
        row = session.get_one(EventRow, (mission.id, 2))
        row.actor = "Planner"
        session.delete(session.get_one(EventRow, (mission.id, len(history))))
    with api.repo.database.write() as session:
        faults = verify_chains(session)[1]
        assert "the head is at event" in faults[0].reason
        session.get_one(ChainRow, mission.id).seq -= 1
    with api.repo.database.read() as session:
        assert verify_chains(session)[1] != []


def test_a_copy_of_a_mission_is_a_what_if_of_its_own(api: Api, mission: Mission) -> None:
    target = api.post(f"/missions/{mission.id}/targets", TARGET)
    order = {"target_id": target["id"], "instrument": "science_camera", "value": 1.0}
    first = api.post(f"/missions/{mission.id}/observation-requests", order)
    api.post(f"/missions/{mission.id}/observation-requests", {**order, "after": [first["id"]]})
    copy = api.post(f"/missions/{mission.id}/copy", {"name": "What if"})
    assert copy["copied_from"] == mission.id
    assert copy["counts"]["observation_requests"] == 2
    requests = api.get(f"/missions/{copy['id']}/observation-requests")["items"]
    assert requests[1]["after"] == [requests[0]["id"]]
    api("DELETE", f"/targets/{requests[0]['target_id']}", headers={"If-Match": "*"})
    assert api.get(f"/missions/{mission.id}")["counts"]["targets"] == 1


def test_heights_come_as_binary_thinned_to_what_was_asked_for(api: Api, mission: Mission) -> None:
    whole = api("GET", f"/missions/{mission.id}/terrain/heights?max_posts=200000")
    rows, columns = (int(n) for n in whole.headers["x-outcrop-shape"].split(","))
    assert (rows, columns) == (320, 320)
    assert len(whole.content) == rows * columns * 4
    west, _, _, north = (float(b) for b in whole.headers["x-outcrop-bounds"].split(","))
    point = api.get(f"/missions/{mission.id}/terrain/point?east_m={west}&north_m={north}")
    assert struct.unpack_from("<f", whole.content)[0] == pytest.approx(point["up_m"], abs=1e-3)
    thin = api("GET", f"/missions/{mission.id}/terrain/heights?max_posts=1000")
    assert len(thin.content) // 4 <= 1000
    problem(api("GET", f"/missions/{mission.id}/terrain/heights?layer=outer"), 404, "not-found")


def test_the_ortho_image_is_sent_and_made_small(api: Api, mission: Mission) -> None:
    from PIL import Image

    for query, size in (("", 320), ("?max_px=100", 64)):
        answer = api("GET", f"/missions/{mission.id}/terrain/ortho{query}")
        assert answer.status_code == 200
        assert Image.open(io.BytesIO(answer.content)).size == (size, size)


def upload(api: Api, name: str, content: bytes, who: str | None = None) -> str:
    answer = api("POST", f"/uploads?file_name={name}", content=content, who=who)
    assert answer.status_code == 201, answer.text
    identifier: str = answer.json()["id"]
    return identifier


def test_a_mission_stands_on_an_uploaded_terrain_folder(api: Api, terrain_folder: Path) -> None:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for file in terrain_folder.iterdir():
            archive.write(file, f"yard/{file.name}")
    order = {
        "name": "Uploaded",
        "terrain": {"source": "uploaded", "upload_id": upload(api, "yard.zip", out.getvalue())},
    }
    made = api.post("/missions", order)
    assert api.get(f"/missions/{made['id']}/terrain")["layers"][0]["rows"] == 320
    assert len(api.get(f"/missions/{made['id']}/sols")["items"]) == 1


def test_a_dem_without_georeference_is_refused(api: Api, tmp_path: Path) -> None:
    import numpy as np
    import rasterio
    from rasterio.errors import NotGeoreferencedWarning

    path = tmp_path / "plain.tif"
    with (
        pytest.warns(NotGeoreferencedWarning),
        rasterio.open(path, "w", driver="GTiff", height=8, width=8, count=1, dtype="float32") as dataset,
    ):
        dataset.write(np.zeros((8, 8), np.float32), 1)
    order = {
        "name": "Plain",
        "terrain": {"source": "uploaded", "upload_id": upload(api, "plain.tif", path.read_bytes())},
    }
    document = problem(api("POST", "/missions", order), 422, "terrain-unusable")
    assert "has no georeference" in document["detail"]
    assert str(tmp_path) not in document["detail"]


def test_a_mission_can_be_generated(sqlite_api: Api) -> None:
    made = sqlite_api.post(
        "/missions", {"name": "Made", "terrain": {"source": "generated", "seed": 3, "size_m": 48.0}}
    )
    assert sqlite_api.get(f"/missions/{made['id']}/terrain")["bounds_m"]["east_max_m"] == pytest.approx(
        24.0, abs=0.5
    )


def test_writes_are_committed_when_they_are_answered(api: Api, mission: Mission) -> None:
    made = api.post(f"/missions/{mission.id}/targets", TARGET)
    with api.repo.database.read() as session:
        assert session.scalars(select(TargetRow.id)).all() == [made["id"]]
