"""Rovers over REST: what may be named of them, and requests for any instrument that a rover carries."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

from ground.resources.missions.value import Mission
from mission.plugins import Registry
from rover_iface import profiles
from rover_iface.profile import load as profile_load
from rover_iface.profile import load_profile
from tests.ground.conftest import Api, yard
from tests.ground.test_missions_api import problem


@pytest.fixture
def site(sqlite_api: Api, terrain_folder: Path) -> Mission:
    return yard(sqlite_api.repo, terrain_folder)


def test_a_rover_tells_its_instruments_actions_and_keys(sqlite_api: Api) -> None:
    rover = sqlite_api.get("/rovers/k9")
    instruments = {i["name"]: i for i in rover["instruments"]}
    imager = instruments["microscopic_imager"]
    assert (imager["profile_name"], imager["use"], imager["tracked"]) == ("mi", "contact", True)
    assert imager["action"] == "ipplaceinstrument"
    assert imager["time_s"] == {"mean": 504.0, "sd": 120.0}
    assert imager["data_mbit"] == 96.0
    assert instruments["science_camera"]["standoff_m"] == 2.0
    actions = {a["name"]: a for a in rover["actions"]}
    assert actions["navigate"]["one_of"] == [["target"], ["x", "y"]]
    assert actions["ipplaceinstrument"]["instrument"] == "instrument"
    modes = {p["name"]: p for p in actions["navigate"]["parameters"]}["mode"]
    assert modes["choices"] == ["blind", "avoid", "track"]
    keys = {t["key"]: t for t in rover["telemetry"]}
    assert keys["trackerstate"]["arguments"] == 1
    kinds = {c["kind"]: c for c in rover["constraints"]}
    assert {"window", "sun_elevation", "tracked", "must_do", "after"} <= set(kinds)
    assert "at_least_rad" in kinds["sun_elevation"]["form"]["properties"]


def test_rovers_are_listed_and_an_unknown_one_is_not_found(sqlite_api: Api) -> None:
    listed = {r["name"]: r for r in sqlite_api.get("/rovers")["items"]}
    assert {"microscopic_imager", "science_camera"} <= set(listed["k9"]["instruments"])
    assert listed["mer"]["problem"] == ""
    answer = sqlite_api("GET", "/rovers/curiosity")
    assert answer.status_code == 404
    assert "there are k9, mer" in answer.json()["detail"]


def _request(api: Api, mission: Mission, **members: object) -> dict[str, Any]:
    target = api.post(f"/missions/{mission.id}/targets", {"east_m": 4.0, "north_m": 1.0})
    body = {"target_id": target["id"], "instrument": "science_camera", "value": 3.0, **members}
    made: dict[str, Any] = api.post(f"/missions/{mission.id}/observation-requests", body)
    return made


def test_an_instrument_is_taken_by_either_name_and_told_by_one(sqlite_api: Api, site: Mission) -> None:
    request = _request(sqlite_api, site, instrument="mi")
    assert request["instrument"] == "microscopic_imager"
    assert request["tracked"] is True
    changed = sqlite_api(
        "PATCH",
        f"/observation-requests/{request['id']}",
        {"instrument": "scicam"},
        headers={"If-Match": "*"},
    )
    assert changed.json()["instrument"] == "science_camera"


def test_an_instrument_that_the_rover_lacks_is_refused_with_the_known_ones(
    sqlite_api: Api, site: Mission
) -> None:
    target = sqlite_api.post(f"/missions/{site.id}/targets", {"east_m": 4.0, "north_m": 1.0})
    body = {"target_id": target["id"], "instrument": "apxs", "value": 3.0}
    answer = sqlite_api("POST", f"/missions/{site.id}/observation-requests", body)
    found = problem(answer, 422, "invalid-input")
    assert found["errors"][0]["pointer"] == "/instrument"
    assert 'has no instrument "apxs"; it carries microscopic_imager, science_camera' in found["detail"]


def test_a_request_carries_constraints_of_any_known_kind(sqlite_api: Api, site: Mission) -> None:
    high = {"kind": "sun_elevation", "at_least_rad": 0.35}
    request = _request(sqlite_api, site, constraints=[high])
    whole = {**high, "at_most_rad": math.pi / 2}
    assert request["constraints"] == [whole]
    listed = sqlite_api.get(f"/missions/{site.id}/observation-requests")["items"]
    assert listed[0]["constraints"] == [whole]
    changed = sqlite_api(
        "PATCH", f"/observation-requests/{request['id']}", {"constraints": []}, headers={"If-Match": "*"}
    )
    assert changed.json()["constraints"] == []


@pytest.mark.parametrize(
    ("constraint", "words"),
    [
        ({"kind": "full_moon"}, 'unknown constraint "full_moon"; known are after, must_do'),
        ({"kind": "sun_elevation", "at_least_rad": "high"}, "at_least_rad"),
        ({"kind": "sun_elevation", "at_least_rad": 1.0, "at_most_rad": 0.5}, "at least 57.2958 degrees high"),
        ({"kind": "tracked"}, "for which a request has the member tracked"),
    ],
)
def test_a_constraint_that_cannot_be_read_is_named(
    sqlite_api: Api, site: Mission, constraint: dict[str, object], words: str
) -> None:
    target = sqlite_api.post(f"/missions/{site.id}/targets", {"east_m": 4.0, "north_m": 1.0})
    body = {"target_id": target["id"], "instrument": "scicam", "value": 3.0, "constraints": [constraint]}
    answer = sqlite_api("POST", f"/missions/{site.id}/observation-requests", body)
    assert words in problem(answer, 422, "invalid-input")["detail"]


def test_requests_are_told_of_another_rover_and_none_is_lost(
    sqlite_api: Api, site: Mission, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A rover without the imager takes over and gives the mission back."""
    bare = (profiles.FOLDER / "k9.toml").read_text().replace("[instruments.mi]", "[instruments.apxs]")
    (tmp_path / "bare.toml").write_text(bare.replace('"microscopic_imager"', '"x_ray"'))
    monkeypatch.setattr(profiles, "FOLDER", tmp_path)
    known = Registry("rover profile", "outcrop.profiles", {n: f"rover_iface.profiles:{n}" for n in ("bare",)})
    whole = load_profile("k9")
    monkeypatch.setattr(profile_load, "_NAMED", known)
    assert whole.name == "k9"
    request = _request(sqlite_api, site, instrument="microscopic_imager")
    api = sqlite_api
    mission = f"/missions/{site.id}"
    api("PATCH", mission, {"rover_profile": "bare"}, headers={"If-Match": "*"})
    told = api.get(f"/observation-requests/{request['id']}")
    assert told["state"] == "open"
    assert 'has no instrument "microscopic_imager"; it carries science_camera, x_ray' in told["state_reason"]
    answer = api("POST", f"{mission}/plans", {})
    assert answer.status_code == 409
    refused = answer.json()["detail"]
    assert request["id"] in refused
    assert "it carries science_camera, x_ray" in refused
    api("PATCH", mission, {"rover_profile": "k9"}, headers={"If-Match": "*"})
    assert api.get(f"/observation-requests/{request['id']}")["state_reason"] == ""


def test_a_package_that_cannot_be_imported_is_listed_with_its_error(
    sqlite_api: Api, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = {"k9": "rover_iface.profiles:k9", "ghost": "no_such_package:PROFILE"}
    monkeypatch.setattr(profile_load, "_NAMED", Registry("rover profile", "outcrop.profiles", names))
    listed = {r["name"]: r["problem"] for r in sqlite_api.get("/rovers")["items"]}
    assert listed["k9"] == ""
    assert "no_such_package:PROFILE) cannot be loaded: ModuleNotFoundError" in listed["ghost"]
    words = problem(sqlite_api("GET", "/rovers/ghost"), 422, "invalid-input")["detail"]
    assert "others are k9" in words
