"""Read what a run left behind, or leaves while it goes on."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import orjson

from ground.errors import NotFoundError, StateError
from ground.gdr.packed import is_kept, read_kept
from ground.gdr.repository import Repository
from ground.jobs.value import JobState
from ground.records.actor import Actor
from ground.records.get_resource import read_row
from ground.records.show import value_of
from ground.resources.products.kind import PRODUCT
from ground.resources.products.value import Product
from ground.resources.runs.dry_run import product_rows
from ground.resources.runs.kind import RUN
from ground.resources.runs.row import RunRow
from ground.resources.runs.trace_value import Samples, Telemetry, Trace, TraceEvent
from ground.resources.runs.value import Run, RunKind
from ground.resources.runs.work import LIVE, StoredProduct, columns, live_lines_of, trace_event

GIVEN_UP = {JobState.FAILED.value, JobState.CANCELLED.value}


def read_trace(repo: Repository, actor: Actor, run_id: str) -> Trace:
    """Return the executive's trace; of a run that was given up, what there was until then.

    Raises
    ------
    StateError
        While the run is not over.
    """
    row: RunRow = read_row(repo, actor, RUN, run_id)
    live = repo.run_dir(run_id) / LIVE
    if row.trace_sha256 is None and row.state in GIVEN_UP and is_kept(live):
        seen = [TraceEvent(e["t_s"], e["event"], e["arguments"]) for e in live_lines_of(live, "trace")]
        return Trace(run_id, row.outcome or row.state, seen[-1].t_s if seen else 0.0, seen)
    if row.trace_sha256 is None:
        raise StateError(f"run {run_id} is {row.state}; its trace is there when it is over")
    document = orjson.loads(repo.files.read(row.trace_sha256))
    events = [TraceEvent(e["t_s"], e["event"], e["arguments"]) for e in document["events"]]
    end_s = document["end_s"] if document["end_s"] is not None else (events[-1].t_s if events else 0.0)
    return Trace(run_id, document["outcome"], end_s, events)


def read_telemetry(repo: Repository, actor: Actor, run_id: str) -> Telemetry:
    """Return telemetry as columns, what there is so far while the run goes on."""
    row: RunRow = read_row(repo, actor, RUN, run_id)
    if row.telemetry_sha256 is not None:
        samples = Samples(**orjson.loads(repo.files.read(row.telemetry_sha256)))
    else:
        samples = columns(live_lines_of(repo.run_dir(run_id) / LIVE, "telemetry"))
    return value_of(Telemetry, samples, run_id=run_id, complete=row.telemetry_sha256 is not None)


_TAKEN_IN = {RunKind.EXECUTION, RunKind.TRAINING}


class LiveLines:
    """The lines of a run: telemetry, trace records, and products as they came; each byte is read once.

    An execution that was taken in has no such lines; those of its folder stand in for them, by time.
    """

    AT_ONCE_BYTES = 2**18
    """A page of about a thousand samples: who follows many runs has this much of each in memory."""

    def __init__(self, repo: Repository, run: Run) -> None:
        self._repo, self._run_id = repo, run.id
        self._path = repo.run_dir(run.id) / LIVE
        self._taken_in = run.kind in _TAKEN_IN
        self._line, self._at = 0, 0
        self._inode: int | None = None
        self._unpacked: bytes | None = None

    def grown(self) -> object:
        """Return something that is another when there are more lines."""
        try:
            return self._path.stat().st_size
        except OSError:
            return None

    def to_the_end(self) -> int:
        """Go behind the last line there is, and return how many there are."""
        while self._next(parsed=False):
            pass
        return self._line

    def behind(self, after: int) -> list[tuple[int, str, Any]]:
        """Return some lines behind line `after`, each with its number and what it is; none at the end."""
        if after < self._line:
            self._line, self._at = 0, 0
        while raw := self._next():
            first = self._line - len(raw)
            found = [(first + n, *line) for n, line in enumerate(raw, 1) if first + n > after]
            if found:
                made = [data for _, kind, data in found if kind == "product"]
                products = iter(_live_products(self._repo, self._run_id, made))
                return [(n, k, next(products) if k == "product" else data) for n, k, data in found]
        return []

    def _next(self, *, parsed: bool = True) -> list[tuple[str, Any]]:
        """Return the next lines and stand behind them; those that are not wanted are only counted."""
        if self._taken_in and not is_kept(self._path):
            lines = _lines_of_folder(self._path.parent)[self._line :]
            self._line += len(lines)
            return lines
        whole = self._some()
        raw = whole.split(b"\n")[:-1]
        self._line += len(raw)
        self._at += len(whole)
        return [_line_of(line) if parsed else ("", None) for line in raw]

    def _some(self) -> bytes:
        """Return whole lines from where it stands."""
        wanted = self.AT_ONCE_BYTES
        while True:
            found = self._bytes(wanted)
            end = found.rfind(b"\n") + 1
            if end or len(found) < wanted:
                return found[:end]
            wanted *= 2  # a line longer than that

    def _bytes(self, wanted: int) -> bytes:
        try:
            with self._path.open("rb") as file:
                there = os.fstat(file.fileno())
                if there.st_size < self._at or self._inode not in {None, there.st_ino}:
                    self._line, self._at = 0, 0  # its job was begun anew
                self._inode = there.st_ino
                file.seek(self._at)
                return file.read(wanted)
        except FileNotFoundError:
            if self._unpacked is None and is_kept(self._path):
                self._unpacked = read_kept(self._path)
            return (self._unpacked or b"")[self._at : self._at + wanted]


def _line_of(line: bytes) -> tuple[str, Any]:
    try:
        kind, data = json.loads(line)
    except ValueError:  # a disk that was full: the lines behind it are whole
        return "note", {"t_s": None, "kind": "damage", "text": "a line of the run cannot be read"}
    return str(kind), data


def _live_products(repo: Repository, run_id: str, items: Sequence[StoredProduct]) -> list[Product]:
    """Return products of a run as they will be recorded, with where their files are until then."""
    if not items:
        return []
    with repo.database.read() as session:
        rows = product_rows(session, session.get_one(RunRow, run_id), items)
        shown = PRODUCT.show(session, rows)
    return [replace(p, file_url=f"/api/v1/runs/{run_id}/products/{p.id}/file") for p in shown]


def read_live_product(repo: Repository, actor: Actor, run_id: str, product_id: str) -> tuple[Product, Path]:
    """Return a product that a run has announced, recorded or not yet, and where its file lies."""
    read_row(repo, actor, RUN, run_id)
    made = live_lines_of(repo.run_dir(run_id) / LIVE, "product")
    found = _live_products(repo, run_id, [item for item in made if item["id"] == product_id])
    if not found or not (path := repo.files.path(found[0].sha256)).is_file():
        raise NotFoundError(f"run {run_id} has made no product {product_id}")
    return found[0], path


def _lines_of_folder(folder: Path) -> list[tuple[str, Any]]:
    """Return samples and trace records of a `run/1` folder in the order of their times."""
    found: list[tuple[float, str, Any]] = []
    for name, kind in (("trace.jsonl", "trace"), ("telemetry.jsonl", "telemetry")):
        path = folder / name
        for line in path.read_bytes().splitlines() if path.exists() else ():
            row = json.loads(line)
            data = row if kind == "telemetry" else trace_event(row[0], row[1], row[2:])
            found.append((data["t_s"], kind, data))
    return [(kind, data) for _, kind, data in sorted(found, key=lambda item: item[0])]
