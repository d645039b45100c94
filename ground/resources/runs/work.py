"""Run a plan's CRL on a simulated rover, and write down what happens as it happens."""

from __future__ import annotations

import hashlib
import json
import mimetypes
import shutil
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path, PurePosixPath
from typing import IO, TYPE_CHECKING, Any, Literal, NotRequired, TypedDict, overload

import orjson

from executive.ports import Operation
from ground.day.prepare import Report
from ground.errors import ArchiveError, InvalidInputError, JobFailedError
from ground.gdr.base import utc_now
from ground.gdr.files import FileStore, files_at
from ground.gdr.ids import new_id
from ground.gdr.packed import is_kept, pack_file, read_kept
from ground.gdr.places import JOB_PATIENCE_S, fetched, keep_folder, open_store, place_of
from ground.gdr.terrain_folders import load_cached
from ground.jobs.queue import WorkStoppedError
from ground.resources.runs.order import RunWork
from ground.resources.runs.run_form import (
    DOCUMENT,
    PRODUCT,
    SAMPLE,
    RunDocument,
    held_record,
    is_number,
    read_json,
    read_lines,
)
from ground.resources.runs.trace_value import Samples
from ground.uplink.flight import Flight, ProductLine, Sample, SampleLine, fly, product_line
from ground.uplink.product_labels import whole_label
from ground.uplink.rehearsal import Sent, heard, write_ground_view
from rover_iface.registry import find_rover

if TYPE_CHECKING:
    from executive.ports import Product, TraceRecord

LIVE = "live.jsonl"
CONTROL = "control.json"
JOURNAL = "journal.jsonl"
LOOK_S = 0.05
"""How long a wish of the operator may wait while the run is held."""
WISH_S = 0.01
"""How long it may wait at full speed, where a look at each event would take a tenth of the run's time."""
PROGRESS_S = 5.0
"""Plan seconds between two reports of the pose while driving, where somebody watches at a pace. At full speed
the abstract rover reports where its even motion changes: readers draw the straight line between reports.
"""
OVER = ("trace.jsonl", "telemetry.jsonl")
"""Files of a run's folder that are in the store too when it is over."""


class TraceLine(TypedDict):
    """A record of the trace as JSON: when, what, and of what."""

    t_s: float
    event: str
    arguments: list[str]


class StoredProduct(TypedDict):
    """A product whose file is in the store; one that was announced has its id and time already."""

    label: dict[str, Any]
    file_name: str
    sha256: str
    size_bytes: int
    media: str
    id: NotRequired[str]
    created_utc: NotRequired[str]


class RunResult(TypedDict):
    """What a run's row holds of a run that is over; its trace, telemetry and products are in the store."""

    document: RunDocument
    outcome: str
    utility: float | None
    duration_s: float
    energy_used_j: float | None
    options_taken: list[str]
    trace_sha256: str
    telemetry_sha256: str
    products: list[StoredProduct]


def trace_event(t_s: float, event: str, arguments: Iterable[str]) -> TraceLine:
    """Return a record of the trace as JSON."""
    return {"t_s": t_s, "event": event, "arguments": list(arguments)}


@dataclass(frozen=True, slots=True)
class Wish:
    """What an operator asks of a run that goes on; `steps` counts the single steps asked for so far."""

    pace: float = 0.0
    paused: bool = False
    steps: int = 0
    abort: bool = False

    @classmethod
    def read(cls, text: bytes) -> Wish:
        """Return the wish in a control file."""
        return cls(**json.loads(text))


def _encode(line: object) -> str:
    """Return a line of JSON; half of a surrogate pair, which a name may hold, is for the slower library."""
    try:
        return orjson.dumps(line).decode()
    except TypeError:
        return json.dumps(line, separators=(",", ":"))


