"""A flood of log-ins pays for nothing that was not looked at, and counts on all servers together."""

from __future__ import annotations

import asyncio
from collections import Counter
from concurrent.futures import ThreadPoolExecutor

import httpx
import pytest

from ground.app.service import build_app
from ground.errors import TooManyAttemptsError
from ground.gdr.repository import Repository, open_repository
from ground.records.actor import SYSTEM_ACTOR, Role
from ground.resources.people.accounts import create_person
from ground.resources.people.log_in_limits import (
    PLACES,
    TRIES,
    TRIES_OF_ADDRESS,
    LogInLimits,
    paid,
    pay,
    refund,
)
from ground.settings import SettingsError, load_settings
from tests.ground.conftest import settings_for

PASSWORD = "correct horse battery"
OWNER, ADDRESS = "Ann", "10.0.0.1"


@pytest.fixture
def team(repo: Repository) -> Repository:
    """Give a repository with accounts, and one person with a password."""
    settings = settings_for(
        repo.data_dir, repo.database.url.render_as_string(hide_password=False), auth="accounts"
    )
    ours = open_repository(settings)
    create_person(ours, SYSTEM_ACTOR, OWNER, Role.PLANNER, PASSWORD)
    return ours


async def flood(repo: Repository, addresses: list[str], name: str = OWNER) -> Counter[int]:
    """Return how often each status came for one wrong password from each address, all at once."""
    app = build_app(repo, with_worker=False)

    async def guess(address: str) -> int:
        transport = httpx.ASGITransport(app=app, client=(address, 1))
        async with httpx.AsyncClient(transport=transport, base_url="http://testserver") as client:
            answer = await client.post("/api/v1/session", json={"name": name, "password": "wrong"})
            assert answer.status_code == 401 or int(answer.headers["retry-after"]) > 0
            return answer.status_code

    return Counter(await asyncio.gather(*map(guess, addresses)))


def test_who_is_turned_away_in_a_flood_has_not_paid(team: Repository) -> None:
    counts = asyncio.run(flood(team, [ADDRESS] * 40))
    assert set(counts) == {401, 429}
    assert paid(team, OWNER, ADDRESS) == counts[401] < TRIES
    team.database.dispose()


def test_no_more_log_ins_are_looked_at_than_there_are_places(
    team: Repository, monkeypatch: pytest.MonkeyPatch
) -> None:
    inside, most = 0, 0
    enter = LogInLimits.knock

    def knock(limits: LogInLimits, name: str, address: str) -> None:
        nonlocal inside, most
        inside += 1
        most = max(most, inside)
        enter(limits, name, address)

    async def looked_at(work: object) -> None:
        nonlocal inside
        await asyncio.sleep(0)
        inside -= 1

    monkeypatch.setattr(LogInLimits, "knock", knock)
    monkeypatch.setattr("ground.resources.people.authentication.check", looked_at)
    counts = asyncio.run(flood(team, [f"10.0.{n // 200}.{n % 200}" for n in range(400)], "nobody"))
    assert 1 < most <= PLACES
    assert counts[401] + counts[429] == 400
    team.database.dispose()


def test_the_limit_of_an_address_holds_for_all_servers_together(team: Repository) -> None:
    for number in range(TRIES_OF_ADDRESS):
        pay(team, f"name {number}", ADDRESS)
    with pytest.raises(TooManyAttemptsError):
        pay(team, "another", ADDRESS)
    pay(team, "another", "10.0.0.2")
    refund(team, "name 3", ADDRESS)  # one was right
    pay(team, "another", ADDRESS)
    with pytest.raises(TooManyAttemptsError):
        pay(team, "one more", ADDRESS)
    team.database.dispose()


def test_payments_at_the_same_time_are_no_more_than_those_one_after_the_other(team: Repository) -> None:
    def guess(number: int) -> bool:
        try:
            pay(team, f"name {number % 20}", ADDRESS)
        except TooManyAttemptsError:
            return False
        return True

    with ThreadPoolExecutor(8) as servers:
        assert sum(servers.map(guess, range(120))) == TRIES_OF_ADDRESS
    assert all(paid(team, f"name {number}", ADDRESS) <= TRIES for number in range(20))
    team.database.dispose()


@pytest.mark.parametrize("given", ["*", "10.0.0.1, *", "0.0.0.0/0", "::/0", "proxy.example"])
def test_a_proxy_that_could_be_anybody_is_refused(given: str) -> None:
    with pytest.raises(SettingsError, match=r"OUTCROP_TRUSTED_PROXIES=.*(name your proxies|is everybody)"):
        load_settings(trusted_proxies=given)


def test_proxies_are_named_by_address_or_network() -> None:
    assert load_settings(trusted_proxies="10.0.0.1, 172.16.0.0/12, ::1").trusted_proxies
