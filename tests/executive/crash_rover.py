"""A scripted rover in a process of its own, and the executive's end of the line to it.

`execute` is the executive, in another process: it runs or resumes the run of a journal, and kills its process
with SIGKILL after so many records (0: never).
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from collections.abc import Sequence
from multiprocessing.connection import Client, Connection, Listener
from multiprocessing.context import ForkServerContext
from pathlib import Path
from typing import Any

from executive.ports import Command, CommandId, CommandStatus, Event
from executive.runtime import run_plan
from executive.runtime.codec import Json
from executive.runtime.journal import FileJournal, JournalFile
from executive.runtime.recovery import resume_session
from executive.runtime.scripted_rover import Behaviour, ScriptedRover

KEY = b"rover"


class RemoteRover:
    """The rover as the executive sees it, through a socket."""

    def __init__(self, address: str) -> None:
        deadline = time.monotonic() + 20
        while True:
            try:
                self.line = Client(address, family="AF_UNIX", authkey=KEY)
            except (FileNotFoundError, ConnectionRefusedError):  # it is not there yet, or does not listen
                assert time.monotonic() < deadline, f"no rover listens at {address}"
                time.sleep(0.005)
            else:
                break

    def ask(self, name: str, *arguments: object) -> Any:
        self.line.send((name, arguments))
        return self.line.recv()

    def send(self, command: Command) -> None:
        self.ask("send", command)

    def abort(self, command: CommandId) -> None:
        self.ask("abort", command)

    def status(self, command: CommandId) -> CommandStatus:
        status: CommandStatus = self.ask("status", command)
        return status

    def next_event(self, until_ms: int | None) -> Event | None:
        event: Event | None = self.ask("next_event", until_ms)
        return event


def serve(address: str, actions: dict[str, tuple[Behaviour, ...]], script: tuple[Event, ...]) -> None:
    """Be the rover, for one executive after the other, until one says `bye`.

    An event that was fetched by an executive which died before it said so is delivered again.
    """
    rover = ScriptedRover({"soc": 80}, actions, script)
    unsure: list[Event] = []
    delivered: list[Event] = []
    with Listener(address, family="AF_UNIX", authkey=KEY) as listener:
        while True:
            with listener.accept() as line:
                unsure, delivered = delivered, []
                if not talk(rover, line, unsure, delivered):
                    return


def talk(rover: ScriptedRover, line: Connection, unsure: list[Event], delivered: list[Event]) -> bool:
    """Answer one executive; return False when the rover may go."""
    while True:
        try:
            name, arguments = line.recv()
        except (EOFError, ConnectionResetError):
            delivered[:0] = unsure
            return True
        answer: Any = None
        if name == "bye":
            line.send([(str(command.id), command.issue) for command in rover.sent])
            return False
        if name == "next_event":
            limit = arguments[0]
            if unsure and (limit is None or unsure[0].t_ms <= limit):
                answer = unsure.pop(0)
            elif not unsure:
                answer = rover.next_event(limit)
            if answer is not None:
                delivered.append(answer)
        elif name == "durable":
            delivered.clear()
        elif name == "time":
            answer = rover.t_ms
        else:
            answer = getattr(rover, name)(*arguments)
        line.send(answer)


class DeadlyJournal(FileJournal):
    """A journal that writes record by record and kills the process after a given one."""

    def __init__(self, path: Path, rover: RemoteRover, kill_at: int, *, number: int = 0) -> None:
        super().__init__(path, number=number, sync=False)
        self.rover = rover
        self.kill_at = kill_at

    def append(self, records: Sequence[Json], *, durable: bool) -> None:
        for record in records:
            super().append([record], durable=False)
            if self.number == self.kill_at:
                os.kill(os.getpid(), signal.SIGKILL)
        self.rover.ask("durable")


def execute(journal: Path, address: str, kill_at: int) -> None:
    """Run the plan beside the journal, or go on with the run of the journal."""
    rover = RemoteRover(address)
    if journal.exists() and journal.stat().st_size:
        file = JournalFile(journal)
        file.cut_torn_tail()
        sink = DeadlyJournal(journal, rover, kill_at, number=len(file.records))
        resume_session(file.records, rover, sink, now_ms=rover.ask("time")).run()
    else:
        journal.touch()
        sink = DeadlyJournal(journal, rover, kill_at)
        run_plan(journal.with_suffix(".crl").read_text(), rover, run_id="day", journal=sink)


def start_rover(
    address: str, actions: dict[str, tuple[Behaviour, ...]], script: tuple[Event, ...]
) -> multiprocessing.process.BaseProcess:
    """Start the process of the rover."""
    process = nursery().Process(target=serve, args=(address, actions, script), daemon=True)
    process.start()
    return process


def nursery() -> ForkServerContext:
    """Return what makes processes that have loaded this module already."""
    made = multiprocessing.get_context("forkserver")
    made.set_forkserver_preload(["tests.executive.crash_rover"])
    return made
