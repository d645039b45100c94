"""Runs that have heard nothing of their rover yet."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from executive.ports import Command, CommandId, CommandState, Result, Update
from executive.runtime.codec import Json
from executive.runtime.journal import JournalFile, last_number
from executive.runtime.live import LiveRuntime, LiveSettings
from executive.runtime.wire import Address, WireOptions, WireRover
from executive.runtime.wire.frames import FrameReader, frame
from executive.runtime.wire.outbox import RESTARTED, UNHEARD
from tests.executive.wire.servers import JumpingClock, Waiter, served
from tests.waiting import until

QUICK = WireOptions(retry_s=0.1, beat_s=0.05, dead_s=2.0, pause_s=0.02, longest_pause_s=0.1, patience_s=3.0)
LONG = Command(CommandId("run", "long", 1), "wait", {"duration_s": 60.0})
PLAN = """(plan :id day :node (block :id root :node-list
 ((task :id long :action wait :parameters (duration_s = 60)))))"""


class Hand:
    """A rover's end of a line that says what a test lets it say."""

    def __init__(self) -> None:
        self.heard: list[Json] = []
        self._line: socket.socket | None = None

    def dial(self) -> socket.socket:
        ours, theirs = socket.socketpair()
        self._line = ours
        self._reader = threading.Thread(target=self._read, args=(ours,), daemon=True)
        self._reader.start()
        return theirs

    def _read(self, line: socket.socket) -> None:
        reader = FrameReader()
        while data := line.recv(65536):
            self.heard += reader.feed(data)

    def kinds(self) -> list[object]:
        return [message["m"] for message in self.heard]

    def say(self, message: Json) -> None:
        until(lambda: self._line is not None)
        assert self._line is not None
        self._line.sendall(frame(message))

    def welcome(self, boot: int, last: int) -> None:
        until(lambda: "hello" in self.kinds())
        self.say(
            {"m": "welcome", "protocol": "wire/1", "rover": "hand", "run": "run", "t": 5}
            | {"boot": boot, "first": boot + 1, "last": last, "rate": 1.0}
        )

    def hang_up(self) -> None:
        line, self._line, self.heard = self._line, None, []
        if line is not None:
            line.shutdown(socket.SHUT_RDWR)
            self._reader.join(5)
            line.close()


@contextmanager
def hand_held() -> Iterator[tuple[Hand, WireRover]]:
    hand = Hand()
    line = WireRover(hand.dial, run="run", options=QUICK)
    try:
        yield hand, line
    finally:
        line.close()
        hand.hang_up()


def test_a_rover_is_ready_when_what_it_had_said_is_here() -> None:
    """The greeting comes before the word: a run that began between the two had no number in its journal."""
    with hand_held() as (hand, line):

        def speak() -> None:
            hand.welcome(boot=1000, last=1001)
            time.sleep(0.2)
            hand.say({"m": "event", "event": {"e": "update", "t": 5, "number": 1001, "values": {"a": 1}}})

        threading.Thread(target=speak, daemon=True).start()
        line.wait_ready(5)
        heard = line.next_event(0)
        assert isinstance(heard, Update)
        assert heard.number == 1001


def test_a_rover_that_restarts_before_its_first_word_is_asked_what_it_knows() -> None:
    with hand_held() as (hand, line):
        threading.Thread(target=hand.welcome, args=(0, 0), daemon=True).start()
        line.wait_ready(5)
        line.send(LONG)
        until(lambda: "send" in hand.kinds())
        hand.hang_up()
        hand.welcome(boot=7, last=7)
        until(lambda: "status" in hand.kinds())
        hand.say({"m": "status", "id": ["run", "long", 1], "state": "unknown"})
        ended = None
        end = time.monotonic() + 5
        while not isinstance(ended, Result) and time.monotonic() < end:
            ended = line.next_event(0)
        assert ended == Result(0, LONG.id, False, RESTARTED)
        assert "send" not in hand.kinds()


def test_a_resumed_run_that_heard_nothing_sends_nothing_again(tmp_path: Path) -> None:
    """Killed before a word of the rover was durable; the rover restarted and may have begun the task."""
    journal, where = tmp_path / "journal.jsonl", tmp_path / "r.sock"
    settings = LiveSettings(monitor_ms=100)
    first, second = Waiter(JumpingClock()), Waiter(JumpingClock())
    line = WireRover(Address(where), run="run", options=QUICK)
    run = LiveRuntime(PLAN, line, run_id="run", journal=journal, settings=settings)
    run.turn()  # at plan time 0, with the link away
    with served(first, where):
        until(lambda: first.carried_out)
        line.close()
        run.shut_down()
    assert last_number(JournalFile(journal).records) == 0
    line = WireRover(Address(where), run="run", options=QUICK)
    with served(second, where):
        again = LiveRuntime(PLAN, line, run_id="run", journal=journal, resume=True, settings=settings)
        thread = threading.Thread(target=again.run, daemon=True)
        thread.start()
        thread.join(5)
        again.shut_down()
        line.close()
    assert second.carried_out == []
    assert "end root FAILED child-failed" in [" ".join((r.event, *r.arguments)) for r in again.session.trace]


@pytest.mark.parametrize(("number", "reason"), [(0, UNHEARD), (12, RESTARTED)])
def test_a_line_that_was_begun_before_the_run_came_back_still_sends_nothing_again(
    number: int, reason: str, tmp_path: Path
) -> None:
    """The dictionary of a run whose folder lost it is asked for before the journal is looked at."""
    rover = Waiter(JumpingClock())
    with served(rover, tmp_path / "r.sock") as (address, _):
        line = WireRover(address, run="run", options=QUICK)
        line.wait_ready(5)
        line.since(number)
        status = line.status(LONG.id)
        line.close()
    assert status.state is CommandState.DONE
    assert status.result == Result(0, LONG.id, False, reason)
    assert rover.carried_out == []


def test_a_new_run_may_ask_about_a_command_that_the_rover_does_not_know(tmp_path: Path) -> None:
    with served(Waiter(JumpingClock()), tmp_path / "r.sock") as (address, _):
        line = WireRover(address, run="run", options=QUICK)
        line.wait_ready(5)
        assert line.status(LONG.id).state is CommandState.UNKNOWN
        line.close()