class _Live:
    """Writes each sample and each record as a line, `["telemetry", {...}]` or `["trace", {...}]`, at its
    pace; does what the file of `control_run` asks, and writes `["control", {...}]` at the start and then.
    Each product is put into the store as the rover makes it, and a line `["product", {...}]` says so.
    """

    def __init__(
        self,
        out: IO[str],
        control: Path,
        pace: float,
        budget_s: float,
        report: Report,
        stop: Callable[[], bool],
        store: FileStore,
    ) -> None:
        self.products: dict[str, StoredProduct] = {}
        self._store = store
        self._out, self._budget_s, self._report, self._stop = out, budget_s, report, stop
        self._control, self._seen = control, b""
        self._wish = Wish(pace=pace)
        self._steps = 0
        self._looked = 0.0
        self._anchor = (0.0, time.monotonic())
        self._line("control", {"t_s": 0.0, **asdict(self._wish)})

    def stopped(self) -> bool:
        """Return whether the run is to end: an operator's abort, or the job is given up."""
        return self._wish.abort or self._stop()

    def sample(self, sample: Sample) -> None:
        self._hold(sample.t_s)
        self._line("telemetry", sample.line())
        self._report(min(0.97, sample.t_s / self._budget_s), f"t = {sample.t_s:.0f} s")

    def trace(self, record: TraceRecord) -> None:
        t_s = record.t_ms / 1000
        self._hold(t_s)
        self._steps += 1
        self._line("trace", trace_event(t_s, record.event, record.arguments))

    def product(self, product: Product) -> None:
        item = store_product(self._control.parent, self._store, product_line(product))
        self.products[product.path] = {**item, "id": new_id("prd"), "created_utc": utc_now().isoformat()}
        self._line("product", self.products[product.path])

    def _line(self, kind: str, data: Mapping[str, object]) -> None:
        self._out.write(_encode([kind, data]) + "\n")
        if self._wish.pace > 0 or self._wish.paused or kind in {"control", "product"}:
            self._out.flush()

    def _look(self, plan_s: float) -> None:
        """Take up what the control file asks."""
        now = time.monotonic()
        if now - self._looked < WISH_S:
            return
        self._looked = now
        try:
            text = self._control.read_bytes()
        except OSError:
            return
        if text == self._seen:
            return
        self._seen = text
        wish = Wish.read(text)
        if wish.steps != self._wish.steps:
            self._steps = 0
        self._wish = wish
        self._anchor = (plan_s, time.monotonic())
        self._line("control", {"t_s": plan_s, **asdict(wish)})

    def _hold(self, plan_s: float) -> None:
        """Let plan time pass no faster than the pace (0 = as fast as it goes), and not at all while paused.

        A step lets the executive's records pass up to the next one.
        """
        self._look(plan_s)
        while not self.stopped():
            wish = self._wish
            if wish.paused and self._steps >= (1 if wish.steps else 0):
                self._anchor = (plan_s, time.monotonic())
            elif wish.pace <= 0 or wish.paused:
                return
            else:
                since, began = self._anchor
                left = (plan_s - since) / wish.pace - (time.monotonic() - began)
                if left <= 0:
                    return
                time.sleep(min(left, LOOK_S))
                self._look(plan_s)
                continue
            time.sleep(LOOK_S)
            self._look(plan_s)


