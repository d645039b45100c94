"""Many rows at once: all of them or none, each wrong one named, one act for undo, once for each key."""

from __future__ import annotations

from typing import Any

import pytest

from ground.gdr.history import verify_chains
from ground.records import bulk
from ground.resources.missions.value import Mission
from tests.ground.conftest import Api
from tests.ground.test_missions_api import problem


def places(count: int, name: str = "R") -> list[dict[str, Any]]:
    return [{"name": f"{name}{n}", "east_m": -6.0 + 0.1 * n, "north_m": 3.0} for n in range(count)]


def targets(api: Api, mission: Mission) -> dict[str, Any]:
    return {t["name"]: t for t in api.get(f"/missions/{mission.id}/targets?limit=1000")["items"]}


def test_rows_are_one_act_that_one_undo_takes_back(api: Api, mission: Mission) -> None:
    url = f"/missions/{mission.id}/targets/bulk"
    first = api.post(url, {"create": places(40)}, status=200)
    before = targets(api, mission)
    assert [row["id"] for row in first["created"]] == [before[f"R{n}"]["id"] for n in range(40)]
    rows = {
        "delete": [{"id": before[f"R{n}"]["id"], "revision": 1} for n in range(10)],
        "update": [
            {"id": before[f"R{n}"]["id"], "revision": None, "changes": {"name": f"R{n - 10}", "notes": "x"}}
            for n in range(10, 20)  # the names of those that go
        ],
        "create": [*places(2, "New"), {"east_m": 1.0, "north_m": 1.0}],
    }
    done = api.post(url, rows, status=200)
    assert [len(done[w]) for w in ("created", "updated", "deleted")] == [3, 10, 10]
    assert {row["revision"] for row in done["updated"]} == {2}
    after = targets(api, mission)
    assert after["R3"]["id"] == before["R13"]["id"]
    assert len(after) == 33
    api.post(f"/missions/{mission.id}/undo", {}, status=200)
    back = targets(api, mission)
    assert {n: t["id"] for n, t in back.items()} == {n: t["id"] for n, t in before.items()}
    with api.repo.database.read() as session:
        assert verify_chains(session)[1] == []


def test_if_one_row_is_wrong_nothing_is_done_and_each_wrong_one_is_named(api: Api, mission: Mission) -> None:
    url = f"/missions/{mission.id}/targets"
    kept = api.post(url, {"name": "Kept", "east_m": 1.0, "north_m": 1.0})
    seq = api.get(f"/missions/{mission.id}/history?newest_first=true&limit=1")["items"][0]["seq"]
    rows = {
        "create": [
            *places(2),
            {"name": "Kept", "east_m": 2.0, "north_m": 1.0},
            {"east_m": 900, "north_m": 0},
        ],
        "update": [{"id": kept["id"], "revision": 7, "changes": {"notes": "x"}}],
        "delete": [{"id": "tgt-none", "revision": None}],
    }
    told = problem(api("POST", f"{url}/bulk", rows), 422, "invalid-input")
    assert [w["pointer"] for w in told["errors"]] == [
        "/delete/0",
        "/update/0",
        "/create/2/name",
        "/create/3/east_m",
    ]
    assert "4 of 6 rows" in told["detail"]
    assert list(targets(api, mission)) == ["Kept"]
    assert api.get(f"/missions/{mission.id}/history?newest_first=true&limit=1")["items"][0]["seq"] == seq
    malformed = {"create": [{"east_m": 1.0}, {"east_m": "x", "north_m": 1.0}]}
    told = problem(api("POST", f"{url}/bulk", malformed), 422, "invalid-input")
    assert [w["pointer"] for w in told["errors"]] == ["/create/0/north_m", "/create/1/east_m"]


def test_rows_of_another_mission_and_roles_that_may_not_are_refused(
    api: Api, mission: Mission, terrain_folder: Any
) -> None:
    from tests.ground.conftest import yard

    other = yard(api.repo, terrain_folder, "Other")
    theirs = api.post(f"/missions/{other.id}/targets", {"east_m": 1.0, "north_m": 1.0})
    rows = {"delete": [{"id": theirs["id"], "revision": 1}]}
    problem(api("POST", f"/missions/{mission.id}/targets/bulk", rows), 422, "invalid-input")
    problem(api("POST", f"/missions/{mission.id}/targets/bulk", {}, who="Viewer"), 403, "forbidden")
    problem(api("POST", "/missions/msn-none/targets/bulk", {}), 404, "not-found")


