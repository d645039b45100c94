"""What differs between a mission and its copy: each edit of either side, once, and no other."""

from __future__ import annotations

from typing import Any

from ground.resources.missions.value import Mission
from tests.ground.conftest import Api
from tests.ground.test_missions_api import problem


def told(found: Any, *names: str) -> set[tuple[Any, ...]]:
    return {tuple(edit[name] for name in names) for edit in found["edits"]}


def two_targets(api: Api, mission: str) -> list[str]:
    return [
        api.post(f"/missions/{mission}/targets", {"name": n, "east_m": e, "north_m": 1.0})["id"]
        for n, e in (("Rock", 2.0), ("Vein", 4.0))
    ]


def named(api: Api, mission: str, kind: str = "targets") -> dict[str, Any]:
    return {item.get("name"): item for item in api.get(f"/missions/{mission}/{kind}")["items"]}


def patch(api: Api, path: str, **members: Any) -> Any:
    found = api("PATCH", path, members, headers={"If-Match": "*"})
    assert found.status_code == 200, found.text
    return found.json()


def remove(api: Api, path: str) -> None:
    assert api("DELETE", path, headers={"If-Match": "*"}).status_code == 204


def test_a_copy_does_not_differ_until_somebody_changes_either(api: Api, mission: Mission) -> None:
    rock, vein = two_targets(api, mission.id)
    api.post(
        f"/missions/{mission.id}/observation-requests",
        {"target_id": rock, "instrument": "science_camera", "value": 3.0},
    )
    patch(api, f"/missions/{mission.id}", drive_rules=[{"from_target_id": vein, "to_target_id": rock}])
    copy = api.post(f"/missions/{mission.id}/copy", {"name": "What if", "notes": "for the meeting"})["id"]
    same = api.get(f"/missions/{mission.id}/difference?from_id={copy}")
    assert (same["edits"], same["conflicts"]) == ([], [])
    assert (same["base_mission_id"], same["base_event"]) == (mission.id, same["event"])
    assert api.get(f"/missions/{copy}/difference?from_id={mission.id}")["conflicts"] == []


def test_each_edit_of_either_side_is_told_once_and_conflicts_are_named(api: Api, mission: Mission) -> None:
    rock, vein = two_targets(api, mission.id)
    request = api.post(
        f"/missions/{mission.id}/observation-requests",
        {"target_id": vein, "instrument": "science_camera", "value": 3.0},
    )["id"]
    copy = api.post(f"/missions/{mission.id}/copy", {"name": "What if"})["id"]
    theirs = named(api, copy)
    patch(api, f"/targets/{rock}", notes="ours")
    patch(api, f"/targets/{theirs['Rock']['id']}", notes="theirs", east_m=2.5)
    new = api.post(f"/missions/{copy}/targets", {"name": "Soil", "east_m": 0.0, "north_m": 3.0})["id"]
    asked = api.post(
        f"/missions/{copy}/observation-requests",
        {"target_id": theirs["Vein"]["id"], "instrument": "science_camera", "value": 1.0},
    )["id"]
    remove(api, f"/targets/{vein}")
    found = api.get(f"/missions/{mission.id}/difference?from_id={copy}")
    assert told(found, "side", "action", "kind", "id", "field") == {
        ("ours", "changed", "target", rock, "notes"),
        ("theirs", "changed", "target", rock, "notes"),
        ("theirs", "changed", "target", rock, "place"),
        ("theirs", "added", "target", new, ""),
        ("theirs", "added", "observation_request", asked, ""),
        ("ours", "removed", "target", vein, ""),
        ("ours", "removed", "observation_request", request, ""),
    }
    conflicts = {(c["kind"], c["resource"], c["id"], c["field"]): c for c in found["conflicts"]}
    assert set(conflicts) == {
        ("both-changed", "target", rock, "notes"),
        ("refers-to-removed", "observation_request", asked, "target_id"),
    }
    one = conflicts["both-changed", "target", rock, "notes"]
    assert (one["name"], one["base"], one["ours"], one["theirs"]) == ("Rock", "", "ours", "theirs")
    turned = api.get(f"/missions/{copy}/difference?from_id={mission.id}")
    assert len(turned["edits"]) == len(found["edits"])
    assert {c["kind"] for c in turned["conflicts"]} == {"both-changed", "refers-to-removed"}


def test_missions_without_a_common_past_and_those_one_may_not_see_are_refused(
    api: Api, mission: Mission
) -> None:
    other = api.post(f"/missions/{mission.id}/copy", {"name": "One"})["id"]
    second = api.post(f"/missions/{mission.id}/copy", {"name": "Two"})["id"]
    for pair in ((other, second), (mission.id, mission.id)):
        found = api("GET", f"/missions/{pair[0]}/difference?from_id={pair[1]}")
        problem(found, 422, "invalid-input")
    problem(api("GET", f"/missions/{mission.id}/difference?from_id=msn-none"), 404, "not-found")
