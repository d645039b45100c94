"""Copy a mission: a what-if of its own.

What belongs to the mission is read as one state of the database and written in small transactions, so that
nobody else's write waits for a large copy. Until the last of them no list shows the copy, it cannot be asked
for, nor can its parts; what a crash leaves of one goes with a later copy or when a server starts.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

from sqlalchemy import Table, delete, select
from sqlalchemy.orm import Session

from ground.errors import StateError
from ground.gdr.base import Columns, table_of, utc_now
from ground.gdr.history import ChainRow, Change, hold_chain, open_chain, record
from ground.gdr.ids import new_id, new_ids
from ground.gdr.raw_rows import RawRow, RawRows
from ground.gdr.repository import Repository
from ground.gdr.seals import seal_digests
from ground.records.actor import Action, Actor
from ground.records.edit import public
from ground.records.get_resource import find_row
from ground.resources.kinds import KINDS
from ground.resources.merge_bases.kind import MERGE_BASE
from ground.resources.merge_bases.row import MergeBaseRow
from ground.resources.missions.kind import MISSION
from ground.resources.missions.row import MissionRow
from ground.resources.missions.value import Mission
from ground.resources.people.mission_roles import inherit_roles

COPIED = ("frame", "solution", "frame_file", "site_map", "sol", "target", "observation_request", "keep_out")
"""Kinds that a copy has, in the order in which they refer to each other."""
ROWS_AT_ONCE = 2000
"""Rows of one transaction: about 20 ms, so that one may wait for two of them within 50 ms."""
LEFT_BEHIND = timedelta(minutes=10)
"""A copy that has written nothing for so long goes on no more: its server was stopped.

A transaction of one takes about 10 ms and waits for others at most as long as the database lets it.
"""

CLAIMED = datetime(1970, 1, 1, tzinfo=UTC)
"""When a copy was modified that is being deleted: whoever wrote it finds that it is not theirs any more."""

ANEW = ("author", "revision", "mission_id", "created_utc", "modified_utc")
"""Columns that are the copy's own."""
_NAMES = ("frame_id", "reference_id", "solution_id", "file_id", "target_id")
"""Columns that refer to something of the same mission."""
_REQUEST = "observation_request"


@dataclass(frozen=True, slots=True)
class _Part:
    """Rows of one kind."""

    kind: str
    raw: RawRows
    rows: Sequence[RawRow]


@dataclass(frozen=True, slots=True)
class _Source:
    """What is copied: the columns of the mission, and its parts in the order of `COPIED`, at one moment."""

    mission: Columns
    parts: Sequence[_Part]
    event: int
    """Number of its newest event at that moment."""


def copy_mission(repo: Repository, actor: Actor, mission_id: str, *, name: str, notes: str = "") -> Mission:
    """Return a copy with its own sols, targets, requests and keep-outs; plans and runs stay with the first.

    Requests begin again as open. The terrain is shared, it never changes. Who may see the first may see the
    copy, and nobody else: see `inherit_roles`.
    """
    actor.require(Action.EDIT_MISSION, mission_id)
    copy_id = new_id(MISSION.prefix)
    with repo.database.apart():
        sweep_copies(repo)
        source = _read(repo, mission_id)
        ids = _new_ids(source)
        beat = _begin(repo, actor, source.mission, copy_id, name, notes)
        for raw, columns in _copies(source, actor, copy_id, ids):
            names, digests, rows = (
                columns[raw.place["id"]],
                raw.digests(columns),
                [*zip(*columns, strict=True)],
            )
            with repo.database.write() as session:
                beat = _alive(session, copy_id, beat)
                raw.write(session.connection(), rows)
                seal_digests(session, copy_id, raw.table, names, digests)
    with repo.database.write() as session:
        find_row(session, MISSION, mission_id)
        inherit_roles(session, actor, mission_id, copy_id)
        hold_chain(session, copy_id)
        _alive(session, copy_id, beat)
        copy = session.get_one(MissionRow, copy_id)
        copy.in_making = False
        copy.anchor_frame_id = ids.get(source.mission["anchor_frame_id"])
        copy.drive_rules = _rules(source.mission["drive_rules"], ids)
        session.add(_base(source, actor, copy_id, ids))
        session.flush()
        record(session, copy_id, Change(actor.name, "copy", MISSION.name, copy_id, None, public(copy)))
        return MISSION.show_one(session, copy)


def _read(repo: Repository, mission_id: str) -> _Source:
    """Return a mission and its parts as one moment saw them."""
    with repo.database.read() as session:
        whole = {} if repo.database.is_sqlite else {"isolation_level": "REPEATABLE READ"}
        reader = session.connection(execution_options=whole)
        find_row(session, MISSION, mission_id)
        missions = _table("mission")
        mission = reader.execute(select(missions).where(missions.c.id == mission_id)).mappings().one()
        event = reader.execute(select(ChainRow.seq).where(ChainRow.id == mission_id)).scalar_one()
        parts = []
        for kind_name in COPIED:
            raw = RawRows(_table(kind_name), reader.dialect, unread=ANEW)
            parts.append(_Part(kind_name, raw, raw.read(reader, mission_id)))
        return _Source(dict(mission), parts, event)


