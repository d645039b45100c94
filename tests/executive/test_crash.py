"""The process of the executive is killed after every journal record in turn; the rover lives on."""

from __future__ import annotations

import signal
from collections import defaultdict
from pathlib import Path

import pytest

from executive.ports import Event, TraceRecord, Update
from executive.runtime import run_plan
from executive.runtime.journal import JournalFile, MemoryJournal, Sink
from executive.runtime.loading import load_plan
from executive.runtime.recovery import recorded_trace, replay, resume_session
from executive.runtime.scripted_rover import Behaviour, ScriptedRover
from executive.runtime.session import Session
from tests.executive.crash_rover import RemoteRover, execute, nursery, start_rover

SHORT_PLAN = """
(plan :id short :node
 (block :id root :node-list
  ((task :id a :action image :retries 1)
   (branch :id br :options
     ((option :id go :utility 2 :node (task :id b :action drive))
      (option :id stay :utility 1 :node (task :id c :action image)))))))
"""

DAY_PLAN = """
(plan :id day
 :floating ((floating-contingency :id low :trigger-conditions ((database (:soc < 25)))
             :max-insertions 2 :node (task :id charge :action recharge)))
 :node
 (block :id root :node-list
  ((concurrent-block :id morning :node-list
     ((task :id warm :action heat)
      (block :id drive :node-list
        ((task :id d1 :action navigate :retries 2 :retry-delay 60)
         (task :id d2 :action navigate)))
      (task :id pan :action image :start-temporal-conditions ((warm end (100 9000))))))
   (branch :id br1 :on-option-failure :next :options
     ((option :id place :utility 9 :node (task :id pl :action place :duration (0 3600)))
      (option :id look :utility 3 :node (task :id lk :action image))))
   (task :id d3 :action navigate)
   (concurrent-block :id noon :continue-on-failure t :node-list
     ((task :id spec :action spectrum)
      (task :id bad :action image :continue-on-failure t)))
   (branch :id br2 :if-none :skip :options
     ((option :id extra :utility 1 :eligible-conditions ((database (:novelty > 0.5)))
       :node (task :id ex :action image))))
   (task :id d4 :action navigate)
   (task :id rep :action downlink))))
"""

DAY_ACTIONS = {
    "*": (Behaviour(900_000),),
    "d1": (Behaviour(600_000, success=False), Behaviour(1_200_000)),
    "d2": (Behaviour(800_000, updates={"soc": 20}),),
    "charge": (Behaviour(2_000_000, updates={"soc": 90}),),
    "pl": (Behaviour(7_200_000, abort_delay_ms=30_000),),
    "bad": (Behaviour(100_000, success=False),),
}
DAY_SCRIPT: tuple[Event, ...] = (Update(5_000_000, {"novelty": 0.7}),)


class Killed(BaseException):
    """The process is gone."""


class FragileJournal(MemoryJournal):
    """A journal in memory whose process dies after a given number of records."""

    def __init__(self, kill_at: int) -> None:
        super().__init__()
        self.kill_at = kill_at

    def append(self, records: list[dict[str, object]], *, durable: bool) -> None:  # type: ignore[override]
        for record in records:
            super().append([record], durable=durable)
            if len(self.records) == self.kill_at:
                raise Killed


class ReliableRover(ScriptedRover):
    """A rover that hands events out again when they were fetched by an executive that died with them."""

    def __init__(self) -> None:
        super().__init__({"soc": 80}, DAY_ACTIONS, DAY_SCRIPT)
        self.fetched: list[Event] = []
        self.again: list[Event] = []

    def next_event(self, until_ms: int | None) -> Event | None:
        if self.again and (until_ms is None or self.again[0].t_ms <= until_ms):
            event: Event | None = self.again.pop(0)
        else:
            event = super().next_event(until_ms)
        if event is not None:
            self.fetched.append(event)
        return event

    def commit(self) -> None:
        self.fetched.clear()

    def executive_died(self) -> None:
        self.again = self.fetched + self.again
        self.fetched = []


