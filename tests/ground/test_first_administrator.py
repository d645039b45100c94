"""The first administrator is who reads the server's log, never who comes first."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta

import pytest
from sqlalchemy import update

from ground.app.service import say_how_to_begin
from ground.errors import GroundError
from ground.gdr.base import utc_now
from ground.gdr.repository import Repository, open_repository
from ground.records.actor import SYSTEM_ACTOR, Role
from ground.resources.people.accounts import create_person
from ground.resources.people.first_administrator import invite, make_first_administrator
from ground.resources.people.row import InvitationRow
from tests.ground.conftest import Api, open_api, settings_for
from tests.ground.test_missions_api import problem

PASSWORD = "correct horse battery"


@pytest.fixture
def bare(repo: Repository) -> Iterator[Repository]:
    """Give a repository with accounts and nobody to log in; its profiles have no password."""
    address = repo.database.url.render_as_string(hide_password=False)
    ours = open_repository(settings_for(repo.data_dir, address, auth="accounts"))
    yield ours
    ours.database.dispose()


@pytest.fixture
def service(bare: Repository) -> Iterator[Api]:
    yield from open_api(bare)


def form(token: str, name: str = "Ada") -> dict[str, str]:
    return {"token": token, "name": name, "password": PASSWORD}


def token_of(repo: Repository, caplog: pytest.LogCaptureFixture) -> str:
    caplog.clear()
    with caplog.at_level(logging.ERROR):
        say_how_to_begin(repo)
    return caplog.text.split("token ")[1].split()[0]


def test_the_token_of_the_log_makes_one_administrator_once(
    service: Api, caplog: pytest.LogCaptureFixture
) -> None:
    assert service.get("/session")["wants_administrator"] is True
    first, second = token_of(service.repo, caplog), token_of(service.repo, caplog)
    assert service.post("/first-administrator", form(second))["role"] == "admin"
    service("POST", "/session", {"name": "Ada", "password": PASSWORD})
    assert service.get("/people")["items"]
    service.client.cookies.clear()
    assert service.get("/session")["wants_administrator"] is False
    for token in (first, second):
        problem(service("POST", "/first-administrator", form(token, "Eve")), 409, "conflict")
    say_how_to_begin(service.repo)
    assert invite(service.repo) is None


def test_the_first_visitor_becomes_nothing(service: Api, caplog: pytest.LogCaptureFixture) -> None:
    token = token_of(service.repo, caplog)
    for guess in ("x", token[:-1], token.swapcase()):
        problem(service("POST", "/first-administrator", form(guess)), 401, "not-authenticated")
    problem(service("GET", "/people"), 401, "not-authenticated")
    with service.repo.database.write() as session:
        session.execute(update(InvitationRow).values(expires_utc=utc_now() - timedelta(seconds=1)))
    problem(service("POST", "/first-administrator", form(token)), 401, "not-authenticated")


def test_guesses_of_the_token_are_limited_like_those_of_a_password(service: Api) -> None:
    answers = [service("POST", "/first-administrator", form(f"guess {n}")).status_code for n in range(7)]
    assert answers == [401] * 5 + [429] * 2


def test_of_many_at_the_same_time_one_becomes_administrator(bare: Repository) -> None:
    token = invite(bare)
    assert token is not None

    def come(number: int) -> bool:
        try:
            make_first_administrator(bare, token, f"Person {number}", PASSWORD)
        except GroundError:
            return False
        return True

    with ThreadPoolExecutor(6) as people:
        assert sum(people.map(come, range(6))) == 1


def test_no_token_is_given_where_there_is_an_administrator_or_profiles(
    bare: Repository, repo: Repository
) -> None:
    assert invite(repo) is None
    create_person(bare, SYSTEM_ACTOR, "Bo", Role.PLANNER, PASSWORD)
    assert invite(bare) is not None
    create_person(bare, SYSTEM_ACTOR, "Ada", Role.ADMIN, PASSWORD)
    assert invite(bare) is None
