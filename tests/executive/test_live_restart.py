"""Restart from anywhere: the plan clock goes on, nothing said is lost, nothing is carried out twice."""

from __future__ import annotations

import os
import random
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from executive.errors import JournalError
from executive.ports import (
    Acknowledgement,
    Command,
    CommandId,
    CommandState,
    CommandStatus,
    Event,
    Result,
    Update,
    Value,
)
from executive.runtime import journal as journal_module
from executive.runtime.journal import JournalFile, never_began
from executive.runtime.live import LiveRuntime, LiveSettings
from executive.runtime.recovery import recorded_trace, replay
from tests.executive.test_live import HandClock, Port

NOON = datetime(2031, 5, 4, 12, tzinfo=UTC)
QUIET = LiveSettings(silence_ms=None, monitor_ms=None, heartbeat_ms=None)
LATE = "(task :id late :action image :start-temporal-conditions ((7200 9000)))"


def begin(path: Path, plan: str = LATE, *, at: datetime = NOON, resume: bool = True) -> LiveRuntime:
    return LiveRuntime(
        plan, Port(), run_id="live", journal=path, resume=resume, settings=QUIET, wall=lambda: at
    )


def test_the_header_says_when_plan_time_0_was_before_anything_else(tmp_path: Path) -> None:
    run = begin(tmp_path / "j")
    header = JournalFile(tmp_path / "j").header
    assert (header["clock"], header["rate"]) == ("wall", 1.0)
    assert datetime.fromisoformat(header["instant"]) == NOON
    run.shut_down()


def test_the_plan_clock_goes_on_while_the_process_is_away(tmp_path: Path) -> None:
    run = begin(tmp_path / "j")
    run.turn()
    run.shut_down()
    run = begin(tmp_path / "j", at=NOON + timedelta(hours=2, seconds=3))
    run.turn()
    starts = [r for r in run.session.trace if r.event == "start"]
    assert len(starts) == 1
    assert 7_203_000 <= starts[0].t_ms < 7_204_000
    run.shut_down()


def test_a_wall_clock_that_was_set_back_does_not_set_the_plan_clock_back(tmp_path: Path) -> None:
    run = begin(tmp_path / "j")
    run.turn()
    run.shut_down()
    run = begin(tmp_path / "j", at=NOON + timedelta(hours=1))
    run.turn()
    run.shut_down()
    run = begin(tmp_path / "j", at=NOON - timedelta(days=1))
    run.turn()
    assert 3_600_000 <= run.session.now_ms < 3_601_000
    assert any("the plan clock goes on from there" in note.text for note in run.session.notes)
    run.shut_down()


@pytest.mark.parametrize(("epoch", "begins_ms"), [("11:50:00", 600_000), ("12:10:00", 0)])
def test_a_plan_with_an_epoch_keeps_its_time_of_day(tmp_path: Path, epoch: str, begins_ms: int) -> None:
    run = begin(tmp_path / "j", f'(plan :id p :epoch "2031-05-04T{epoch}Z" :node {LATE})')
    assert run.session.start_ms == pytest.approx(begins_ms, abs=1_000)
    instant = datetime.fromisoformat(JournalFile(tmp_path / "j").header["instant"])
    assert instant == NOON - timedelta(milliseconds=begins_ms)
    run.shut_down()


def test_a_journal_cut_anywhere_in_its_header_is_a_run_that_never_began(tmp_path: Path) -> None:
    begin(tmp_path / "j").shut_down()
    header = (tmp_path / "j").read_bytes().splitlines(keepends=True)[0]
    for size in range(len(header)):
        path = tmp_path / f"cut-{size}"
        path.write_bytes(header[:size])
        assert never_began(path)
        run = begin(path)
        run.turn()
        assert recorded_trace(JournalFile(path).records) == run.session.trace
        run.shut_down()
    assert not never_began(tmp_path / "j")


@pytest.mark.parametrize("content", [b"hello", b'{"n":0,"k":"note"', b"\n", b"\x00" * 64])
def test_what_is_no_beginning_of_a_header_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "j"
    path.write_bytes(content)
    with pytest.raises(JournalError):
        begin(path)
    assert path.read_bytes() == content


# --- kills at any instant ------------------------------------------------------------


class KilledError(BaseException):
    """The process is dead."""


class Fate:
    """Counts the instants at which a process may die, and lets it die at one of them."""

    def __init__(self, rng: random.Random) -> None:
        self.rng = rng
        self.left: int | None = None

    def instant(self) -> None:
        if self.left is not None:
            self.left -= 1
            if self.left < 0:
                self.left = None
                raise KilledError


class Disk:
    """What is on the disk if the power goes: synced bytes, and any beginning of what came after."""

    def __init__(self, path: Path, fate: Fate, patch: pytest.MonkeyPatch) -> None:
        self.path, self.fate, self.synced = path, fate, 0
        self.write, self.fsync, self.open, self.close = os.write, os.fsync, os.open, os.close
        self.handles: set[int] = set()
        patch.setattr(journal_module.os, "open", self.opens)
        patch.setattr(journal_module.os, "close", self.closes)
        patch.setattr(journal_module.os, "write", self.writes)
        patch.setattr(journal_module.os, "fsync", self.syncs)

    def writes(self, file: int, data: bytes) -> int:
        self.fate.instant()
        written = self.write(file, data[: max(1, self.fate.rng.randint(0, len(data)))])
        self.fate.instant()
        return written

    def syncs(self, file: int) -> None:
        self.fate.instant()
        self.fsync(file)
        if self.path.exists():
            self.synced = self.path.stat().st_size
        self.fate.instant()

    def opens(self, *arguments: Any) -> int:
        handle = self.open(*arguments)
        self.handles.add(handle)
        return handle

    def closes(self, handle: int) -> None:
        self.handles.discard(handle)
        self.close(handle)

    def lose_power(self) -> None:
        while self.handles:  # the system closes what a dead process held
            self.close(self.handles.pop())
        if self.path.exists():
            size = self.path.stat().st_size
            os.truncate(self.path, self.fate.rng.randint(min(self.synced, size), size))


