"""A live run: safety, garbage, clocks, floods. Most tests turn the owner by hand, without threads."""

from __future__ import annotations

import errno
import socket
import threading
from datetime import UTC, datetime
from pathlib import Path

import pytest

import executive.runtime.control as control_module
import executive.runtime.wire.address as address_module
from executive.errors import JournalError
from executive.ports import (
    Acknowledgement,
    Command,
    CommandId,
    CommandState,
    CommandStatus,
    Operation,
    Operator,
    Result,
    Update,
)
from executive.runtime.clocks import MonotonicClock, SteadyClock, plan_start_ms
from executive.runtime.codec import Json
from executive.runtime.control import ControlSocket, RunControl, ask_run
from executive.runtime.journal import JournalFile
from executive.runtime.live import LiveRuntime, LiveSettings
from executive.runtime.mailbox import Mailbox
from executive.runtime.recovery import recorded_trace, replay
from executive.runtime.scripted_rover import Behaviour, ScriptedRover
from executive.runtime.wire.address import Address

TWO_TASKS = "(block :id root :node-list ((task :id a :action image) (task :id b :action drive)))"
WITH_SAFE = (
    f"(plan :id p :library ((alternate :id safe :node (task :id beacon :action call))) :node {TWO_TASKS})"
)


class HandClock:
    """A clock that a test sets."""

    def __init__(self) -> None:
        self.t_ms = 0

    def now_ms(self) -> int:
        return self.t_ms


class Port:
    """The far end of the command line, recorded."""

    def __init__(self) -> None:
        self.sent: list[Command] = []
        self.aborted: list[CommandId] = []
        self.beats: list[int] = []
        self.states: dict[CommandId, CommandStatus] = {}
        self.broken = False

    def send(self, command: Command) -> None:
        if self.broken:
            raise OSError("line is down")
        self.sent.append(command)

    def abort(self, command: CommandId) -> None:
        self.aborted.append(command)

    def status(self, command: CommandId) -> CommandStatus:
        return self.states.get(command, CommandStatus(CommandState.RUNNING))

    def heartbeat(self, t_ms: int) -> None:
        self.beats.append(t_ms)


class Bench:
    """A live run that is turned by hand."""

    def __init__(self, plan: str = TWO_TASKS, **settings: object) -> None:
        self.clock = HandClock()
        self.port = Port()
        self.run = LiveRuntime(
            plan,
            self.port,
            run_id="live",
            clock=self.clock,
            settings=LiveSettings(**settings),  # type: ignore[arg-type]
        )
        self.run.turn()

    def at(self, t_s: float) -> None:
        self.clock.t_ms = int(t_s * 1000)
        self.run.turn()

    def returns(self, task: str, t_s: float, *, success: bool = True, attempt: int = 1) -> None:
        self.run.post(Result(0, CommandId("live", task, attempt), success))
        self.at(t_s)

    @property
    def trace(self) -> list[tuple[float, str]]:
        return [(r.t_ms / 1000, " ".join((r.event, *r.arguments))) for r in self.run.session.trace]

    @property
    def notes(self) -> list[str]:
        return [note.text for note in self.run.session.notes]


def test_a_plan_runs_on_posted_events() -> None:
    bench = Bench()
    bench.returns("a", 3)
    bench.returns("b", 7.5)
    assert bench.trace[-1] == (7.5, "end root SUCCEEDED")
    assert bench.run.picture["over"]


def test_bounds_that_passed_between_two_rounds_are_taken_at_their_own_time() -> None:
    bench = Bench("(task :id a :action image :duration (0 4))")
    bench.at(9)
    bench.run.post(Acknowledgement(0, CommandId("live", "a", 1)))
    bench.at(9)
    assert bench.port.aborted == [CommandId("live", "a", 1)]
    assert bench.trace[-1] == (9, "end a FAILED end-window-missed")
    assert {s["t"] for s in [bench.run.picture]} == {9000}


