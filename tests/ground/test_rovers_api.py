"""Rovers over REST: what may be named of them, and requests for any instrument that a rover carries."""

from __future__ import annotations

from tests.ground.conftest import Api


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
