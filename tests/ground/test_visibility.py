"""A mission that a person may not see is not there: every operation answers as for one that never was."""

from __future__ import annotations

import asyncio
import json
import re
from collections.abc import AsyncIterator
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.api import context
from ground.api.context import OTHER_NAMES, Ask
from ground.api.hub import Hub
from ground.api.shared_reads import RowReads
from ground.app.api import build_api
from ground.errors import AuthenticationError
from ground.gdr.base import Utc, utc_now
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.records.actor import ALLOWED, Action, Actor, KeyScope, Role
from ground.resources.kinds import KINDS
from ground.resources.missions.row import MissionRow
from ground.resources.missions.value import Mission
from ground.resources.people.row import PersonRow, SigningKeyRow
from ground.resources.tables import METADATA
from tests.ground.conftest import Api, yard
from tests.ground.test_security import BODIES

ABSENT = "never_was"
NO_MISSION = {"person_id", "key_id", "session_id"}
"""Ids of what belongs to no mission."""
WITHIN = {"item_id": "product", "feature_id": "target"}
"""Ids that count within the mission that their path names, with a kind that has such ids."""
WORDS = {"collection_id": "targets", "group": "products", "index": "0", "file": "dem.tif", "page": "p1"}
"""What else a path names; none of it is an id of a row."""
OPERATIONS = [
    (method.upper(), path, operation["operationId"])
    for path, operations in build_api().openapi()["paths"].items()
    for method, operation in operations.items()
    if "_id}" in path and not set(re.findall(r"\{([a-z_]+_id)\}", path)) <= NO_MISSION
]


def kind_of(parameter: str) -> str:
    return (WITHIN | OTHER_NAMES).get(parameter, parameter.removesuffix("_id"))


def ids_of(path: str) -> list[str]:
    """Return the parameters of a path that name rows."""
    return [name for name in re.findall(r"\{([a-z_]+_id)\}", path) if name not in WORDS]


def fill(session: Session, mission: Mission) -> dict[str, str]:
    """Put one row of every kind into a mission, of whatever fits its columns; return its id by kind."""
    ids = {"mission": mission.id}
    kinds = {kind.row.__tablename__: kind for kind in KINDS.values()}
    for table in METADATA.sorted_tables:
        kind = kinds.get(table.name)
        if kind is None or kind.name in ids or "mission_id" not in table.c:
            continue
        given: dict[str, Any] = {}
        for column in table.c:
            if column.name == "mission_id":
                given[column.name] = mission.id
            elif column.foreign_keys:
                other = next(iter(column.foreign_keys)).column.table.name
                known = kinds.get(other)
                given[column.name] = ids.get(known.name) if known is not None else None
                if given[column.name] is None and not column.nullable:
                    given[column.name] = session.scalar(select(METADATA.tables[other].c.id).limit(1))
            elif not column.nullable and column.default is None and column.server_default is None:
                made = {str: f"hid{kind.name}"[:20], bool: False, int: 7, float: 1.0, datetime: utc_now()}
                of_time = isinstance(column.type, Utc)
                given[column.name] = made.get(datetime if of_time else column.type.python_type, [])
        ids[kind.name] = given["id"] = f"hidden_{kind.name}"
        session.execute(table.insert().values(**given))
    return ids


@pytest.fixture
def hidden(sqlite_repo: Repository, terrain_folder: Any) -> Mission:
    return yard(sqlite_repo, terrain_folder, "Secret Valley")


@pytest.fixture
def ids(sqlite_repo: Repository, hidden: Mission) -> dict[str, str]:
    roles = {
        "Eve": ("admin", {hidden.id: "none"}),
        "Nobody": ("none", {}),
        "Guest": ("none", {hidden.id: "viewer"}),
    }
    with sqlite_repo.database.write() as session:
        for name, (role, missions) in roles.items():
            row = PersonRow(id=new_id("psn"), author="", name=name, role=role, mission_roles=missions)
            session.add(row)
        return fill(session, hidden)


def told(api: Api, who: str, method: str, path: str, operation: str, ids: dict[str, str]) -> tuple[int, str]:
    """Return status and text of an answer, with the ids that were asked for taken out."""
    named, url = ids_of(path), path
    for word, value in WORDS.items():
        url = url.replace(f"{{{word}}}", value)
    for name in named:
        url = url.replace(f"{{{name}}}", ids[kind_of(name)])
    body = BODIES.get(operation, {}) if method in {"POST", "PATCH", "PUT"} else None
    answer = api(method, url, body, who=who, headers={"If-Match": "*"})
    content = answer.text
    if "json" in answer.headers.get("content-type", ""):
        document = answer.json()
        if isinstance(document, dict):
            document.pop("request_id", None)
        content = json.dumps(document, sort_keys=True)
    for name in named:
        content = content.replace(ids[kind_of(name)], f"<{kind_of(name)}>")
    return answer.status_code, content