def test_stop_goes_before_everything_that_waits() -> None:
    bench = Bench(mailbox_limit=100)
    for n in range(10_000):
        bench.run.post(Update(0, {"k": n}))
    bench.run.post(Result(0, CommandId("live", "a", 1), success=True))
    bench.run.stop()
    bench.at(1)
    assert [e for _, e in bench.trace if e != "abort"][-1] == "end root ABORTED operator"
    assert not any(c.id.task == "b" for c in bench.port.sent)


def test_stop_works_during_a_pause_and_twice() -> None:
    bench = Bench()
    bench.run.pause()
    bench.at(1)
    bench.run.stop()
    bench.run.stop()
    bench.at(2)
    bench.run.post(Acknowledgement(0, CommandId("live", "a", 1)))
    bench.at(3)
    assert bench.trace[-1] == (3, "end root ABORTED operator")


def test_emergency_stop_reaches_the_rover_without_the_owner() -> None:
    bench = Bench()
    bench.run.emergency_stop()
    assert bench.port.sent[-1].action == "safemode"


def test_silent_rover_is_made_safe_by_the_alternate() -> None:
    bench = Bench(WITH_SAFE, silence_ms=60_000, grace_ms=10_000)
    bench.at(59)
    assert not bench.port.aborted
    bench.at(60)
    bench.at(60)
    assert bench.port.aborted == [CommandId("live", "a", 1)]
    bench.at(71)
    bench.at(71)
    assert [c.action for c in bench.port.sent] == ["image", "call"]
    assert "no word from the rover for 60 s: the alternate 'safe' takes over" in bench.notes
    assert "live/a/1 was not acknowledged: taken as stopped" in bench.notes


def test_silent_rover_without_an_alternate_gets_safemode() -> None:
    bench = Bench(silence_ms=60_000, grace_ms=10_000)
    bench.at(60)
    bench.at(60)
    assert [c.action for c in bench.port.sent] == ["image", "safemode"]
    bench.at(71)
    bench.at(71)
    assert bench.trace[-1] == (71, "end root ABORTED operator")


def test_any_word_of_the_rover_counts_as_life() -> None:
    bench = Bench(silence_ms=60_000)
    for t in range(0, 600, 50):
        bench.run.post(Update(0, {"heartbeat": t}))
        bench.at(t)
    assert not bench.port.aborted


def test_an_operator_is_no_sign_of_life() -> None:
    bench = Bench(silence_ms=60_000)
    bench.run.post(Operator(0, Operation.RESUME))
    bench.at(50)
    bench.at(61)
    assert bench.port.sent[-1].action == "safemode"


def test_the_rover_hears_a_heartbeat() -> None:
    bench = Bench(heartbeat_ms=5_000)
    for t in range(1, 21):
        bench.at(t)
    assert bench.port.beats == [5_000, 10_000, 15_000, 20_000]


def test_garbage_is_noted_and_harms_nothing() -> None:
    bench = Bench()
    garbage: list[object] = [
        Update(0, {"k": float("nan"), "m": [1], 3: 4, "good": 1}),  # type: ignore[dict-item]
        Update(0, None),  # type: ignore[arg-type]
        Result(0, "a", success=True),  # type: ignore[arg-type]
        Result(0, CommandId("live", "nobody", 1), success=True),
        Result(0, CommandId("live", "a", 7), success=True),
        Result(0, CommandId("yesterday", "a", 1), success=True),
        Acknowledgement(0, CommandId("live", "b", 1)),
        Update(0, {"time": 1e9, "outcome a": "failed"}),
    ]
    for event in garbage:
        bench.run.post(event)  # type: ignore[arg-type]
    bench.at(1)
    database = bench.run.session.engine.run.database
    assert database["good"] == 1
    assert database["time"] == 1
    assert "k" not in database
    assert bench.run.session.engine.run.instances["a"].outcome is None
    assert len(bench.notes) >= 9
    bench.returns("a", 2)
    bench.returns("b", 3)
    assert bench.trace[-1] == (3, "end root SUCCEEDED")


