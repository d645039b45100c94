"""Run a plan on the real clock, on a rover in a process of its own, and write down what happens.

The lines are those of a dry run (`telemetry`, `trace`, `product`, `control`), told from the journal as it
grows, and `link` once a second: state of the line, age of the last word, open commands. Nothing here is in
the executive's way: a job that hangs, or whose database does, holds up the telling and not the run.
"""

from __future__ import annotations

import json
import logging
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import IO

from executive.crl import CrlError
from executive.errors import ExecutiveError
from executive.ports import CommandId, Product
from executive.runtime.codec import Json, event_from_json
from executive.runtime.control import RunControl, link_document
from executive.runtime.journal import never_began, record_of
from executive.runtime.wire.address import Address
from executive.runtime.wire.client import WireRover
from ground.day.prepare import Report
from ground.errors import ArchiveError, InvalidInputError, JobFailedError
from ground.gdr.base import utc_now
from ground.gdr.files import FileStore, files_at
from ground.gdr.ids import new_id
from ground.gdr.places import JOB_PATIENCE_S, fetched, keep_folder, open_store, place_of
from ground.jobs.queue import WorkStoppedError
from ground.resources.runs.order import RunWork
from ground.resources.runs.work import (
    LIVE,
    RunResult,
    StoredProduct,
    read_run_folder,
    store_product,
    trace_event,
)
from ground.uplink.flight import SampleBook, product_line
from ground.uplink.live import JOURNAL, LiveOptions, complete, run_live
from ground.uplink.serve_rover import ROVER_SOCKET, Serving, rover_at

logger = logging.getLogger(__name__)

TELL_S = 0.1
LINK_S = 1.0
LINGER_S = 120.0
"""How long a rover waits for the executive of a worker that died."""


class JournalTeller:
    """Turns the journal of a run, as it grows, into lines for whoever watches."""

    def __init__(self, folder: Path, out: IO[str], store: FileStore) -> None:
        self.products: dict[str, StoredProduct] = {}
        self.t_s = 0.0
        self._folder, self._out, self._store = folder, out, store
        self._book = SampleBook()
        self._at = 0
        self._announced: list[Product] = []

    def line(self, kind: str, data: Mapping[str, object]) -> None:
        self._out.write(json.dumps([kind, data], separators=(",", ":")) + "\n")
        self._out.flush()

    def tell(self) -> None:
        """Write down what has come since the last time."""
        try:
            with (self._folder / JOURNAL).open("rb") as file:
                file.seek(self._at)
                data = file.read()
        except FileNotFoundError:
            return
        whole = data[: data.rfind(b"\n") + 1]
        self._at += len(whole)
        for raw in whole.splitlines():
            record = record_of(raw.decode("utf-8", "replace"))
            if record is not None:
                self._tell(record)
        self._announced = [product for product in self._announced if not self._keep(product)]

    def _tell(self, record: Json) -> None:
        self.t_s = record.get("t", 1000 * self.t_s) / 1000
        if record["k"] == "trace":
            self.line("trace", trace_event(self.t_s, record["e"], record["a"]))
        elif record["k"] == "send":
            self._book.sent(CommandId(*record["id"]))
        elif record["k"] == "note":
            self.line("note", {"t_s": self.t_s, "kind": record["kind"], "text": record["text"]})
        for document in record["events"] if record["k"] == "step" else ():
            event = event_from_json(document)
            sample = self._book.heard(event)
            if sample is not None:
                self.line("telemetry", sample.line())
            elif isinstance(event, Product):
                self._announced.append(event)

    def _keep(self, product: Product) -> bool:
        """Return whether a product is in the store now; it may not be whole yet."""
        if product.path in self.products:
            return True
        try:
            item = store_product(self._folder, self._store, product_line(product))
        except ArchiveError:
            return False
        self.products[product.path] = {**item, "id": new_id("prd"), "created_utc": utc_now().isoformat()}
        self.line("product", self.products[product.path])
        return True


