"""Rovers that refuse, never answer, answer twice or to nobody, and clocks that run backwards.

Each is told in a sentence of the journal, and the plan reacts as it was written: never a traceback or a hang.
"""

from __future__ import annotations

import threading
import time
from pathlib import Path

import pytest

from executive.ports import Acknowledgement, Command, CommandId, CommandState, CommandStatus, Result, Update
from executive.runtime.journal import JournalFile
from executive.runtime.live import LiveRuntime, LiveSettings
from executive.runtime.recovery import recorded_trace, replay
from executive.runtime.session import RunOutcome
from tests.executive.wire.servers import JumpingClock, Waiter, served
from tests.executive.wire.test_wire import line_to

PLAN = """(plan :id day :library ((alternate :id safe :node (task :id beacon :action wait)))
 :node (block :id root :node-list (
   (task :id odd :action {action} :duration (0 {limit_s}))
   (task :id after :action wait :parameters (duration_s = 0.1)))))"""
SETTINGS = LiveSettings(silence_ms=20_000, grace_ms=500, monitor_ms=200, stuck_ms=1_500)


def flown(rover: Waiter, folder: Path, action: str = "wait", limit_s: float = 60.0) -> RunOutcome:
    """Return what came of a plan; its journal replays, whatever the rover said."""
    with served(rover, folder / "r.sock") as (address, _), line_to(address) as line:
        line.wait_ready(60)
        text = PLAN.format(action=action, limit_s=limit_s)
        run = LiveRuntime(text, line, run_id="run", journal=folder / "journal", settings=SETTINGS)
        thread = threading.Thread(target=run.run)
        thread.start()
        thread.join(timeout=120)
        hung = thread.is_alive()
        if hung:
            run.shut_down()
            thread.join()
        assert not hung, run.session.trace
        records = JournalFile(folder / "journal").records
        assert replay(records) == recorded_trace(records)
        return run.session.result()


def said(outcome: RunOutcome) -> list[str]:
    return [note.text for note in outcome.notes]


def events(outcome: RunOutcome) -> list[str]:
    return [" ".join((record.event, *record.arguments)) for record in outcome.trace]


def test_an_action_that_the_rover_does_not_have_fails_with_its_reason(tmp_path: Path) -> None:
    outcome = flown(Waiter(JumpingClock()), tmp_path, action="dance")
    assert "end odd FAILED action-failed" in events(outcome)
    assert "alternate safe" in events(outcome)
    assert "unknown action dance" in (tmp_path / "journal").read_text("utf-8")


class Deaf(Waiter):
    """A rover that takes `odd` up and never says a word of it; with `stubborn` not even when stopped."""

    def __init__(self, *, stubborn: bool) -> None:
        super().__init__(JumpingClock())
        self.stubborn = stubborn

    def send(self, command: Command) -> None:
        if command.id.task == "odd":
            self.carried_out.append(command.id)
        else:
            super().send(command)

    def status(self, command: CommandId) -> CommandStatus:
        if command.task == "odd" and self.stubborn:
            return CommandStatus(CommandState.RUNNING)
        return super().status(command)


@pytest.mark.parametrize("stubborn", [False, True])
def test_an_action_that_never_answers_ends_at_its_time_and_safe_takes_over(
    stubborn: bool, tmp_path: Path
) -> None:
    rover = Deaf(stubborn=stubborn)
    outcome = flown(rover, tmp_path, limit_s=1.0)
    assert any(text.startswith("end odd ") and "SUCCEEDED" not in text for text in events(outcome))
    assert "alternate safe" in events(outcome)
    assert [c.task for c in rover.carried_out] == ["odd", "beacon"]
    if stubborn:
        assert any("odd" in text and "taken as stopped" in text for text in said(outcome))


class Stammerer(Waiter):
    """A rover that gives every answer twice, the second the contrary of the first, and answers nobody."""

    def _over(self, event: Result | Acknowledgement) -> None:
        super()._over(event)
        self.events.append(Result(event.t_ms, event.command, False, "no, it failed"))
        self.events.append(Result(event.t_ms, CommandId("run", "nobody", 1), True))
        self.events.append(Acknowledgement(event.t_ms, CommandId("another", event.command.task, 1)))


def test_a_second_answer_and_one_to_nobody_are_noted_and_change_nothing(tmp_path: Path) -> None:
    outcome = flown(Stammerer(JumpingClock()), tmp_path)
    assert outcome.outcome == "SUCCEEDED"
    assert "alternate safe" not in events(outcome)
    assert any("odd" in text for text in said(outcome))
    assert any("nobody" in text for text in said(outcome))


class BackwardClock(JumpingClock):
    """A clock that runs backwards from ten hours after its start."""

    def now_ms(self) -> int:
        return max(0, 36_000_000 - super().now_ms())


def test_a_rovers_clock_that_runs_backwards_is_noted_and_harms_nothing(tmp_path: Path) -> None:
    outcome = flown(Waiter(BackwardClock()), tmp_path)
    assert outcome.outcome == "SUCCEEDED"
    assert outcome.end_ms is not None
    assert outcome.end_ms < 60_000
    assert said(outcome).count("the rover's clock runs backwards; ours goes on") == 1


def test_a_rover_whose_word_is_of_the_wrong_type_is_noted_key_by_key(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    rover = Waiter(JumpingClock())
    rover.events.append("a text")  # type: ignore[arg-type]
    rover.events.append(Update("late", {"soc": 1.0}))  # type: ignore[arg-type]
    rover.events.append(Update(0, {7: 1.0}))  # type: ignore[dict-item]
    rover.events.append(Result(0, "odd", True))  # type: ignore[arg-type]
    rover.events.append(Result(0, CommandId("run", "odd", 1), "perhaps"))  # type: ignore[arg-type]
    outcome = flown(rover, tmp_path)
    assert outcome.outcome == "SUCCEEDED"
    left_out = [getattr(record, "left_out", "") for record in caplog.records]
    assert any("'a text'" in text for text in left_out), left_out
    assert any("state key 7" in text for text in left_out), left_out


def test_a_stop_leaves_a_plan_over_even_if_its_rover_never_answers(tmp_path: Path) -> None:
    rover = Deaf(stubborn=True)
    with served(rover, tmp_path / "r.sock") as (address, _), line_to(address) as line:
        line.wait_ready(60)
        run = LiveRuntime(PLAN.format(action="wait", limit_s=600), line, run_id="run", settings=SETTINGS)
        thread = threading.Thread(target=run.run)
        thread.start()
        end = time.monotonic() + 60
        while not rover.carried_out and time.monotonic() < end:
            time.sleep(0.01)
        run.emergency_stop()
        thread.join(timeout=60)
        hung = thread.is_alive()
        run.shut_down()
        thread.join(5)
    assert not hung
    assert run.session.result().outcome == "ABORTED"