class Confirming(MemoryJournal):
    """Tells the rover when what was fetched from it is safe."""

    def __init__(self, inner: Sink, rover: ReliableRover) -> None:
        super().__init__()
        self.inner = inner
        self.rover = rover

    def append(self, records: list[dict[str, object]], *, durable: bool) -> None:  # type: ignore[override]
        self.inner.append(records, durable=durable)
        self.rover.commit()


def per_node(trace: list[TraceRecord]) -> dict[str, list[tuple[str, ...]]]:
    """Return the sequence of events of each node, without times and without `restart`."""
    table: dict[str, list[tuple[str, ...]]] = defaultdict(list)
    for record in trace:
        if record.event != "restart":
            table[record.arguments[0] if record.arguments else ""].append((record.event, *record.arguments))
    return dict(table)


def test_a_run_killed_after_any_record_goes_on_as_if_nothing_had_happened() -> None:
    plan = load_plan(DAY_PLAN)
    whole = ReliableRover()
    reference = run_plan(plan, whole, run_id="day", journal=MemoryJournal())
    assert reference.outcome == "SUCCEEDED"
    commands = [str(c.id) for c in whole.sent]
    records = MemoryJournal()
    run_plan(plan, ReliableRover(), run_id="day", journal=records)
    for kill_at in range(1, len(records.records)):
        rover = ReliableRover()
        journal = FragileJournal(kill_at)
        with pytest.raises(Killed):
            Session(plan, rover, run_id="day", journal=Confirming(journal, rover)).run()
        rover.executive_died()
        journal.kill_at = -1
        session = resume_session(
            list(journal.records), rover, Confirming(journal, rover), now_ms=rover.t_ms, plan=plan
        )
        session.run()
        assert per_node(session.trace) == per_node(list(reference.trace)), kill_at
        assert [str(c.id) for c in rover.sent] == commands, kill_at
        assert recorded_trace(journal.records) == session.trace
        assert replay(journal.records, plan) == session.trace


def run_with_kills(
    folder: Path, plan: str, kill_points: list[int], *, actions: dict[str, tuple[Behaviour, ...]]
) -> None:
    """Kill the executive's process once in each run, after the given number of records."""
    reference_rover = ScriptedRover({"soc": 80}, actions, DAY_SCRIPT)
    reference = run_plan(plan, reference_rover, run_id="day")
    commands = [(str(c.id), c.issue) for c in reference_rover.sent]
    for kill_at in kill_points:
        journal = folder / f"{kill_at}.journal"
        journal.with_suffix(".crl").write_text(plan)
        address = str(folder / f"{kill_at}.sock")
        process = start_rover(address, actions, DAY_SCRIPT)
        try:
            assert end_of(journal, address, kill_at) == -signal.SIGKILL, kill_at
            assert end_of(journal, address, 0) == 0, kill_at
            sent = RemoteRover(address).ask("bye")
        finally:
            process.join(timeout=10)
            process.kill()
        trace = recorded_trace(JournalFile(journal).records)
        assert any(r.event == "restart" for r in trace) or trace[-1].event == "end" or kill_at == 1
        assert per_node(trace) == per_node(list(reference.trace)), kill_at
        assert sent == commands, kill_at


def end_of(journal: Path, address: str, kill_at: int) -> int | None:
    """Return how a process ended that ran the executive on."""
    process = nursery().Process(target=execute, args=(journal, address, kill_at))
    process.start()
    process.join()
    return process.exitcode


def test_the_process_is_killed_and_the_rover_lives_on(tmp_path: Path) -> None:
    run_with_kills(tmp_path, SHORT_PLAN, [2, 7, 13], actions={"*": (Behaviour(5_000),)})


@pytest.mark.slow
def test_the_process_is_killed_after_every_record_of_a_day(tmp_path: Path) -> None:
    journal = MemoryJournal()
    run_plan(DAY_PLAN, ScriptedRover({"soc": 80}, DAY_ACTIONS, DAY_SCRIPT), run_id="day", journal=journal)
    run_with_kills(tmp_path, DAY_PLAN, list(range(1, len(journal.records))), actions=DAY_ACTIONS)