def test_a_result_that_is_neither_true_nor_false_is_a_failure() -> None:
    bench = Bench()
    bench.run.post(Result(0, CommandId("live", "a", 1), success="yes"))  # type: ignore[arg-type]
    bench.at(1)
    assert (1, "end a FAILED action-failed") in bench.trace


def test_the_second_answer_to_a_command_is_ignored() -> None:
    bench = Bench()
    bench.returns("a", 1)
    bench.returns("a", 2, success=False)
    assert "result of live/a/1: no such command is running" in bench.notes
    assert bench.run.session.engine.run.instances["a"].outcome == "SUCCEEDED"


def test_a_rover_that_stops_an_action_by_itself_is_taken_at_its_word() -> None:
    bench = Bench()
    bench.run.post(Acknowledgement(0, CommandId("live", "a", 1)))
    bench.at(1)
    assert (1, "end a FAILED action-failed") in bench.trace


def test_a_lost_result_is_found_by_the_action_monitor() -> None:
    bench = Bench()
    command = CommandId("live", "a", 1)
    bench.port.states[command] = CommandStatus(CommandState.DONE, Result(4, command, success=True))
    bench.run.check_actions()
    bench.at(5)
    assert (5, "end a SUCCEEDED") in bench.trace


def test_a_command_the_rover_does_not_know_is_sent_again_and_then_given_up() -> None:
    bench = Bench(resend_limit=2)
    bench.port.states[CommandId("live", "a", 1)] = CommandStatus(CommandState.UNKNOWN)
    for t in range(1, 6):
        bench.run.check_actions()
        bench.at(t)
    assert [str(c.id) for c in bench.port.sent] == ["live/a/1"] * 3
    assert "end a FAILED action-failed" in [e for _, e in bench.trace]


def test_an_aborted_command_the_rover_does_not_know_is_not_sent_again() -> None:
    bench = Bench("(task :id a :action image :duration (0 4))")
    command = CommandId("live", "a", 1)
    bench.port.states[command] = CommandStatus(CommandState.UNKNOWN)
    bench.at(5)
    assert bench.port.aborted == [command]
    bench.run.check_actions()
    bench.at(6)
    assert [c.id for c in bench.port.sent] == [command]
    assert bench.trace[-1] == (6, "end a FAILED end-window-missed")


THREE = "(block :id r :node-list ((task :id a :action x) (task :id b :action x) (task :id c :action x)))"


def test_go_after_a_step_lets_the_plan_go_on() -> None:
    bench = Bench(THREE)
    bench.run.pause()
    bench.returns("a", 1)
    bench.run.step()
    bench.run.resume()
    bench.at(2)
    bench.returns("b", 3)
    bench.at(4)
    assert [c.id.task for c in bench.port.sent] == ["a", "b", "c"]
    assert not bench.run.held


def test_a_step_lets_one_macro_step_begin_and_says_that_the_plan_is_held() -> None:
    bench = Bench(THREE)
    bench.run.pause()
    bench.returns("a", 1)
    bench.run.step()
    assert bench.run.held
    bench.at(2)
    assert bench.run.held
    bench.returns("b", 3)
    bench.at(4)
    assert [c.id.task for c in bench.port.sent] == ["a", "b"]
    assert bench.run.session.engine.run.paused


def test_a_run_that_comes_back_says_whether_it_is_held(tmp_path: Path) -> None:
    path = tmp_path / "live.journal"
    port, clock = Port(), HandClock()
    first = LiveRuntime(TWO_TASKS, port, run_id="live", clock=clock, journal=path)
    first.turn()
    control = RunControl(first)
    assert control.answer({"m": "hold"})["ok"]
    assert control.answer({"m": "state"})["held"]  # not taken up yet
    first.turn()
    first.shut_down()
    control = RunControl(LiveRuntime(TWO_TASKS, port, run_id="live", clock=clock, journal=path, resume=True))
    assert control.answer({"m": "state"})["held"]
    control.answer({"m": "go"})
    assert not control.answer({"m": "state"})["held"]
    control.runtime.turn()
    assert not control.held
    control.runtime.shut_down()


