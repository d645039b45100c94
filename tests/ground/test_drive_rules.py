"""Drives that people forbid or draw, from the interface to the path network."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from ground.resources.missions.value import Mission
from tests.ground.conftest import Api, yard
from tests.ground.test_missions_api import problem


@pytest.fixture
def site(sqlite_api: Api, terrain_folder: Path) -> Mission:
    return yard(sqlite_api.repo, terrain_folder)


@pytest.fixture
def targets(sqlite_api: Api, site: Mission) -> list[str]:
    """Two targets, west and north-east, each with a request for an image."""
    found = []
    for name, east, north in (("West", -6.0, 0.0), ("East", 5.0, 4.0)):
        target = sqlite_api.post(
            f"/missions/{site.id}/targets", {"name": name, "east_m": east, "north_m": north}
        )
        body = {"target_id": target["id"], "instrument": "science_camera", "value": 3.0, "tracked": False}
        sqlite_api.post(f"/missions/{site.id}/observation-requests", body)
        found.append(target["id"])
    return found


def _rule(api: Api, mission: str, *rules: dict[str, Any]) -> Any:
    return api("PATCH", f"/missions/{mission}", {"drive_rules": list(rules)}, headers={"If-Match": "*"})


def _network(api: Api, mission: str) -> dict[str, Any]:
    job = api.post(f"/missions/{mission}/path-networks", {}, status=202)
    api.jobs()
    found: dict[str, Any] = api.get(f"/path-networks/{job['subject_id']}")
    return found


def _drives(network: dict[str, Any]) -> dict[tuple[str | None, str | None], list[list[float]]]:
    """Return the drives of a network between targets (None: the start), as drawn."""
    of = {node["id"]: node["target_id"] for node in network["nodes"]}
    return {(of[s["start"]], of[s["end"]]): s["points_m"] for s in network["segments"]}


def test_a_forbidden_drive_is_gone_and_comes_back_with_the_rule(
    sqlite_api: Api, site: Mission, targets: list[str]
) -> None:
    west, east = targets
    free = _drives(_network(sqlite_api, site.id))
    assert {(west, east), (east, west), (None, west), (None, east)} <= set(free)
    mission = _rule(sqlite_api, site.id, {"from_target_id": west, "to_target_id": east}).json()
    assert mission["drive_rules"] == [{"from_target_id": west, "to_target_id": east, "via_m": None}]
    ruled = _drives(_network(sqlite_api, site.id))
    assert set(free) - set(ruled) == {(west, east), (east, west)}
    _rule(sqlite_api, site.id)
    assert _drives(_network(sqlite_api, site.id)) == free


def test_a_drawn_way_is_in_the_network_and_makes_plans_stale(
    sqlite_api: Api, site: Mission, targets: list[str]
) -> None:
    network = _network(sqlite_api, site.id)
    assert not sqlite_api.get(f"/path-networks/{network['id']}")["stale"]
    via = [[1.0, 4.5], [3.0, 5.5]]
    _rule(sqlite_api, site.id, {"from_target_id": None, "to_target_id": targets[1], "via_m": via})
    assert sqlite_api.get(f"/path-networks/{network['id']}")["stale"]
    drives = _drives(_network(sqlite_api, site.id))
    assert drives[None, targets[1]][1:-1] == via
    assert drives[targets[1], None][1:-1] == via[::-1] if (targets[1], None) in drives else True


@pytest.mark.parametrize(
    ("rules", "words"),
    [
        ([{"from_target_id": None, "to_target_id": "tgt-nowhere"}], "there is no target tgt-nowhere"),
        ([{"from_target_id": "WEST", "to_target_id": "WEST"}], "from one place to another"),
        (
            [
                {"from_target_id": "WEST", "to_target_id": "EAST"},
                {"from_target_id": "EAST", "to_target_id": "WEST", "via_m": []},
            ],
            "a rule for this drive already",
        ),
    ],
)
def test_a_rule_that_makes_no_sense_is_refused(
    sqlite_api: Api, site: Mission, targets: list[str], rules: list[dict[str, Any]], words: str
) -> None:
    ids = {"WEST": targets[0], "EAST": targets[1]}
    named = [{k: ids.get(x, x) if isinstance(x, str) else x for k, x in rule.items()} for rule in rules]
    document = problem(_rule(sqlite_api, site.id, *named), 422, "invalid-input")
    assert words in document["detail"]
    assert document["errors"][0]["pointer"].startswith("/drive_rules/")


def test_rules_go_with_their_targets_come_back_with_them_and_are_copied(
    sqlite_api: Api, site: Mission, targets: list[str]
) -> None:
    west, east = targets
    rules = [
        {"from_target_id": west, "to_target_id": east, "via_m": None},
        {"from_target_id": None, "to_target_id": east, "via_m": [[1.0, 4.5]]},
    ]
    _rule(sqlite_api, site.id, *rules)
    copy = sqlite_api.post(f"/missions/{site.id}/copy", {"name": "Copy"})
    names = {t["id"]: t["name"] for t in sqlite_api.get(f"/missions/{copy['id']}/targets")["items"]}
    assert [
        (names.get(r["from_target_id"]), names[r["to_target_id"]], r["via_m"]) for r in copy["drive_rules"]
    ] == [("West", "East", None), (None, "East", [[1.0, 4.5]])]
    sqlite_api("DELETE", f"/targets/{west}", headers={"If-Match": "*"})
    assert sqlite_api.get(f"/missions/{site.id}")["drive_rules"] == rules[1:]
    sqlite_api("POST", f"/missions/{site.id}/undo", {"anyone": True})
    assert sqlite_api.get(f"/missions/{site.id}")["drive_rules"] == rules
