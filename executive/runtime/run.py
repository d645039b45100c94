"""Run a plan to its end in one call, on the virtual clock of its rover."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from executive.crl import Plan
from executive.engine.spec import PlanSpec
from executive.ports import Operator, Rover, TraceListener, UtilitySource
from executive.runtime.journal import FileJournal, Sink
from executive.runtime.session import RunOutcome, Session


def run_plan(
    plan: str | Plan | PlanSpec,
    rover: Rover,
    *,
    run_id: str = "run",
    journal: Path | Sink | None = None,
    listeners: Sequence[TraceListener] = (),
    utility_source: UtilitySource | None = None,
    operator_events: Iterable[Operator] = (),
    start_ms: int = 0,
    sync: bool = True,
) -> RunOutcome:
    """Run a plan to its end on the virtual clock of a simulated rover; never sleeps.

    Parameters
    ----------
    plan
        CRL text (validated), a plan, or one compiled by `loading.load_plan` (to run it often).
    journal
        Path of a new journal file, or any sink; None keeps no journal.
    sync
        Whether a journal file is made durable (fsync) at each macro step that lets something out.

    Raises
    ------
    CrlValidationError
        If the plan is rejected.
    JournalError
        If the journal cannot be written; no effect has left the executive that is not in it.
    """
    sink = FileJournal.create(journal, sync=sync) if isinstance(journal, Path) else journal
    try:
        session = Session(
            plan,
            rover,
            run_id=run_id,
            journal=sink,
            listeners=listeners,
            utility_source=utility_source,
            operator_events=operator_events,
            start_ms=start_ms,
        )
        return session.run()
    finally:
        if isinstance(journal, Path) and sink is not None:
            sink.close()
