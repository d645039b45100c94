"""A whole mission as one archive, `mission/1`: rows, history, terrain and files, each with its hash."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import tempfile
import zipfile
from datetime import datetime
from pathlib import Path
from typing import Any

from sqlalchemy import insert, select
from sqlalchemy.orm import Session

from ground.errors import ArchiveError, ConflictError, NotFoundError
from ground.gdr.archives import extract_zip
from ground.gdr.base import Utc
from ground.gdr.history import GENESIS, ChainRow, EventRow, event_digest
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.resources.backups.check_files import pictures_of
from ground.resources.missions.kind import show_missions
from ground.resources.missions.row import MissionRow
from ground.resources.missions.value import Mission
from ground.resources.runs.read_snapshot import JOURNAL
from ground.resources.tables import METADATA
from ground.resources.terrains.row import TerrainRow

FORMAT = "mission/1"
TABLES = tuple(t.name for t in METADATA.sorted_tables if "mission_id" in t.c and t.name != "jobs")
"""Tables with a mission's rows, in the order in which they refer to each other; jobs are not kept."""


def _record(row: Any) -> dict[str, Any]:
    return {k: x.isoformat() if isinstance(x, datetime) else x for k, x in row.items()}


def _rows(session: Session, mission_id: str) -> dict[str, list[dict[str, Any]]]:
    tables = METADATA.tables
    mission = session.execute(
        select(tables["missions"]).where(tables["missions"].c.id == mission_id)
    ).mappings()
    head = mission.one()
    terrain = session.execute(select(tables["terrains"]).where(tables["terrains"].c.id == head["terrain_id"]))
    found = {"terrains": [_record(terrain.mappings().one())], "missions": [_record(head)]}
    for name in TABLES:
        table = tables[name]
        query = select(table).where(table.c.mission_id == mission_id).order_by(table.c.id)
        found[name] = [_record(row) for row in session.execute(query).mappings()]
    for name, column in (("event_chains", "id"), ("events", "chain_id")):
        table = tables[name]
        query = select(table).where(table.c[column] == mission_id).order_by(*table.primary_key.columns)
        found[name] = [_record(row) for row in session.execute(query).mappings()]
    return found


def _hashes(rows: dict[str, list[dict[str, Any]]]) -> set[str]:
    named = {r["sha256"] for name in ("products", "packages", "site_maps") for r in rows[name]}
    named |= {sha256 for r in rows["traverses"] for sha256 in pictures_of(r["document"])}
    for run in rows["runs"]:
        named |= {run[name] for name in ("trace_sha256", "telemetry_sha256") if run[name]}
    return named


