"""The judge of `studies.live_ros2_days` against logs that are wrong, each in one way."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from executive.ports import CommandId
from rover_iface.ros2.load import load_mapping
from studies.live_ros2_days import MAPPING, Day, compare, goal_of
from tests.ros2.fakes import Bench

GO, REST = CommandId("run", "go", 1), CommandId("run", "rest", 1)


def send(command: CommandId, action: str) -> dict[str, Any]:
    return {"k": "send", "id": list(command), "action": action, "t": 1000}


def told(command: CommandId, kind: str = "result", *, success: bool = True) -> dict[str, Any]:
    event = {"e": kind, "command": list(command), "success": success, "reason": "" if success else "lost: x"}
    return {"k": "step", "t": 9000, "events": [event]}


RECORDS = [send(GO, "navigate"), send(REST, "wait"), told(GO), told(REST)]
BEGIN = {"what": "begin", "goal": goal_of(GO)}
END = {"what": "end", "goal": goal_of(GO), "how": "succeeded"}


def judged(goals: list[dict[str, Any]], records: list[dict[str, Any]]) -> Day:
    day = Day(1, {})
    compare(goals, records, day)
    return day


def test_a_day_that_is_well_is_well() -> None:
    day = judged([BEGIN, END], RECORDS)
    assert (day.problems, day.doubled, day.lost) == ([], 0, 0)
    assert (day.commands, day.plan_s, day.ends) == (2, 9.0, {"done": 2})


@pytest.mark.parametrize(
    ("goals", "records", "doubled", "lost", "said"),
    [
        ([BEGIN, END, BEGIN, END], RECORDS, 1, 0, "carried out twice"),
        ([BEGIN], [*RECORDS[:2], told(GO, success=False), told(REST)], 0, 0, "goals that go on"),
        ([], RECORDS, 0, 1, "told as done"),
        ([BEGIN, {**END, "how": "aborted"}], RECORDS, 0, 1, "told as done"),
        ([BEGIN, END], [*RECORDS[:2], told(GO)], 0, 1, "commands without an end"),
        ([BEGIN, END], RECORDS[1::2], 0, 0, "no command"),
    ],
)
def test_a_day_that_is_wrong_in_one_way_is_seen(
    goals: list[dict[str, Any]], records: list[dict[str, Any]], doubled: int, lost: int, said: str
) -> None:
    day = judged(goals, records)
    assert (day.doubled, day.lost) == (doubled, lost)
    assert any(said in problem for problem in day.problems)


def test_the_goal_of_a_command_is_the_one_that_the_bridge_gives(tmp_path: Path) -> None:
    bench = Bench(tmp_path, load_mapping(MAPPING))
    command = bench.send("navigate", x=1.0, y=0.0)
    assert bench.accept().hex() == goal_of(command)
