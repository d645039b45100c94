"""Run a plan against a rover and leave the run's folder, the format `run/1`.

The folder holds `run.json`, `plan.crl`, `journal.jsonl`, `trace.jsonl` (one `[t_s, event, ...]` a line),
`telemetry.jsonl` (one sample a line) and `products.jsonl` with the files of `products/`. Nothing here needs a
database or a network.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, TypedDict

from executive.engine.spec import PlanSpec
from executive.ports import (
    Acknowledgement,
    Command,
    CommandId,
    CommandStatus,
    Event,
    Operator,
    Product,
    Result,
    Rover,
    TraceRecord,
    Update,
)
from executive.runtime.journal import FileJournal, Sink, record_of
from executive.runtime.lines import line_of
from executive.runtime.loading import load_plan
from executive.runtime.session import RunOutcome, Session
from ground import durable
from ground.durable import DRAFT, put_in_place
from ground.errors import StateError

FORMAT = "run/1"


class TrackerLine(TypedDict):
    """A tracker in a line of `telemetry.jsonl`."""

    state: str
    confidence: float


class SampleLine(TypedDict):
    """A line of `telemetry.jsonl`: see `Sample`."""

    t_s: float
    east_m: float
    north_m: float
    heading_rad: float
    battery_j: float
    energy_used_j: float
    task: str
    trackers: dict[str, TrackerLine]


class ProductLine(TypedDict):
    """A line of `products.jsonl`: when and by which attempt of which task a file was made, and its digest."""

    t_s: float
    task: str
    attempt: int
    kind: str
    path: str
    sha256: str
    label: dict[str, str | float | bool]


@dataclass(frozen=True, slots=True)
class Sample:
    """State of the rover at one time: pose in the site frame, energy, and the trackers by target."""

    t_s: float
    east_m: float
    north_m: float
    heading_rad: float
    battery_j: float
    energy_used_j: float
    task: str
    trackers: Mapping[str, tuple[str, float]]

    def line(self) -> SampleLine:
        """Return what `telemetry.jsonl` holds of it."""
        return {
            "t_s": self.t_s,
            "east_m": round(self.east_m, 4),
            "north_m": round(self.north_m, 4),
            "heading_rad": round(self.heading_rad, 5),
            "battery_j": round(self.battery_j, 1),
            "energy_used_j": round(self.energy_used_j, 1),
            "task": self.task,
            "trackers": {t: {"state": s, "confidence": round(c, 4)} for t, (s, c) in self.trackers.items()},
        }


class SampleBook:
    """Makes a sample of each change of state that a rover reports."""

    def __init__(self) -> None:
        self.samples: list[Sample] = []
        self._state: dict[str, Any] = {}
        self._running: dict[CommandId, str] = {}

    def sent(self, command: CommandId) -> None:
        self._running[command] = command.task

    def heard(self, event: Event) -> Sample | None:
        """Return the sample of an event, None of one that reports no state."""
        match event:
            case Update(values=values):
                self._state.update(values)
            case Result(command=command, updates=values) | Acknowledgement(command=command, updates=values):
                self._state.update(values)
                self._running.pop(command, None)
            case _:
                return None
        self.samples.append(self._sample(event.t_ms))
        return self.samples[-1]

    def _sample(self, t_ms: int) -> Sample:
        state = self._state
        trackers = {
            key.removeprefix("trackerstate "): (
                str(value),
                self._number(f"trackerconfidence {key.removeprefix('trackerstate ')}"),
            )
            for key, value in state.items()
            if key.startswith("trackerstate ")
        }
        return Sample(
            t_ms / 1000,
            self._number("pose x"),
            self._number("pose y"),
            self._number("pose heading"),
            self._number("battery-energy"),
            self._number("energy-used"),
            next(iter(self._running.values()), ""),
            trackers,
        )

    def _number(self, key: str) -> float:
        """Return a number of the state; what a rover reports there that is none counts as 0."""
        value = self._state.get(key, 0.0)
        return float(value) if isinstance(value, int | float) else 0.0


class Recorder:
    """A rover that remembers what it reported: every change of state becomes a sample."""

    def __init__(
        self,
        rover: Rover,
        listener: Callable[[Sample], None] | None = None,
        on_product: Callable[[Product], None] | None = None,
    ) -> None:
        self.rover = rover
        self.book = SampleBook()
        self._listener, self._on_product = listener, on_product

    @property
    def samples(self) -> list[Sample]:
        return self.book.samples

    def send(self, command: Command) -> None:
        self.book.sent(command.id)
        self.rover.send(command)

    def abort(self, command: CommandId) -> None:
        self.rover.abort(command)

    def status(self, command: CommandId) -> CommandStatus:
        return self.rover.status(command)

    def next_event(self, until_ms: int | None) -> Event | None:
        event = self.rover.next_event(until_ms)
        if event is None:
            return None
        if isinstance(event, Product) and self._on_product is not None:
            self._on_product(event)
        sample = self.book.heard(event)
        if sample is not None and self._listener is not None:
            self._listener(sample)
        return event


@dataclass(frozen=True)
class Flight:
    """A finished run: what came of it, and everything the rover reported."""

    folder: Path
    outcome: RunOutcome
    samples: tuple[Sample, ...]
    document: Mapping[str, Any]

    def options_taken(self) -> tuple[str, ...]:
        """Return the ids of the options that branches chose, in order."""
        return tuple(r.arguments[1] for r in self.outcome.trace if r.event == "choose")

    def lost_targets(self) -> tuple[str, ...]:
        """Return the targets whose track was lost at some time, in the order of their loss."""
        lost: dict[str, None] = {}
        for sample in self.samples:
            for target, (state, _) in sample.trackers.items():
                if state == "lost":
                    lost.setdefault(target)
        return tuple(lost)


def fly(
    crl_text: str,
    rover: Rover,
    folder: Path,
    *,
    run_id: str,
    about: Mapping[str, object] | None = None,
    on_sample: Callable[[Sample], None] | None = None,
    on_trace: Callable[[TraceRecord], None] | None = None,
    on_product: Callable[[Product], None] | None = None,
    should_stop: Callable[[], bool] = lambda: False,
    sync: bool = True,
    repeats: Sequence[Any] = (),
    operator: Sequence[Operator] = (),
) -> Flight:
    """Run a plan to its end on the rover's virtual clock and return the run; its folder is `folder`.

    A stop that is asked for becomes an operator's abort: the run ends as a real one would. `about` goes into
    `run.json` as it is (rover, seed, faults, plan). `repeats` holds the records of a journal that this run
    has to repeat before it goes on. `operator` holds commands with the times at which the rover hears them.

    Raises
    ------
    CrlError
        If the plan is rejected.
    JournalError
        If the journal cannot be written, or the folder holds one already.
    StateError
        If the run does something else than `repeats` says.
    """
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "plan.crl").write_text(crl_text, encoding="utf-8")
    recorder = Recorder(rover, on_sample, on_product)
    listeners = () if on_trace is None else (on_trace,)
    file = FileJournal.create(folder / "journal.jsonl", sync=sync)
    journal: Sink = _Repeating(file, repeats) if repeats else file
    try:
        session = Session(_loaded(crl_text), recorder, run_id=run_id, journal=journal, listeners=listeners)
        session.plan_text = crl_text  # the journal begins with the text as it came
        session.start()
        for heard in operator:
            session.inject(heard)
        stopped = False
        while session.step_once():
            if not stopped and should_stop():
                stopped = True
                session.abort()
        outcome = session.result()
    finally:
        journal.close()
    about = {"stopped": stopped, **(about or {})}
    return write_run(folder, outcome, recorder.samples, outcome.products, about, sync=sync)


def write_run(
    folder: Path,
    outcome: RunOutcome,
    samples: Sequence[Sample],
    products: Sequence[Product],
    about: Mapping[str, object],
    *,
    sync: bool = True,
) -> Flight:
    """Write what came of a run into its folder, the form `run/1`, and return it.

    `run.json` says that the run is over, so it comes last and whole; with `sync` all of it is durable then.
    """
    document = {
        "format": FORMAT,
        "run": outcome.run_id,
        "plan_digest": outcome.plan_digest,
        "outcome": outcome.outcome,
        "reason": outcome.reason,
        "end_s": outcome.end_s,
        "utility": outcome.utility,
        "reward": outcome.reward,
        "over_budget": outcome.over_budget,
        "outcomes": dict(outcome.outcomes),
        **about,
    }
    _write_lines(folder / "trace.jsonl", ([r.t_ms / 1000, r.event, *r.arguments] for r in outcome.trace))
    _write_lines(folder / "telemetry.jsonl", (s.line() for s in samples))
    _write_lines(folder / "products.jsonl", map(product_line, products))
    draft, done = folder / f"{DRAFT}run.json", folder / "run.json"
    draft.write_text(json.dumps(document, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    if sync:
        files = {"trace.jsonl", "telemetry.jsonl", "products.jsonl", *(p.path for p in products)}
        for path in (folder / name for name in files):
            if path.is_file():
                durable.sync(path)
        put_in_place(draft, done)
    else:
        draft.replace(done)
    return Flight(folder, outcome, tuple(samples), document)


@lru_cache(maxsize=2)
def _loaded(crl_text: str) -> PlanSpec:
    """Return a plan ready to run: one plan is flown again and again, with other seeds."""
    return load_plan(crl_text)


class _Repeating:
    """A journal that begins with the records of another: the first that differs stops the run."""

    def __init__(self, journal: FileJournal, wanted: Sequence[Any]) -> None:
        self._journal, self._wanted, self._number = journal, wanted, 0

    def append(self, records: Sequence[Any], *, durable: bool) -> None:
        for record in records:
            number = self._number
            if number < len(self._wanted) and record_of(line_of(number, record)) != self._wanted[number]:
                raise StateError(
                    f"the rover does not repeat record {number} of the interrupted journal; one that lived "
                    "on is taken up by the live executive, not by --resume"
                )
            self._number += 1
        self._journal.append(records, durable=durable)

    def close(self) -> None:
        self._journal.close()


def product_line(product: Product) -> ProductLine:
    """Return what `products.jsonl` holds of a product."""
    return {
        "t_s": product.t_ms / 1000,
        "task": product.command.task,
        "attempt": product.command.attempt,
        "kind": product.kind,
        "path": product.path,
        "sha256": product.sha256,
        "label": dict(product.label),
    }


_encode = json.JSONEncoder(sort_keys=True).encode  # `json.dumps` makes an encoder for each line


def _write_lines(path: Path, rows: Iterable[Any]) -> None:
    with path.open("w", encoding="utf-8") as file:
        file.writelines(_encode(row) + "\n" for row in rows)
