"""A whole mission as one archive, `mission/1`: rows, history, terrain and files, each with its hash."""

from __future__ import annotations

import hashlib
import json
import re
import zipfile
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.campaigns.result import RESULTS
from ground.errors import ArchiveError, InvalidInputError, StateError
from ground.gdr.base import Utc
from ground.gdr.history import GENESIS, event_digest, event_of
from ground.gdr.packed import is_kept, read_kept
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.get_resource import require_mission
from ground.resources.backups.check_files import pictures_of
from ground.resources.runs.read_snapshot import JOURNAL
from ground.resources.tables import METADATA
from ground.uplink.verify import MAX_COUNTER

if TYPE_CHECKING:
    from ground.resources.traverses.row import Localization

FORMAT = "mission/1"
Record = dict[str, object]
"""One row as it stands in `rows.json`."""

Rows = dict[str, list[Record]]
RIGHTS = ("approvals", "waivers", "packages", "statements", "signatures", "elsewhere")
"""Tables that say who allowed what: of an archive they are history, never rows."""

_LEFT_OUT = {"jobs", "counters", "webhooks", *RIGHTS}
TABLES = tuple(t.name for t in METADATA.sorted_tables if "mission_id" in t.c and t.name not in _LEFT_OUT)
"""Tables with a mission's rows, in the order in which they refer to each other; jobs and webhooks are not."""


def _record(row: Any) -> Record:
    return {k: x.isoformat() if isinstance(x, datetime) else x for k, x in row.items()}


def _rows(session: Session, mission_id: str) -> Rows:
    tables = METADATA.tables
    mission = session.execute(
        select(tables["missions"]).where(tables["missions"].c.id == mission_id)
    ).mappings()
    head = mission.one()
    terrain = session.execute(select(tables["terrains"]).where(tables["terrains"].c.id == head["terrain_id"]))
    found = {"terrains": [_record(terrain.mappings().one())], "missions": [_record(head)]}
    for name in (*TABLES, *RIGHTS):
        table = tables[name]
        query = select(table).where(table.c.mission_id == mission_id).order_by(table.c.id)
        found[name] = [_record(row) for row in session.execute(query).mappings()]
    for name, column in (("event_chains", "id"), ("events", "chain_id")):
        table = tables[name]
        query = select(table).where(table.c[column] == mission_id).order_by(*table.primary_key.columns)
        found[name] = [_record(row) for row in session.execute(query).mappings()]
    return found


def file_hashes(rows: Rows) -> set[str]:
    named = {str(r["sha256"]) for name in ("products", "packages", "site_maps") for r in rows[name]}
    adjusted = (cast("Localization | None", r["document"]) for r in rows["traverses"])
    named |= {sha256 for document in adjusted for sha256 in pictures_of(document)}
    for run in rows["runs"]:
        named |= {str(run[name]) for name in ("trace_sha256", "telemetry_sha256") if run[name]}
    return named