def _table(kind_name: str) -> Table:
    return table_of(KINDS[kind_name].row)


def _new_ids(source: _Source) -> dict[str, str]:
    """Return the ids of the copies by those of what is copied."""
    found: dict[str, str] = {}
    for part in source.parts:
        place = part.raw.place["id"]
        mine = new_ids(KINDS[part.kind].prefix, len(part.rows))
        found |= zip((row[place] for row in part.rows), mine, strict=True)
    return found


def _begin(repo: Repository, actor: Actor, source: Columns, copy_id: str, name: str, notes: str) -> datetime:
    """Write the copy of the mission itself, which nobody sees yet; return its first sign of life."""
    beat = utc_now()
    mine = {**source, "author": actor.name, "revision": 1, "created_utc": beat, "modified_utc": beat}
    mine |= {"id": copy_id, "name": name, "notes": notes, "copied_from": source["id"], "in_making": True}
    with repo.database.write() as session:
        session.add(MissionRow(**{**mine, "anchor_frame_id": None, "drive_rules": None}))
        session.flush()
        open_chain(session, copy_id)
    return beat


def _alive(session: Session, copy_id: str, beat: datetime) -> datetime:
    """Note that a copy goes on, and return when: until it is whole, its row was modified when it last wrote.

    Raises
    ------
    StateError
        If somebody else has it for left behind, and deletes it.
    """
    row = session.get(MissionRow, copy_id, with_for_update=True, populate_existing=True)
    if row is None or row.modified_utc != beat:
        raise StateError(f"the copy stood still for more than {LEFT_BEHIND} and was deleted; copy again")
    row.modified_utc = max(utc_now(), beat + timedelta(microseconds=1))
    return row.modified_utc


def _copies(
    source: _Source, actor: Actor, copy_id: str, ids: Mapping[str, str]
) -> Iterator[tuple[RawRows, list[Sequence[Any]]]]:
    """Yield the columns of the rows of a copy, as many as a transaction writes, as they refer."""
    now = utc_now()
    for part in source.parts:
        place = part.raw.place
        made = part.raw.time(now)
        fixed = dict(zip(ANEW, (actor.name, 1, copy_id, made, made), strict=True))
        fixed |= {"state": "open", "state_reason": ""} if part.kind == _REQUEST else {}
        named = [place[name] for name in ("id", *_NAMES) if name in place]
        after = place.get("after") if part.kind == _REQUEST else None
        for first in range(0, len(part.rows), ROWS_AT_ONCE):
            some = part.rows[first : first + ROWS_AT_ONCE]
            columns: list[Sequence[Any]] = list(zip(*some, strict=True))
            for name, value in fixed.items():
                columns[place[name]] = [value] * len(some)
            for at in named:
                columns[at] = [value if value is None else ids[value] for value in columns[at]]
            if after is not None:
                columns[after] = [_after(text, ids) for text in columns[after]]
            yield part.raw, columns


def _after(text: str, ids: Mapping[str, str]) -> str:
    return json.dumps([ids[request] for request in json.loads(text) if request in ids])


def _base(source: _Source, actor: Actor, copy_id: str, ids: Mapping[str, str]) -> MergeBaseRow:
    """Return what a copy is compared by with what it was made of, and merged."""
    head = {"id": new_id(MERGE_BASE.prefix), "author": actor.name, "mission_id": copy_id}
    return MergeBaseRow(**head, from_id=source.mission["id"], event=source.event, pairs=list(ids.items()))


def _rules(rules: Sequence[Mapping[str, Any]] | None, ids: Mapping[str, str]) -> list[dict[str, Any]] | None:
    """Return drive rules between the targets of the copy."""
    ends = ("from_target_id", "to_target_id")
    return [{**rule, **{end: ids.get(rule[end]) for end in ends}} for rule in rules] if rules else None


def sweep_copies(repo: Repository) -> None:
    """Delete what is left of copies whose server was stopped, in small transactions too.

    How long one has taken says nothing: it is left behind when it has written nothing for long.
    """
    old = (MissionRow.in_making, MissionRow.modified_utc < utc_now() - LEFT_BEHIND)
    with repo.database.read() as session:
        left = list(session.scalars(select(MissionRow.id).where(*old)))
    for mission_id in left:
        with repo.database.write() as session:
            here = select(MissionRow).where(MissionRow.id == mission_id, *old)
            claimed = session.scalars(here.with_for_update()).first()
            if claimed is None:
                continue  # it goes on after all, or another server was faster
            claimed.modified_utc = CLAIMED
        for kind_name in reversed(COPIED):
            while _shrink(repo, _table(kind_name), mission_id):
                pass
        with repo.database.write() as session:
            row = session.get(MissionRow, mission_id, with_for_update=True)
            if row is not None:  # of two servers that start one does it
                session.delete(row)


def _shrink(repo: Repository, table: Table, mission_id: str) -> bool:
    """Delete some rows of a mission; return whether there were any. Their seals go with the mission's."""
    some = select(table.c.id).where(table.c.mission_id == mission_id).order_by(table.c.id.desc())
    with repo.database.write() as session:
        found = list(session.scalars(some.limit(ROWS_AT_ONCE)))
        if found:
            session.execute(delete(table).where(table.c.id.in_(found)))
        return bool(found)