def export_mission(repo: Repository, actor: Actor, mission_id: str, target: Path) -> None:
    """Write a mission into a zip archive."""
    actor.require(Action.READ, mission_id)
    with repo.database.read() as session:
        if session.get(MissionRow, mission_id) is None:
            raise NotFoundError(f"there is no mission {mission_id}")
        rows = _rows(session, mission_id)
    terrain_dir = repo.terrain_dir(rows["terrains"][0]["id"])
    files = {f"terrain/{p.name}": p for p in sorted(terrain_dir.iterdir()) if p.name[0] != "."}
    files |= {f"files/{sha256}": repo.files.path(sha256) for sha256 in sorted(_hashes(rows))}
    journals = {f"runs/{run['id']}/{JOURNAL}": repo.run_dir(run["id"]) / JOURNAL for run in rows["runs"]}
    files |= {name: path for name, path in journals.items() if path.is_file()}
    content = json.dumps(rows, sort_keys=True).encode()
    manifest = {
        "format": FORMAT,
        "mission": mission_id,
        "name": rows["missions"][0]["name"],
        "files": {
            "rows.json": hashlib.sha256(content).hexdigest(),
            **{name: hashlib.sha256(path.read_bytes()).hexdigest() for name, path in files.items()},
        },
    }
    draft = target.with_name(f".{target.name}.draft")
    with zipfile.ZipFile(draft, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("manifest.json", json.dumps(manifest, indent=1, sort_keys=True))
        archive.writestr("rows.json", content)
        for name, path in files.items():
            archive.write(path, name)
    draft.replace(target)


def import_mission(repo: Repository, actor: Actor, source: Path, *, name: str | None = None) -> Mission:
    """Return the mission of an archive, with its ids, files and history.

    Raises
    ------
    ArchiveError
        If the archive is damaged, unsafe or of another form, or its history does not hold together.
    ConflictError
        If the mission is here already.
    """
    actor.require(Action.EDIT_MISSION)
    with tempfile.TemporaryDirectory(prefix="outcrop-import-") as work:
        folder = Path(work) / "mission"
        extract_zip(source, folder, max_bytes=int(repo.settings.max_body_mib * 32 * 2**20))
        rows = _checked(folder)
        terrain_id = rows["terrains"][0]["id"]
        mission_id = rows["missions"][0]["id"]
        for sha256 in _hashes(rows):
            if repo.files.put_file(folder / "files" / sha256).sha256 != sha256:
                raise ArchiveError(f"files/{sha256} is not what its name says")
        place = repo.terrain_dir(terrain_id)
        if not place.is_dir():
            place.parent.mkdir(parents=True, exist_ok=True)
            shutil.copytree(folder / "terrain", place)
        for run in rows["runs"]:
            journal = folder / "runs" / run["id"] / JOURNAL
            if journal.is_file() and not (kept := repo.run_dir(run["id"]) / JOURNAL).exists():
                kept.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(journal, kept)
        with repo.database.write() as session:
            if session.get(MissionRow, mission_id) is not None:
                raise ConflictError(f"mission {mission_id} is here already")
            tables = METADATA.tables
            if session.get(TerrainRow, terrain_id) is None:
                session.execute(insert(tables["terrains"]).values(**_typed("terrains", rows["terrains"][0])))
            for table in ("missions", *TABLES, "event_chains", "events"):
                for record in rows[table]:
                    session.execute(insert(tables[table]).values(**_typed(table, record)))
            _check_chain(session, mission_id)
            mission = session.get_one(MissionRow, mission_id)
            if name is not None:
                mission.name = name
            session.flush()
            return show_missions(session, [mission])[0]


def _checked(folder: Path) -> dict[str, list[dict[str, Any]]]:
    try:
        manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
        listed = dict(manifest["files"])
    except (OSError, ValueError, KeyError, TypeError) as err:
        raise ArchiveError("the archive has no readable manifest.json") from err
    if manifest.get("format") != FORMAT:
        raise ArchiveError(f"the archive has the format {manifest.get('format')!r}; {FORMAT} is readable")
    present = {p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file()} - {"manifest.json"}
    if present != set(listed):
        odd = sorted(present ^ set(listed))[0]
        raise ArchiveError(f"the archive is damaged: {odd} is missing or not in its manifest")
    for name, digest in listed.items():
        if hashlib.sha256((folder / name).read_bytes()).hexdigest() != digest:
            raise ArchiveError(
                f"the archive is damaged: {name} is not what the manifest says (SHA-256 differs)"
            )
    rows: dict[str, list[dict[str, Any]]] = json.loads((folder / "rows.json").read_text(encoding="utf-8"))
    rows |= {name: [] for name in TABLES if name not in rows}  # tables of a newer version
    wanted = {"terrains", "missions", *TABLES, "event_chains", "events"}
    mission = rows.get("missions", [{}])[0].get("id")
    if set(rows) != wanted or any(r.get("mission_id") != mission for t in TABLES for r in rows[t]):
        raise ArchiveError("the archive holds rows of something else than one mission")
    if any(r["chain_id"] != mission for r in rows["events"]) or any(
        r["id"] != mission for r in rows["event_chains"]
    ):
        raise ArchiveError("the archive holds the history of something else")
    terrain = rows["terrains"][0]["id"]
    for identifier in (terrain, mission, *(r["id"] for t in TABLES for r in rows[t])):
        if not re.fullmatch(r"[A-Za-z0-9_-]{1,40}", str(identifier)):
            raise ArchiveError(f"the archive holds something with the id {str(identifier)[:60]!r}")
    return rows


def _typed(name: str, record: dict[str, Any]) -> dict[str, Any]:
    table = METADATA.tables[name]
    unknown = set(record) - set(table.c.keys())
    if unknown:
        raise ArchiveError(f"the archive comes from a newer version: {name} has {sorted(unknown)[0]!r}")
    return {
        column: datetime.fromisoformat(value)
        if isinstance(table.c[column].type, Utc) and isinstance(value, str)
        else value
        for column, value in record.items()
    }


def _check_chain(session: Session, mission_id: str) -> None:
    head = session.get(ChainRow, mission_id)
    previous, seq = GENESIS, 0
    for event in session.scalars(
        select(EventRow).where(EventRow.chain_id == mission_id).order_by(EventRow.seq)
    ):
        if event.seq != seq + 1 or event_digest(event, previous) != event.sha256:
            raise ArchiveError(f"the history of the archive is broken at event {event.seq}")
        previous, seq = event.sha256, event.seq
    if head is None or (head.seq, head.sha256) != (seq, previous):
        raise ArchiveError("the history of the archive is cut off")
