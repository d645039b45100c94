"""A run on the wall clock: threads that only post events, and one owner of all state.

::

    telemetry ──┐
    action      ├──> Mailbox ──> owner (LiveRuntime.turn) ──> rover
    monitor     │                    │
    plan        │                    └──> journal, listeners
    watcher   ──┘

The timer is the owner's wait itself: it sleeps until something is posted or the next bound is due. `turn` is
one round of the owner and may be called without any thread, which is how the rules below are tested.

Safety: `stop` is an operator abort that goes before everything that waits. When the rover has said nothing
for `silence_ms`, the plan gives way to its alternate `safe`, or, without one, is aborted and the rover is
sent `safemode`; commands that are not acknowledged within `grace_ms` are then taken as stopped.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from functools import partial
from pathlib import Path
from typing import Protocol, cast, runtime_checkable

from executive.crl import Plan, canonical_text, parse
from executive.engine.instance import Instance, Note
from executive.engine.run import command_of
from executive.errors import MisuseError
from executive.ports import (
    Acknowledgement,
    Clock,
    Command,
    CommandId,
    CommandPort,
    CommandState,
    Event,
    EventSource,
    Link,
    Operation,
    Operator,
    Result,
    TraceListener,
    Update,
    UtilitySource,
)
from executive.runtime.clocks import MonotonicClock, instant_of, plan_now_ms, plan_start_ms, utc_now
from executive.runtime.inbox import Inbox
from executive.runtime.journal import (
    FileJournal,
    JournalFile,
    PlanTime,
    Sink,
    last_number,
    last_time,
    never_began,
    plan_time,
)
from executive.runtime.loading import load_plan
from executive.runtime.mailbox import Mailbox
from executive.runtime.recovery import resume_session
from executive.runtime.session import RunOutcome, Session

logger = logging.getLogger(__name__)

SAFE_ALTERNATE = "safe"
STARTS = ("start", "retry", "resume", "insert", "alternate")
"""Events of the trace by which something begins: what a single step waits for."""
SAFEMODE = "safemode"


@runtime_checkable
class Heartbeat(Protocol):
    """A command port may want to hear from the executive regularly."""

    def heartbeat(self, t_ms: int) -> None: ...


@dataclass(frozen=True, slots=True)
class LiveSettings:
    """How a live run watches over the rover; times in milliseconds of the plan clock, None = off."""

    silence_ms: int | None = 60_000
    grace_ms: int = 10_000
    stuck_ms: int | None = 60_000
    """How long a command may go on that was told to stop, on a rover that answers otherwise."""
    heartbeat_ms: int | None = 5_000
    monitor_ms: int | None = 10_000
    rate: float = 1.0
    """Plan seconds in a second of the wall clock, where no clock is given."""
    watch_s: float = 1.0
    mailbox_limit: int = 10_000
    resend_limit: int = 3


@dataclass(frozen=True, slots=True)
class _Wish:
    """What somebody asked for since the owner last looked; two of the same are told apart by `is`."""

    held: bool


class LiveRuntime:
    """One plan on a live rover.

    Parameters
    ----------
    plan
        CRL text or a plan.
    port
        The way to the rover; it may also be an `EventSource`, which a thread then reads, and a `Heartbeat`.
    journal
        Path of the journal; with `resume` an existing one is continued (CRL.md 10), at the plan time that
        the wall clock gives it; one that holds no whole header begins anew.
    clock
        The plan clock, where it is not the wall clock; `wall` is the wall clock, for tests.
    plan_folder
        Folder in which new plans (`*.crl`) appear; each replaces the running one.
    """

    def __init__(
        self,
        plan: str | Plan,
        port: CommandPort,
        *,
        run_id: str,
        journal: Path | Sink | None = None,
        resume: bool = False,
        clock: Clock | None = None,
        wall: Callable[[], datetime] = utc_now,
        settings: LiveSettings | None = None,
        plan_folder: Path | None = None,
        listeners: Sequence[TraceListener] = (),
        utility_source: UtilitySource | None = None,
    ) -> None:
        self.settings = settings if settings is not None else LiveSettings()
        self.mailbox = Mailbox(self.settings.mailbox_limit)
        self.port = port
        self.plan_folder = plan_folder
        self.run_id = run_id
        self._now = 0
        self._complaints: list[Note] = []
        self._inbox = Inbox(port, self.complain)
        self._own_sink = isinstance(journal, Path)
        self._flooded = False
        self._safing_since: int | None = None
        self._stops_asked: dict[CommandId, int] = {}
        """When the owner first saw that a command is to stop."""
        self._threads: list[threading.Thread] = []
        self._stopping = threading.Event()
        self._owner = threading.RLock()
        self._asked_again: dict[CommandId, int] = {}
        self._stepping = False
        self._wish: _Wish | None = None
        self._wishing = threading.Lock()
        self._sink: Sink | None
        if isinstance(journal, Path) and resume and not never_began(journal):
            file = JournalFile(journal)
            file.check_identity(run_id=run_id)
            file.cut_torn_tail()
            self.clock = clock if clock is not None else self._clock_again(file, wall())
            self._now = max(self.clock.now_ms(), last_time(file.records))
            self._attach()
            self._sink = FileJournal(journal, number=len(file.records))
            self._ask_for_missed(last_number(file.records))  # what the journal holds is durable by now
            self.session = resume_session(
                file.records,
                self._inbox,
                self._sink,
                now_ms=self._now,
                listeners=listeners,
                utility_source=utility_source,
            )
        else:
            compiled = load_plan(plan)
            rate = self.settings.rate
            time = PlanTime("given")
            if clock is None:
                present = wall()
                start_ms = plan_start_ms(compiled.epoch, present, rate)
                clock = MonotonicClock(start_ms, speed=rate)
                instant = present - timedelta(milliseconds=start_ms / rate)
                time = PlanTime("wall", rate, instant.isoformat())
            self.clock = clock
            self._now = clock.now_ms()
            self._sink = FileJournal.create(journal) if isinstance(journal, Path) else journal
            self.session = Session(
                compiled,
                self._inbox,
                run_id=run_id,
                journal=self._sink,
                listeners=listeners,
                utility_source=utility_source,
                start_ms=self._now,
                time=time,
            )
            self.session.plan_text = plan if isinstance(plan, str) else compiled.text
            self.session.open_journal()
            self._attach()
            self._hear_what_is_there()
        self._heard = self._beat = self._now
        self._safe_plan = safe_plan(self.session.plan_text)

    def _clock_again(self, file: JournalFile, present: datetime) -> Clock:
        """Return the plan clock of a run that comes back: it has gone on while the process was away."""
        time = plan_time(file.header)
        last = last_time(file.records)
        if time.instant is None:
            self.complain(
                "risk", "the journal holds no instant of plan time 0: the clock goes on from its end"
            )
            return MonotonicClock(last, speed=time.rate)
        now = plan_now_ms(instant_of(time.instant), present, time.rate)
        if now < last:
            self.complain(
                "risk",
                f"the wall clock gives plan time {now / 1000:g} s, the journal ends at {last / 1000:g} s: "
                "the plan clock goes on from there",
            )
        return MonotonicClock(max(now, last), speed=time.rate)

    def _attach(self) -> None:
        if isinstance(self.port, Link):
            self.port.attach(self.clock, self.complain)

    def _hear_what_is_there(self) -> None:
        """Take what the rover has said before the run: its state is part of the first macro step."""
        if hasattr(self.port, "next_event"):
            source = cast("EventSource", self.port)
            while event := self._inbox.ask("state", partial(source.next_event, self._now), None):
                self._inbox.events.append(event._replace(t_ms=self._now))

    def _ask_for_missed(self, number: int) -> None:
        """Take what the rover said while nobody listened, and then its present state."""
        self._inbox.commit(number)
        self._inbox.events += (e._replace(t_ms=min(e.t_ms, self._now)) for e in self._inbox.since(number))
        state = self._inbox.present_state()
        if state:
            self._inbox.events.append(Update(self._now, state))

    # --- for any thread ------------------------------------------------------------

    def post(self, event: Event) -> None:
        """Hand over an event from the rover or an operator."""
        self.mailbox.post(event)

    def pause(self) -> None:
        """Hold the plan: nothing starts."""
        self._ask(Operation.PAUSE)

    def resume(self) -> None:
        """Let the plan go on, also one that is stepping."""
        self._ask(Operation.RESUME)

    def step(self) -> None:
        """Let the plan go on until something has started, and hold it then.

        Everything that can start in the same macro step starts: the tasks of a concurrent block together.
        """
        self._ask(Operation.RESUME, step=True)

    def _ask(self, operation: Operation, *, step: bool = False) -> None:
        with self._wishing:
            self._stepping = step
            self._wish = _Wish(step or operation is Operation.PAUSE)
            self.post(Operator(0, operation))

    @property
    def held(self) -> bool:
        """Whether the plan is held, or goes on no further than a step; what was asked last counts at once."""
        with self._wishing:
            if self._wish is not None:
                return self._wish.held
            return self._stepping or self.session.engine.run.paused

    def stop(self) -> None:
        """Stop the plan: an operator abort that goes before everything that waits."""
        self.post(Operator(0, Operation.ABORT))

    def replace(self, plan_text: str) -> None:
        self.post(Operator(0, Operation.REPLACE, plan_text))

    def emergency_stop(self) -> None:
        """Stop rover and plan from the calling thread, even if the owner is stuck.

        A port with a link stops everything the rover does; another is sent `safemode`.
        """
        self.stop()
        if isinstance(self.port, Link):
            self.port.stop()
            return
        self.port.send(Command(CommandId(self.run_id, "emergency-stop", 1), SAFEMODE, {}))

    def complain(self, kind: str, text: str) -> None:
        """Note something for the journal."""
        self._complaints.append(Note(self._now, kind, text))

    @property
    def picture(self) -> dict[str, object]:
        """The state of the run after the last round of the owner; any thread may ask.

        A picture is made when it is asked for, so a round costs nothing for nodes to which nothing happens.
        """
        with self._owner:
            return self.session.snapshot()

    # --- the owner -------------------------------------------------------------------

    def turn(self) -> None:
        """Do one round: let what was posted and everything that is due happen, look after the rover."""
        with self._owner:
            self._turn()

    def _turn(self) -> None:
        session = self.session
        now = max(self._now, self.clock.now_ms())
        self._now = now
        with self._wishing:
            events, taken = self.mailbox.take(now), self._wish
        if self.mailbox.merged and not self._flooded:
            self._flooded = True
            self.complain(
                "telemetry", "telemetry comes faster than it is taken: updates are merged key by key"
            )
        if any(not isinstance(event, Operator) for event in events):
            self._heard = now
        if isinstance(self.port, Link):
            self._hear_line(self.port, now)
        self._inbox.events += events
        self._write_complaints()
        before = len(session.trace)
        session.step(now)
        started = any(record.event in STARTS for record in session.trace[before:])
        with self._wishing:
            if self._wish is taken:  # else somebody has asked for something since: that is for the next round
                self._wish = None
                if self._stepping and started:
                    self._stepping = False
                    self._wish = _Wish(held=True)
                    self.post(Operator(0, Operation.PAUSE))
        if not session.over:
            self._watch_over(now)

    def run(self) -> RunOutcome:
        """Be the owner until the plan is over; starts and ends the threads."""
        self._start_threads()
        try:
            while not self.session.over:
                with self._owner:  # the journal is not closed within a round, nor is there one after it
                    if self._stopping.is_set():
                        break
                    self._turn()
                self.mailbox.wait(self._pause_s() if not self.session.over else 0.0)
        finally:
            self.shut_down()
        return self.session.result()

    def shut_down(self) -> None:
        """End the threads and close the journal; the plan can be resumed from the journal."""
        self._stopping.set()
        self.mailbox.close()
        for thread in self._threads:
            if thread is not threading.current_thread():
                thread.join(timeout=5)
        self._threads = []
        if self._own_sink and self._sink is not None:
            with self._owner:
                self._sink.close()

    def _pause_s(self) -> float:
        """Return how long the owner may wait if nothing is posted."""
        due = [self.session.engine.next_wakeup()]
        settings = self.settings
        if settings.silence_ms is not None:
            due.append(self._heard + settings.silence_ms)
        if settings.heartbeat_ms is not None:
            due.append(self._beat + settings.heartbeat_ms)
        if self._safing_since is not None:
            due.append(self._safing_since + settings.grace_ms)
        ahead = min((t for t in due if t is not None), default=self._now + 1000) - self._now
        speed = float(getattr(self.clock, "speed", 1.0))
        return min(max(ahead, 1) / 1000 / speed, 1.0)

    def _hear_line(self, port: Link, now: int) -> None:
        """An answer on the line is a word of the rover, too."""
        age_s = port.link().age_s
        if age_s is not None:
            speed = float(getattr(self.clock, "speed", 1.0))
            self._heard = max(self._heard, now - round(1000 * age_s * speed))

    def _write_complaints(self) -> None:
        if self._complaints:
            complaints, self._complaints = self._complaints, []
            self.session.add_notes(complaints)

    # --- looking after the rover --------------------------------------------------------

    def _watch_over(self, now: int) -> None:
        settings = self.settings
        if settings.heartbeat_ms is not None and now - self._beat >= settings.heartbeat_ms:
            self._beat = now
            if isinstance(self.port, Heartbeat):
                self._inbox.ask("heartbeat", partial(self.port.heartbeat, now), None)
        self._end_stuck(now)
        if self._safing_since is not None:
            self._finish_safing(now, self._safing_since)
        elif settings.silence_ms is not None and now - self._heard >= settings.silence_ms:
            self._make_safe(now)

    def _end_stuck(self, now: int) -> None:
        """A command that does not stop keeps the plan from its alternate only for so long."""
        asked = {c: self._stops_asked.get(c, now) for c, n in self._commands() if n.abort_asked}
        self._stops_asked = asked
        limit_ms = self.settings.stuck_ms
        for command, since in asked.items():
            if limit_ms is not None and now - since >= limit_ms:
                self.complain(
                    "risk",
                    f"{command} was told to stop {(now - since) / 1000:g} s ago and is not acknowledged, "
                    "though the rover answers: taken as stopped",
                )
                self._inbox.events.append(Acknowledgement(now, command))

    def _commands(self) -> list[tuple[CommandId, Instance]]:
        return list(self.session.engine.run.commands.items())

    def _make_safe(self, now: int) -> None:
        """The rover has been silent for too long."""
        silent_s = (now - self._heard) / 1000
        self._safing_since = now
        if self._safe_plan is not None:
            what = f"the alternate {SAFE_ALTERNATE!r} takes over"
            self.replace(self._safe_plan)
        else:
            what = f"the plan is aborted and the rover is sent {SAFEMODE!r}"
            self.stop()
            self._inbox.send(Command(CommandId(self.run_id, "safing", 1), SAFEMODE, {}))
        self.complain("safing", f"no word from the rover for {silent_s:g} s: {what}")
        logger.warning("safing", extra={"t_s": now / 1000, "silent_s": silent_s})

    def _finish_safing(self, now: int, since: int) -> None:
        """Commands whose stop a silent rover does not acknowledge count as stopped after the grace."""
        if now - since < self.settings.grace_ms:
            return
        if self._heard > since:
            self._safing_since = None
            return
        for command, node in self._commands():
            if node.abort_asked:
                self.complain("safing", f"{command} was not acknowledged: taken as stopped")
                self._inbox.events.append(Acknowledgement(now, command))
        self._safing_since = now

    # --- threads ----------------------------------------------------------------------

    def _start_threads(self) -> None:
        if self._threads:
            raise MisuseError(f"run {self.run_id} is running already")
        jobs: list[tuple[str, Callable[[], None]]] = []
        if hasattr(self.port, "next_event"):
            jobs.append(("telemetry", self._read_telemetry))
        if self.settings.monitor_ms is not None:
            jobs.append(("action-monitor", self._monitor_actions))
        if self.plan_folder is not None:
            jobs.append(("plan-watcher", self._watch_plans))
        for name, job in jobs:
            thread = threading.Thread(target=job, name=f"{self.run_id}-{name}", daemon=True)
            self._threads.append(thread)
            thread.start()

    def _read_telemetry(self) -> None:
        """Telemetry thread: post what the rover says."""
        source = cast("EventSource", self.port)
        while not self._stopping.is_set():
            event = self._inbox.ask("telemetry", partial(source.next_event, self.clock.now_ms()), None)
            if event is None:
                self._stopping.wait(0.002)
            else:
                self.mailbox.post(event)

    def _monitor_actions(self) -> None:
        """Action monitor thread: ask for the status of running commands, in case a result was lost."""
        period = (self.settings.monitor_ms or 1000) / 1000 / float(getattr(self.clock, "speed", 1.0))
        while not self._stopping.wait(period):
            self.check_actions()

    def check_actions(self) -> None:
        """Ask the rover about each running command: post a lost result, repeat a lost command."""
        with self._owner:
            running = tuple(self.session.engine.run.commands)
        for command in running:
            status = self._inbox.status(command)
            if status.state is CommandState.DONE and status.result is not None:
                self.mailbox.post(status.result._replace(number=0))
            elif status.state is CommandState.UNKNOWN:
                self._repeat(command)

    def _repeat(self, command: CommandId) -> None:
        """Deal with a command that the rover does not know; one that is to stop has stopped.

        All of it under the lock, so that no abort of the owner comes between the look and the sending.
        """
        with self._owner:
            node = self.session.engine.run.commands.get(command)
            if node is None:
                return
            if node.abort_asked:
                self.complain("port", f"the rover does not know {command}: taken as stopped")
                self.mailbox.post(Acknowledgement(0, command))
                return
            tries = self._asked_again.get(command, 0)
            self._asked_again[command] = tries + 1
            if tries < self.settings.resend_limit:
                self.complain("port", f"the rover does not know {command}: sent again")
                self._inbox.send(command_of(node))
            elif tries == self.settings.resend_limit:
                self.mailbox.post(Result(0, command, success=False, reason="the rover does not know it"))

    def _watch_plans(self) -> None:
        """Plan watcher thread: post plans that appear in the folder."""
        seen: set[tuple[str, int]] = set()
        while not self._stopping.wait(self.settings.watch_s):
            self.check_plans(seen)

    def check_plans(self, seen: set[tuple[str, int]]) -> None:
        """Post each plan of the folder that was not seen before, in order of name."""
        folder = self.plan_folder
        if folder is None or not folder.is_dir():
            return
        for path in sorted(folder.glob("*.crl")):
            try:
                mark = (path.name, path.stat().st_mtime_ns)
                if mark in seen:
                    continue
                seen.add(mark)
                text = path.read_text(encoding="utf-8")
            except (OSError, UnicodeDecodeError) as error:
                self.complain("plan-watcher", f"{path.name} cannot be read: {error}")
                continue
            self.replace(text)


def safe_plan(plan_text: str) -> str | None:
    """Return a plan that consists of the alternate `safe` of a plan, or None if it has none."""
    plan = parse(plan_text)
    for alternate in plan.library:
        if alternate.id == SAFE_ALTERNATE:
            return canonical_text(
                Plan(id=plan.id, node=alternate.node, resources=plan.resources, epoch=plan.epoch)
            )
    return None


def stop_on_signals(runtime: LiveRuntime, *numbers: int) -> None:
    """Let signals (SIGINT, SIGTERM, ...) stop the plan; a second one ends the process as usual."""
    import signal

    def handle(number: int, _frame: object) -> None:
        signal.signal(number, signal.SIG_DFL)
        runtime.stop()

    for number in numbers or (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, handle)