class _Watch:
    """A thread that tells what happens, and lets a job that is given up abort its run."""

    def __init__(self, teller: JournalTeller, budget_s: float, report: Report, stop: Callable[[], bool]):
        self._teller, self._budget_s, self._report, self._stop = teller, budget_s, report, stop
        self._over = threading.Event()
        self._thread: threading.Thread | None = None
        self._told, self._shown, self._failed, self._aborted = 0.0, "", "", False

    def begin(self, control: RunControl) -> None:
        self._thread = threading.Thread(target=self._watch, args=(control,), name="telling", daemon=True)
        self._thread.start()

    def _watch(self, control: RunControl) -> None:
        while not self._over.wait(TELL_S):
            for act in (self._teller.tell, partial(self._show, control), partial(self._look, control)):
                self._guarded(act)

    def _show(self, control: RunControl) -> None:
        """Tell how the line stands, once a second, and what the run was asked, when it was."""
        t_s = control.runtime.clock.now_ms() / 1000
        if time.monotonic() - self._told >= LINK_S:
            self._told = time.monotonic()
            self._teller.line("link", link_document(control.runtime))
            self._report(min(0.97, t_s / self._budget_s), f"t = {t_s:.0f} s")
        state = f"{control.held} {control.stopped}"
        if state != self._shown:
            data = {"t_s": t_s, "pace": control.runtime.settings.rate, "paused": control.held}
            self._teller.line("control", {**data, "steps": control.steps, "abort": control.stopped})
            self._shown = state

    def _look(self, control: RunControl) -> None:
        """Abort the run if its job was given up."""
        if not self._aborted and self._stop():
            control.answer({"m": "abort"})
            self._aborted = True

    def _guarded(self, act: Callable[[], None]) -> None:
        """Do a part of a round; a full disk or a busy database keeps the run from nothing, and passes."""
        try:
            act()
        except Exception as error:
            if str(error) != self._failed:
                self._failed = str(error)
                logger.exception("a live run cannot be told of")

    def end(self) -> None:
        self._over.set()
        if self._thread is not None:
            self._thread.join(timeout=10)
        self._guarded(self._teller.tell)


def live_work(order: RunWork, report: Report, should_stop: Callable[[], bool]) -> RunResult:
    """Return outcome, trace, telemetry and products of a live run; the files of products are in the store.

    A job that is taken up again goes on with its run: the journal is there, and the rover waits.

    Raises
    ------
    JobFailedError
        If the CRL, a fault or the rover's name cannot be used, or the rover does not start.
    """
    from rover_iface.errors import RoverError

    folder = place_of(order.run_dir)
    folder.mkdir(parents=True, exist_ok=True)
    begun = not never_began(folder / JOURNAL)
    budget_s = max(float(order.problem["budget"]["time_s"]), 1.0)
    speed = order.pace or 1.0
    address = Address(folder / ROVER_SOCKET)
    serving = Serving(
        order.rover,
        _world(folder, order),
        address,
        out=folder,
        seed=order.seed,
        speed=speed,
        linger_s=LINGER_S,
    )
    report(0.0, "the rover wakes")
    about = {"rover": order.rover, "seed": order.seed, "faults": list(order.faults)}
    try:
        with rover_at(serving), (folder / LIVE).open("w", encoding="utf-8") as out:
            rover = WireRover(address, run=order.run_id)
            teller = JournalTeller(folder, out, files_at(order.files_dir))
            watch = _Watch(teller, budget_s, report, should_stop)
            try:
                if not begun:
                    rover.wait_ready(LiveOptions().connect_s)
                settings = LiveOptions().settings(speed)
                flight = run_live(
                    order.crl_text,
                    rover,
                    folder,
                    settings=settings,
                    resume=begun,
                    about=about,
                    on_runtime=watch.begin,
                )
                flight = complete(flight)
            finally:
                watch.end()
                rover.close(over=True)
    except (RoverError, ExecutiveError, CrlError, InvalidInputError) as err:
        raise JobFailedError(str(err)) from err
    if should_stop():
        raise WorkStoppedError
    report(0.98, "products")
    result = read_run_folder(folder, files_at(order.files_dir), teller.products)
    keep_folder(open_store(order.run_dir, JOB_PATIENCE_S))
    return {**result, "options_taken": list(flight.options_taken())}


def _world(folder: Path, order: RunWork) -> Path:
    """Write the world of the rover's process; return its folder."""
    place = folder / "world"
    place.mkdir(exist_ok=True)
    document = {
        "format": "world/1",
        "name": str(order.problem.get("name", "")),
        "profile": order.rover_profile,
        "problem": order.problem,
        "sun": asdict(order.sky),
        "faults": list(order.faults),
        "terrain": str(fetched(order.terrain_dir).resolve()),
    }
    with suppress(FileNotFoundError):
        (place / "world.json").unlink()
    (place / "world.json").write_text(json.dumps(document) + "\n", encoding="utf-8")
    return place
