"""How long commands take through the bridge to ROS 2, and a cancel until the robot stands.

    .venv/bin/python -m studies.live_ros2 [--ros DIR] [--goals 100] [--page FILE]

DIR is made by `scripts/ros-venv`. The robot is the server of `examples/ros2_turtle`, in a process of its own,
as the bridge is; when a goal came to it and when it stood is read from its log. One clock times them all.
"""

from __future__ import annotations

import argparse
import os
import re
import statistics
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

from executive.ports import Acknowledgement
from studies.live_kills import put, quantile
from tests.ros2.processes import EXAMPLE, Drive, Ros
from tests.waiting import until

STAMP = re.compile(r"\[INFO\] \[([\d.]+)\] \[turtle_server\]: (.+)")


def _told(ros: Ros, words: str, times: int) -> bool:
    """Return whether the robot has said so more often than this."""
    return len(stamps(ros, words)) > times


def measure(ros: Ros, goals: int) -> dict[str, list[float]]:
    """Return milliseconds: send to goal at the robot, abort to standing, abort to its acknowledgement."""
    ros.start(EXAMPLE / "turtle_server.py")
    drive = Drive(ros.bridge(), ros.folder / "run")
    until(lambda: drive.state("pose x") is not None)
    found: dict[str, list[float]] = {"came": [], "stood": [], "told": []}
    for n in range(goals):
        sent = time.time()
        command = drive.send("navigate", f"go-{n}", x=80.0, y=float(n % 2))
        until(partial(_told, ros, "a goal has come", n))
        time.sleep(0.1)
        aborted = time.time()
        drive.rover.abort(command)
        answer = drive.answer(command)
        told = time.time()
        assert isinstance(answer, Acknowledgement)
        until(partial(_told, ros, "stopped", n))
        found["came"].append(1000 * (stamps(ros, "a goal has come")[n] - sent))
        found["stood"].append(1000 * (stamps(ros, "stopped")[n] - aborted))
        found["told"].append(1000 * (told - aborted))
    drive.rover.close(over=True)
    return found


def stamps(ros: Ros, what: str) -> list[float]:
    """Return when the robot said something, seconds since 1970."""
    return [float(at) for at, said in STAMP.findall(ros.log()) if said == what]


def main() -> None:
    """Run the study; print its table, and write the page if one is named."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--ros", type=Path, default=Path(".ros-venv"))
    parser.add_argument("--goals", type=int, default=100)
    parser.add_argument("--page", type=Path, default=None, help="put the result into this page")
    given = parser.parse_args()
    load = os.getloadavg()[0]
    with tempfile.TemporaryDirectory() as folder:
        ros = Ros(given.ros.absolute() / "bin/python", Path(folder))
        try:
            found = measure(ros, given.goals)
        finally:
            ros.end()

    def row(name: str) -> str:
        ms = found[name]
        return f"{statistics.median(ms):.0f}, {quantile(ms, 0.99):.0f}, {max(ms):.0f} ms"

    lines = [
        f"| goals, each cancelled | {given.goals} |",
        f"| command to goal at the robot: median, p99, most | {row('came')} |",
        f"| abort to the robot standing: median, p99, most | {row('stood')} |",
        f"| abort to its acknowledgement: median, p99, most | {row('told')} |",
        f"| load of the machine (2 cores) at the start | {load:.1f} |",
    ]
    sys.stdout.write("\n".join(lines) + "\n")
    if given.page is not None:
        put(given.page, "ros2", f"python -m studies.live_ros2 --goals {given.goals}", lines)


if __name__ == "__main__":
    main()
