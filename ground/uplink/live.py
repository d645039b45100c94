"""Execute a package on a rover that lives its own life, on the real clock, over a wire.

Standard library and `cryptography` alone: it is the heart of the on-board file. The folder of the run holds
the journal, and while the run goes on `control.sock` (see `executive.runtime.control`) and `live.json`, by
which `outcrop stop` finds the rover even if this process is hung.
"""

from __future__ import annotations

import contextlib
import json
import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

from executive.errors import WireError
from executive.ports import Command, Operator, Product
from executive.runtime.codec import effect_from_json, events_from_json
from executive.runtime.control import CONTROL_SOCKET, ControlSocket, RunControl, Stopped, ask_run
from executive.runtime.journal import JournalFile, Record, never_began, plan_time
from executive.runtime.live import LiveRuntime, LiveSettings, stop_on_signals
from executive.runtime.session import RunOutcome
from executive.runtime.wire.address import Address, Keys
from executive.runtime.wire.client import WireRover
from executive.runtime.wire.stop import stop_rover
from ground.durable import DRAFT
from ground.errors import InvalidInputError, StateError
from ground.uplink.admission import Admitted, admitted, check_plan
from ground.uplink.flight import Flight, Sample, SampleBook, write_run
from ground.uplink.verify import Package

logger = logging.getLogger(__name__)

LIVE = "live.json"
"""In the folder of a live run: where its rover is, and the keys to it."""
JOURNAL = "journal.jsonl"
DICTIONARY = "dictionary.json"
"""In the folder of a live run: which dictionary its rover told, and in which run."""
PATIENCE_S = 0.1
"""How long a stop waits for the run before it goes to the rover."""


@dataclass(frozen=True, slots=True)
class LiveOptions:
    """How a live run is conducted; seconds of the wall clock.

    Attributes
    ----------
    silence_s
        After so long without a word the plan gives way to `safe`, or is aborted; None = never.
    stuck_s
        How long a command may go on that was told to stop, on a rover that answers otherwise.
    connect_s
        How long a new run waits for its rover; one that is resumed waits for nothing.
    products_s
        How long a run that is over waits for products that are still to come down.
    """

    silence_s: float | None = 60.0
    grace_s: float = 10.0
    stuck_s: float = 60.0
    heartbeat_s: float = 5.0
    monitor_s: float = 5.0
    connect_s: float = 30.0
    products_s: float = 60.0

    def settings(self, rate: float) -> LiveSettings:
        """Return the settings of a runtime whose plan clock runs at `rate`."""

        def plan_ms(seconds: float) -> int:
            return max(1, round(1000 * rate * seconds))

        return LiveSettings(
            silence_ms=None if self.silence_s is None else plan_ms(self.silence_s),
            grace_ms=plan_ms(self.grace_s),
            stuck_ms=plan_ms(self.stuck_s),
            heartbeat_ms=plan_ms(self.heartbeat_s),
            monitor_ms=plan_ms(self.monitor_s),
            rate=rate,
        )


@dataclass(frozen=True, slots=True)
class LivePlace:
    """Where a package is executed live.

    Attributes
    ----------
    world
        Folder of the rover's ledger.
    dictionary
        Name, version and SHA-256 of the rover's dictionary, for a rover that does not tell its own.
    products_here
        The rover writes its products into the folder of the run itself.
    """

    address: Address
    world: Path
    trust: Path
    keys: Keys | None = None
    dictionary: tuple[str, str, str] | None = None
    products_here: bool = False


class _MarkedRover(WireRover):
    """A rover before whose first command the ledger is marked."""

    mark: Callable[[], None] | None = None

    def send(self, command: Command) -> None:
        if self.mark is not None:
            self.mark()
            self.mark = None
        super().send(command)