def test_a_repeat_with_its_key_gets_the_first_answer(api: Api, mission: Mission) -> None:
    url, key = f"/missions/{mission.id}/targets/bulk", {"Idempotency-Key": "k-1"}
    body = {"create": [{**p, "notes": "n" * 15_000} for p in places(100)]}  # more than 1 MiB
    first = api("POST", url, body, headers=key)
    again = api("POST", url, body, headers=key)
    assert (first.status_code, again.json()) == (200, first.json())
    assert again.headers["idempotent-replay"] == "true"
    assert len(targets(api, mission)) == 100


def test_too_many_rows_are_refused(api: Api, mission: Mission, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bulk, "MAX_ROWS", 5)
    url = f"/missions/{mission.id}/keep-outs/bulk"
    ring = {"polygon_m": [[1, 1], [2, 1], [2, 2]]}
    told = problem(api("POST", url, {"create": [ring] * 6}), 422, "invalid-input")
    assert told["detail"] == "6 rows; at most 5 are one act"
    assert len(api.post(url, {"create": [ring] * 5}, status=200)["created"]) == 5


def test_requests_of_a_mission_are_filed_and_deleted_together(api: Api, mission: Mission) -> None:
    target = api.post(f"/missions/{mission.id}/targets", {"east_m": 4.0, "north_m": 1.0})["id"]
    url = f"/missions/{mission.id}/observation-requests"
    row = {"target_id": target, "instrument": "science_camera", "value": 2.0}
    made = api.post(f"{url}/bulk", {"create": [row] * 3}, status=200)["created"]
    api(
        "PATCH",
        f"/observation-requests/{made[2]['id']}",
        {"after": [made[0]["id"]]},
        headers={"If-Match": "*"},
    )
    gone = [{"id": made[0]["id"], "revision": None}, {"id": made[1]["id"], "revision": None}]
    api.post(f"{url}/bulk", {"delete": gone}, status=200)
    (left,) = api.get(url)["items"]
    assert (left["id"], left["after"]) == (made[2]["id"], [])


def test_the_terrain_is_asked_before_the_database_is_held(
    api: Api, mission: Mission, monkeypatch: pytest.MonkeyPatch
) -> None:
    from ground.gdr.database import in_act
    from ground.resources.targets import create_target

    asked, ask = [], create_target.surfaces_at

    def note(*given: Any) -> Any:
        asked.extend([in_act()] * len(given[1]))
        return ask(*given)

    monkeypatch.setattr(create_target, "surfaces_at", note)
    api.post(f"/missions/{mission.id}/targets/bulk", {"create": places(5)}, status=200)
    assert asked == [False] * 5


def test_rows_of_one_act_that_others_rest_on_are_named_however_many_there_are(
    api: Api, mission: Mission
) -> None:
    made = api.post(f"/missions/{mission.id}/targets/bulk", {"create": places(30)}, status=200)["created"]
    order = {"instrument": "science_camera", "value": 1.0}
    api.post(f"/missions/{mission.id}/observation-requests", {**order, "target_id": made[20]["id"]})
    answer = problem(api("POST", f"/missions/{mission.id}/undo", {"event": 5}), 409, "wrong-state")
    newest = api.get(f"/missions/{mission.id}/history?newest_first=true&limit=1")["items"][0]
    assert answer["event"] == newest["seq"]
    api.post(f"/missions/{mission.id}/undo", {}, status=200)
    api.post(f"/missions/{mission.id}/undo", {}, status=200)
    assert targets(api, mission) == {}


def on_new(count: int, name: str = "N") -> list[dict[str, Any]]:
    return [{"target": place, "instrument": "science_camera", "value": 2.0} for place in places(count, name)]


def test_a_request_makes_its_target_and_one_undo_takes_both_back(api: Api, mission: Mission) -> None:
    url = f"/missions/{mission.id}/observation-requests"
    made = api.post(url, {**on_new(1)[0], "target": {"east_m": 4.0, "north_m": 1.0}})
    (target,) = targets(api, mission).values()
    assert (made["target_id"], made["target_name"]) == (target["id"], "T1")
    api.post(f"/missions/{mission.id}/undo", {}, status=200)
    assert (targets(api, mission), api.get(url)["items"]) == ({}, [])
    api.post(f"/missions/{mission.id}/redo", {}, status=200)
    assert list(targets(api, mission)) == ["T1"]
    assert [r["id"] for r in api.get(url)["items"]] == [made["id"]]


