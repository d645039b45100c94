"""Random plans in random worlds: nothing overlooked, nothing left open, nothing done twice, replay equal."""

from __future__ import annotations

import json
import random
from collections import defaultdict
from collections.abc import Sequence

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)

from executive.crl import CrlValidationError, Plan
from executive.engine.spec import Kind, PlanSpec
from executive.ports import (
    Acknowledgement,
    Command,
    CommandId,
    CommandState,
    CommandStatus,
    Event,
    Operation,
    Operator,
    Result,
    TraceRecord,
    Update,
)
from executive.runtime.codec import trace_line
from executive.runtime.journal import MemoryJournal
from executive.runtime.loading import load_plan, load_replacement
from executive.runtime.recovery import recorded_trace, recover_session, replay
from executive.runtime.scripted_rover import ScriptedRover
from executive.runtime.session import Session
from tests.executive.invariants import check_commands, check_resources, check_trace
from tests.executive.naive import NaiveEngine
from tests.executive.worlds import Case, Maker, random_case
from tests.strategies import plans

HORIZON_MS = 150_000


def valid_plan(case: Case) -> PlanSpec | None:
    try:
        return load_plan(case.plan)
    except CrlValidationError:
        return None


def run_fast(case: Case, plan: PlanSpec) -> tuple[Session, MemoryJournal, ScriptedRover]:
    rover = ScriptedRover(case.initial, case.actions, case.script)
    journal = MemoryJournal()
    session = Session(plan, rover, journal=journal)
    steps = 0
    while session.now_ms <= HORIZON_MS and session.step_once():
        check_resources(session.engine)
        steps += 1
        assert steps < 20_000, "the run does not come to an end"
    return session, journal, rover


