"""The bridge over a real ROS 2: plans, aborts, floods, servers that die, a robot like one with Nav2."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from executive.ports import Acknowledgement, Product, Result, Update
from executive.runtime import LiveRuntime
from executive.runtime.wire import WireRover
from executive.runtime.wire.contract import check_wire
from tests.ros2.processes import EXAMPLE, Drive, Ros
from tests.shared import script
from tests.waiting import until

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("ros2")]


@pytest.fixture
def ros(ros_python: Path, tmp_path: Path) -> Iterator[Ros]:
    made = Ros(ros_python, tmp_path)
    try:
        yield made
    finally:
        made.end()


@pytest.fixture
def drive(ros: Ros) -> Iterator[Drive]:
    ros.start(EXAMPLE / "turtle_server.py", "--speed", "2")
    made = Drive(ros.bridge(), ros.folder / "run")
    try:
        until(lambda: made.state("pose x") is not None)
        yield made
    finally:
        made.rover.close(over=True)


def test_a_plan_is_carried_out_and_a_window_cuts_a_drive(ros: Ros) -> None:
    ros.start(EXAMPLE / "turtle_server.py")
    address = ros.bridge()
    plan = (EXAMPLE / "plan.crl").read_text()
    rover = WireRover(address, run="sol-1", out=ros.folder / "run")
    rover.wait_ready(40)
    outcome = LiveRuntime(plan, rover, run_id="sol-1").run()
    rover.wait_for_products(20)
    rover.close(over=True)
    assert outcome.outcome == "SUCCEEDED"
    assert outcome.outcomes["drive-far"] == "FAILED"
    assert outcome.outcomes["drive-home"] == "SUCCEEDED"
    times = {(r.event, r.arguments[0]): r.t_ms for r in outcome.trace}
    cut = times["end", "drive-far"] - times["start", "drive-far"]
    assert 4000 <= cut < 5000  # cancelled at 4 s, acknowledged when the robot stood
    assert len(list((ros.folder / "run/products").glob("*.png"))) == 1


def test_the_example_of_thirty_lines_runs(ros: Ros) -> None:
    lines = (EXAMPLE / "drive.py").read_text().splitlines()
    assert len(lines) <= 30
    ros.start(EXAMPLE / "turtle_server.py", "--speed", "5")
    address = ros.bridge()
    command = [sys.executable, EXAMPLE / "drive.py", EXAMPLE / "plan.crl", str(address), ros.folder / "sol"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=90, check=False)
    assert done.stdout.endswith("SUCCEEDED\n"), done.stderr


def test_the_bridge_keeps_the_contract_of_the_wire(ros: Ros) -> None:
    ros.start(EXAMPLE / "turtle_server.py")
    address = ros.bridge()
    first = Drive(address, ros.folder / "first", "first")
    until(lambda: first.state("pose x") is not None)
    first.rover.close(over=True)
    findings = check_wire(address, patience_s=10)
    assert [f"{f.name}: {f.detail}" for f in findings if not f.passed] == []


def test_each_way_to_fail_has_its_name(drive: Drive) -> None:
    rejected = drive.answer(drive.send("navigate", "too-far", x=1000.0, y=0.0))
    assert isinstance(rejected, Result)
    assert rejected.reason.startswith("rejected: the action server /navigate_to_pose")
    aborted = drive.answer(drive.send("navigate", "no-way", x=100.0, y=0.0))
    assert isinstance(aborted, Result)
    assert aborted.reason.startswith("aborted: ")
    assert aborted.reason.endswith("no path to the goal")
    refused = drive.answer(drive.send("lamp", "off", lit=False))
    assert isinstance(refused, Result)
    assert refused.reason == "refused: /lamp answered success = False: the switch is stuck"
    for good in (drive.send("lamp", lit=True), drive.send("image"), drive.send("patrol", route="1 0; 1 1")):
        answer = drive.answer(good)
        assert isinstance(answer, Result)
        assert answer.success, answer.reason
    until(lambda: drive.state("pose y") == pytest.approx(1.0, abs=0.01), 5)
    assert [e.kind for e in drive.heard if isinstance(e, Product)] == ["image"]
    assert drive.state("battery") == pytest.approx(100, abs=5)
    assert drive.state("base-state") == "ok"


def test_an_abort_stops_the_robot(drive: Drive) -> None:
    command = drive.send("navigate", x=80.0, y=0.0)
    until(lambda: drive.state("speed") == 2.0)
    drive.rover.abort(command)
    assert isinstance(drive.answer(command), Acknowledgement)
    until(lambda: drive.state("speed") == 0.0, 5)
    place = drive.state("pose x")
    time.sleep(0.5)
    assert drive.state("pose x") == place


def test_a_server_that_dies_has_lost_the_goal(ros: Ros) -> None:
    server = ros.start(EXAMPLE / "turtle_server.py")
    drive = Drive(ros.bridge(), ros.folder / "run")
    command = drive.send("navigate", x=80.0, y=0.0)
    until(lambda: drive.state("speed") == 0.5)
    server.send_signal(signal.SIGINT)
    lost = drive.answer(command)
    assert isinstance(lost, Result)
    assert lost.reason.startswith("lost: the action server /navigate_to_pose")
    absent = drive.answer(drive.send("navigate", "again", x=1.0, y=0.0))
    assert isinstance(absent, Result)
    assert absent.reason.startswith("absent: the action server /navigate_to_pose")
    ros.start(EXAMPLE / "turtle_server.py", "--speed", "5")
    until(lambda: drive.state("pose x") == 0.0)
    back = drive.answer(drive.send("navigate", "once-more", x=1.0, y=0.0))
    assert isinstance(back, Result)
    assert back.success, back.reason
    drive.rover.close(over=True)


def test_a_bridge_that_comes_back_cancels_what_it_left(ros: Ros) -> None:
    ros.start(EXAMPLE / "turtle_server.py")
    drive = Drive(ros.bridge(), ros.folder / "run")
    drive.send("navigate", x=80.0, y=0.0)
    until(lambda: drive.state("speed") == 0.5)
    ros.processes[-1].kill()
    drive.rover.close()
    again = Drive(ros.bridge(), ros.folder / "again", "again")
    until(lambda: again.state("speed") == 0.0)
    assert "is left over from before" in ros.log()
    again.rover.close(over=True)


FLOOD = """
import math, rclpy
from sensor_msgs.msg import BatteryState
rclpy.init()
node = rclpy.create_node("flood")
told = node.create_publisher(BatteryState, "/battery_state", 10)
messages = [BatteryState(percentage=p) for p in (0.5, math.nan, 7.0)]
while rclpy.ok():
    for message in messages:
        told.publish(message)
