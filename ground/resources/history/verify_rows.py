"""Check every row against what the history says of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

import orjson
from sqlalchemy import Table
from sqlalchemy.orm import Session

from ground.gdr.as_stored import StoredRow, stored_rows
from ground.gdr.base import Columns, Utc
from ground.gdr.history import EventRow
from ground.gdr.seals import SYSTEM, key_of, row_digest, sealed_tables
from ground.resources.kinds import KINDS
from ground.resources.tables import METADATA


@dataclass(frozen=True, slots=True)
class RowFault:
    """A row, by table and key, that is not what the history says; `seal` is the digest it should have."""

    row: str
    reason: str
    seal: str | None = None

    def __str__(self) -> str:
        return f"{self.row}: {self.reason}"


@dataclass(frozen=True, slots=True)
class RowReport:
    """How many rows were checked, how many earlier than the seals are in no event, and what does not fit."""

    checked: int
    untold: int
    faults: list[RowFault]


@dataclass(slots=True)
class _Book:
    """What the events say last of each row, by `table/key`: its seal, or the document of an older event."""

    seals: dict[str, str | None] = field(default_factory=dict)
    documents: dict[str, Columns | None] = field(default_factory=dict)
    chain: dict[str, str] = field(default_factory=dict)
    sealed: set[str] = field(default_factory=set)
    """Chains that had seals from their first event on: all their rows are told of."""

    def take(self, event: Columns) -> None:
        """Write down what an event says."""
        if event["rows"] is not None:
            if event["seq"] == 1:
                self.sealed.add(event["chain_id"])
            for key, digest in event["rows"].items():
                self.seals[key] = digest
                self.chain[key] = event["chain_id"]
                self.documents.pop(key, None)
                if digest is None and key == f"missions/{event['chain_id']}":
                    self._forget(event["chain_id"])
        elif event["kind"] in KINDS:
            key = f"{KINDS[event['kind']].row.__tablename__}/{event['subject_id']}"
            after = event["after"]
            if key not in self.seals and (after is None or "id" in after) and (event["before"] or after):
                self.documents[key] = after
                self.chain[key] = event["chain_id"]
                if after is None and event["kind"] == "mission":
                    self._forget(event["chain_id"])

    def _forget(self, mission_id: str) -> None:
        """Let all rows of a mission go with it; it may come back with an archive."""
        for key, chain_id in self.chain.items():
            if chain_id == mission_id:
                known = self.seals if key in self.seals else self.documents
                known[key] = None


def verify_rows(session: Session) -> RowReport:
    """Return what does not fit: altered rows, rows that no event tells of, and rows that are gone."""
    book = _Book()
    for event in stored_rows(session, METADATA.tables[EventRow.__tablename__]):
        if not event.damaged:
            book.take(event.values)
    faults: list[RowFault] = []
    seen: set[str] = set()
    untold = 0
    for table in sealed_tables():
        for row in stored_rows(session, table):
            key = key_of(table, row.values)
            seen.add(key)
            reason = _reason(book, table, key, row)
            if reason:
                faults.append(RowFault(key, reason, book.seals.get(key)))
            untold += key not in book.seals and key not in book.documents
    said = book.documents | book.seals
    gone = [key for key in said.keys() - seen if said[key] is not None]
    known = [key for key in sorted(gone) if key.partition("/")[0] in METADATA.tables]
    faults += [RowFault(key, "it is gone, and no event says so", book.seals.get(key)) for key in known]
    return RowReport(len(seen), untold, faults)


def _reason(book: _Book, table: Table, key: str, row: StoredRow) -> str:
    """Return why a row does not fit; nothing if it does."""
    if row.damaged:
        return f"its {row.damaged[0]} is not as it was written"
    if key in book.seals:
        seal = book.seals[key]
        if seal is None:
            return "it went by an event, and is here"
        return "" if row_digest(table, row.values) == seal else "it is not what its last event left"
    if key in book.documents:
        document = book.documents[key]
        if document is None:
            return "it went by an event, and is here"
        odd = _differing(table, document, row.values)
        return f"its {odd} is not what its last event says" if odd else ""
    owner = row.values["id"] if table.name == "missions" else row.values.get("mission_id")
    return "no event tells of it" if (owner or SYSTEM) in book.sealed else ""


def _differing(table: Table, document: Mapping[str, Any], values: Columns) -> str:
    """Return the first column in which a row differs from the document of an older event."""
    for name, said in document.items():
        if name not in table.c:
            continue
        if isinstance(table.c[name].type, Utc) and isinstance(said, str):
            said = datetime.fromisoformat(said)
        if orjson.dumps(_number(said)) != orjson.dumps(_number(values[name])):
            return name
    return ""


def _number(value: Any) -> Any:
    return float(value) if isinstance(value, int) and not isinstance(value, bool) else value