def run_naive(case: Case, plan: PlanSpec) -> Session:
    rover = ScriptedRover(case.initial, case.actions, case.script)
    session = Session(plan, rover)
    session.engine = NaiveEngine(plan, loader=load_replacement)
    for tick in range(HORIZON_MS // 500 + 1):
        session.step(tick * 500)
        if session.over:
            break
    return session


def by_time(trace: Sequence[TraceRecord]) -> dict[int, list[tuple[str, ...]]]:
    table: dict[int, list[tuple[str, ...]]] = defaultdict(list)
    for record in trace:
        if record.t_ms <= HORIZON_MS:
            table[record.t_ms].append((record.event, *record.arguments))
    return {t: sorted(events) for t, events in table.items()}


def check_seed(seed: int, size: int) -> bool:
    case = random_case(seed, size=size)
    plan = valid_plan(case)
    if plan is None:
        return False
    session, journal, rover = run_fast(case, plan)
    check_trace(plan, session.trace, over=session.over)
    check_commands(rover.sent)
    assert by_time(session.trace) == by_time(run_naive(case, plan).trace)
    again = replay(journal.records, plan)
    assert [json.dumps(trace_line(r)) for r in again] == [json.dumps(trace_line(r)) for r in session.trace]
    assert recorded_trace(journal.records) == session.trace
    return True


def test_engine_agrees_with_one_that_looks_at_everything() -> None:
    valid = sum(check_seed(seed, 14) for seed in range(300))
    assert valid >= 150


@pytest.mark.slow
def test_engine_agrees_with_one_that_looks_at_everything_in_many_worlds() -> None:
    assert sum(check_seed(seed, 8 + seed % 30) for seed in range(1_000, 5_000)) >= 1_500


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(seed=st.integers(0, 10**9), crash_at=st.integers(0, 60), away=st.integers(0, 20))
def test_a_run_that_crashed_obeys_the_same_rules(seed: int, crash_at: int, away: int) -> None:
    case = random_case(seed, size=10)
    plan = valid_plan(case)
    if plan is None:
        return
    rover = ScriptedRover(case.initial, case.actions, case.script)
    journal = MemoryJournal()
    session = Session(plan, rover, journal=journal)
    session.step(crash_at * 500)
    if not session.over:
        rover.wait_until(crash_at * 500 + away * 500)
        session = recover_session(plan, rover, journal, now_ms=rover.t_ms)
    while session.now_ms <= HORIZON_MS and session.step_once():
        check_resources(session.engine)
    check_trace(plan, session.trace, over=session.over)
    check_commands(rover.sent)
    assert replay(journal.records, plan) == recorded_trace(journal.records) == session.trace


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(plan=plans(), seed=st.integers(0, 10**6))
def test_any_valid_plan_runs_and_agrees_with_the_one_that_looks_at_everything(plan: Plan, seed: int) -> None:
    maker = Maker(random.Random(seed))
    compiled = load_plan(plan)
    tasks = [node.id for tree in compiled.trees() for node in tree.walk() if node.kind is Kind.TASK]
    case = Case("", maker.values(), {task: (maker.behaviour(), maker.behaviour()) for task in tasks}, ())
    session, journal, rover = run_fast(case, compiled)
    check_trace(compiled, session.trace, over=session.over)
    check_commands(rover.sent)
    assert replay(journal.records) == session.trace
    naive = Session(compiled, ScriptedRover(case.initial, case.actions))
    naive.engine = NaiveEngine(compiled)
    while naive.now_ms <= HORIZON_MS and naive.step_once():
        pass
    assert by_time(session.trace) == by_time(naive.trace)


class ManualRover:
    """A rover that answers when it is told to, and what it is told to."""

    def __init__(self) -> None:
        self.sent: list[Command] = []
        self.running: list[CommandId] = []
        self.stopping: list[CommandId] = []
        self.over: list[CommandId] = []
        self.events: list[Event] = []

    def send(self, command: Command) -> None:
        self.sent.append(command)
        self.running.append(command.id)

    def abort(self, command: CommandId) -> None:
        if command in self.stopping:
            return  # asked again after a restart
        assert command in self.running, f"abort of {command}, which is not running"
        self.running.remove(command)
        self.stopping.append(command)

    def status(self, command: CommandId) -> CommandStatus:
        return CommandStatus(CommandState.RUNNING)

    def next_event(self, until_ms: int | None) -> Event | None:
        if self.events and (until_ms is None or self.events[0].t_ms <= until_ms):
            return self.events.pop(0)
        return None


class ExecutiveMachine(RuleBasedStateMachine):
    """An adversary plays rover and operator; whatever it does, the rules hold."""

    def __init__(self) -> None:
        super().__init__()
        self.ready = False

    @initialize(seed=st.integers(0, 10**6), size=st.integers(1, 25))
    def begin(self, seed: int, size: int) -> None:
        plan = valid_plan(random_case(seed, size=size))
        if plan is None:
            plan = load_plan("(block :id root :node-list ((task :id a :action x) (task :id b :action y)))")
        self.plan = plan
        self.rover = ManualRover()
        self.left_alone: set[CommandId] = set()
        """Commands of tasks with `:on-resume :fail`: after a restart nobody waits for them."""
        self.journal = MemoryJournal()
        self.session = Session(self.plan, self.rover, journal=self.journal)
        self.session.start()
        self.ready = True

    def hand_over(self, event: Event) -> None:
        self.rover.events.append(event)
        self.session.step(self.session.now_ms)

    @precondition(lambda self: self.ready and self.rover.running)
    @rule(data=st.data(), success=st.booleans(), twice=st.booleans())
    def an_action_returns(self, data: st.DataObject, success: bool, twice: bool) -> None:
        command = data.draw(st.sampled_from(self.rover.running))
        self.rover.running.remove(command)
        self.rover.over.append(command)
        self.hand_over(Result(self.session.now_ms, command, success))
        if twice:
            self.hand_over(Result(self.session.now_ms, command, not success))

    @precondition(lambda self: self.ready and self.rover.stopping)
    @rule(data=st.data(), too_late=st.booleans())
    def an_abort_is_answered(self, data: st.DataObject, too_late: bool) -> None:
        command = data.draw(st.sampled_from(self.rover.stopping))
        self.rover.stopping.remove(command)
        now = self.session.now_ms
        self.hand_over(Result(now, command, success=True) if too_late else Acknowledgement(now, command))

    @precondition(lambda self: self.ready)
    @rule(
        key=st.sampled_from(["k0", "k1", "k2", "battery", "time", "outcome t1"]),
        value=st.one_of(st.integers(0, 60), st.booleans(), st.text(max_size=3), st.floats()),
    )
    def a_value_comes(self, key: str, value: float | str | bool) -> None:
        self.hand_over(Update(self.session.now_ms, {key: value}))

    @precondition(lambda self: self.ready)
    @rule(task=st.text(max_size=3), attempt=st.integers(-1, 3))
    def an_unknown_command_is_answered(self, task: str, attempt: int) -> None:
        self.hand_over(Result(self.session.now_ms, CommandId("elsewhere", task, attempt), success=True))

    @precondition(lambda self: self.ready)
    @rule(
        operation=st.sampled_from(
            [Operation.PAUSE, Operation.RESUME, Operation.RESUME, Operation.ABORT, Operation.REPLACE]
        ),
        seed=st.integers(0, 500),
    )
    def the_operator_speaks(self, operation: Operation, seed: int) -> None:
        text = random_case(seed, size=6).plan if operation is Operation.REPLACE else None
        if operation is Operation.ABORT and seed % 5:
            return
        self.hand_over(Operator(self.session.now_ms, operation, text))

    @precondition(lambda self: self.ready)
    @rule(by_ms=st.integers(1, 30_000))
    def time_passes(self, by_ms: int) -> None:
        self.session.step(self.session.now_ms + by_ms)

    @precondition(lambda self: self.ready)
    @rule()
    def the_process_dies_and_comes_back(self) -> None:
        session = recover_session(self.plan, self.rover, self.journal, now_ms=self.session.now_ms)
        assert session.trace[: len(self.session.trace)] == self.session.trace
        self.left_alone |= set(self.session.engine.run.commands) - set(session.engine.run.commands)
        self.session = session

    @invariant()
    def rules_hold(self) -> None:
        if not self.ready:
            return
        check_resources(self.session.engine)
        check_commands(self.rover.sent)
        check_trace(self.session.engine.run.plan, [], over=False)
        picture = self.session.snapshot()
        assert picture["t"] == self.session.now_ms

    def teardown(self) -> None:
        if not self.ready:
            return
        assert replay(self.journal.records, self.plan) == self.session.trace
        assert recorded_trace(self.journal.records) == self.session.trace
        starts: dict[str, int] = defaultdict(int)
        for record in self.session.trace:
            if record.event == "start":
                starts[record.arguments[0]] += 1
            elif record.event == "end" and starts[record.arguments[0]]:
                starts[record.arguments[0]] -= 1
        if self.session.over:
            assert not any(starts.values()), starts
            assert set(self.rover.running) <= self.left_alone


def test_an_adversary_cannot_break_the_rules() -> None:
    run_state_machine_as_test(  # type: ignore[no-untyped-call]
        ExecutiveMachine,
        settings=settings(max_examples=40, stateful_step_count=40, deadline=None),
    )


@pytest.mark.slow
def test_an_adversary_cannot_break_the_rules_in_long_runs() -> None:
    run_state_machine_as_test(  # type: ignore[no-untyped-call]
        ExecutiveMachine,
        settings=settings(max_examples=250, stateful_step_count=100, deadline=None),
    )