class NumberingRover:
    """A rover in another process: it numbers what it says and forgets what was acknowledged.

    Each beat is said once and stands in no present state: one that is lost is lost for ever.
    """

    def __init__(self, fate: Fate) -> None:
        self.fate = fate
        self.t_ms = 0
        self.number = 0
        self.kept: list[Event] = []
        self.unheard: list[Event] = []
        self.done: dict[CommandId, Result | Acknowledgement] = {}
        self.running: dict[CommandId, int] = {}
        self.carried_out: list[CommandId] = []
        self.state: dict[str, Value] = {"soc": 80}

    def say(self, make: Callable[[int], Event]) -> None:
        self.number += 1
        event = make(self.number)
        self.kept.append(event)
        self.unheard.append(event)

    def live_until(self, t_ms: int) -> None:
        for at in range(self.t_ms + 100, t_ms + 1, 100):
            self.t_ms = at
            if at % 3_000 == 0 and at <= 18_000:
                self.say(lambda n, at=at: Update(at, {"beat": at // 3_000}, n))  # type: ignore[misc]
            for command, until in list(self.running.items()):
                if until <= at:
                    del self.running[command]
                    self.say(lambda n, at=at, c=command: Result(at, c, True, number=n))  # type: ignore[misc]
                    self.done[command] = self.kept[-1]  # type: ignore[assignment]

    def send(self, command: Command) -> None:
        self.fate.instant()
        if command.id not in self.carried_out:
            self.carried_out.append(command.id)
            self.running[command.id] = self.t_ms + 2_000
        self.fate.instant()

    def abort(self, command: CommandId) -> None:
        if self.running.pop(command, None) is not None:
            self.say(lambda n: Acknowledgement(self.t_ms, command, number=n))
            self.done[command] = self.kept[-1]  # type: ignore[assignment]

    def status(self, command: CommandId) -> CommandStatus:
        if command in self.running:
            return CommandStatus(CommandState.RUNNING)
        if command in self.done:
            return CommandStatus(CommandState.DONE, self.done[command])
        return CommandStatus(CommandState.UNKNOWN)

    def commit(self, number: int) -> None:
        self.fate.instant()
        self.kept = [e for e in self.kept if e.number > number]  # type: ignore[union-attr]

    def since(self, number: int) -> Sequence[Event]:
        self.unheard = []
        return [e for e in self.kept if e.number > number]  # type: ignore[union-attr]

    def present_state(self) -> Mapping[str, Value]:
        return dict(self.state)


DAY = """(plan :id day :node (block :id root :node-list (
  (task :id a :action image)
  (task :id b :action drive :wait-for-conditions ((database (:beat >= 3))))
  (concurrent-block :id c :node-list ((task :id c1 :action image) (task :id c2 :action heat)))
  (task :id d :action image :wait-for-conditions ((database (:beat >= 6)))))))"""


def live_through(seed: int, folder: Path, patch: pytest.MonkeyPatch) -> None:
    """Run the day with kills at random instants; check that it ends and that nothing was done twice."""
    rng = random.Random(seed)
    fate = Fate(rng)
    path = folder / f"{seed}.journal"
    disk = Disk(path, fate, patch)
    rover = NumberingRover(fate)
    clock = HandClock()
    lives = 0
    while True:
        lives += 1
        fate.left = rng.randint(0, 60) if lives < 6 else None
        try:
            run = LiveRuntime(
                DAY, rover, run_id="day", journal=path, resume=True, clock=clock, settings=QUIET
            )
            while not run.session.over and clock.t_ms < 120_000:
                rover.live_until(clock.t_ms)
                for event in rover.unheard:
                    run.post(event)
                rover.unheard = []
                run.turn()
                clock.t_ms += 100
            break
        except KilledError:
            disk.lose_power()
            clock.t_ms += rng.choice([0, 100, 2_500, 5_000])
            rover.live_until(clock.t_ms)
    fate.left = None
    assert run.session.over, (seed, run.session.trace)
    assert run.session.engine.run.outcome is not None
    assert len(rover.carried_out) == len(set(rover.carried_out)) == 5
    assert [c.attempt for c in rover.carried_out] == [1] * 5
    run.shut_down()
    records = JournalFile(path).records
    assert replay(records) == recorded_trace(records) == run.session.trace
    path.unlink()


def test_a_run_killed_at_any_instant_comes_to_its_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for seed in range(150):
        with monkeypatch.context() as patch:
            live_through(seed, tmp_path, patch)


@pytest.mark.slow
def test_a_run_killed_at_very_many_instants_comes_to_its_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for seed in range(1_000, 3_000):
        with monkeypatch.context() as patch:
            live_through(seed, tmp_path, patch)