def work(order: RunWork, report: Report, should_stop: Callable[[], bool]) -> RunResult:
    """Return outcome, trace, telemetry and products of a run; the files of products are in the store.

    Raises
    ------
    JobFailedError
        If the CRL, a fault or the rover's name cannot be used.
    """
    from executive.crl import CrlError
    from executive.errors import ExecutiveError
    from rover_iface.errors import RoverError
    from rover_iface.simulator.faults import load_faults

    folder = place_of(order.run_dir)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    budget_s = max(float(order.problem["budget"]["time_s"]), 1.0)
    report(0.0, "the rover wakes")
    reach = heard(order.link, [Sent(Operation(c.operation), c.sent_s) for c in order.commands])
    try:
        rover = find_rover(order.rover)(
            {
                "format": "world/1",
                "name": str(order.problem.get("name", "")),
                "profile": order.rover_profile,
                "problem": order.problem,
                "sun": asdict(order.sky),
                "progress_at_bends": order.pace == 0,
            },
            out=folder,
            seed=order.seed,
            faults=load_faults(order.faults),
            progress_s=PROGRESS_S,
            terrain=load_cached(fetched(order.terrain_dir)),
        )
        with (folder / LIVE).open("w", encoding="utf-8") as out:
            pace, store = order.pace, files_at(order.files_dir)
            live = _Live(out, folder / CONTROL, pace, budget_s, report, should_stop, store)
            flight = fly(
                order.crl_text,
                rover,
                folder,
                run_id=order.run_id,
                about={"rover": order.rover, "seed": order.seed, "faults": list(order.faults)},
                on_sample=live.sample,
                on_trace=live.trace,
                on_product=live.product,
                should_stop=live.stopped,
                sync=False,
                operator=[event for _, event in reach if event is not None],
            )
        if order.link is not None:
            write_ground_view(folder, order.link, flight, reach)
    except (RoverError, ExecutiveError, CrlError, InvalidInputError) as err:
        raise JobFailedError(str(err)) from err
    if should_stop():
        raise WorkStoppedError
    report(0.98, "products")
    result = result_of(flight, store, live.products)
    pack_run(folder)
    keep_folder(open_store(order.run_dir, JOB_PATIENCE_S))
    return {**result, "options_taken": list(flight.options_taken())}


def pack_run(folder: Path) -> None:
    """Pack what a run that is over leaves in its folder: lines told while it went on, and the journal.

    Trace and telemetry are in the store; the folder's own go. A run that was given up stays as it is.
    """
    for name in (LIVE, JOURNAL):
        pack_file(folder / name)
    for name in OVER:
        (folder / name).unlink()


def read_run_folder(
    folder: Path, store: FileStore, stored: Mapping[str, StoredProduct] | None = None
) -> RunResult:
    """Put trace, telemetry and products of a `run/1` folder into the file store; return what a run's row
    holds. `stored` are the products that are there already, by their path.

    Raises
    ------
    ArchiveError
        If the folder is not `run/1`, a file is missing or not what its record says.
    """
    path = folder / "run.json"
    document = DOCUMENT.read(path, read_json(path))
    if document.get("format") != "run/1":
        raise ArchiveError(f"{folder.name}: run.json has not the format run/1")
    trace, samples = read_lines(folder / "trace.jsonl"), read_lines(folder / "telemetry.jsonl")
    products = read_lines(folder / "products.jsonl")
    return kept_run(folder, document, trace, samples, products, store, stored or {})


def result_of(flight: Flight, store: FileStore, stored: Mapping[str, StoredProduct]) -> RunResult:
    """Return what `read_run_folder` would of a run that this process has just flown, without reading it."""
    path = flight.folder / "run.json"
    document = DOCUMENT.read(path, json.loads(json.dumps(flight.document)))
    trace = [[record.t_ms / 1000, record.event, *record.arguments] for record in flight.outcome.trace]
    samples = [sample.line() for sample in flight.samples]
    products = [product_line(product) for product in flight.outcome.products]
    return kept_run(flight.folder, document, trace, samples, products, store, stored)


