"""Processes of ROS 2 for tests: servers, the bridge, and an executive's end of its wire."""

from __future__ import annotations

import contextlib
import os
import subprocess
from pathlib import Path

from executive.ports import Acknowledgement, Command, CommandId, Event, Result
from executive.runtime.wire import Address, WireRover
from tests.waiting import until

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "examples/ros2_turtle"
DOMAIN = str(1 + os.getpid() % 100)


class Ros:
    """Processes in one ROS domain of their own."""

    def __init__(self, python: Path, folder: Path) -> None:
        self.python, self.folder = python, folder
        self.processes: list[subprocess.Popen[bytes]] = []
        self.environment = {
            **os.environ,
            "AMENT_PREFIX_PATH": str(python.parents[1]),
            "PYTHONPATH": str(ROOT),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "ROS_DOMAIN_ID": DOMAIN,
            "ROS_LOG_DIR": str(folder / "log"),
        }

    def start(self, *arguments: str | Path) -> subprocess.Popen[bytes]:
        log = (self.folder / f"process-{len(self.processes)}.log").open("wb")
        process = subprocess.Popen([self.python, *arguments], env=self.environment, stdout=log, stderr=log)
        self.processes.append(process)
        return process

    def bridge(self, mapping: Path = EXAMPLE / "turtle.yaml") -> Address:
        where = self.folder / f"bridge-{len(self.processes)}.sock"
        command = ["-m", "ground.cli", "rover", "ros2", mapping, "--listen", f"unix:{where}"]
        self.start(*command, "--out", self.folder / "out")
        until(where.is_socket)
        return Address(where)

    def log(self) -> str:
        return "".join(p.read_text(errors="replace") for p in sorted(self.folder.glob("process-*.log")))

    def end(self) -> None:
        """End all processes."""
        for process in self.processes:
            process.terminate()
        for process in self.processes:
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(timeout=10)
            process.kill()


class Drive:
    """An executive's end: sends, hears, and knows when."""

    def __init__(self, address: Address, folder: Path, run: str = "run") -> None:
        self.rover = WireRover(address, run=run, out=folder)
        self.rover.wait_ready(40)
        self.heard: list[Event] = []

    def hear(self) -> list[Event]:
        new = []
        while (event := self.rover.next_event(0)) is not None:
            new.append(event)
        self.heard += new
        return new

    def send(self, action: str, task: str = "", /, **parameters: float | str | bool) -> CommandId:
        command = CommandId(self.rover.run, task or action, 1)
        self.rover.send(Command(command, action, parameters))
        return command

    def answer(self, command: CommandId, seconds: float = 40.0) -> Result | Acknowledgement:
        def found() -> list[Event]:
            self.hear()
            ends = (e for e in self.heard if isinstance(e, Result | Acknowledgement))
            return [e for e in ends if e.command == command]

        until(lambda: bool(found()), seconds)
        (event,) = found()
        assert isinstance(event, Result | Acknowledgement)
        return event

    def state(self, key: str) -> object:
        return self.rover.present_state().get(key)
