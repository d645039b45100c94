"""Live runs killed at random instants, on a disk and a clock of their own, beside a rover that lives on."""

from __future__ import annotations

import os
import random
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest

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
from executive.runtime.journal import JournalFile
from executive.runtime.live import LiveRuntime, LiveSettings
from executive.runtime.recovery import recorded_trace, replay
from tests.executive.test_live import HandClock

QUIET = LiveSettings(silence_ms=None, monitor_ms=None, heartbeat_ms=None)


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


def live_through(seed: int, folder: Path, patch: pytest.MonkeyPatch) -> int:
    """Run the day with kills at random instants and return how many there were.

    Raises
    ------
    AssertionError
        If the run does not end, does anything twice, jumps in its plan time, or does not replay.
    """
    rng = random.Random(seed)
    fate = Fate(rng)
    path = folder / f"{seed}.journal"
    disk = Disk(path, fate, patch)
    rover = NumberingRover(fate)
    clock = HandClock()
    lives = 0
    back_at: list[int] = []
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
            back_at.append(clock.t_ms)
            rover.live_until(clock.t_ms)
    fate.left = None
    assert run.session.over, (seed, run.session.trace)
    assert run.session.engine.run.outcome is not None
    assert len(rover.carried_out) == len(set(rover.carried_out)) == 5
    assert [c.attempt for c in rover.carried_out] == [1] * 5
    run.shut_down()
    records = JournalFile(path).records
    assert replay(records) == recorded_trace(records) == run.session.trace
    times = [record.t_ms for record in run.session.trace]
    assert times == sorted(times)
    assert {r.t_ms for r in run.session.trace if r.event == "restart"} <= set(back_at)
    path.unlink()
    return lives - 1