def export_mission(repo: Repository, actor: Actor, mission_id: str, target: Path) -> None:
    """Write a mission into a zip archive; what is kept packed here is unpacked there, for every reader."""
    actor.require(Action.READ, mission_id)
    with repo.database.read() as session:
        require_mission(session, mission_id)
        rows = _rows(session, mission_id)
    terrain_dir = repo.terrain_dir(str(rows["terrains"][0]["id"]))
    files = {f"terrain/{p.name}": p for p in sorted(terrain_dir.iterdir()) if p.name[0] != "."}
    try:
        files |= {f"files/{sha256}": repo.files.path(sha256) for sha256 in sorted(file_hashes(rows))}
    except (ValueError, TypeError) as err:
        raise StateError("a row of the mission names a file by something that is not a SHA-256") from err
    journals = {f"runs/{run['id']}/{JOURNAL}": repo.run_dir(str(run["id"])) / JOURNAL for run in rows["runs"]}
    for name, path in files.items():
        if not is_kept(path):
            raise StateError(
                f"{name} of the mission is gone here; `outcrop check --contents` names all that is"
            )
    files |= {name: path for name, path in journals.items() if is_kept(path)}
    content = json.dumps(rows, sort_keys=True).encode()
    manifest = {
        "format": FORMAT,
        "mission": mission_id,
        "name": rows["missions"][0]["name"],
        "files": {
            "rows.json": hashlib.sha256(content).hexdigest(),
            **{name: hashlib.sha256(read_kept(path)).hexdigest() for name, path in files.items()},
        },
    }
    draft = target.with_name(f".{target.name}.draft")
    with zipfile.ZipFile(draft, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("manifest.json", json.dumps(manifest, indent=1, sort_keys=True))
        archive.writestr("rows.json", content)
        for name, path in files.items():
            archive.writestr(name, read_kept(path), zipfile.ZIP_DEFLATED)
    draft.replace(target)


def read_archive(folder: Path) -> Rows:
    """Return the rows of an archive that was unpacked, by table.

    Raises
    ------
    ArchiveError
        If it is damaged, of another form, or its history or plans do not hold together.
    """
    try:
        manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
        listed = dict(manifest["files"])
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as err:
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
    try:
        rows = _shaped(json.loads((folder / "rows.json").read_text(encoding="utf-8")))
    except (OSError, ValueError, RecursionError) as err:
        raise ArchiveError("the archive has no readable rows.json") from err
    mission = rows["missions"][0].get("id")
    if any(r.get("mission_id") != mission for t in (*TABLES, *RIGHTS) for r in rows[t]):
        raise ArchiveError("the archive holds rows of something else than one mission")
    if any(r.get("chain_id") != mission for r in rows["events"]) or any(
        r.get("id") != mission for r in rows["event_chains"]
    ):
        raise ArchiveError("the archive holds the history of something else")
    terrain = rows["terrains"][0]["id"]
    for identifier in (terrain, mission, *(r.get("id") for t in TABLES for r in rows[t])):
        if not re.fullmatch(r"[A-Za-z0-9_-]{1,40}", str(identifier)):
            raise ArchiveError(f"the archive holds something with the id {str(identifier)[:60]!r}")
    try:
        if not all(re.fullmatch(r"[0-9a-f]{64}", str(sha256)) for sha256 in file_hashes(rows)):
            raise ArchiveError("the archive names a file by something that is not a SHA-256")
        _check_history(rows)
        _check_plans(rows)
        _check_campaigns(rows)
        for record in rows["packages"] + rows["statements"]:
            if not 0 <= int(str(record["sequence" if "sequence" in record else "counter"])) <= MAX_COUNTER:
                raise ArchiveError("the archive holds a package whose counter is not one")
    except (ValueError, TypeError, LookupError, AttributeError, OverflowError) as err:
        raise ArchiveError(f"a row of the archive is malformed: {type(err).__name__} {err}"[:200]) from err
    return rows


def _shaped(document: object) -> Rows:
    """Return rows by table, lists of objects each, of every table and no other.

    Raises
    ------
    ArchiveError
        If the document has another shape.
    """
    wanted = {"terrains", "missions", *TABLES, *RIGHTS, "event_chains", "events"}
    empty: Rows = {name: [] for name in (*TABLES, *RIGHTS)}  # those of a newer version
    found: Rows = empty | document if isinstance(document, dict) else {}
    if set(found) != wanted or not all(
        isinstance(rows, list) and all(isinstance(row, dict) for row in rows) for rows in found.values()
    ):
        raise ArchiveError("the archive holds other tables than those of a mission")
    if [len(found[name]) for name in ("missions", "terrains", "event_chains")] != [1, 1, 1]:
        raise ArchiveError("the archive holds rows of something else than one mission")
    return found


def typed(name: str, record: Mapping[str, object]) -> dict[str, object]:
    """Return a row of an archive as the database takes it.

    Raises
    ------
    ArchiveError
        If it has a column that is not known, or one of another type; SQLite would take it.
    """
    table = METADATA.tables[name]
    unknown = set(record) - set(table.c.keys())
    if unknown:
        raise ArchiveError(f"the archive comes from a newer version: {name} has {sorted(unknown)[0]!r}")
    found = {}
    for column, value in record.items():
        kind = table.c[column].type
        if isinstance(kind, Utc) and isinstance(value, str):
            value = datetime.fromisoformat(value)
        python = kind.python_type
        checked = python in {int, float, str, bool, dict, list} and value is not None
        fits = isinstance(value, int | float if python is float else python)
        if checked and (not fits or (isinstance(value, bool) and python is not bool)):
            raise ArchiveError(f"the archive is malformed: {name} has {column} {str(value)[:40]!r}")
        found[column] = value
    return found


def _check_history(rows: Rows) -> None:
    """Raise unless the events of an archive hold together up to its head."""
    previous, seq = GENESIS, 0
    for record in sorted(rows["events"], key=lambda r: int(str(r["seq"]))):
        event = event_of(typed("events", record))
        if event.seq != seq + 1 or event_digest(event, previous) != event.sha256:
            raise ArchiveError(f"the history of the archive is broken at event {event.seq}")
        previous, seq = event.sha256, event.seq
    if [(r["seq"], r["sha256"]) for r in rows["event_chains"]] != [(seq, previous)]:
        raise ArchiveError("the history of the archive is cut off")


def _check_campaigns(rows: Rows) -> None:
    """Raise unless what each campaign says is a `campaign/1`."""
    for campaign in rows["campaigns"]:
        if campaign["result"] is not None:
            try:
                RESULTS.from_document(campaign["result"])
            except InvalidInputError as err:
                raise ArchiveError(
                    f"the campaign {campaign['id']} of the archive is malformed: {err}"
                ) from err


def _check_plans(rows: Rows) -> None:
    """Raise unless each plan's digest is that of its text."""
    from executive.crl import CrlError, digest, parse

    for plan in rows["plans"]:
        try:
            found = None if plan["crl_text"] is None else digest(parse(str(plan["crl_text"])))
        except (CrlError, RecursionError) as err:
            raise ArchiveError(f"the plan {plan['id']} of the archive is not CRL") from err
        if found != plan["crl_sha256"]:
            raise ArchiveError(f"the plan {plan['id']} of the archive is not what its SHA-256 says")
