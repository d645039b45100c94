"""Every row is checked against the history: what was altered, added or removed behind its back is named."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import delete, func, select, text, update

from ground.gdr.history import Change, EventRow, hold_chain, record, verify_chains
from ground.gdr.repository import Repository
from ground.gdr.seals import sealed_tables
from ground.records.actor import SYSTEM_ACTOR
from ground.resources.comments.row import CommentRow
from ground.resources.history.verify_rows import RowReport, verify_rows
from ground.resources.mission_archives.import_mission import import_mission
from ground.resources.missions.value import Mission
from ground.resources.observation_requests.row import ObservationRequestRow
from ground.resources.packages.row import CounterRow
from ground.resources.tables import METADATA
from ground.resources.targets.row import TargetRow
from studies.flipped_bits import ARCHIVE, study
from tests.ground.conftest import Api
from tests.ground.test_missions_api import upload


def report(repo: Repository) -> RowReport:
    with repo.database.read() as session:
        assert verify_chains(session)[1] == []
        return verify_rows(session)


@pytest.fixture
def worked(api: Api, mission: Mission) -> Api:
    """Give a mission with a bit of everything that costs no planning, and acts taken back."""
    url = f"/missions/{mission.id}"
    rock, gone = (
        api.post(f"{url}/targets", {"east_m": east, "north_m": 1.0, "name": name})
        for east, name in ((1.0, "Rock"), (2.0, "Gone"))
    )
    for target in (rock, gone):
        given = {"target_id": target["id"], "instrument": "science_camera", "value": 1.0}
        api.post(f"{url}/observation-requests", given)
    api("PATCH", f"/targets/{rock['id']}", {"notes": "flat"}, headers={"If-Match": "*"})
    api("DELETE", f"/targets/{gone['id']}", headers={"If-Match": "*"})
    api.post(f"{url}/undo", {}, 200)
    api.post(f"{url}/redo", {}, 200)
    api.post(f"{url}/comments", {"subject_kind": "target", "subject_id": rock["id"], "text": "look"})
    upload(api, "a.bin", b"something")
    import_mission(api.repo, SYSTEM_ACTOR, ARCHIVE)
    with api.repo.database.write() as session:  # written by code that tells no event
        session.add(CounterRow(mission_id=mission.id, last=4))
    return api


def test_what_people_jobs_and_archives_write_is_all_told(worked: Api) -> None:
    found = report(worked.repo)
    assert (found.faults, found.untold) == ([], 0)
    with worked.repo.database.read() as session:
        counts = [session.scalar(select(func.count()).select_from(table)) or 0 for table in sealed_tables()]
    assert found.checked == sum(counts) > 20


def test_what_was_altered_put_in_or_taken_out_is_named(worked: Api, mission: Mission) -> None:
    with worked.repo.database.write() as session:
        mine = TargetRow.mission_id == mission.id
        target = session.scalars(select(TargetRow.id).where(mine)).one()
        requests = ObservationRequestRow.mission_id == mission.id
        request = session.scalars(select(ObservationRequestRow.id).where(requests)).one()
        comment = session.scalars(select(CommentRow.id)).first()
        session.execute(update(TargetRow).where(mine).values(east_m=1.0000001))
        session.execute(delete(ObservationRequestRow).where(requests))
        session.execute(update(CommentRow).where(CommentRow.id == comment).values(id="cmt-another"))
        session.execute(update(CounterRow).where(CounterRow.mission_id == mission.id).values(last=3))
        plans = METADATA.tables["plans"]
        (plan, *_) = session.scalars(select(plans.c.id)).all()
        session.execute(update(plans).where(plans.c.id == plan).values(crl_text=plans.c.crl_text + " "))
    assert {fault.row: fault.reason for fault in report(worked.repo).faults} == {
        f"targets/{target}": "it is not what its last event left",
        f"observation_requests/{request}": "it is gone, and no event says so",
        f"comments/{comment}": "it is gone, and no event says so",
        "comments/cmt-another": "no event tells of it",
        f"counters/{mission.id}": "it is not what its last event left",
        f"plans/{plan}": "it is not what its last event left",
    }


def test_rows_go_with_their_mission(worked: Api, mission: Mission) -> None:
    answer = worked("DELETE", f"/missions/{mission.id}", headers={"If-Match": "*"}, who="Administrator")
    assert answer.status_code == 204
    assert report(worked.repo).faults == []


def test_a_text_that_is_none_stops_no_check(sqlite_api: Api) -> None:
    upload(sqlite_api, "a.bin", b"something")
    with sqlite_api.repo.database.write() as session:
        session.execute(text("UPDATE people SET name = CAST(x'ff61' AS TEXT) WHERE name = 'Viewer'"))
        session.execute(text("UPDATE events SET after = '{\"a\": 1 }' WHERE seq = 2"))
    with sqlite_api.repo.database.read() as session:
        assert [(f.seq, f.reason) for f in verify_chains(session)[1]] == [
            (2, "its after is not as it was written")
        ]
        assert "its name is not as it was written" in {f.reason for f in verify_rows(session).faults}


def test_a_rolled_back_write_leaves_no_seal(worked: Api, mission: Mission) -> None:
    def count() -> Any:
        with worked.repo.database.read() as session:
            return session.scalar(select(func.count()).select_from(EventRow))

    def fail() -> None:
        with worked.repo.database.write() as session:
            session.get_one(CounterRow, mission.id).last = 9
            session.flush()
            raise ZeroDivisionError

    before = count()
    with pytest.raises(ZeroDivisionError):
        fail()
    assert (count(), report(worked.repo).faults) == (before, [])


def test_a_write_undone_within_an_act_leaves_no_gap_in_the_history(worked: Api, mission: Mission) -> None:
    """The head of a chain is remembered from one event to the next: not over what was undone between."""
    repo = worked.repo

    def write(reason: str) -> None:
        with repo.database.write() as session:
            hold_chain(session, mission.id)
            record(session, mission.id, Change("Planner", "note", "mission", mission.id, None, None, reason))
            if reason == "undone":
                raise ZeroDivisionError

    with repo.database.together():
        write("first")
        for _ in range(2):
            with pytest.raises(ZeroDivisionError):
                write("undone")
        write("second")
        write("third")
    with repo.database.read() as session:
        newest = select(EventRow.reason).where(EventRow.chain_id == mission.id).order_by(EventRow.seq)
        assert session.scalars(newest).all()[-3:] == ["first", "second", "third"]
        assert verify_chains(session)[1] == []


def test_single_flipped_bits_are_found_and_named(tmp_path: Path) -> None:
    counts, missed = study(90, 7)
    assert missed == []
    assert {place: tally["found"] for place, tally in counts.items()} == {"backup": 30, "file": 30, "row": 30}