def test_every_id_of_a_path_is_known_to_belong_to_a_mission_or_to_none() -> None:
    parameters = {name for _, path, _ in OPERATIONS for name in ids_of(path)}
    assert all("{mission_id}" in path for _, path, _ in OPERATIONS if WITHIN.keys() & set(ids_of(path)))
    assert {kind_of(name) for name in parameters - NO_MISSION} <= set(KINDS)
    assert len(OPERATIONS) > 100


@pytest.mark.parametrize("who", ["Eve", "Nobody"])
def test_every_operation_answers_as_if_the_mission_had_never_been(
    sqlite_api: Api, ids: dict[str, str], hidden: Mission, who: str
) -> None:
    absent = {kind: f"{ABSENT}_{kind}" for kind in KINDS}
    wanted = {kind_of(n) for _, path, _ in OPERATIONS for n in ids_of(path)}
    assert wanted <= set(ids), "each kind of a path has a row in the hidden mission"
    wrong = []
    for method, path, operation in OPERATIONS:
        real = told(sqlite_api, who, method, path, operation, ids)
        never = told(sqlite_api, who, method, path, operation, absent)
        if real != never or hidden.name in real[1] or not 400 <= real[0] < 500:
            wrong.append((method, path, real, never))
    assert wrong == []


def test_a_copy_in_the_making_is_there_for_no_operation_on_a_mission(
    sqlite_api: Api, ids: dict[str, str], hidden: Mission
) -> None:
    with sqlite_api.repo.database.write() as session:
        session.get_one(MissionRow, hidden.id).in_making = True
    absent = {kind: f"{ABSENT}_{kind}" for kind in KINDS}
    wrong = []
    for method, path, operation in OPERATIONS:
        if "{mission_id}" in path:
            real = told(sqlite_api, "Administrator", method, path, operation, ids)
            never = told(sqlite_api, "Administrator", method, path, operation, absent)
            if real != never or hidden.name in real[1]:
                wrong.append((method, path, real, never))
    assert wrong == []


def test_lists_and_roles_hold_no_word_of_it(sqlite_api: Api, ids: dict[str, str], hidden: Mission) -> None:
    for who in ("Eve", "Nobody"):
        page = sqlite_api.get("/missions?count=true", who=who)
        assert (page["items"], page["total"]) == ([], 0)
        assert hidden.id not in sqlite_api("GET", "/people", who=who).text
        assert hidden.id not in sqlite_api("GET", "/session", who=who).text
    assert [m["id"] for m in sqlite_api.get("/missions", who="Guest")["items"]] == [hidden.id]
    assert sqlite_api("GET", f"/missions/{hidden.id}/targets", who="Guest").status_code == 200
    assert [m["id"] for m in sqlite_api.get("/missions", who="Planner")["items"]] == [hidden.id]


def test_a_key_for_other_missions_does_not_see_it() -> None:
    key = Actor("Bo", Role.PLANNER, {}, KeyScope(missions=frozenset({"msn-1"})))
    assert key.sees("msn-1")
    assert not key.sees("msn-2")
    assert key.visible_missions() == (frozenset({"msn-1"}), frozenset())
    assert not key.sees_all
    assert ALLOWED[Role.NONE] == frozenset()
    key.require(Action.PLAN, "msn-1")


def test_an_upload_is_there_for_who_made_it_and_for_administrators(
    sqlite_api: Api, ids: dict[str, str], hidden: Mission
) -> None:
    answer = sqlite_api("POST", "/uploads?file_name=run.txt", content=b"x", who="Planner")
    upload, frame = answer.json()["id"], ids["frame"]
    given = {"upload_id": upload}
    forms: dict[str, Any] = {
        "/missions/import": given,
        "/runs/ingest": given,
        "/missions": {"name": "Stolen", "terrain": {"source": "uploaded", **given}},
        f"/missions/{hidden.id}/geometry": given,
        f"/missions/{hidden.id}/frame-files": given,
        f"/missions/{hidden.id}/site-maps": {"frame_id": frame, **given},
    }
    for path, form in forms.items():
        other = sqlite_api("POST", path, form, who="Flight Director")
        never = sqlite_api(
            "POST", path, json.loads(json.dumps(form).replace(upload, ABSENT)), who="Flight Director"
        )
        assert f"there is no upload {upload}" in other.json()["detail"], (path, other.text)
        assert other.json()["detail"] == never.json()["detail"].replace(ABSENT, upload)
        for who in ("Planner", "Administrator"):
            if (path, who) != ("/runs/ingest", "Planner"):
                assert "no upload" not in sqlite_api("POST", path, form, who=who).text, (path, who)


