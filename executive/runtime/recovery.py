"""Replay, time travel and restart from a journal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from executive.engine.core import Engine
from executive.engine.instance import Effect, UtilityUsed
from executive.engine.snapshot import snapshot
from executive.engine.spec import PlanSpec
from executive.errors import JournalError
from executive.ports import (
    Rover,
    TraceListener,
    TraceRecord,
    UtilitySource,
    Value,
)
from executive.runtime.codec import effect_from_json, event_from_json
from executive.runtime.journal import (
    FileJournal,
    JournalFile,
    MemoryJournal,
    Record,
    Sink,
    last_number,
    macro_steps,
    require,
)
from executive.runtime.loading import load_plan, load_replacement
from executive.runtime.session import Session


class RecordedUtilities:
    """The utilities that a run used, in order: replay asks them instead of the source of that time."""

    def __init__(self, records: Sequence[Record]) -> None:
        self._values: dict[tuple[str, int], list[float]] = {}
        for used in (effect_from_json(record) for record in records if record["k"] == "utility"):
            if isinstance(used, UtilityUsed):
                self._values.setdefault((used.option, used.t_ms), []).append(used.value)
        for values in self._values.values():
            values.reverse()

    def __call__(self, option: str, t_ms: int, _database: Mapping[str, Value]) -> float | None:
        values = self._values.get((option, t_ms))
        return values.pop() if values else None


def apply_input(engine: Engine, record: Record) -> list[Effect]:
    """Let an input record of a journal happen again; return its effects."""
    t_ms = require(record, "t", int)
    match record["k"]:
        case "step":
            events = [event_from_json(e) for e in require(record, "events", list)]
            return engine.step(t_ms, events)
        case "deadline":
            return engine.deadline(t_ms) or []
        case "restart":
            return engine.restart(t_ms)
        case other:
            raise JournalError(f"record {record.get('n')} of kind {other!r} is not an input")


def rebuild(
    records: Sequence[Record], plan: PlanSpec | None = None, *, upto: int | None = None
) -> tuple[Engine, list[Effect], list[Effect]]:
    """Run the inputs of a journal again.

    Returns
    -------
    tuple
        The engine; all effects; and those of the last macro step that the journal does not hold yet (the
        process died while it was being written).
    """
    header = records[0]
    compiled = plan if plan is not None else load_plan(require(header, "plan", str), trusted=True)
    engine = Engine(
        compiled,
        run_id=require(header, "run", str),
        loader=load_replacement,
        utilities=RecordedUtilities(records),
        risks=require(header, "risks", bool),
    )
    engine.move_to(require(header, "start", int))
    effects: list[Effect] = []
    missing: list[Effect] = []
    for record, written in macro_steps(records[1:]):
        if upto is not None and require(record, "n", int) > upto:
            break
        fresh = apply_input(engine, record)
        effects += fresh
        held = sum(r["k"] != "end" and not is_complaint(r) for r in written)
        missing = fresh[held:]
    return engine, effects, missing


ENGINE_NOTES = ("risk", "ignored", "unasked", "rejected")


def is_complaint(record: Record) -> bool:
    """Tell whether a note was not written by the engine but by what stands around it."""
    return bool(record["k"] == "note" and record["kind"] not in ENGINE_NOTES)


def replay(records: Sequence[Record], plan: PlanSpec | None = None) -> list[TraceRecord]:
    """Return the trace that the inputs of a journal give."""
    _, effects, _ = rebuild(records, plan)
    return [effect for effect in effects if isinstance(effect, TraceRecord)]


def recorded_trace(records: Sequence[Record]) -> list[TraceRecord]:
    """Return the trace that a journal holds."""
    effects = (effect_from_json(record) for record in records if record["k"] == "trace")
    return [effect for effect in effects if isinstance(effect, TraceRecord)]


def state_at(records: Sequence[Record], seq: int, plan: PlanSpec | None = None) -> dict[str, object]:
    """Return the picture of the run after the macro step to which record `seq` belongs.

    Raises
    ------
    JournalError
        If there is no such record.
    """
    if not 0 <= seq < len(records):
        raise JournalError(f"the journal has records 0 to {len(records) - 1}, there is none of number {seq}")
    engine, effects, _ = rebuild(records, plan, upto=seq)
    trace = sum(isinstance(e, TraceRecord) for e in effects)
    picture = snapshot(engine.run, sequence=trace)
    picture["record"] = seq
    return picture


def resume_session(
    records: Sequence[Record],
    rover: Rover,
    sink: Sink,
    *,
    now_ms: int,
    plan: PlanSpec | None = None,
    listeners: Sequence[TraceListener] = (),
    utility_source: UtilitySource | None = None,
) -> Session:
    """Return the session that goes on from a journal, after its first macro step (CRL.md 10)."""
    engine, _, unwritten = rebuild(records, plan)
    engine.run.utilities = utility_source
    session = Session.resumed(
        engine,
        rover,
        journal=sink,
        listeners=listeners,
        trace=recorded_trace(records),
        plan_text=require(records[0], "plan", str),
        received=last_number(records),
    )
    session.come_back(max(now_ms, engine.t), unwritten)
    return session


def recover_session(
    plan: PlanSpec | None,
    rover: Rover,
    journal: MemoryJournal,
    *,
    now_ms: int,
    listeners: Sequence[TraceListener] = (),
    utility_source: UtilitySource | None = None,
) -> Session:
    """Go on from a journal in memory, as after a crash."""
    return resume_session(
        list(journal.records),
        rover,
        journal,
        now_ms=now_ms,
        plan=plan,
        listeners=listeners,
        utility_source=utility_source,
    )


def recover_run(
    journal: Path,
    rover: Rover,
    *,
    now_ms: int,
    run_id: str | None = None,
    plan_digest: str | None = None,
    listeners: Sequence[TraceListener] = (),
    utility_source: UtilitySource | None = None,
    sync: bool = True,
) -> tuple[Session, FileJournal]:
    """Go on with the run of a journal file whose process died; the caller closes the journal.

    Raises
    ------
    JournalError
        If the file is not a journal, is damaged before its last line, or belongs to another run or plan.
    """
    file = JournalFile(journal)
    file.check_identity(run_id=run_id, plan_digest=plan_digest)
    file.cut_torn_tail()
    sink = FileJournal(journal, number=len(file.records), sync=sync)
    session = resume_session(
        file.records, rover, sink, now_ms=now_ms, listeners=listeners, utility_source=utility_source
    )
    return session, sink
