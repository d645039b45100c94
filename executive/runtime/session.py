"""A run driven step by step on the virtual clock of its rover."""

from __future__ import annotations

import heapq
import logging
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from executive.crl import Plan
from executive.engine.core import Engine
from executive.engine.instance import Abort, Effect, Note
from executive.engine.run import command_of
from executive.engine.snapshot import snapshot
from executive.engine.spec import PlanSpec
from executive.errors import MisuseError
from executive.ports import (
    Acknowledgement,
    Command,
    CommandId,
    CommandState,
    Event,
    Operation,
    Operator,
    Product,
    Receipts,
    Rover,
    TraceListener,
    TraceRecord,
    UtilitySource,
)
from executive.runtime.codec import Entry, Input, event_to_json
from executive.runtime.journal import MemoryJournal, PlanTime, Sink, header_record
from executive.runtime.loading import load_plan, load_replacement
from executive.runtime.sanitize import sanitized

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class RunOutcome:
    """What came of a run.

    Attributes
    ----------
    outcome, end_ms
        Of the last root (CRL.md 4.8), and when it ended; None if the plan stayed unfinished.
    trace
        Every event of the trace, in order.
    outcomes
        Outcome of every node of the plan; None for a node that did not finish.
    reward, utility
        Sum of the rewards of tasks that succeeded, and that minus the penalty for overrun (CRL.md 6.4).
    exceeded
        Budgets that the run went over; the penalty for overrun is due with the first.
    """

    run_id: str
    plan_digest: str
    outcome: str | None
    end_ms: int | None
    trace: tuple[TraceRecord, ...]
    outcomes: dict[str, str | None]
    reward: float
    utility: float
    exceeded: tuple[str, ...]
    products: tuple[Product, ...] = ()
    notes: tuple[Note, ...] = ()
    reason: str = ""

    @property
    def over_budget(self) -> bool:
        return bool(self.exceeded)

    @property
    def end_s(self) -> float | None:
        return None if self.end_ms is None else self.end_ms / 1000


@dataclass(order=True, slots=True)
class _Injected:
    t_ms: int
    serial: int
    event: Event = field(compare=False)


