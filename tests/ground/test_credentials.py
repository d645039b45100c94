"""Passwords changed and set anew; sessions and keys listed, narrowed and taken back."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from datetime import timedelta
from pathlib import Path

import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from sqlalchemy import update

from ground.gdr.base import utc_now
from ground.gdr.ids import new_id
from ground.gdr.repository import open_repository
from ground.resources.people.accounts import ensure_profiles
from ground.resources.people.log_in_limits import TRIES
from ground.resources.people.password_hash import hash_of
from ground.resources.people.row import CredentialRow, PersonRow
from ground.resources.people.signing_keys import FORM
from ground.uplink.keys import public_text, sign
from tests.ground.approving import registered
from tests.ground.conftest import Api, open_api, settings_for, yard
from tests.ground.test_missions_api import problem

PASSWORD, ANOTHER = "correct horse battery", "another horse battery"
Headers = dict[str, str]


@pytest.fixture(scope="module")
def hashed() -> str:
    return hash_of(PASSWORD)


@pytest.fixture
def team(sqlite_template: Path, hashed: str, tmp_path: Path) -> Iterator[Api]:
    """Give a service with accounts for an administrator, a planner and a flight director."""
    (tmp_path / "data").mkdir()
    shutil.copyfile(sqlite_template, tmp_path / "data" / "outcrop.db")
    repo = open_repository(settings_for(tmp_path / "data", auth="accounts"))
    ensure_profiles(repo)
    with repo.database.write() as session:
        for name, role in (("Ada", "admin"), ("Bo", "planner"), ("Cy", "flight_director")):
            row = PersonRow(id=new_id("psn"), author="", name=name, role=role, mission_roles={})
            row.password_hash = hashed
            session.add(row)
    yield from open_api(repo)
    repo.database.dispose()


def log_in(api: Api, name: str, password: str = PASSWORD, program: str = "a browser") -> Headers:
    given = {"name": name, "password": password}
    answer = api("POST", "/session", given, headers={"User-Agent": program})
    assert answer.status_code == 201, answer.text
    api.client.cookies.clear()
    cookie = answer.headers["set-cookie"].split(";")[0]
    return {"Cookie": cookie, "X-CSRF-Token": answer.json()["csrf_token"]}


def key_of(api: Api, headers: Headers, **narrowed: object) -> Headers:
    made = api.post("/api-keys", {"name": "script", **narrowed}, headers=headers)
    return {"Authorization": f"Bearer {made['secret']}"}


def id_of(api: Api, headers: Headers, name: str) -> str:
    return next(p["id"] for p in api.get("/people", headers=headers)["items"] if p["name"] == name)


def test_a_person_changes_their_password_and_their_other_sessions_end(team: Api) -> None:
    here, there = log_in(team, "Bo"), log_in(team, "Bo")
    change = {"old": PASSWORD, "new": ANOTHER}
    assert team("PUT", "/session/password", change, headers=here).status_code == 204
    assert team("GET", "/missions", headers=here).status_code == 200
    problem(team("GET", "/missions", headers=there), 401, "not-authenticated")
    problem(team("POST", "/session", {"name": "Bo", "password": PASSWORD}), 401, "not-authenticated")
    log_in(team, "Bo", ANOTHER)


def test_a_wrong_old_password_is_a_guess_like_any_other(team: Api) -> None:
    headers = log_in(team, "Bo")
    change = {"old": "guessed wrong", "new": ANOTHER}
    for _ in range(TRIES):
        problem(team("PUT", "/session/password", change, headers=headers), 422, "invalid-input")
    change["old"] = PASSWORD
    problem(team("PUT", "/session/password", change, headers=headers), 429, "too-many-attempts")


def test_an_administrator_sets_a_password_anew_but_not_their_own(team: Api) -> None:
    ada, bo = log_in(team, "Ada"), log_in(team, "Bo")
    theirs, own = id_of(team, ada, "Bo"), id_of(team, ada, "Ada")
    body = {"password": ANOTHER}
    problem(team("PUT", f"/people/{theirs}/password", body, headers=bo), 403, "forbidden")
    assert team("PUT", f"/people/{theirs}/password", body, headers=ada).status_code == 204
    problem(team("GET", "/missions", headers=bo), 401, "not-authenticated")
    log_in(team, "Bo", ANOTHER)
    problem(team("PUT", f"/people/{own}/password", body, headers=ada), 403, "forbidden")
    problem(team("PUT", "/people/psn-none/password", body, headers=ada), 404, "not-found")


def test_profiles_have_no_passwords_to_change(sqlite_api: Api) -> None:
    change = {"old": "", "new": ANOTHER}
    problem(sqlite_api("PUT", "/session/password", change, who="Planner"), 409, "conflict")


def test_sessions_are_listed_and_ended_by_their_owner_and_by_an_administrator(team: Api) -> None:
    ada, here, there = log_in(team, "Ada"), log_in(team, "Bo"), log_in(team, "Bo", program="a telephone")
    mine = team.get("/sessions", headers=here)
    assert [(s["person"], s["program"], s["current"]) for s in mine] == [
        ("Bo", "a telephone", False),
        ("Bo", "a browser", True),
    ]
    problem(team("GET", "/sessions?everyone=true", headers=here), 403, "forbidden")
    theirs = team.get("/sessions?everyone=true", headers=ada)
    assert sorted(s["person"] for s in theirs) == ["Ada", "Bo", "Bo"]
    of_ada = next(s["id"] for s in theirs if s["person"] == "Ada")
    problem(team("DELETE", f"/sessions/{of_ada}", headers=here), 403, "forbidden")
    assert team("DELETE", f"/sessions/{mine[0]['id']}", headers=here).status_code == 204
    problem(team("GET", "/missions", headers=there), 401, "not-authenticated")
    assert team("DELETE", f"/sessions/{mine[1]['id']}", headers=ada).status_code == 204
    problem(team("GET", "/missions", headers=here), 401, "not-authenticated")
    problem(team("DELETE", f"/sessions/{mine[1]['id']}", headers=ada), 404, "not-found")


def test_keys_are_listed_without_their_secrets(team: Api) -> None:
    ada, bo = log_in(team, "Ada"), log_in(team, "Bo")
    made = team.post("/api-keys", {"name": "script", "days": 3, "role": "viewer"}, headers=bo)
    listed = team("GET", "/api-keys", headers=bo)
    assert made["secret"] not in listed.text
    assert [(k["name"], k["role"], k["mission_ids"], k["person"]) for k in listed.json()] == [
        ("script", "viewer", None, "Bo")
    ]
    assert team.get("/api-keys", headers=ada) == []
    assert [k["id"] for k in team.get("/api-keys?everyone=true", headers=ada)] == [made["id"]]
    key = {"Authorization": f"Bearer {made['secret']}"}
    assert team("DELETE", f"/api-keys/{made['id']}", headers=ada).status_code == 204
    problem(team("GET", "/missions", headers=key), 401, "not-authenticated")
    assert team.get("/api-keys", headers=bo) == []


def test_a_narrowed_key_does_no_more_than_it_is_for(team: Api, terrain_folder: Path) -> None:
    here, elsewhere = yard(team.repo, terrain_folder), yard(team.repo, terrain_folder, "Other")
    bo = log_in(team, "Bo")
    target = {"east_m": 1.0, "north_m": 1.0}
    reads = key_of(team, bo, role="viewer")
    assert team("GET", f"/missions/{here.id}/targets", headers=reads).status_code == 200
    problem(team("POST", f"/missions/{here.id}/targets", target, headers=reads), 403, "forbidden")
    one = key_of(team, bo, mission_ids=[here.id])
    assert team("POST", f"/missions/{here.id}/targets", target, headers=one).status_code == 201
    assert team("POST", f"/missions/{elsewhere.id}/targets", target, headers=one).status_code in {403, 404}
    assert team("GET", f"/missions/{elsewhere.id}/targets", headers=one).status_code in {403, 404}
    more = key_of(team, bo, role="admin")  # a role that its owner has not got adds nothing
    problem(team("POST", "/people", {"name": "Eve", "password": PASSWORD}, headers=more), 403, "forbidden")


@pytest.mark.parametrize(
    ("method", "path", "body"),
    [
        ("POST", "/api-keys", {"name": "wider"}),
        ("GET", "/api-keys", None),
        ("GET", "/sessions", None),
        ("DELETE", "/sessions/ses-x", None),
        ("DELETE", "/api-keys/key-x", None),
        ("PUT", "/session/password", {"old": PASSWORD, "new": ANOTHER}),
        ("PUT", "/people/psn-x/password", {"password": ANOTHER}),
        ("POST", "/signing-keys", {"public": "A" * 43 + "=", "proof": "A" * 86 + "=="}),
        ("DELETE", "/signing-keys/key-x", None),
    ],
)
def test_a_narrowed_key_makes_no_other_way_in(team: Api, method: str, path: str, body: object) -> None:
    key = key_of(team, log_in(team, "Ada"), role="admin")
    problem(team(method, path, body, headers=key), 403, "narrowed-key")


def test_a_narrowed_key_leaves_its_owners_signing_keys_alone(team: Api) -> None:
    cy, mine, other = log_in(team, "Cy"), Ed25519PrivateKey.generate(), Ed25519PrivateKey.generate()
    known = registered(team, "Cy", mine, headers=cy)
    narrow = key_of(team, cy, role="viewer")
    taken = {"public": public_text(other), "proof": sign(other, FORM, "owner", b"Cy")}
    problem(team("POST", "/signing-keys", taken, headers=narrow), 403, "narrowed-key")
    problem(team("DELETE", f"/signing-keys/{known}", headers=narrow), 403, "narrowed-key")
    (listed,) = team.get("/signing-keys", headers=cy)
    assert (listed["id"], listed["revoked_utc"]) == (known, None)


def test_a_key_that_is_outdated_opens_nothing_and_is_not_listed(team: Api) -> None:
    bo = log_in(team, "Bo")
    key = key_of(team, bo)
    with team.repo.database.write() as session:
        old = update(CredentialRow).where(CredentialRow.kind == "api_key")
        session.execute(old.values(expires_utc=utc_now() - timedelta(seconds=1)))
    problem(team("GET", "/missions", headers=key), 401, "not-authenticated")
    assert team.get("/api-keys", headers=bo) == []