def test_who_may_see_nothing_sees_nobody_but_themselves(
    sqlite_api: Api, ids: dict[str, str], hidden: Mission
) -> None:
    everybody = {p["name"]: p["id"] for p in sqlite_api.get("/people")["items"]}
    page = sqlite_api.get("/people?count=true", who="Nobody")
    assert ([p["name"] for p in page["items"]], page["total"]) == (["Nobody"], 1)
    assert sqlite_api.get("/people?sort=name&limit=1", who="Nobody")["next_cursor"] is None
    assert sqlite_api.get("/people?name=Planner", who="Nobody")["items"] == []
    assert sqlite_api.get(f"/people/{everybody['Nobody']}", who="Nobody")["name"] == "Nobody"
    theirs = sqlite_api("GET", f"/people/{everybody['Planner']}", who="Nobody")
    never = sqlite_api("GET", "/people/psn-none", who="Nobody")
    assert (theirs.status_code, never.status_code) == (404, 404)
    with sqlite_api.repo.database.write() as session:
        session.add(
            SigningKeyRow(id="key-1", person_id=everybody["Planner"], name="k", public="A" * 43 + "=")
        )
    assert sqlite_api.get("/signing-keys", who="Nobody") == []
    assert len(sqlite_api.get("/signing-keys", who="Viewer")) == 1
    assert len(sqlite_api.get("/people", who="Guest")["items"]) == len(everybody)  # sees a mission of theirs


HISTORIES = ("history", "as-of/1", "events")


def test_the_history_of_the_system_and_of_deleted_missions_is_administrators_alone(
    sqlite_api: Api, ids: dict[str, str], hidden: Mission
) -> None:
    scientist = next(p for p in sqlite_api.get("/people")["items"] if p["name"] == "Scientist")
    given = {"mission_roles": {hidden.id: "planner"}}
    any_revision = {"If-Match": "*"}
    changed = sqlite_api(
        "PATCH", f"/people/{scientist['id']}", given, who="Administrator", headers=any_revision
    )
    assert changed.status_code == 200
    for who in ("Viewer", "Planner", "Flight Director", "Eve", "Nobody", "Guest"):
        admin = who == "Eve"  # an administrator, from whom one mission is hidden
        for history in HISTORIES[:2] if admin else HISTORIES:
            answer = sqlite_api("GET", f"/missions/system/{history}", who=who)
            never = sqlite_api("GET", f"/missions/{ABSENT}/{history}", who=who)
            assert answer.status_code == (200 if admin else 404), (who, history)
            if not admin:
                assert answer.json()["detail"] == never.json()["detail"].replace(ABSENT, "system")
    told = sqlite_api.get("/missions/system/history", who="Administrator")["items"]
    assert any(hidden.id in json.dumps(event["after"]) for event in told)
    assert all("external_sha256" not in (event["after"] or {}) for event in told)


@pytest.mark.parametrize("now", [Actor("Bo", Role.NONE), None])
def test_a_stream_ends_when_its_listener_may_not_see_it_any_more(
    sqlite_repo: Repository, hidden: Mission, now: Actor | None
) -> None:
    whoever = [Actor("Bo", Role.VIEWER), Actor("Bo", Role.VIEWER), now]

    async def again() -> Actor:
        who = whoever.pop(0)
        if who is None:
            raise AuthenticationError("the session has ended")
        return who

    async def parts() -> AsyncIterator[int]:
        for number in range(9):
            yield number

    async def heard() -> list[int]:
        reads = RowReads(sqlite_repo, context.look)
        ask = Ask(sqlite_repo, Actor("Bo", Role.VIEWER), KINDS, again, Hub(sqlite_repo), reads)
        return [n async for n in context._while_seen(parts(), ask, {"mission_id": hidden.id})]

    assert asyncio.run(heard()) == [0, 1]


def test_a_copy_is_seen_by_whoever_sees_the_first_and_nobody_else(
    sqlite_repo: Repository, sqlite_api: Api, terrain_folder: Path
) -> None:
    first = yard(sqlite_repo, terrain_folder, "Secret Valley")
    roles = {"Eve": ("viewer", "none"), "Guest": ("none", "planner"), "Bo": ("viewer", "planner")}
    with sqlite_repo.database.write() as session:
        for name, (role, there) in roles.items():
            given = {first.id: there}
            session.add(PersonRow(id=new_id("psn"), author="", name=name, role=role, mission_roles=given))
    for who in ("Planner", "Guest"):
        copy = sqlite_api.post(f"/missions/{first.id}/copy", {"name": f"What if, {who}"}, who=who)["id"]
        assert sqlite_api("GET", f"/missions/{copy}", who="Eve").status_code == 404
        assert sqlite_api("GET", f"/missions/{copy}/history", who="Eve").status_code == 404
        target = {"east_m": 1.0, "north_m": 1.0}
        assert sqlite_api("POST", f"/missions/{copy}/targets", target, who="Guest").status_code == 201
        assert sqlite_api("GET", f"/missions/{copy}", who="Bo").status_code == 200
        assert sqlite_api("POST", f"/missions/{copy}/targets", target, who="Bo").status_code == 403
    assert sqlite_api.get("/missions?count=true", who="Eve")["total"] == 0
