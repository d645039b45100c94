"""Follow the history of a repository back to a moment: every event holds what was there before it."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from sqlalchemy import Table, delete, insert, or_, select, update
from sqlalchemy.orm import Session

from ground.gdr.history import GENESIS, SYSTEM, ChainRow, EventRow
from ground.gdr.seals import row_digest, seal
from ground.jobs.row import JobRow
from ground.records.edit import BULKY
from ground.resources.history.as_of import BESIDE
from ground.resources.history.verify_rows import verify_rows
from ground.resources.kinds import KINDS
from ground.resources.packages.row import CounterRow
from ground.resources.tables import METADATA


def rewind(session: Session, until: datetime) -> list[str]:
    """Take back every event behind a moment, and every row made since; return what cannot come back.

    The parts of a mission that was deleted since, and the computed bulk (tree, text) of a plan that was,
    stand in no event: a backup from before the deletion has them. A key that was revoked since stays revoked,
    and a job that was not over is cancelled.
    """
    missing: list[str] = []
    e = EventRow
    later = select(e).where(e.at_utc > until, e.action.not_in(BESIDE)).order_by(e.chain_id, e.seq.desc())
    for event in session.scalars(later).all():
        kind = KINDS.get(event.kind)
        if kind is not None and (event.before is not None or event.after is not None):
            sentence = _take_back(session, kind.row.__table__, event)
            missing += [sentence] if sentence else []
    session.flush()
    for table in reversed(METADATA.sorted_tables):
        if "created_utc" in table.c:
            session.execute(delete(table).where(table.c.created_utc > until))
    jobs = JobRow.__table__.c
    over = update(JobRow).where(or_(jobs.finished_utc.is_(None), jobs.finished_utc > until))
    session.execute(over.values(state="cancelled", message="taken back by a restore"))
    for chain in session.scalars(select(ChainRow)).all():
        session.execute(delete(e).where(e.chain_id == chain.id, e.at_utc > until))
        query = select(e.seq, e.sha256).where(e.chain_id == chain.id).order_by(e.seq.desc()).limit(1)
        last = session.execute(query).first()
        if last is None and chain.id != SYSTEM:
            session.delete(chain)
        else:
            chain.seq, chain.sha256 = (0, GENESIS) if last is None else (last.seq, last.sha256)
    session.flush()
    return missing + _without_results(session)


def _without_results(session: Session) -> list[str]:
    """Take computed results off rows that had none at the moment; return a sentence for each that is odd.

    Events hold no results; the seals tell whether there were any.
    """
    missing = []
    for fault in verify_rows(session).faults:
        name, _, key = fault.row.partition("/")
        if name == CounterRow.__tablename__:  # it keeps its value, so that none is given twice
            seal(session, session.get_one(CounterRow, key))
            continue
        table = METADATA.tables[name]
        mine = next(iter(table.primary_key.columns)) == key
        row = session.execute(select(table).where(mine)).mappings().first()
        results = {c.name: None for c in table.columns if c.name in BULKY and c.nullable}
        if row is not None and results and row_digest(table, {**row, **results}) == fault.seal:
            session.execute(update(table).where(mine).values(**results))
        else:
            missing.append(str(fault))
    return missing


def _take_back(session: Session, table: Any, event: EventRow) -> str:
    """Give a row the columns that it had before an event; return what is missing of it then."""
    mine = table.c.id == event.subject_id
    if event.before is None:
        session.execute(delete(table).where(mine))
        return ""
    columns = _columns(table, event.before)
    if event.after is not None:
        session.execute(update(table).where(mine).values(**columns))
        return ""
    if event.kind == "mission":
        return f"mission {event.subject_id} was deleted since; its parts are in a backup from before that"
    known = {*columns, *(c.name for c in table.columns if c.nullable or c.default is not None)}
    wanting = [c.name for c in table.columns if c.name not in known]
    if wanting:
        return f"{event.kind} {event.subject_id} was deleted since and its {wanting[0]} is in no event"
    session.execute(insert(table).values(**columns))
    return ""


def _columns(table: Table, document: dict[str, Any]) -> dict[str, Any]:
    return {
        name: datetime.fromisoformat(value) if name.endswith("_utc") and isinstance(value, str) else value
        for name, value in document.items()
        if name in table.c
    }