"""


def test_a_flood_with_nan_holds_nothing_up(ros: Ros, drive: Drive) -> None:
    script = ros.folder / "flood.py"
    script.write_text(FLOOD)
    for _ in range(2):
        ros.start(script)
    until(lambda: drive.state("battery") == 50.0)
    before = len(drive.heard)
    command = drive.send("navigate", x=2.0, y=0.0)
    answer = drive.answer(command, 20)
    assert isinstance(answer, Result)
    assert answer.success, answer.reason
    batteries = [e for e in drive.heard[before:] if isinstance(e, Update) and "battery" in e.values]
    assert len(batteries) <= 25
    assert all(0 <= float(e.values["battery"]) <= 100 for e in batteries)


CLOCK = """
import time, rclpy
from builtin_interfaces.msg import Time
from rosgraph_msgs.msg import Clock
rclpy.init()
node = rclpy.create_node("world")
told = node.create_publisher(Clock, "/clock", 10)
begun = time.monotonic()
while rclpy.ok():
    t = 1000 + 4 * (time.monotonic() - begun)
    told.publish(Clock(clock=Time(sec=int(t), nanosec=int(t % 1 * 1e9))))
    time.sleep(0.02)
"""


def test_the_rovers_clock_is_that_of_the_simulation(ros: Ros) -> None:
    (ros.folder / "world.py").write_text(CLOCK)
    text = (
        (EXAMPLE / "turtle.yaml")
        .read_text()
        .replace("name: turtle", "name: turtle\nsim_time: true\nrate: 4", 1)
    )
    (ros.folder / "turtle.yaml").write_text(text)
    (ros.folder / "turtle.dictionary.toml").write_text((EXAMPLE / "turtle.dictionary.toml").read_text())
    ros.start(ros.folder / "world.py")
    drive = Drive(ros.bridge(ros.folder / "turtle.yaml"), ros.folder / "run")
    assert drive.rover.wait_ready(5).rate == 4.0
    begun = time.monotonic()
    answer = drive.answer(drive.send("wait", duration_s=16.0))
    took = time.monotonic() - begun
    drive.rover.close(over=True)
    assert isinstance(answer, Result)
    assert answer.success
    assert 3.9 <= took < 8.0


SNIPPETS = vars(script("docs_snippets"))
PAGES = [
    page
    for page in SNIPPETS["guide_pages"]()
    if any("ros" in block.marks for block in SNIPPETS["blocks"](page.read_text(encoding="utf-8")))
]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_what_a_page_does_with_ros_runs_as_it_stands(ros_python: Path, page: Path) -> None:
    assert SNIPPETS["run_page"](page, slow=False, ros=ros_python.parents[1]) == []


def test_the_pages_about_ros_are_among_them() -> None:
    assert {"drive-a-ros2-robot", "drive-in-mujoco", "ros2"} <= {page.stem for page in PAGES}
