"""Copies of missions: whole or not there, in small transactions, told by the history, undone like others."""

from __future__ import annotations

import json
from datetime import timedelta
from typing import Any

import pytest
from sqlalchemy import func, select, text

from ground.app import service
from ground.gdr.base import table_of
from ground.gdr.history import EventRow, verify_chains
from ground.gdr.ids import new_id, new_ids
from ground.gdr.raw_rows import RawRows
from ground.gdr.seals import row_digest, values_of
from ground.resources.history.verify_rows import verify_rows
from ground.resources.mission_archives import copy_mission as copying
from ground.resources.missions.row import MissionRow
from ground.resources.missions.value import Mission
from ground.resources.targets.row import TargetRow
from tests.ground.conftest import Api
from tests.ground.test_bulk import places
from tests.ground.test_missions_api import problem


def require_sound(api: Api) -> None:
    with api.repo.database.read() as session:
        assert verify_chains(session)[1] == []
        assert verify_rows(session).faults == []


def test_a_copy_that_is_not_whole_is_there_for_nobody_and_goes_with_a_later_one(
    api: Api, mission: Mission, monkeypatch: pytest.MonkeyPatch
) -> None:
    api.post(f"/missions/{mission.id}/targets/bulk", {"create": places(7)}, status=200)
    monkeypatch.setattr(copying, "ROWS_AT_ONCE", 3)
    with monkeypatch.context() as killed:

        def die(*_: object) -> None:
            raise RuntimeError("killed")

        killed.setattr(copying, "inherit_roles", die)
        assert api("POST", f"/missions/{mission.id}/copy", {"name": "Half"}).status_code == 500
    with api.repo.database.read() as session:
        half = session.scalars(select(MissionRow).where(MissionRow.in_making)).one()
        assert session.scalar(select(func.count()).where(TargetRow.mission_id == half.id)) == 7
        part = session.scalars(select(TargetRow.id).where(TargetRow.mission_id == half.id).limit(1)).one()
    listed = api.get("/missions?count=true")
    assert [m["id"] for m in listed["items"]] == [mission.id]
    assert listed["total"] == 1
    for path in (
        "",
        "/history",
        "/targets",
        "/observation-requests",
        "/drafts",
        "/stac",
        "/features",
        "/sols",
    ):
        problem(api("GET", f"/missions/{half.id}{path}", who="Viewer"), 404, "not-found")
    problem(
        api("DELETE", f"/missions/{half.id}", headers={"If-Match": "*"}, who="Administrator"),
        404,
        "not-found",
    )
    any_revision = {"If-Match": "*"}
    for method, body in (("GET", None), ("PATCH", {"name": "mine"}), ("DELETE", None)):
        for who in ("Planner", "Administrator"):  # from whom no mission is hidden
            told = problem(
                api(method, f"/targets/{part}", body, headers=any_revision, who=who), 404, "not-found"
            )
            assert told["detail"] == f"there is no target {part}"
    require_sound(api)

    young = api.post(f"/missions/{mission.id}/copy", {"name": "Whole"})
    assert young["counts"]["targets"] == 7
    with api.repo.database.write() as session:
        row = session.get(MissionRow, half.id)
        assert row is not None, "it may be another server's, at work"
        row.modified_utc -= timedelta(hours=2)
    api.post(f"/missions/{mission.id}/copy", {"name": "Again"})
    with api.repo.database.read() as session:
        assert session.get(MissionRow, half.id) is None
        assert session.scalar(select(func.count()).where(TargetRow.mission_id == half.id)) == 0
    require_sound(api)


