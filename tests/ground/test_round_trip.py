"""Export, delete and import give the same mission: what differs, and nothing else, is listed here."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from sqlalchemy import select

from ground.gdr.base import utc_now
from ground.gdr.history import verify_chains
from ground.gdr.repository import Repository
from ground.records.actor import Actor, Role
from ground.records.delete_resource import delete_resource
from ground.resources.approvals.row import ApprovalRow, WaiverRow
from ground.resources.comments.row import CommentRow
from ground.resources.history.verify_rows import verify_rows
from ground.resources.kinds import KINDS
from ground.resources.mission_archives.import_mission import import_mission
from ground.resources.mission_archives.mission_archive import export_mission
from ground.resources.packages.row import CounterRow, PackageRow, SignatureRow, StatementRow
from ground.resources.plans.row import PlanRow
from ground.resources.plans.value import PlanState
from ground.resources.runs.row import RunRow
from ground.resources.tables import METADATA
from studies.flipped_bits import ARCHIVE

ADA, BOB = Actor("Ada", Role.ADMIN), Actor("Bob", Role.ADMIN)
COMMON = {"author": "Ada"}

GONE = {"approvals": 1, "waivers": 1, "packages": 1, "statements": 1, "signatures": 1, "elsewhere": 1}
"""Rows that do not come back: who allowed what is history, in a new document of `elsewhere`."""
CHANGED: dict[str, set[str]] = {
    "plans": {"author", "approved_by", "state", "elsewhere"},
    "runs": {"author", "elsewhere", "package_sha256", "job_id"},
}
"""Columns that say what was allowed or done here; of all other tables the author's name alone."""


def parts(repo: Repository, mission_id: str) -> dict[str, dict[str, Any]]:
    """Return every row of a mission by table and id."""
    found: dict[str, dict[str, Any]] = {}
    with repo.database.read() as session:
        for table in METADATA.sorted_tables:
            key = table.c.get("id" if table.name == "missions" else "mission_id")
            if key is not None:
                rows = session.execute(select(table).where(key == mission_id)).mappings()
                found[table.name] = {str(row[next(iter(table.primary_key)).name]): dict(row) for row in rows}
    return found


def allowed(repo: Repository, mission_id: str) -> None:
    """Have the first plan approved, waived, signed, packed and flown."""
    with repo.database.write() as session:
        plan = session.scalars(select(PlanRow).where(PlanRow.mission_id == mission_id)).first()
        assert plan is not None
        plan.author, plan.elsewhere = "Ada", False
        plan.state, plan.approved_by = PlanState.UPLINKED.value, "Bob"
        for run in session.scalars(select(RunRow).where(RunRow.mission_id == mission_id)):
            run.elsewhere, run.package_sha256, run.job_id = False, "7" * 64, "job-1"
        for row in session.scalars(select(PlanRow).where(PlanRow.id != plan.id)):
            row.elsewhere = False
        named = {"mission_id": mission_id, "plan_id": plan.id, **COMMON}
        digests = dict.fromkeys(
            ("crl_sha256", "terrain_sha256", "dictionary_sha256", "models_sha256"), "0" * 64
        )
        stored = repo.files.put_bytes(b"a package")
        session.add(ApprovalRow(id="apv-1", note="good", **digests, **named))
        session.add(WaiverRow(id="wvr-1", rule="margin", reason="known", **named))
        session.add(
            StatementRow(id="stm-1", counter=3, sha256="1" * 64, manifest="{}", landmarks="{}", **named)
        )
        session.flush()
        signature = {"statement_id": "stm-1", "role": "author", "key_id": "k", "signature": "s"}
        session.add(SignatureRow(id="sgn-1", mission_id=mission_id, **signature, **COMMON))
        session.add(PackageRow(id="pkg-1", sequence=3, sha256=stored.sha256, key_id="k", **named))
        session.merge(CounterRow(mission_id=mission_id, last=3))
        subject = {"subject_kind": "plan", "subject_id": plan.id, "text": "go"}
        session.add(CommentRow(id="cmt-1", mission_id=mission_id, **subject, **COMMON))


def test_export_delete_and_import_give_the_same_mission_but_for_what_was_allowed(
    repo: Repository, tmp_path: Path
) -> None:
    mission = import_mission(repo, ADA, ARCHIVE)
    allowed(repo, mission.id)
    before = parts(repo, mission.id)
    export_mission(repo, ADA, mission.id, tmp_path / "m.zip")
    delete_resource(repo, ADA, KINDS["mission"], mission.id, None)
    assert not any(parts(repo, mission.id).values())
    began = utc_now()
    import_mission(repo, BOB, tmp_path / "m.zip")
    after = parts(repo, mission.id)

    gone = {name: len(before[name]) for name in before if before[name].keys() - after[name].keys()}
    assert gone == GONE
    new = {name: after[name].keys() - before[name].keys() for name in before}
    assert {name for name, keys in new.items() if keys} == {"elsewhere"}
    (kept,) = (after["elsewhere"][key] for key in new["elsewhere"])
    assert (kept["author"], kept["created_utc"] > began) == ("Bob", True)
    for name in (*GONE, "states"):
        assert kept["document"][name], f"{name} stand in the history of elsewhere"

    differing: dict[str, set[str]] = {}
    for name, rows in before.items():
        for key in rows.keys() & after[name].keys():
            odd = {column for column in rows[key] if rows[key][column] != after[name][key][column]}
            differing[name] = differing.get(name, set()) | odd
    for name, columns in differing.items():
        assert columns <= CHANGED.get(name, {"author"}), name
    assert differing["plans"] == CHANGED["plans"]
    assert differing["runs"] >= CHANGED["runs"] - {"author"}
    with repo.database.read() as session:
        assert verify_chains(session)[1] == verify_rows(session).faults == []