class _Door:
    """A listening socket that cannot take its first connections."""

    def __init__(self, door: socket.socket) -> None:
        self.door, self.failures = door, [OSError(errno.EMFILE, "Too many open files")] * 2

    def accept(self) -> object:
        if self.failures:
            raise self.failures.pop()
        return self.door.accept()

    def __getattr__(self, name: str) -> object:
        return getattr(self.door, name)


def test_the_way_for_a_stop_outlives_a_lack_of_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def listen(address: Address) -> _Door:
        return _Door(address_module.listen(address))

    monkeypatch.setattr(control_module, "listen", listen)
    bench = Bench()
    door = ControlSocket(tmp_path, RunControl(bench.run))
    try:
        assert ask_run(tmp_path, {"m": "state"})["ok"]
    finally:
        door.close()
    door._thread.join(5)
    assert not door._thread.is_alive()


def test_a_malformed_fault_is_told_what_is_wrong_with_it() -> None:
    faults: list[Json] = []
    control = RunControl(Bench().run, faults.append)
    assert "found 'silent'" in control.answer({"m": "inject", "fault": "silent"})["reason"]
    assert "found None" in control.answer({"m": "inject"})["reason"]
    assert control.answer({"m": "inject", "fault": {"kind": "silent"}}) == {"ok": True}
    assert faults == [{"kind": "silent"}]
    none = RunControl(Bench().run).answer({"m": "inject", "fault": {"kind": "silent"}})
    assert none["reason"] == "this rover takes no faults"


def test_a_broken_line_does_not_break_the_executive() -> None:
    bench = Bench()
    bench.port.broken = True
    bench.returns("a", 1)
    bench.at(2)
    assert "send of live/b/1 failed: line is down" in bench.notes
    assert not bench.run.session.over


def test_new_plans_are_taken_from_the_folder(tmp_path: Path) -> None:
    bench = Bench()
    bench.run.plan_folder = tmp_path
    seen: set[tuple[str, int]] = set()
    (tmp_path / "2.crl").write_text(TWO_TASKS.replace(":id b", ":id c"))
    (tmp_path / "1.crl").write_text("(no plan")
    bench.run.check_plans(seen)
    bench.run.check_plans(seen)
    bench.at(1)
    assert [e for _, e in bench.trace].count("replace") == 1
    assert any(note.kind == "rejected" for note in bench.run.session.notes)
    bench.returns("a", 2)
    assert bench.port.sent[-1].id.task == "c"


def test_a_clock_that_jumps_is_not_followed() -> None:
    source, reference, words = HandClock(), HandClock(), list[str]()
    clock = SteadyClock(source, reference_ms=reference.now_ms, report=words.append)

    def both(by_ms: int, jump_ms: int = 0) -> int:
        reference.t_ms += by_ms
        source.t_ms += by_ms + jump_ms
        return clock.now_ms()

    assert both(500) == 500
    assert both(500, jump_ms=3_600_000) == 1_000
    assert both(500) == 1_500
    assert both(500, jump_ms=-7_200_000) == 2_000
    assert both(500, jump_ms=10) == 2_510
    assert [w.split(" ms")[0] for w in words] == [
        "the clock jumped by +3600000",
        "the clock jumped by -7200000",
    ]


def test_the_plan_clock_never_goes_back() -> None:
    bench = Bench()
    bench.at(10)
    bench.returns("a", 4)
    assert (10, "end a SUCCEEDED") in bench.trace


def test_a_leap_of_an_unguarded_clock_closes_windows_once() -> None:
    plan = (
        "(block :id root :node-list ((task :id a :action image :duration (0 60) :continue-on-failure t) "
        "(task :id b :action drive)))"
    )
    bench = Bench(plan, silence_ms=None)
    bench.at(86_400)
    assert bench.port.aborted == [CommandId("live", "a", 1)]
    bench.run.post(Acknowledgement(0, CommandId("live", "a", 1)))
    bench.at(86_401)
    assert (86_401, "start b") in bench.trace


