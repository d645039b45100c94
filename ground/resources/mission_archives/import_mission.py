"""Take in the archive of a mission; what it says others allowed is history, never a right here."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path

from sqlalchemy import insert
from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.orm import Session

from ground.durable import copy_folder
from ground.errors import ArchiveError, ConflictError
from ground.gdr.archives import extract_zip
from ground.gdr.base import utc_now
from ground.gdr.history import ChainRow, Change, open_chain
from ground.gdr.history import record as write_event
from ground.gdr.ids import new_id
from ground.gdr.packed import write_packed
from ground.gdr.places import keep_folder
from ground.gdr.repository import Repository
from ground.gdr.seals import seal, seal_mission
from ground.jobs.value import JobState
from ground.records.actor import ELSEWHERE, Action, Actor
from ground.resources.drafts.value import DraftState
from ground.resources.mission_archives.mission_archive import (
    RIGHTS,
    TABLES,
    Record,
    Rows,
    file_hashes,
    read_archive,
    typed,
)
from ground.resources.missions.kind import MISSION
from ground.resources.missions.row import ElsewhereRow, MissionRow
from ground.resources.missions.value import Mission
from ground.resources.packages.row import CounterRow
from ground.resources.plans.value import PlanState
from ground.resources.plans.work import findings_of
from ground.resources.runs.read_snapshot import JOURNAL
from ground.resources.sols.row import usable_energy_j
from ground.resources.tables import METADATA
from ground.resources.terrains.row import TerrainRow


def import_mission(repo: Repository, actor: Actor, source: Path, *, name: str | None = None) -> Mission:
    """Return the mission of an archive, with its ids and files; what others did elsewhere is history.

    An archive proves nothing about who allowed what, so its approvals, waivers, packages, signatures and
    events become one document of the table `elsewhere`; its plans are computed and the importer's to sign
    for, its runs verify nothing, its campaigns and predictions count for no rule, and its people are named as
    people of elsewhere.

    Raises
    ------
    ArchiveError
        If the archive is damaged, unsafe or of another form, or its history does not hold together.
    ConflictError
        If the mission, or something else with an id of the archive, is here already.
    """
    actor.require(Action.EDIT_MISSION)
    with tempfile.TemporaryDirectory(prefix="outcrop-import-") as work:
        folder = Path(work) / "mission"
        extract_zip(source, folder, max_bytes=int(repo.settings.max_body_mib * 32 * 2**20))
        rows = read_archive(folder)
        _check_terrain(folder / "terrain", rows["terrains"][0])
        texts = {run[name] for run in rows["runs"] for name in ("trace_sha256", "telemetry_sha256")}
        for sha256 in file_hashes({**rows, "packages": []}):
            try:
                file = folder / "files" / sha256
                packed = sha256 in texts
                stored = repo.files.put_packed(file.read_bytes()) if packed else repo.files.put_file(file)
            except OSError as err:
                raise ArchiveError(f"the archive is damaged: files/{sha256} is missing") from err
            if stored.sha256 != sha256:
                raise ArchiveError(f"files/{sha256} is not what its name says")
        try:
            with repo.database.write() as session:
                mission = _insert(repo, session, actor, folder, rows)
                if name is not None:
                    mission.name = name
                session.flush()
                return MISSION.show_one(session, mission)
        except (SQLAlchemyError, ValueError, TypeError, LookupError, AttributeError) as err:
            cause = str(getattr(err, "orig", None) or err).splitlines()[0]
            raise ArchiveError(f"the rows of the archive do not fit in here: {cause[:160]}") from err


def _check_terrain(folder: Path, row: Record) -> None:
    from rover_iface.errors import RoverError
    from rover_iface.terrain import load_terrain

    try:
        found = load_terrain(folder).sha256
    except (RoverError, OSError) as err:
        raise ArchiveError(f"the terrain of the archive cannot be read: {err}") from err
    if found != row.get("sha256"):
        raise ArchiveError("the terrain of the archive is not what its SHA-256 says")


def _insert(repo: Repository, session: Session, actor: Actor, folder: Path, rows: Rows) -> MissionRow:
    """Write the rows of an archive as they may stand here, and its folders."""
    mission_id, terrain = str(rows["missions"][0]["id"]), rows["terrains"][0]
    if session.get(MissionRow, mission_id) is not None:
        raise ConflictError(f"mission {mission_id} is here already")
    tables = METADATA.tables
    known = session.get(TerrainRow, terrain["id"])
    if known is not None and known.sha256 != terrain["sha256"]:
        raise ConflictError(f"another terrain {terrain['id']} is here already")
    if known is None:
        session.execute(
            insert(tables["terrains"]).values(**typed("terrains", quarantined("terrains", terrain)))
        )
    sols = {str(sol["id"]): sol for sol in rows["sols"]}
    rows = {**rows, "plans": [_with_findings(plan, sols) for plan in rows["plans"]]}
    for table in ("missions", *TABLES):
        for record in rows[table]:
            row = quarantined(table, record, actor.name)
            session.execute(insert(tables[table]).values(**typed(table, row)))
    counters = [int(str(r["sequence"])) for r in rows["packages"]]
    counters += [int(str(r["counter"])) for r in rows["statements"]]
    session.add(CounterRow(mission_id=mission_id, last=max(counters, default=0)))
    if session.get(ChainRow, mission_id) is None:  # of a mission that was deleted here it goes on
        open_chain(session, mission_id)
    document: dict[str, object] = {part: rows[part] for part in (*RIGHTS, "events", "event_chains")}
    document["states"] = {plan["id"]: plan["state"] for plan in rows["plans"]}
    els = ElsewhereRow(id=new_id("els"), author=actor.name, mission_id=mission_id, document=document)
    session.add(els)
    session.flush()
    heads = {"events": len(rows["events"]), "head": rows["event_chains"][0]["sha256"], "elsewhere": els.id}
    seal_mission(session, mission_id)
    if known is None:
        seal(session, session.get_one(TerrainRow, terrain["id"]))
    write_event(session, mission_id, Change(actor.name, "import", "mission", mission_id, None, heads))
    if known is None:  # whatever lies there is of an import that failed
        place = repo.folders("terrains").at(str(terrain["id"]))
        copy_folder(folder / "terrain", place.root)
        keep_folder(place)
    for run in rows["runs"]:
        run_id = str(run["id"])
        journal = folder / "runs" / run_id / JOURNAL
        if journal.is_file():
            place = repo.folders("runs").at(run_id)
            write_packed(place.root / JOURNAL, journal.read_bytes())
            keep_folder(place)
    return session.get_one(MissionRow, mission_id)


def quarantined(table: str, record: Record, importer: str = "") -> dict[str, object]:
    """Return a row of an archive as it may stand here: without rights, and naming people of elsewhere."""
    row = {**record, "author": _of_elsewhere(str(record["author"]))}
    if table == "missions":
        row |= {"in_making": False}
    elif table == "plans":
        row |= {"author": importer, "approved_by": None, "elsewhere": True}
        if record["state"] not in {PlanState.DRAFT.value, PlanState.COMPUTED.value}:
            row["state"] = PlanState.COMPUTED.value
    elif table == "runs":
        row |= {"elsewhere": True, "package_sha256": None, "job_id": None, "state": _ended(record)}
    elif table == "campaigns":
        row |= {"elsewhere": True, "state": _ended(record)}
    elif table == "drafts":
        row |= _decided_draft(record, importer)
    return row


def _decided_draft(record: Record, importer: str) -> Record:
    """Return the columns of a draft that nobody can take over here.

    Who takes one over relies on who drafted it, and of that an archive is not a witness.
    """
    names = ("drafted_by", "drafted_for", "decided_by")
    columns: Record = {name: _of_elsewhere(str(record[name])) if record[name] else "" for name in names}
    if record["state"] in {DraftState.ACCEPTED.value, DraftState.REJECTED.value}:
        return columns
    now = utc_now().isoformat()
    rejected = {"state": DraftState.REJECTED.value, "decided_by": importer, "decided_utc": now}
    return {**columns, **rejected, "reason": "it was open in the archive it came with"}


def _of_elsewhere(name: str) -> str:
    return name if name.endswith(ELSEWHERE) else name[: 80 - len(ELSEWHERE)] + ELSEWHERE


def _ended(record: Record) -> str:
    """Return the state of what a job did; a job that had not ended there goes on nowhere."""
    state = str(record["state"])
    return JobState.CANCELLED.value if state in {JobState.QUEUED.value, JobState.RUNNING.value} else state


def _with_findings(plan: Record, sols: Mapping[str, Record]) -> Record:
    """Return a plan with what the validator here has against it; what was found elsewhere counts not.

    The charge is that of its sol, which people here see and change, not what the problem beside it says.
    """
    from rover_iface.errors import ProfileError
    from rover_iface.profile import load_profile

    if plan["crl_text"] is None:
        return {**plan, "findings": []}
    try:
        language = load_profile(str(plan["rover_profile"])).language
    except ProfileError as err:
        unknown = {"code": "E000", "severity": "error", "message": f"the plan cannot be checked: {err}"}
        return {**plan, "findings": [{**unknown, "node": None, "line": None, "column": None}]}
    sol = sols[str(plan["sol_id"])]
    charge = (float(str(sol[name])) for name in ("battery_j", "energy_floor_j", "energy_budget_j"))
    battery_j = usable_energy_j(*charge)
    return {**plan, "findings": findings_of(str(plan["crl_text"]), language, battery_j=battery_j)}