class Session:
    """One run on a virtual clock: nothing moves but by `step` and `run`; single-threaded, never sleeps.

    Parameters
    ----------
    plan
        Text, plan or compiled plan. A text is validated.
    rover
        Carries out commands and advances the clock by its events.
    journal
        Where the records go; None keeps none.
    listeners
        Called with each trace record once it is durable.
    """

    def __init__(
        self,
        plan: str | Plan | PlanSpec,
        rover: Rover,
        *,
        run_id: str = "run",
        journal: Sink | None = None,
        listeners: Sequence[TraceListener] = (),
        utility_source: UtilitySource | None = None,
        operator_events: Iterable[Operator] = (),
        start_ms: int = 0,
        risks: bool | None = None,
        time: PlanTime | None = None,
    ) -> None:
        compiled = plan if isinstance(plan, PlanSpec) else load_plan(plan)
        self.risks = journal is not None if risks is None else risks
        self.engine = Engine(
            compiled, run_id=run_id, loader=load_replacement, utilities=utility_source, risks=self.risks
        )
        self.engine.move_to(start_ms)
        self.rover = rover
        self.run_id = run_id
        self.start_ms = start_ms
        self.time = time if time is not None else PlanTime(instant=compiled.epoch)
        self.journal = journal
        self.listeners = list(listeners)
        self.received = 0
        """Highest number of the rover's stream that was taken."""
        self.trace: list[TraceRecord] = []
        self.notes: list[Note] = []
        self.products: list[Product] = []
        self.macro_steps = 0
        self.plan_text = plan if isinstance(plan, str) else compiled.text
        self._injected: list[_Injected] = []
        self._serial = 0
        self._started = False
        self._ended = False
        self._opened = False
        self._stamp = start_ms
        for event in operator_events:
            self.inject(event)

    @classmethod
    def resumed(
        cls,
        engine: Engine,
        rover: Rover,
        *,
        journal: Sink | None,
        listeners: Sequence[TraceListener] = (),
        trace: Sequence[TraceRecord] = (),
        plan_text: str = "",
        received: int = 0,
    ) -> Session:
        """Return the session of a run that is under way: its engine was rebuilt from a journal."""
        session = cls(engine.run.plan, rover, run_id=engine.run.run_id, journal=journal, listeners=listeners)
        session.engine = engine
        session.plan_text = plan_text
        session.trace = list(trace)
        session.received = received
        session._started = True
        session._ended = engine.over
        return session

    # --- driving ----------------------------------------------------------------

    @property
    def started(self) -> bool:
        return self._started

    @property
    def over(self) -> bool:
        """The plan is over."""
        return self.engine.over

    @property
    def now_ms(self) -> int:
        """The plan clock."""
        return self.engine.t

    def start(self) -> None:
        """Take the first macro step: the initial state of the rover and the activation of the root."""
        if self._started:
            raise MisuseError(f"run {self.run_id} was started already")
        self.open_journal()
        self._started = True
        self._macro_step(self.start_ms, self._collect(self.start_ms))

    def open_journal(self) -> None:
        """Write the header of the journal."""
        if self.journal is not None and not self._opened:
            self._opened = True
            self._append(
                [
                    header_record(
                        run_id=self.run_id,
                        plan_text=self.plan_text,
                        plan_digest=self.engine.run.plan.digest,
                        start_ms=self.start_ms,
                        risks=self.risks,
                        time=self.time,
                    )
                ],
                durable=True,
            )

    def run(self) -> RunOutcome:
        """Drive the plan to its end, or until nothing can happen any more; return what came of it."""
        if not self._started:
            self.start()
        self.step(None)
        return self.result()

    def step(self, until_ms: int | None) -> None:
        """Let everything happen up to and including `until_ms`; None = to the end."""
        if not self._started:
            self.start()
        while not self.engine.over and self._next(until_ms):
            pass
        if self.engine.over:
            self._end()
        elif until_ms is not None:
            self.engine.move_to(until_ms)

    def step_once(self) -> bool:
        """Take the next macro step, whenever it comes; tell whether there was one."""
        if not self._started:
            self.start()
            return True
        if self.over or not self._next(None):
            return False
        if self.engine.over:
            self._end()
        return True

    def pause(self) -> None:
        """Operator command `pause`, at the present time."""
        self.inject(Operator(self.now_ms, Operation.PAUSE))

    def resume(self) -> None:
        """Operator command `resume-plan`, at the present time."""
        self.inject(Operator(self.now_ms, Operation.RESUME))

    def abort(self) -> None:
        """Operator command `abort`, at the present time."""
        self.inject(Operator(self.now_ms, Operation.ABORT))

    def replace(self, plan_text: str) -> None:
        """Operator command `replace`, at the present time."""
        self.inject(Operator(self.now_ms, Operation.REPLACE, plan_text))

    def inject(self, event: Event) -> None:
        """Add an event that does not come from the rover; one of the past counts as one of now."""
        self._serial += 1
        heapq.heappush(self._injected, _Injected(max(event.t_ms, self.engine.t), self._serial, event))

    def add_notes(self, notes: Sequence[Note]) -> None:
        """Write notes that do not come from the engine."""
        self.notes += notes
        if self.journal is not None:
            self._append(notes, durable=False)

    def snapshot(self) -> dict[str, object]:
        """Return the node tree, windows, watched conditions, pending events and resource levels."""
        pending = [event_to_json(entry.event) for entry in sorted(self._injected)]
        return snapshot(self.engine.run, pending_events=pending, sequence=len(self.trace))

    def events_since(self, sequence: int) -> list[tuple[int, TraceRecord]]:
        """Return the trace records after the first `sequence` ones, each with its number, counted from 1.

        A viewer that reconnects asks with the last number it has seen and misses nothing.
        """
        return list(enumerate(self.trace[max(0, sequence) :], max(0, sequence) + 1))

    def result(self) -> RunOutcome:
        """Return what has come of the run so far."""
        engine = self.engine
        return RunOutcome(
            run_id=self.run_id,
            plan_digest=engine.run.plan.digest,
            outcome=engine.run.outcome.value if engine.run.outcome is not None else None,
            end_ms=engine.run.end_ms if engine.over else None,
            trace=tuple(self.trace),
            outcomes=engine.outcomes(),
            reward=engine.run.reward,
            utility=engine.utility(),
            exceeded=engine.exceeded_budgets(),
            products=tuple(self.products),
            notes=tuple(self.notes),
            reason=engine.run.root.reason if engine.over else "",
        )

    def come_back(self, now_ms: int, unwritten: Sequence[Effect] = ()) -> None:
        """Go on after a crash: `restart`, then the missed events, then what the rover says of open commands.

        `unwritten` are effects of the last macro step that the journal does not hold yet.
        """
        engine = self.engine
        if self.journal is not None and unwritten:
            self._append(unwritten, durable=False)
        for effect in unwritten:
            if isinstance(effect, TraceRecord):
                self.trace.append(effect)
                self._tell(effect)
        if engine.over:
            self._end()
            return
        unknown: list[CommandId] = []
        for command in list(engine.run.commands):
            status = self.rover.status(command)
            if status.state is CommandState.UNKNOWN:
                unknown.append(command)
            elif status.state is CommandState.DONE and status.result is not None:
                self.inject(status.result._replace(t_ms=now_ms, number=0))
        effects = engine.restart(now_ms)
        aborted = {effect.command for effect in effects if isinstance(effect, Abort)}
        open_aborts = [c for c, node in engine.run.commands.items() if node.abort_asked and c not in aborted]
        self._handle(Input("restart", engine.t), [e for e in effects if e_is_not_for(e, unknown)], True)
        for command in open_aborts:
            if command not in unknown:
                self.rover.abort(command)
        for command in unknown:
            node = engine.run.commands.get(command)
            if node is None:
                continue
            if node.abort_asked:
                self.inject(Acknowledgement(engine.t, command))
            else:
                self.rover.send(command_of(node))
        events = self._collect(engine.t)
        self._macro_step(engine.t, events)

    # --- inside -----------------------------------------------------------------

    def _next(self, until_ms: int | None) -> bool:
        """Do the next thing that is due up to `until_ms`; tell whether there was one."""
        engine = self.engine
        now = engine.agenda.now
        if engine.agenda.deadline_due():
            events = self._collect(engine.t)
            if events:
                self._macro_step(engine.t, events)
                return True
            effects = engine.deadline(engine.t)
            if effects is not None:
                self._handle(Input("deadline", engine.t), effects)
                return True
        wake = engine.next_wakeup()
        limit = wake if until_ms is None else until_ms if wake is None else min(wake, until_ms)
        events = self._collect(limit if limit is None or limit > now else now)
        if events:
            self._macro_step(max(now, self._stamp), events)
            return True
        if wake is not None and (until_ms is None or wake <= until_ms):
            self._macro_step(max(now, wake), [])
            return True
        return False

    def _collect(self, until_ms: int | None) -> list[Event]:
        """Return all events of the next time stamp up to `until_ms`, and keep the stamp."""
        injected = self._injected
        limit = until_ms
        if injected and (limit is None or injected[0].t_ms < limit):
            limit = injected[0].t_ms
        events: list[Event] = []
        event = self.rover.next_event(limit)
        if event is not None:
            self._stamp = stamp_of(event, self.engine.t)
            while event is not None:
                events.append(event)
                event = self.rover.next_event(self._stamp)
        elif injected and limit == injected[0].t_ms:
            self._stamp = injected[0].t_ms
        else:
            return events
        while injected and injected[0].t_ms <= self._stamp:
            events.append(heapq.heappop(injected).event)
        return events

    def _macro_step(self, t_ms: int, events: Sequence[Event]) -> None:
        before = self.received
        clean, complaints = sanitized(self._unseen(events) if before else events, self.engine.t)
        effects = self.engine.step(t_ms, clean)
        self.macro_steps += 1
        for event in clean:
            if isinstance(event, Operator):
                continue
            if event.number > self.received:
                self.received = event.number
            if isinstance(event, Product):
                self.products.append(event)
        entry = Input("step", self.engine.t, clean)
        self._handle(entry, [*complaints, *effects] if complaints else effects, bool(events))
        if self.received > before and isinstance(self.rover, Receipts):
            self.rover.commit(self.received)

    def _unseen(self, events: Sequence[Event]) -> Sequence[Event]:
        """Leave out what the rover has said before (CRL.md 10)."""
        seen = self.received
        return [e for e in events if not (number := getattr(e, "number", 0)) or number > seen]

    def _handle(self, entry: Input, effects: Sequence[Effect], durable: bool = False) -> None:
        """Make records durable, then let the effects out."""
        if self.journal is not None:
            self.journal.append([entry, *effects], durable=durable or bool(effects))
        for effect in effects:
            if isinstance(effect, Command):
                self.rover.send(effect)
            elif isinstance(effect, TraceRecord):
                self.trace.append(effect)
                if self.listeners:
                    self._tell(effect)
            elif isinstance(effect, Abort):
                self.rover.abort(effect.command)
            elif isinstance(effect, Note):
                self.notes.append(effect)

    def _tell(self, record: TraceRecord) -> None:
        for listener in self.listeners:
            listener(record)

    def _append(self, records: Sequence[Entry], *, durable: bool) -> None:
        assert self.journal is not None
        self.journal.append(records, durable=durable)

    def _end(self) -> None:
        if self._ended:
            return
        self._ended = True
        engine = self.engine
        if self.journal is not None:
            self._append(
                [
                    {
                        "k": "end",
                        "t": engine.run.end_ms,
                        "outcome": engine.run.outcome.value if engine.run.outcome is not None else None,
                        "reward": engine.run.reward,
                        "utility": engine.utility(),
                    }
                ],
                durable=True,
            )


def stamp_of(event: object, now_ms: int) -> int:
    """Return the time stamp of what a rover gave; what has none counts as of now."""
    t_ms = getattr(event, "t_ms", None)
    return t_ms if isinstance(t_ms, int) and not isinstance(t_ms, bool) else now_ms


def e_is_not_for(effect: Effect, commands: Sequence[CommandId]) -> bool:
    """Tell whether an effect does not ask the rover to stop something it has never heard of."""
    return not (isinstance(effect, Abort) and effect.command in commands)


__all__ = ["MemoryJournal", "RunOutcome", "Session"]
