"""Lists: narrowed, sorted, counted, paged without a gap; what nobody knows is refused by its name."""

from __future__ import annotations

import base64
import json
import random
from typing import Any

import pytest

from ground.app.api import build_api
from ground.records.scalars import narrowing, sortable
from ground.resources.kinds import KINDS
from ground.resources.missions.value import Mission
from tests.ground.conftest import Api
from tests.ground.test_missions_api import problem


@pytest.fixture
def rocks(api: Api, mission: Mission) -> str:
    rng = random.Random(7)
    url = f"/missions/{mission.id}/targets"
    for number in range(23):
        place = {"east_m": rng.uniform(-8, 8), "north_m": rng.uniform(-8, 8)}
        kind = rng.choice(["float", "vein", ""])
        api.post(url, {"name": f"R{rng.randrange(10**6)}-{number}", "feature_type": kind, **place})
    return url


def paged(api: Api, url: str, **asked: Any) -> list[Any]:
    found: list[Any] = []
    while True:
        page = api.get(url, params=asked)
        found += page["items"]
        if page["next_cursor"] is None:
            return found
        asked["cursor"] = page["next_cursor"]


def test_pages_of_a_sorted_list_have_each_once_in_order(api: Api, rocks: str) -> None:
    every = sorted(item["id"] for item in paged(api, rocks))
    for name in ("name", "feature_type", "created_utc", "slope_rad", "frame_id", "id"):
        for sign in ("", "-"):
            found = paged(api, rocks, sort=sign + name, limit=4)
            assert sorted(item["id"] for item in found) == every
            values = [item[name] for item in found]
            if name == "frame_id":  # nobody has one: the ids alone tell them apart
                assert [item["id"] for item in found] == every
            elif api.repo.database.is_sqlite or name not in {"name", "feature_type"}:
                assert values == sorted(values, reverse=bool(sign))  # texts: as the database sorts


def test_what_has_no_value_comes_last_both_ways(api: Api, mission: Mission) -> None:
    url = f"/missions/{mission.id}/frames"
    api.post(url, {"name": "SITE_FRAME", "counter": [1]})
    for drive in (3, 1, 2):
        api.post(url, {"name": "ROVER_FRAME", "counter": [1, drive]})
    for sign, wanted in (("", [1, 2, 3, None]), ("-", [3, 2, 1, None])):
        assert [f["drive"] for f in paged(api, url, sort=f"{sign}drive", limit=1)] == wanted


def test_a_list_is_narrowed_by_any_plain_member_and_counted(api: Api, rocks: str) -> None:
    every = paged(api, rocks)
    for kind in ("float", "vein", ""):
        wanted = [item["id"] for item in every if item["feature_type"] == kind]
        page = api.get(rocks, params={"feature_type": kind, "count": True, "limit": 2})
        assert (page["total"], len(page["items"])) == (len(wanted), 2)
        assert [item["id"] for item in paged(api, rocks, feature_type=kind, limit=3)] == wanted
    assert api.get(rocks, params={"name": every[5]["name"]})["items"] == [every[5]]
    assert api.get(rocks)["total"] is None
    assert api.get(rocks, params={"author": "Nobody", "count": True}) == {
        "items": [],
        "next_cursor": None,
        "total": 0,
    }


def test_what_is_not_known_is_refused_by_its_name(api: Api, rocks: str) -> None:
    told = problem(api("GET", f"{rocks}?feature=vein"), 422, "invalid-input")
    assert told["errors"][0]["pointer"] == "feature"
    assert "feature_type" in told["detail"]
    told = problem(api("GET", f"{rocks}?sort=covariance_m2"), 422, "invalid-input")
    assert (told["errors"][0]["pointer"], "slope_rad" in told["detail"]) == ("sort", True)
    problem(api("GET", f"{rocks}?sort=--name"), 422, "invalid-input")
    mission = rocks.split("/")[2]
    assert "takes none" in problem(api("GET", f"/missions/{mission}?x=1"), 422, "invalid-input")["detail"]
    problem(api("POST", f"{rocks}?dry=1", {"east_m": 1.0, "north_m": 1.0}), 422, "invalid-input")
    problem(api("GET", f"/missions/{mission}/jobs?state=idle"), 422, "invalid-input")


def cursor(*parts: object) -> str:
    return base64.urlsafe_b64encode(json.dumps(parts).encode()).decode().rstrip("=")


STRANGE = [
    ("", "!!"),
    ("", cursor("", None)),
    ("", cursor("name", "x", "tgt-1")),
    ("", cursor("", None, "a b")),
    ("", cursor("", None, "x'--")),
    ("name", cursor("name", 3, "tgt-1")),
    ("name", cursor("name", "\ud800", "tgt-1")),
    ("name", cursor("name", "a\x00", "tgt-1")),
    ("name", cursor("name", ["a"], "tgt-1")),
    ("name", cursor("-name", "a", "tgt-1")),
    ("slope_rad", cursor("slope_rad", "much", "tgt-1")),
    ("created_utc", cursor("created_utc", "noon", "tgt-1")),
    ("created_utc", cursor("created_utc", "0001-01-01T00:00:00+23:59", "tgt-1")),
    ("", base64.urlsafe_b64encode(b"[" * 400).decode()),
    ("", base64.urlsafe_b64encode(b"\xff\xfe").decode()),
]


def test_a_cursor_that_was_made_elsewhere_is_refused(api: Api, mission: Mission) -> None:
    for sort, made in STRANGE:
        asked = {"cursor": made, **({"sort": sort} if sort else {})}
        told = problem(api("GET", f"/missions/{mission.id}/targets", params=asked), 422, "invalid-input")
        assert told["errors"][0]["pointer"] == "cursor", made


def test_every_kind_is_listed_by_every_way_its_document_tells(api: Api, rocks: str) -> None:
    mission = rocks.split("/")[2]
    paths = build_api().openapi()["paths"]
    asked = 0
    for kind in KINDS.values():
        for path in (f"/missions/{{mission_id}}/{kind.collection}", f"/{kind.collection}"):
            told = paths.get(f"/api/v1{path}", {}).get("get")
            if told is None or kind.name == "signing_key":
                continue
            names = {p["name"] for p in told["parameters"] if "name" in p}
            assert set(narrowing(kind)) <= names, kind.name
            for name in sortable(kind):
                page = api.get(path.format(mission_id=mission), params={"sort": f"-{name}", "limit": 1})
                asked += 1
                if page["next_cursor"] is not None:
                    api.get(
                        path.format(mission_id=mission),
                        params={"sort": f"-{name}", "limit": 1, "cursor": page["next_cursor"]},
                    )
    assert asked > 100