def execute_live(
    package: Path,
    place: LivePlace,
    out: Path,
    *,
    resume: bool = False,
    options: LiveOptions | None = None,
    on_repair: Callable[[str], None] = lambda _what: None,
    signals: bool = True,
) -> tuple[Package, Flight]:
    """Return what came of a package on the real clock; its folder `out` has the form `run/1`.

    With `resume` a run that was begun goes on, at the plan time of the wall clock, and one that never began
    begins: it is what a supervisor calls again after whatever happened.

    Raises
    ------
    ArchiveError, AlreadyExecutedError
        If the package must not be executed here and now.
    InvalidInputError
        If the folder is in use, or the journal of a run that was begun is gone.
    WireError
        If a new run finds no rover.
    """
    chosen = options or LiveOptions()
    with contextlib.ExitStack() as ends:
        rover: list[_MarkedRover] = []

        def check(opened: Package) -> None:
            live = _MarkedRover(
                place.address,
                run=run_id_of(opened),
                keys=place.keys,
                out=None if place.products_here else out,
            )
            rover.append(live)
            ends.callback(live.close)
            check_plan(opened, _dictionary(place, live, out, chosen.connect_s))

        given = ends.enter_context(
            admitted(package, place.world, place.trust, check=check, resume=resume, on_repair=on_repair)
        )
        begun = _begun(given, out, resume=resume)
        live = rover[0]
        if given.earlier is None:
            live.mark = lambda: given.ledger.append(given.entry(live_name(place), None))
        rate = plan_rate(out) if begun else live.wait_ready(chosen.connect_s).rate
        _write_place(out, place)
        about = {
            "kind": "execution",
            "rover": live_name(place),
            "seed": 0,
            "faults": [],
            "package_sha256": given.package.sha256,
            "mission": given.package.mission,
            "plan": given.package.manifest["plan"],
            "sequence": given.package.counter,
            "signers": {role: list(people) for role, people in given.package.signers.items()},
        }
        settings = chosen.settings(rate)
        flight = run_live(
            given.package.crl_text, live, out, settings=settings, resume=begun, about=about, signals=signals
        )
        if live.mark is not None:
            live.mark()  # a plan without a command was executed, too
        live.wait_for_products(chosen.products_s)
        live.close(over=True)
        return given.package, complete(flight)


def run_id_of(package: Package) -> str:
    """Return the id of a package's run: of all runs that a rover ever sees, no other has it."""
    return f"execution-{package.counter}-{package.sha256[:12]}"


def live_name(place: LivePlace) -> str:
    return f"live {place.address}"[:80]


def _dictionary(place: LivePlace, rover: WireRover, out: Path, connect_s: float) -> tuple[str, str, str]:
    """Return which dictionary the rover has: as given, as it says, or as the run knew before."""
    if place.dictionary is not None:
        return place.dictionary
    told = _known_dictionary(out, rover.run)
    if told is None:
        told = rover.wait_ready(connect_s).dictionary
        if not told:
            raise InvalidInputError(
                f"the rover at {place.address} does not tell its dictionary; give its file as --dictionary"
            )
        out.mkdir(parents=True, exist_ok=True)
        fresh = out / f"{DICTIONARY}.new"
        fresh.write_text(json.dumps({**told, "run": rover.run}) + "\n", encoding="utf-8")
        fresh.replace(out / DICTIONARY)
    return str(told.get("name")), str(told.get("version")), str(told.get("sha256"))


