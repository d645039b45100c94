"""A copy merged back: one act, by the rules and rights of any change, or named conflicts and nothing done."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import select

from ground.gdr.history import verify_chains
from ground.resources.history.verify_rows import verify_rows
from ground.resources.missions.kind import MISSION
from ground.resources.missions.row import MissionRow
from ground.resources.missions.value import Mission
from ground.resources.tables import METADATA
from tests.ground.approving import signed_by_all, team_of
from tests.ground.conftest import Api, yard
from tests.ground.mission_merges.test_difference import named, patch, remove, two_targets
from tests.ground.planning import file_requests, finished, planned
from tests.ground.test_missions_api import problem


def merge(api: Api, into: str, other: str, status: int = 200, who: str = "Planner", **more: Any) -> Any:
    """Merge with the state of both as it is now, unless it is said."""
    seen = api.get(f"/missions/{into}/difference?from_id={other}")
    body = {"from_id": other, "event": seen["event"], "from_event": seen["from_event"], **more}
    answer = api("POST", f"/missions/{into}/mission-merges", body, who=who)
    assert answer.status_code == status, answer.text
    return answer.json()


def request_on(api: Api, mission: str, target: str, **more: Any) -> Any:
    body = {"target_id": target, "instrument": "science_camera", "value": 3.0, **more}
    return api.post(f"/missions/{mission}/observation-requests", body)


def copy_of(api: Api, mission: str) -> str:
    return str(api.post(f"/missions/{mission}/copy", {"name": "What if"})["id"])


def keys(found: Any) -> set[tuple[str, str, str]]:
    return {(c["kind"], c["id"], c["field"]) for c in found["conflicts"]}


def state(api: Api, mission: str) -> Any:
    """Return the parts of a mission but for what every change counts."""
    head = api.get(f"/missions/{mission}/history?newest_first=true&limit=1")["items"][0]["seq"]
    parts = api.get(f"/missions/{mission}/as-of/{head}")
    counted = {"revision", "modified_utc"}
    return {
        name: [{k: v for k, v in row.items() if k not in counted} for row in rows]
        for name, rows in {**parts["parts"], "mission": [parts["mission"]]}.items()
    }


def test_edits_of_both_sides_are_one_act_that_is_taken_back_whole(api: Api, mission: Mission) -> None:
    rock, _ = two_targets(api, mission.id)
    first = request_on(api, mission.id, rock)["id"]
    copy = copy_of(api, mission.id)
    theirs = named(api, copy)
    patch(api, f"/targets/{rock}", notes="dusty")
    patch(api, f"/targets/{theirs['Rock']['id']}", name="Boulder", east_m=2.5)
    remove(api, f"/targets/{theirs['Vein']['id']}")
    soil = api.post(f"/missions/{copy}/targets", {"name": "Soil", "east_m": 0.0, "north_m": 3.0})["id"]
    early = request_on(api, copy, soil, window_s=[0.0, 900.0], notes="first")["id"]
    request_on(api, copy, soil, after=[early], rationale="then this")
    api.post(f"/missions/{copy}/keep-outs", {"name": "Sand", "polygon_m": [[1, 1], [4, 1], [4, 3]]})
    api.post(f"/missions/{copy}/sols", {"number": 7, "battery_j": 1e6})
    patch(
        api,
        f"/missions/{copy}",
        rover_profile=mission.rover_profile,
        drive_rules=[{"from_target_id": soil, "to_target_id": theirs["Rock"]["id"]}],
    )
    before = state(api, mission.id)
    seen = merge(api, mission.id, copy, preview=True)
    assert (seen["joined"], seen["merge"], seen["conflicts"]) == (True, None, [])
    assert (seen["added"], seen["changed"], seen["removed"]) == (5, 2, 1)
    assert state(api, mission.id) == before

    done = merge(api, mission.id, copy)
    assert done["merge"]["event"] == done["from_event"]
    targets = named(api, mission.id)
    assert set(targets) == {"Boulder", "Soil"}
    assert (targets["Boulder"]["id"], targets["Boulder"]["notes"]) == (rock, "dusty")
    assert targets["Boulder"]["position"]["east_m"] == 2.5
    requests = api.get(f"/missions/{mission.id}/observation-requests")["items"]
    new = {r["rationale"] or r["notes"]: r for r in requests if r["id"] != first}
    assert new["then this"]["after"] == [new["first"]["id"]]
    assert new["first"]["target_id"] == targets["Soil"]["id"] != soil
    assert new["first"]["window_s"] == [0.0, 900.0]
    assert [s["number"] for s in api.get(f"/missions/{mission.id}/sols")["items"]][-1] == 7
    rules = api.get(f"/missions/{mission.id}")["drive_rules"]
    assert [{r["from_target_id"], r["to_target_id"]} for r in rules] == [{rock, targets["Soil"]["id"]}]
    events = api.get(f"/missions/{mission.id}/history?newest_first=true&limit=9")["items"]
    events = [e for e in events if e["action"] != "seal"]
    assert {e["actor"] for e in events} == {"Planner"}
    assert {e["reason"] for e in events} == {f"merged from What if ({copy}) as of event {done['from_event']}"}
    again = api.get(f"/missions/{mission.id}/difference?from_id={copy}")
    assert again["conflicts"] == []
    assert {e["side"] for e in again["edits"]} == {"ours"}

    merged = state(api, mission.id)
    api.post(f"/missions/{mission.id}/undo", {}, status=200)
    assert state(api, mission.id) == before
    api.post(f"/missions/{mission.id}/redo", {}, status=200)
    assert state(api, mission.id) == merged
    api.post(f"/missions/{mission.id}/undo", {}, status=200)
    assert merge(api, mission.id, copy)["added"] == 5
    with api.repo.database.read() as session:
        assert verify_chains(session)[1] == []
        assert verify_rows(session).faults == []


def test_conflicts_leave_all_as_it_is_until_a_side_is_taken_in_each(api: Api, mission: Mission) -> None:
    rock, vein = two_targets(api, mission.id)
    copy = copy_of(api, mission.id)
    theirs = named(api, copy)
    patch(api, f"/targets/{rock}", notes="ours")
    patch(api, f"/targets/{theirs['Rock']['id']}", notes="theirs", feature_type="float")
    asked = request_on(api, copy, theirs["Vein"]["id"])["id"]
    remove(api, f"/targets/{vein}")
    api.post(f"/missions/{mission.id}/targets", {"name": "T9", "east_m": 1.0, "north_m": 3.0})
    other = api.post(f"/missions/{copy}/targets", {"name": "T9", "east_m": 0.0, "north_m": 3.0})["id"]
    before = state(api, mission.id)
    found = merge(api, mission.id, copy)
    assert (found["joined"], found["merge"]) == (False, None)
    named_ones = {
        ("both-changed", rock, "notes"),
        ("refers-to-removed", asked, "target_id"),
        ("same-name", other, "name"),
    }
    assert keys(found) == named_ones
    assert state(api, mission.id) == before
    choices = [dict(zip(("kind", "id", "field"), key, strict=True)) for key in sorted(named_ones)]
    taken = [
        {**choice, "take": side} for choice, side in zip(choices, ("theirs", "theirs", "ours"), strict=True)
    ]
    half = merge(api, mission.id, copy, choices=taken[:2])
    assert (half["joined"], keys(half)) == (False, named_ones)
    problem(
        api(
            "POST",
            f"/missions/{mission.id}/mission-merges",
            {"from_id": copy, "preview": True, "choices": [{**taken[0], "field": "name"}]},
        ),
        422,
        "invalid-input",
    )
    done = merge(api, mission.id, copy, choices=taken)
    assert keys(done) == named_ones
    assert done["merge"] is not None
    targets = named(api, mission.id)
    assert set(targets) == {"Rock", "Vein", "T9", "T9 (2)"}
    assert (targets["Rock"]["notes"], targets["Rock"]["feature_type"]) == ("theirs", "float")
    assert targets["T9"]["position"]["east_m"] == 1.0
    assert targets["Vein"]["id"] not in {vein, theirs["Vein"]["id"]}
    requests = api.get(f"/missions/{mission.id}/observation-requests")["items"]
    assert [r["target_id"] for r in requests] == [targets["Vein"]["id"]]
    patch(api, f"/targets/{theirs['Vein']['id']}", notes="seen again")
    assert merge(api, mission.id, copy)["changed"] == 1
    assert named(api, mission.id)["Vein"]["notes"] == "seen again"


def test_a_merge_is_refused_if_either_mission_moved_on_or_nobody_says_what_was_looked_at(
    api: Api, mission: Mission
) -> None:
    rock, _ = two_targets(api, mission.id)
    copy = copy_of(api, mission.id)
    seen = api.get(f"/missions/{mission.id}/difference?from_id={copy}")
    body = {"from_id": copy, "event": seen["event"], "from_event": seen["from_event"]}
    url = f"/missions/{mission.id}/mission-merges"
    for member in ("event", "from_event"):
        left = {name: found for name, found in body.items() if name != member}
        assert problem(api("POST", url, left), 422, "invalid-input")["errors"][0]["pointer"] == f"/{member}"
    api.post(f"/missions/{copy}/targets", {"name": "Soil", "east_m": 0.0, "north_m": 3.0})
    told = problem(api("POST", url, body), 409, "wrong-state")
    assert copy in told["detail"]
    assert told["from_event"] == seen["from_event"] + 1
    patch(api, f"/targets/{rock}", notes="ours")
    now = {**body, "from_event": told["from_event"]}
    assert "the mission moved on" in problem(api("POST", url, now), 409, "wrong-state")["detail"]
    assert len(named(api, mission.id)) == 2


def test_the_rules_of_a_change_by_hand_hold_and_name_the_row(api: Api, mission: Mission) -> None:
    two_targets(api, mission.id)
    sol = api.post(f"/missions/{mission.id}/sols", {"number": 5})["id"]
    copy = copy_of(api, mission.id)
    new = api.post(f"/missions/{copy}/targets", {"name": "Soil", "east_m": 0.0, "north_m": 3.0})["id"]
    with api.repo.database.write() as session:  # ground that the mission does not have
        from ground.resources.targets.row import TargetRow

        session.get_one(TargetRow, new).east_m = 5000.0
    before = state(api, mission.id)
    found = merge(api, mission.id, copy)
    assert (found["joined"], found["merge"]) == (False, None)
    assert keys(found) == {("invalid", new, "")}
    assert not found["conflicts"][0]["choosable"]
    assert state(api, mission.id) == before
    assert api.get(f"/sols/{sol}")["number"] == 5


def test_names_that_were_swapped_and_orders_that_were_turned_come_over(api: Api, mission: Mission) -> None:
    rock, vein = two_targets(api, mission.id)
    a = request_on(api, mission.id, rock, notes="a")["id"]
    b = request_on(api, mission.id, vein, notes="b", after=[a])["id"]
    copy = copy_of(api, mission.id)
    theirs = named(api, copy)
    for target, name in (("Rock", "X"), ("Vein", "Rock"), ("Rock", "Vein")):
        patch(api, f"/targets/{theirs[target]['id']}", name=name)
    asked = {r["notes"]: r["id"] for r in api.get(f"/missions/{copy}/observation-requests")["items"]}
    patch(api, f"/observation-requests/{asked['b']}", after=[])
    patch(api, f"/observation-requests/{asked['a']}", after=[asked["b"]])
    done = merge(api, mission.id, copy)
    assert done["merge"] is not None, done
    targets = named(api, mission.id)
    assert (targets["Vein"]["id"], targets["Rock"]["id"]) == (rock, vein)
    assert api.get(f"/observation-requests/{a}")["after"] == [b]
    assert api.get(f"/observation-requests/{b}")["after"] == []


def test_two_orders_that_make_a_circle_are_named(api: Api, mission: Mission) -> None:
    rock, vein = two_targets(api, mission.id)
    a, b = (request_on(api, mission.id, t, notes=n)["id"] for t, n in ((rock, "a"), (vein, "b")))
    copy = copy_of(api, mission.id)
    asked = {r["notes"]: r["id"] for r in api.get(f"/missions/{copy}/observation-requests")["items"]}
    patch(api, f"/observation-requests/{a}", after=[b])
    patch(api, f"/observation-requests/{asked['b']}", after=[asked["a"]])
    found = merge(api, mission.id, copy, take="theirs")
    assert found["merge"] is None
    assert {c["kind"] for c in found["conflicts"]} == {"circle"}


def test_the_copy_can_be_brought_up_to_date_and_merged_later(api: Api, mission: Mission) -> None:
    rock, _ = two_targets(api, mission.id)
    copy = copy_of(api, mission.id)
    theirs = named(api, copy)
    patch(api, f"/targets/{rock}", notes="ours")
    api.post(f"/missions/{mission.id}/targets", {"name": "Soil", "east_m": 0.0, "north_m": 3.0})
    assert merge(api, copy, mission.id)["added"] == 1
    assert named(api, copy)["Rock"]["notes"] == "ours"
    patch(api, f"/targets/{named(api, copy)['Soil']['id']}", notes="soft")
    patch(api, f"/targets/{theirs['Vein']['id']}", notes="white")
    done = merge(api, mission.id, copy)
    assert (done["conflicts"], done["changed"], done["added"]) == ([], 2, 0)
    assert {n: t["notes"] for n, t in named(api, mission.id).items()} == {
        "Rock": "ours",
        "Vein": "white",
        "Soil": "soft",
    }


def test_who_may_edit_targets_alone_merges_targets_alone(api: Api, mission: Mission) -> None:
    two_targets(api, mission.id)
    copy = copy_of(api, mission.id)
    api.post(f"/missions/{copy}/targets", {"name": "Soil", "east_m": 0.0, "north_m": 3.0})
    merge(api, mission.id, copy, status=403, who="Viewer")
    assert merge(api, mission.id, copy, who="Scientist")["added"] == 1
    api.post(f"/missions/{copy}/keep-outs", {"name": "Sand", "polygon_m": [[1, 1], [4, 1], [4, 3]]})
    before = state(api, mission.id)
    merge(api, mission.id, copy, status=403, who="Scientist")
    assert state(api, mission.id) == before


def test_nothing_is_approved_by_a_merge(sqlite_api: Api, mission_of_requests: Any, tmp_path: Path) -> None:
    """A plan that was approved in a copy stays there, with its approval and signatures."""
    api, mission = sqlite_api, mission_of_requests
    copied = api.post(f"/missions/{mission.id}/copy", {"name": "What if"})
    copy = value_of_copy(api, copied["id"])
    plan = planned(api, copy)
    finished(api, api.post(f"/missions/{copy.id}/runs", {"plan_id": plan["id"], "seed": 4}, status=202))
    signed_by_all(api, plan["id"], team_of(tmp_path / "keys"))
    assert api.get(f"/plans/{plan['id']}")["state"] == "approved"
    api.post(f"/missions/{copy.id}/targets", {"name": "Soil", "east_m": 0.0, "north_m": 3.0})
    moved = {table.name for table in _of_missions()} - {"targets", "merge_bases"}
    before = {name: _rows_of(api, name, mission.id) for name in moved}
    asked = {r["id"]: r["state"] for r in api.get(f"/missions/{copy.id}/observation-requests")["items"]}
    assert set(asked.values()) != {"open"}
    done = merge(api, mission.id, copy.id)
    assert (done["added"], done["changed"], done["removed"]) == (1, 0, 0)
    assert {name: _rows_of(api, name, mission.id) for name in moved} == before
    assert api.get(f"/missions/{mission.id}/plans")["items"] == []
    assert api.get(f"/missions/{mission.id}/approvals")["items"] == []
    assert merge(api, copy.id, mission.id)["changed"] == 0
    assert api.get(f"/plans/{plan['id']}")["state"] == "approved"


def _of_missions() -> list[Any]:
    return [t for t in METADATA.sorted_tables if "mission_id" in t.c]


def _rows_of(api: Api, name: str, mission: str) -> list[Any]:
    table = METADATA.tables[name]
    with api.repo.database.read() as session:
        query = select(table).where(table.c.mission_id == mission).order_by(*table.primary_key.columns)
        return [tuple(row) for row in session.execute(query)]


def value_of_copy(api: Api, identifier: str) -> Mission:
    with api.repo.database.read() as session:
        return MISSION.show_one(session, session.get_one(MissionRow, identifier))


@pytest.fixture
def mission_of_requests(sqlite_api: Api, terrain_folder: Path) -> Mission:
    mission = yard(sqlite_api.repo, terrain_folder)
    file_requests(sqlite_api, mission)
    return mission