def test_a_plan_with_an_epoch_starts_late() -> None:
    now = datetime(2030, 5, 6, 12, 0, 30, tzinfo=UTC)
    assert plan_start_ms("2030-05-06T12:00:00Z", now) == 30_000
    assert plan_start_ms("2030-05-06T12:00:00", now) == 30_000
    assert plan_start_ms("2030-05-06T13:00:00+01:00", now) == 30_000
    assert plan_start_ms("2031-01-01T00:00:00Z", now) == 0
    assert plan_start_ms(None) == 0


def test_flood_of_telemetry_is_merged_and_nothing_else_is_lost() -> None:
    mailbox = Mailbox(limit=100)
    for n in range(1_000):
        mailbox.post(Update(n, {"k": n, f"only{n}": n}))
        if n == 500:
            mailbox.post(Result(n, CommandId("r", "a", 1), success=True))
    mailbox.post(Operator(0, Operation.ABORT))
    events = mailbox.take(7)
    assert len(events) <= 104
    assert isinstance(events[0], Operator)
    assert sum(isinstance(e, Result) for e in events) == 1
    values: dict[str, object] = {}
    for event in events:
        assert event.t_ms == 7
        if isinstance(event, Update):
            values.update(event.values)
    assert values["k"] == 999
    assert len(values) == 1_001
    assert mailbox.merged > 800


def test_a_flood_has_one_sentence_in_the_log_and_the_plan_goes_on() -> None:
    bench = Bench()
    for second in (1, 2):
        for n in range(20_000):
            bench.run.post(Update(0, {"noise": float(n)}))
        bench.at(second)
    assert len([note for note in bench.notes if "faster than it is taken" in note]) == 1
    bench.returns("a", 3)
    bench.returns("b", 4)
    assert bench.trace[-1] == (4, "end root SUCCEEDED")


def test_many_threads_may_post_at_once() -> None:
    mailbox = Mailbox()

    def work(name: int) -> None:
        for n in range(200):
            mailbox.post(Result(0, CommandId("r", f"{name}", n), success=True))

    threads = [threading.Thread(target=work, args=(n,)) for n in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    events = [e for e in mailbox.take(0) if isinstance(e, Result)]
    assert len(events) == 1_600
    for name in range(8):
        own = [e.command.attempt for e in events if e.command.task == str(name)]
        assert own == sorted(own)


def test_a_run_with_all_its_threads(tmp_path: Path) -> None:
    rover = ScriptedRover({"soc": 80}, {"*": (Behaviour(2_000),)})
    path = tmp_path / "live.journal"
    runtime = LiveRuntime(
        TWO_TASKS,
        rover,
        run_id="live",
        journal=path,
        clock=MonotonicClock(speed=100),
        plan_folder=tmp_path,
        settings=LiveSettings(silence_ms=None, watch_s=0.01),
    )
    outcome = runtime.run()
    assert outcome.outcome == "SUCCEEDED"
    assert outcome.end_ms is not None
    assert outcome.end_ms >= 4_000
    records = JournalFile(path).records
    assert replay(records) == recorded_trace(records) == list(outcome.trace)
    assert not [t for t in threading.enumerate() if t.name.startswith("live-")]


def test_a_live_run_goes_on_from_its_journal(tmp_path: Path) -> None:
    path = tmp_path / "live.journal"
    port, clock = Port(), HandClock()
    first = LiveRuntime(TWO_TASKS, port, run_id="live", clock=clock, journal=path)
    first.turn()
    first.shut_down()
    clock.t_ms = 20_000
    second = LiveRuntime(TWO_TASKS, port, run_id="live", clock=clock, journal=path, resume=True)
    second.post(Result(0, CommandId("live", "a", 1), success=True))
    second.turn()
    second.shut_down()
    assert [str(c.id) for c in port.sent] == ["live/a/1", "live/b/1"]
    assert [r.event for r in second.session.trace] == ["start", "start", "restart", "end", "start"]
    with pytest.raises(JournalError, match="belongs to another run"):
        LiveRuntime(TWO_TASKS, port, run_id="other", clock=clock, journal=path, resume=True)