def test_a_copy_is_written_in_small_transactions_and_seen_as_of_its_event(
    api: Api, mission: Mission, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(copying, "ROWS_AT_ONCE", 10)
    api.post(f"/missions/{mission.id}/targets/bulk", {"create": places(45)}, status=200)
    copy = api.post(f"/missions/{mission.id}/copy", {"name": "What if"})
    with api.repo.database.read() as session:
        query = select(EventRow).where(EventRow.chain_id == copy["id"]).order_by(EventRow.seq)
        events = list(session.scalars(query))
    assert len({e.group for e in events}) == len(events), "each stands in a transaction of its own"
    assert max(len(e.rows or {}) for e in events) <= 10 + 1, "its rows, and the mission's sign of life"
    assert (events[-1].action, events[-1].actor) == ("copy", "Planner")
    target = api.get(f"/missions/{copy['id']}/targets?limit=1")["items"][0]
    headers = {"If-Match": "*"}
    api("PATCH", f"/targets/{target['id']}", {"notes": "changed"}, headers=headers)
    past = api.get(f"/missions/{copy['id']}/as-of/{events[-1].seq}")
    assert len(past["parts"]["targets"]) == 45
    assert {t["notes"] for t in past["parts"]["targets"]} == {""}
    api.post(f"/missions/{copy['id']}/undo", {}, status=200)
    assert api.get(f"/targets/{target['id']}")["notes"] == ""
    problem(api("POST", f"/missions/{copy['id']}/undo", {}), 409, "wrong-state")
    require_sound(api)


def test_a_copy_with_a_key_is_made_once(api: Api, mission: Mission) -> None:
    headers: dict[str, Any] = {"Idempotency-Key": "copy-1"}
    first = api("POST", f"/missions/{mission.id}/copy", {"name": "Once"}, headers=headers)
    again = api("POST", f"/missions/{mission.id}/copy", {"name": "Once"}, headers=headers)
    assert first.json() == again.json()
    assert len(api.get("/missions")["items"]) == 2


def test_what_is_left_of_a_copy_goes_when_a_server_starts(
    api: Api, mission: Mission, monkeypatch: pytest.MonkeyPatch
) -> None:
    left = [api.post(f"/missions/{mission.id}/copy", {"name": name})["id"] for name in ("old", "young")]
    with api.repo.database.write() as session:
        for copy, hours in zip(left, (2, 0), strict=True):
            row = session.get_one(MissionRow, copy)
            row.in_making, row.modified_utc = True, row.modified_utc - timedelta(hours=hours)
    monkeypatch.setattr(service, "open_repository", lambda _settings: api.repo)
    monkeypatch.setattr(service, "load_settings", lambda: api.repo.settings)
    monkeypatch.setattr(service, "set_up_logging", lambda _form, _level: None)
    service.create_app()
    with api.repo.database.read() as session:
        there = [copy for copy in left if session.get(MissionRow, copy) is not None]
    assert there == left[1:], "a young one may be at work"


def test_a_copy_that_takes_long_is_not_swept_while_it_goes_on(
    api: Api, mission: Mission, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its row is two hours old, as of a large mission on a slow disk, whenever another server sweeps."""
    api.post(f"/missions/{mission.id}/targets/bulk", {"create": places(7)}, status=200)
    monkeypatch.setattr(copying, "ROWS_AT_ONCE", 3)
    real = copying._copies

    def between(source: Any, actor: Any, copy_id: str, new_ids: Any) -> Any:
        for step in real(source, actor, copy_id, new_ids):
            with api.repo.database.write() as session:
                session.get_one(MissionRow, copy_id).created_utc -= timedelta(hours=2)
            copying.sweep_copies(api.repo)
            yield step

    monkeypatch.setattr(copying, "_copies", between)
    copy = api.post(f"/missions/{mission.id}/copy", {"name": "Long"})
    assert copy["counts"]["targets"] == 7
    require_sound(api)


def test_a_copy_that_was_swept_while_it_stood_still_says_so_and_leaves_nothing(
    api: Api, mission: Mission, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A computer that slept an hour: another server sweeps between two transactions."""
    api.post(f"/missions/{mission.id}/targets/bulk", {"create": places(7)}, status=200)
    monkeypatch.setattr(copying, "ROWS_AT_ONCE", 3)
    real = copying._copies

    def asleep(*given: Any) -> Any:
        for number, step in enumerate(real(*given)):
            if number == 2:
                with monkeypatch.context() as later:
                    later.setattr(copying, "LEFT_BEHIND", timedelta(seconds=-1))
                    copying.sweep_copies(api.repo)
            yield step

    monkeypatch.setattr(copying, "_copies", asleep)
    told = problem(api("POST", f"/missions/{mission.id}/copy", {"name": "Slept"}), 409, "wrong-state")
    assert "stood still" in told["detail"]
    with api.repo.database.read() as session:
        assert not session.scalars(select(MissionRow).where(MissionRow.in_making)).all()
        assert session.scalar(select(func.count()).select_from(TargetRow)) == 7
    require_sound(api)


def test_a_row_that_was_damaged_is_named_by_a_copy_which_leaves_nothing(api: Api, mission: Mission) -> None:
    api.post(f"/missions/{mission.id}/targets/bulk", {"create": places(3)}, status=200)
    for junk in ('{"a": 1}', "null", "7"):
        with api.repo.database.engine.begin() as connection:
            connection.execute(text("UPDATE targets SET normal = :junk"), {"junk": junk})
        answer = problem(
            api("POST", f"/missions/{mission.id}/copy", {"name": "Damaged"}), 503, "data-damaged"
        )
        assert "the table targets holds in normal" in answer["detail"]
    assert [m["id"] for m in api.get("/missions")["items"]] == [mission.id]


def test_ids_made_together_are_ids_like_others_and_ascend() -> None:
    before, many, after = new_id("tgt"), new_ids("tgt", 5000), new_id("tgt")
    assert sorted({before, *many, after}) == [before, *many, after]
    assert {len(name) for name in many} == {len(before)}
    assert new_ids("tgt", 0) == []


@pytest.mark.parametrize("differ", [False, True])
def test_digests_of_columns_are_those_of_the_rows(api: Api, mission: Mission, differ: bool) -> None:
    """Texts that look like the borders between texts, quotes, percent signs, nulls and usual values."""
    odd = [
        "plain",
        'a","b',
        "back\\slash",
        'quote"',
        "100 %b %s",
        "caf\u00e9 \u2028",
        "\x1f",
        ",",
        '"',
        "",
    ]
    with api.repo.database.write() as session:
        for n in range(40):
            k = n if differ else 3
            row = TargetRow(
                id=new_id("tgt"),
                mission_id=mission.id,
                name=f"{n} {odd[k % 10]}",
                notes=odd[k // 4],
                feature_type=odd[-1 - k % 3],
                author="Planner",
                east_m=[0.1, -0.0, 1e-7, 1e22, 3.0][k % 5],
                north_m=float(k),
                up_m=-0.0,
                slope_rad=0.0,
                normal=[0.0, -0.0, 1.0 / (1 + k)],
                covariance_m2=[[1e-9, 0.0], [0.0, 5e-324]],
                source_image=odd[k % 2],
                in_frame={"z": 1, "a": {"y": None, "b": odd[k % 9]}} if k % 3 else None,
            )
            session.add(row)
    with api.repo.database.read() as session:
        connection = session.connection()
        raw = RawRows(table_of(TargetRow), connection.dialect)
        rows = raw.read(connection, mission.id)
        assert len(rows) == 40
        wanted = [
            row_digest(raw.table, values_of(session.get_one(TargetRow, row[raw.place["id"]]))) for row in rows
        ]
    assert raw.digests(list(zip(*rows, strict=True))) == wanted
    at = raw.place["normal"]  # as it was written until lately, with spaces
    older = [[json.dumps(json.loads(v)) if k == at else v for k, v in enumerate(row)] for row in rows]
    assert raw.digests(list(zip(*older, strict=True))) == wanted
    one = [(value,) for value in rows[7]]
    assert raw.digests(one) == wanted[7:8]