def test_a_new_target_that_cannot_be_reached_is_named_in_the_reason(api: Api, mission: Mission) -> None:
    url = f"/missions/{mission.id}/observation-requests"
    ring = {"polygon_m": [[2, -1], [6, -1], [6, 3], [2, 3]]}
    api.post(f"/missions/{mission.id}/keep-outs", ring)
    asked = {"instrument": "microscopic_imager", "value": 1.0}
    made = api.post(url, {**asked, "target": {"east_m": 4.0, "north_m": 1.0}})
    by_hand = api.post(f"/missions/{mission.id}/targets", {"name": "Same", "east_m": 4.0, "north_m": 1.0})
    other = api.post(url, {**asked, "target_id": by_hand["id"]})
    told = [r["observation_point"]["reason"] for r in (made, other)]
    assert told[0].startswith("target T1 has no observation point")
    assert told[1] == told[0].replace("T1", "Same")


def test_many_targets_with_requests_are_one_act(api: Api, mission: Mission) -> None:
    url, key = f"/missions/{mission.id}/observation-requests/bulk", {"Idempotency-Key": "k-2"}
    first = api("POST", url, {"create": on_new(40)}, headers=key)
    assert api("POST", url, {"create": on_new(40)}, headers=key).json() == first.json()
    events = api.get(f"/missions/{mission.id}/history?newest_first=true&limit=100")["items"]
    assert len([e for e in events if e["kind"] in {"target", "observation_request"}]) == 80
    there = targets(api, mission)
    requests = {r["id"]: r for r in api.get(url.replace("/bulk", "?limit=100"))["items"]}
    assert [requests[r["id"]]["target_name"] for r in first.json()["created"]] == [f"N{k}" for k in range(40)]
    one = api.post(f"/missions/{mission.id}/targets", {**places(1)[0], "name": "By hand"})
    asked = {"target_id": one["id"], "instrument": "science_camera", "value": 2.0}
    alone = api.post(url.replace("/bulk", ""), asked)
    assert alone["observation_point"] == requests[first.json()["created"][0]["id"]]["observation_point"]
    for _ in range(3):
        api.post(f"/missions/{mission.id}/undo", {}, status=200)
    assert (len(there), targets(api, mission)) == (40, {})
    with api.repo.database.read() as session:
        assert verify_chains(session)[1] == []


def test_a_row_that_cannot_be_used_keeps_all_targets_and_requests_away(api: Api, mission: Mission) -> None:
    api.post(f"/missions/{mission.id}/targets", {"name": "Kept", "east_m": 1.0, "north_m": 1.0})
    rows = on_new(8)
    rows[1]["target"]["name"] = "Kept"
    rows[3]["target"]["east_m"] = 900.0
    rows[5]["instrument"] = "laser"
    rows[6]["target"]["name"] = "N0"
    url = f"/missions/{mission.id}/observation-requests"
    told = problem(api("POST", f"{url}/bulk", {"create": rows}), 422, "invalid-input")
    assert [w["pointer"] for w in told["errors"]] == [
        "/create/1/target/name",
        "/create/3/target/east_m",
        "/create/5/instrument",
        "/create/6/target/name",
    ]
    assert "900.00" in told["errors"][1]["detail"]
    assert (list(targets(api, mission)), api.get(url)["items"]) == (["Kept"], [])


def test_a_request_is_on_one_target(api: Api, mission: Mission) -> None:
    url = f"/missions/{mission.id}/observation-requests"
    row = on_new(1)[0]
    both = problem(api("POST", url, {**row, "target_id": "tgt-none"}), 422, "invalid-input")
    none = problem(api("POST", url, {"instrument": "science_camera", "value": 1.0}), 422, "invalid-input")
    assert [both["errors"][0]["pointer"], none["errors"][0]["pointer"]] == ["/target", "/target_id"]
    problem(api("POST", f"{url}/bulk", {"create": [row]}, who="Viewer"), 403, "forbidden")
    assert targets(api, mission) == {}
