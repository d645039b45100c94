"""Read what a run left behind, or leaves while it goes on."""

from __future__ import annotations

import json
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
from ground.resources.products.kind import PRODUCT
from ground.resources.products.value import Product
from ground.resources.runs.dry_run import product_rows
from ground.resources.runs.kind import RUN
from ground.resources.runs.row import RunRow
from ground.resources.runs.trace_value import Telemetry, Trace, TraceEvent
from ground.resources.runs.value import Run, RunKind
from ground.resources.runs.work import LIVE, columns, live_lines_of, trace_event
from mission.codec import Document

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
        table: Document = orjson.loads(repo.files.read(row.telemetry_sha256))
    else:
        table = columns(live_lines_of(repo.run_dir(run_id) / LIVE, "telemetry"))
    return Telemetry(run_id=run_id, complete=row.telemetry_sha256 is not None, **table)


_TAKEN_IN = {RunKind.EXECUTION, RunKind.TRAINING}


def live_lines(repo: Repository, run: Run, after: int) -> list[tuple[str, Any]]:
    """Return the lines of a run behind line `after`: telemetry, trace records, and products as they came.

    An execution that was taken in has no such lines; those of its folder stand in for them, by time.
    """
    path = repo.run_dir(run.id) / LIVE
    if not is_kept(path):
        return _lines_of_folder(path.parent)[after:] if run.kind in _TAKEN_IN else []
    lines = read_kept(path).split(b"\n")[:-1]
    found = []
    for line in lines[after:]:
        try:
            kind, data = json.loads(line)
        except ValueError:
            break
        found.append((str(kind), data))
    made = [data for kind, data in found if kind == "product"]
    products = iter(_live_products(repo, run.id, made))
    return [(kind, next(products) if kind == "product" else data) for kind, data in found]


def _live_products(repo: Repository, run_id: str, items: Sequence[Document]) -> list[Product]:
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
