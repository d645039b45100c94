"""Read the three sides of a merge: two missions as they are, and what both began with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import orjson
from sqlalchemy import and_, or_, select
from sqlalchemy.orm import Session

from ground.errors import InvalidInputError
from ground.gdr.base import Columns, table_of
from ground.gdr.history import ChainRow, EventRow
from ground.resources.history.as_of import state_at
from ground.resources.kinds import KINDS
from ground.resources.merge_bases.row import MergeBaseRow, pairs_of
from ground.resources.mission_merges.compared import PLAIN, fields_of
from ground.resources.mission_merges.value import MissionConflict, MissionDifference, MissionEdit
from ground.versions.rows import Fields, Key, RowChange, RowConflict, Rows

Documents = Mapping[tuple[str, str], Columns]
BY_HAND = ("open", "carried")
"""States of a request that people set; all others belong to plans and runs, and no merge moves them."""


@dataclass(frozen=True, slots=True)
class Sides:
    """What a mission (`ours`) and another (`theirs`) began with, and what they are: under ids of ours.

    What ours has no part for has its id of theirs.
    """

    mission_id: str
    from_id: str
    base: Rows
    ours: Rows
    theirs: Rows
    base_mission_id: str
    base_event: int
    event: int
    from_event: int
    ours_of: Mapping[str, str]
    """Ids of ours by those of theirs."""


def snapshot(session: Session) -> None:
    """Let a session that has read nothing yet see one state of the database."""
    if session.get_bind().dialect.name != "sqlite":
        session.connection(execution_options={"isolation_level": "REPEATABLE READ"})


def read_sides(session: Session, mission_id: str, from_id: str) -> Sides:
    """Return the three sides.

    Raises
    ------
    InvalidInputError
        If the missions are one, or neither was copied from or merged into the other.
    """
    if mission_id == from_id:
        raise InvalidInputError("a mission is not merged with itself", pointer="/from_id")
    bases = _bases(session, mission_id, from_id)
    if not bases:
        raise InvalidInputError(
            f"missions {from_id} and {mission_id} have no merge base: neither was copied from the other, or "
            "it was before copies noted what they were made of",
            pointer="/from_id",
        )
    newest = bases[-1]
    ours_of = _pairs(bases, mission_id)
    base_docs = state_at(session, newest.from_id, newest.event)
    is_copy = len(bases) == 1
    our_docs, their_docs = _present(session, mission_id), _present(session, from_id)
    renamed = {} if newest.from_id == mission_id else ours_of
    base = _rows(base_docs, mission_id, renamed)
    theirs = _rows(their_docs, mission_id, ours_of)
    if is_copy:  # requests of a copy begin again as open
        base = {k: {**r, "state": "open"} if k[0] == "observation_request" else r for k, r in base.items()}
    theirs = {key: _of_people(key, row, base.get(key)) for key, row in theirs.items()}
    if is_copy and newest.mission_id == from_id:
        theirs = _without_words_of_the_copy(session, theirs, base, ("mission", mission_id), from_id)
    return Sides(
        mission_id,
        from_id,
        base,
        _rows(our_docs, mission_id, {}),
        theirs,
        newest.from_id,
        newest.event,
        head_of(session, mission_id),
        head_of(session, from_id),
        ours_of,
    )


def head_of(session: Session, mission_id: str) -> int:
    """Return the number of the newest event of a mission."""
    return session.scalars(select(ChainRow.seq).where(ChainRow.id == mission_id)).one()


def _bases(session: Session, mission_id: str, from_id: str) -> list[MergeBaseRow]:
    """Return what either took over from the other, the oldest first."""
    b = MergeBaseRow
    either = or_(
        and_(b.mission_id == mission_id, b.from_id == from_id),
        and_(b.mission_id == from_id, b.from_id == mission_id),
    )
    return list(session.scalars(select(b).where(either).order_by(b.created_utc, b.id)))


def _pairs(bases: list[MergeBaseRow], mission_id: str) -> dict[str, str]:
    """Return ids of a mission by those of the other; what was made anew stands for what was there before."""
    ours_of: dict[str, str] = {}
    theirs_of: dict[str, str] = {}
    for row in bases:
        for there, here in pairs_of(row):
            our, their = (here, there) if row.mission_id == mission_id else (there, here)
            ours_of.pop(theirs_of.get(our, ""), None)
            ours_of[their], theirs_of[our] = our, their
    return ours_of


def _present(session: Session, mission_id: str) -> Documents:
    """Return the parts of a mission as they stand in the history, without the bulk of computed results."""
    found: dict[tuple[str, str], Columns] = {}
    for kind in PLAIN:
        table = table_of(KINDS[kind].row)
        owner = table.c[KINDS[kind].row.mission_key]
        for row in session.execute(select(table).where(owner == mission_id)).mappings():
            found[kind, row["id"]] = orjson.loads(orjson.dumps(dict(row)))
    return found


def _rows(documents: Documents, mission_id: str, ours_of: Mapping[str, str]) -> Rows:
    found: dict[Key, Fields] = {}
    for (kind, identifier), document in documents.items():
        if kind in PLAIN:
            key = mission_id if kind == "mission" else ours_of.get(identifier, identifier)
            found[kind, key] = fields_of(kind, document, lambda i: ours_of.get(i, i))
    return found


def _of_people(key: Key, row: Fields, was: Fields | None) -> Fields:
    """Return a row of theirs with the state of a request only as far as people set it."""
    if key[0] != "observation_request":
        return row
    before = "open" if was is None else was["state"]
    set_again = row["state"] == "open" and before == "carried"
    return {**row, "state": row["state"] if row["state"] == "carried" or set_again else before}


def _without_words_of_the_copy(session: Session, theirs: Rows, base: Rows, key: Key, copy_id: str) -> Rows:
    """Return theirs without notes that were given when it was copied: they are about the copy."""
    e = EventRow
    copied = select(e).where(e.chain_id == copy_id, e.action == "copy").order_by(e.seq).limit(1)
    event = session.scalars(copied).first()
    if event is None or (event.after or {}).get("notes") != theirs[key]["notes"]:
        return theirs
    return {**theirs, key: {**theirs[key], "notes": base.get(key, theirs[key])["notes"]}}


def difference_of(
    sides: Sides, changes: list[RowChange], conflicts: tuple[RowConflict, ...]
) -> MissionDifference:
    """Return what differs, as it is told."""
    edits = [MissionEdit(c.side, c.action, *c.row, c.name, c.field, c.base, c.now) for c in changes]
    return MissionDifference(
        sides.mission_id,
        sides.from_id,
        sides.base_mission_id,
        sides.base_event,
        sides.event,
        sides.from_event,
        edits,
        [told(conflict) for conflict in conflicts],
    )


def told(conflict: RowConflict) -> MissionConflict:
    """Return a conflict as it is told."""
    c = conflict
    return MissionConflict(
        str(c.kind), *c.row, c.name, c.field, c.base, c.ours, c.theirs, choosable=c.choosable
    )