def _known_dictionary(out: Path, run: str) -> Mapping[str, object] | None:
    """Return what a rover told of its dictionary when this very run was begun, None if that is not known."""
    if never_began(out / JOURNAL):
        return None
    try:
        told = json.loads((out / DICTIONARY).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return told if isinstance(told, dict) and told.get("run") == run else None


def plan_rate(out: Path) -> float:
    """Return how many plan seconds a second of the wall clock has in a run that was begun."""
    return plan_time(JournalFile(out / JOURNAL).header).rate


def _begun(given: Admitted, out: Path, *, resume: bool) -> bool:
    """Return whether the folder holds a run to go on with.

    Raises
    ------
    InvalidInputError
        If it is in use, the run is over, or it was begun and its journal is gone.
    """
    journal = out / JOURNAL
    if (out / "run.json").exists():
        raise InvalidInputError(f"the run in {out} came to its end; there is nothing to resume")
    empty = never_began(journal)
    if given.earlier is not None and empty:
        raise InvalidInputError(
            f"{given.name} was begun, and the journal in {out} is gone: what the rover was told is not known"
        )
    if not resume and (journal.exists() or (out / CONTROL_SOCKET).exists()):
        raise InvalidInputError(f"{out} holds a run already; give a new folder, or --resume")
    out.mkdir(parents=True, exist_ok=True)
    return not empty


def _write_place(out: Path, place: LivePlace) -> None:
    keys = place.keys
    files = None if keys is None else [str(p.resolve()) for p in (keys.certificate, keys.key, keys.authority)]
    fresh = out / f"{DRAFT}{LIVE}"  # who stops the rover in an emergency reads it: whole, or not there yet
    fresh.write_text(json.dumps({"connect": str(place.address), "keys": files}) + "\n", "utf-8")
    fresh.replace(out / LIVE)


def run_live(
    crl_text: str,
    rover: WireRover,
    out: Path,
    *,
    settings: LiveSettings,
    resume: bool,
    about: Mapping[str, object],
    signals: bool = False,
    on_runtime: Callable[[RunControl], None] = lambda _control: None,
) -> Flight:
    """Conduct a plan on a rover until it is over, and return the run as its journal tells it.

    `on_runtime` is given the control of the run before it begins.
    """
    out.mkdir(parents=True, exist_ok=True)
    (out / "plan.crl").write_text(crl_text, encoding="utf-8")
    if resume:  # what was told before this process may not have come down
        told = journal_events(JournalFile(out / JOURNAL).records)
        rover.fetch(event for event in told if isinstance(event, Product))
    runtime = LiveRuntime(
        crl_text, rover, run_id=rover.run, journal=out / JOURNAL, resume=resume, settings=settings
    )
    if signals:
        stop_on_signals(runtime)
    control = RunControl(runtime, rover.inject)
    socket = ControlSocket(out, control)
    try:
        on_runtime(control)
        outcome = runtime.run()
    finally:
        socket.close()
    return _flight(out, outcome, {"stopped": control.stopped, **about})


def journal_events(records: Sequence[Record]) -> Iterator[Sample | Product]:
    """Yield the samples and products of a journal in order."""
    book = SampleBook()
    for record in records:
        if isinstance(effect := effect_from_json(record), Command):
            book.sent(effect.id)
        for event in events_from_json(record):
            if isinstance(event, Product):
                yield event
            elif not isinstance(event, Operator) and (sample := book.heard(event)) is not None:
                yield sample


def _flight(out: Path, outcome: RunOutcome, about: Mapping[str, object]) -> Flight:
    told = list(journal_events(JournalFile(out / JOURNAL).records))
    products = tuple({p.path: p for p in told if isinstance(p, Product)}.values())
    samples = tuple(s for s in told if isinstance(s, Sample))
    return Flight(out, replace(outcome, products=products), samples, dict(about))


def complete(flight: Flight) -> Flight:
    """Write the folder of a run that is over; products whose file did not come down are told apart."""
    there = [p for p in flight.outcome.products if (flight.folder / p.path).is_file()]
    missing = sorted({p.path for p in flight.outcome.products} - {p.path for p in there})
    about = {**flight.document, "products_missing": missing}
    return write_run(flight.folder, flight.outcome, flight.samples, there, about)


def stop_run(out: Path, *, rover_s: float = 5.0, by: str = "") -> str:
    """Stop the live run in a folder, and its rover; return in a sentence how. The journal notes `by` whom.

    The run is asked first: its plan must end before its rover stops, or it would look for another way. If
    within a tenth of a second it does not say that its rover has stopped, the rover is told directly, and the
    run heard on. The rover's word is waited for `rover_s` seconds.

    Raises
    ------
    StateError
        If nobody says that the rover has stopped, or the folder holds no live run.
    """
    with ThreadPoolExecutor(1) as pool:
        asked = pool.submit(ask_run, out, {"m": "stop", "by": by})
        with contextlib.suppress(TimeoutError, WireError):
            answer = asked.result(PATIENCE_S)
            if answer.get("rover") != Stopped.ASKED:
                return _how_stopped(answer)
        try:
            document = json.loads((out / LIVE).read_text(encoding="utf-8"))
            address = Address.parse(str(document["connect"]))
            keys = document.get("keys")
            stop_rover(address, None if keys is None else Keys(*map(Path, keys)), rover_s)
        except (OSError, ValueError, KeyError, TypeError, WireError) as second:
            try:
                answer = asked.result()
            except WireError as first:
                raise StateError(f"{first}; nor could its rover be told: {second}") from second
            if answer.get("rover") != Stopped.ASKED:
                return _how_stopped(answer)
            raise StateError(
                f"the run was told to stop, but its rover has not said that it has stopped: {second}"
            ) from second
        late = asked.exception()
    return f"the rover was told directly and says that it has stopped; {late or 'the run was told to stop'}"


def _how_stopped(answer: Mapping[str, object]) -> str:
    if answer.get("rover") == Stopped.SAFEMODE:
        return "the run was told to stop, and its rover was sent safemode"
    return "the run was told to stop, and its rover says that it has stopped"
