"""A request with a key takes effect once, in one transaction with its answer; an act is one for undo."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
from sqlalchemy import select

from ground.gdr.history import EventRow
from ground.gdr.repository import Repository
from ground.records.idempotency import IdempotencyRow, Once
from ground.resources.missions.value import Mission
from tests.ground.conftest import Api

KEY = {"Idempotency-Key": "k-1"}
BODY = {"east_m": 1.0, "north_m": 1.0}


def test_a_crash_between_effect_and_answer_leaves_nothing_and_the_repeat_does_it_once(
    api: Api, mission: Mission, monkeypatch: pytest.MonkeyPatch
) -> None:
    url = f"/missions/{mission.id}/targets"

    def die(*_: Any) -> None:
        raise RuntimeError("power cut")

    with monkeypatch.context() as patch:
        patch.setattr(Once, "_write", die)
        assert api("POST", url, BODY, headers=KEY).status_code == 500
    assert api.get(url)["items"] == []
    first = api("POST", url, BODY, headers=KEY)
    assert first.status_code == 201, first.text
    assert api("POST", url, BODY, headers=KEY).json() == first.json()
    assert len(api.get(url)["items"]) == 1


def test_requests_with_one_key_at_the_same_time_are_one(api: Api, mission: Mission, repo: Repository) -> None:
    url = f"/missions/{mission.id}/targets"
    with ThreadPoolExecutor(8) as pool:
        answers = list(pool.map(lambda _: api("POST", url, BODY, headers=KEY), range(24)))
    assert {a.status_code for a in answers} == {201}
    assert len({a.text for a in answers}) == 1
    assert sum("idempotent-replay" not in a.headers for a in answers) == 1
    assert len(api.get(url)["items"]) == 1
    with repo.database.read() as session:
        assert [r.status for r in session.scalars(select(IdempotencyRow))] == [201]


def test_a_key_that_an_older_server_left_unanswered_is_no_obstacle(
    api: Api, mission: Mission, repo: Repository
) -> None:
    with repo.database.write() as session:
        session.add(
            IdempotencyRow(actor="Planner", key="k-1", request_sha256="", status=0, headers={}, body=b"")
        )
    assert api("POST", f"/missions/{mission.id}/targets", BODY, headers=KEY).status_code == 201


def test_a_refusal_is_repeated_too_and_leaves_nothing_behind(api: Api, mission: Mission) -> None:
    url = f"/missions/{mission.id}/targets"
    api.post(url, {**BODY, "name": "Rock"})
    first = api("POST", url, {**BODY, "name": "Rock"}, headers=KEY)
    assert (first.status_code, first.json()["type"]) == (409, "urn:outcrop:problem:name-taken")
    second = api("POST", url, {**BODY, "name": "Rock"}, headers=KEY)
    assert (second.json(), second.headers["idempotent-replay"]) == (first.json(), "true")


def test_a_refusal_is_kept_before_it_is_answered(
    api: Api, mission: Mission, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Who has the refusal may use its key again at once; the second request was left without an answer."""
    url, keep = f"/missions/{mission.id}/targets", Once.keep
    api.post(url, {**BODY, "name": "Rock"})
    others: list[int] = []

    def late(self: Once, *given: Any) -> Any:
        if not others:
            others.append(0)
            others[0] = api("POST", url, {**BODY, "name": "Stone"}, headers=KEY).status_code
        return keep(self, *given)

    monkeypatch.setattr(Once, "keep", late)
    first = api("POST", url, {**BODY, "name": "Rock"}, headers=KEY)
    assert others == [201]
    assert (first.status_code, first.json()["type"]) == (422, "urn:outcrop:problem:idempotency-key-reused")


def test_a_refusal_gives_way_to_the_answer_that_was_kept_meanwhile(
    api: Api, mission: Mission, monkeypatch: pytest.MonkeyPatch
) -> None:
    url, keep = f"/missions/{mission.id}/targets", Once.keep
    rock = api.post(url, {**BODY, "name": "Rock"})
    others: list[Any] = []

    def late(self: Once, *given: Any) -> Any:
        if not others:
            others.append(None)
            api("DELETE", f"/targets/{rock['id']}", headers={"If-Match": "*"})
            others[0] = api("POST", url, {**BODY, "name": "Rock"}, headers=KEY)
        return keep(self, *given)

    monkeypatch.setattr(Once, "keep", late)
    first = api("POST", url, {**BODY, "name": "Rock"}, headers=KEY)
    assert others[0].status_code == 201
    assert (first.status_code, first.json()) == (201, others[0].json())


def test_a_job_asked_for_with_a_key_is_queued_once_and_seen_after_the_answer(
    api: Api, mission: Mission
) -> None:
    url = f"/missions/{mission.id}/path-networks"
    first = api("POST", url, {}, headers={**KEY, "Prefer": "wait=1"})
    assert first.status_code == 202, first.text
    assert first.headers["preference-applied"] == "wait=1"
    assert api("POST", url, {}, headers=KEY).json()["id"] == first.json()["id"]
    assert api.jobs() == 1
    assert len(api.get(f"/missions/{mission.id}/jobs")["items"]) == 1


def test_a_secret_is_not_kept_with_a_key(api: Api, repo: Repository) -> None:
    api.post("/api-keys", {"name": "script"}, headers=KEY)
    with repo.database.read() as session:
        assert session.scalars(select(IdempotencyRow)).all() == []


def test_undo_of_a_moved_target_moves_it_back_with_what_followed(
    api: Api, mission: Mission, repo: Repository
) -> None:
    target = api.post(f"/missions/{mission.id}/targets", {"east_m": 4.0, "north_m": 1.0})
    for instrument in ("microscopic_imager", "science_camera"):
        api.post(
            f"/missions/{mission.id}/observation-requests",
            {"target_id": target["id"], "instrument": instrument, "value": 1.0},
        )
    requests = f"/missions/{mission.id}/observation-requests"
    stands = [r["observation_point"] for r in api.get(requests)["items"]]
    answer = api("PATCH", f"/targets/{target['id']}", {"east_m": 4.3}, headers={"If-Match": "*"})
    assert answer.status_code == 200, answer.text
    assert [r["observation_point"] for r in api.get(requests)["items"]] != stands
    done = api.post(f"/missions/{mission.id}/undo", {}, 200)
    assert {e["kind"] for e in done} == {"target", "observation_request"}
    back = api.get(f"/targets/{target['id']}")
    changing = {"revision", "modified_utc"}
    assert {k: v for k, v in back.items() if k not in changing} == {
        k: v for k, v in target.items() if k not in changing
    }
    assert [r["observation_point"] for r in api.get(requests)["items"]] == stands
    with repo.database.read() as session:
        groups = session.scalars(select(EventRow.group).where(EventRow.action == "undo").distinct()).all()
    assert len(groups) == 1