def kept_run(
    folder: Path,
    document: RunDocument,
    trace: Sequence[object],
    samples: Sequence[object],
    products: Sequence[object],
    store: FileStore,
    stored: Mapping[str, StoredProduct],
) -> RunResult:
    """Check the lines of a run's three tables and put all into the file store; see `read_run_folder`."""
    path = folder / "trace.jsonl"
    events = [trace_event(row[0], row[1], row[2:]) for row in (held_record(path, row) for row in trace)]
    path = folder / "telemetry.jsonl"
    table = columns([SAMPLE.read(path, sample) for sample in samples])
    path = folder / "products.jsonl"
    rows = [PRODUCT.read(path, row) for row in products]
    items = [stored.get(row["path"]) or store_product(folder, store, row) for row in rows]
    outcome, end_s = document.get("outcome") or "UNFINISHED", document.get("end_s")
    told = {"outcome": outcome, "end_s": end_s, "events": events}
    used = table.energy_used_j
    last_s = events[-1]["t_s"] if events else 0.0
    return {
        "document": document,
        "outcome": outcome,
        "utility": document.get("utility"),
        "duration_s": last_s if end_s is None else end_s,
        "energy_used_j": used[-1] if used and is_number(used[-1]) else None,
        "options_taken": [
            e["arguments"][1] for e in events if e["event"] == "choose" and len(e["arguments"]) > 1
        ],
        "trace_sha256": store.put_packed(orjson.dumps(told)).sha256,
        "telemetry_sha256": store.put_packed(orjson.dumps(table)).sha256,
        "products": items,
    }


def store_product(folder: Path, store: FileStore, row: ProductLine) -> StoredProduct:
    """Store the file of one line of `products.jsonl`; the line's digest must be that of the file."""
    relative = PurePosixPath(str(row["path"]))
    if relative.is_absolute() or ".." in relative.parts or "\\" in str(relative):
        raise ArchiveError(f"{folder.name}: the product path {str(relative)!r} leads outside")
    file = folder / relative
    if file.is_symlink() or not file.is_file():
        raise ArchiveError(f"{folder.name}: the product {relative} is missing")
    content = file.read_bytes()
    if hashlib.sha256(content).hexdigest() != row["sha256"]:
        raise ArchiveError(
            f"{folder.name}: the product {relative} is not what its record says (SHA-256 differs)"
        )
    stored = store.put_bytes(content)
    label = {**whole_label(file, row["sha256"]), **row["label"]}
    return {
        "label": {**label, "kind": row["kind"], "task": row["task"], "t_s": row["t_s"]},
        "file_name": relative.name,
        "sha256": stored.sha256,
        "size_bytes": stored.size_bytes,
        "media": mimetypes.guess_type(relative.name)[0] or "application/octet-stream",
    }


@overload
def live_lines_of(path: Path, wanted: Literal["telemetry"]) -> list[SampleLine]: ...
@overload
def live_lines_of(path: Path, wanted: Literal["trace"]) -> list[TraceLine]: ...
@overload
def live_lines_of(path: Path, wanted: Literal["product"]) -> list[StoredProduct]: ...
def live_lines_of(path: Path, wanted: str) -> Sequence[object]:
    """Return the samples (`telemetry`), records (`trace`) or products (`product`) that a run going on has
    written so far.
    """
    found = []
    if is_kept(path):
        for line in read_kept(path).split(b"\n")[:-1]:
            kind, data = json.loads(line)
            if kind == wanted:
                found.append(data)
    return found


def columns(samples: Sequence[SampleLine]) -> Samples:
    """Return samples as columns of equal length."""
    targets = sorted({target for sample in samples for target in sample["trackers"]})
    trackers = {t: [sample["trackers"].get(t) for sample in samples] for t in targets}
    return Samples(
        t_s=[sample["t_s"] for sample in samples],
        east_m=[sample["east_m"] for sample in samples],
        north_m=[sample["north_m"] for sample in samples],
        heading_rad=[sample["heading_rad"] for sample in samples],
        battery_j=[sample["battery_j"] for sample in samples],
        energy_used_j=[sample["energy_used_j"] for sample in samples],
        task=[sample["task"] for sample in samples],
        tracker_confidence={t: [x and x.get("confidence") for x in one] for t, one in trackers.items()},
        tracker_state={t: [x and x.get("state") for x in one] for t, one in trackers.items()},
    )
