"""One plan, unchanged, on three rovers: the same decisions where the world tells the same."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from executive.ports import Result
from executive.runtime import LiveRuntime, LiveSettings
from executive.runtime.session import RunOutcome
from executive.runtime.wire import Address, WireRover
from ground.uplink.flight import fly
from rover_iface.contract import write_contract_world
from rover_iface.registry import find_rover
from tests.ground.live_site import rover_process
from tests.ros2.processes import ROOT, Drive, Ros
from tests.waiting import until

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("ros2")]

EXAMPLE = ROOT / "examples/ros2_mujoco"
PLAN = (EXAMPLE / "plan.crl").read_text("utf-8")


@pytest.fixture
def ros(ros_python: Path, tmp_path: Path) -> Iterator[Ros]:
    made = Ros(ros_python, tmp_path)
    try:
        yield made
    finally:
        made.end()


def decisions(run: RunOutcome) -> list[tuple[str, ...]]:
    """Return what the executive did, in order, without times and without what rovers call their failures."""
    kept = {"start": 1, "choose": 2, "end": 2}
    return [(r.event, *map(str, r.arguments[: kept[r.event]])) for r in run.trace if r.event in kept]


def live(address: Address, folder: Path) -> RunOutcome:
    rover = WireRover(address, run="three", out=folder)
    settings = LiveSettings(rate=rover.wait_ready(40).rate)
    until(lambda: rover.present_state().get("pose x") is not None)
    run = LiveRuntime(PLAN, rover, run_id="three", settings=settings).run()
    rover.wait_for_products(20)
    rover.close(over=True)
    return run


def begin_front(ros: Ros, world: Path, *more: str | Path) -> Path:
    log = ros.folder / "goals.jsonl"
    ros.start("-m", "rover_iface.mujoco.nav2_front", world, "--rate", "8", "--seed", "5", "--log", log, *more)
    return log


def test_one_plan_decides_alike_on_full_on_the_wire_and_through_ros(ros: Ros, tmp_path: Path) -> None:
    world = write_contract_world(tmp_path / "world")
    full = fly(
        PLAN, find_rover("full")(world, out=tmp_path / "full", seed=5), tmp_path / "full", run_id="three"
    )
    with rover_process(Address(tmp_path / "wire.sock")):
        wire = live(Address(tmp_path / "wire.sock"), tmp_path / "wire")
    log = begin_front(ros, world)
    mujoco = live(ros.bridge(EXAMPLE / "rover.yaml"), tmp_path / "ros")

    assert full.outcome.outcome == "SUCCEEDED"
    assert ("choose", "further", "home") in decisions(full.outcome)
    assert decisions(wire) == decisions(full.outcome)
    assert decisions(mujoco) == decisions(full.outcome)
    assert len(list((tmp_path / "ros/products").glob("*.png"))) == 1
    goals = [json.loads(line) for line in log.read_text("utf-8").splitlines()]
    assert [g["how"] for g in goals if g["what"] == "end"] == ["succeeded", "cancelled", "succeeded"]
    x, y = next((g["x"], g["y"]) for g in reversed(goals) if g["what"] == "end")
    assert (x, y) == pytest.approx((0.2, 0.1), abs=0.2)  # a goal passed by 15 cm counts as reached


def test_faults_of_the_front_reach_the_plan_by_name(ros: Ros, tmp_path: Path) -> None:
    log = begin_front(
        ros,
        write_contract_world(tmp_path / "world"),
        "--fault",
        "1:reject",
        "--fault",
        "2:abort",
        "--fault",
        "3:mute",
    )
    drive = Drive(ros.bridge(EXAMPLE / "rover.yaml"), ros.folder / "run")
    until(lambda: drive.state("pose x") is not None)
    answers = [drive.answer(drive.send("navigate", f"go-{k}", x=0.5, y=0.0)) for k in range(3)]
    said = [answer.reason.partition(":")[0] for answer in answers if isinstance(answer, Result)]
    assert said == ["rejected", "aborted", "overdue"]
    drive.rover.close(over=True)
    goals = [json.loads(line) for line in log.read_text("utf-8").splitlines()]
    assert [g["what"] for g in goals] == ["reject", "begin", "end", "begin", "end"]


def test_a_front_without_a_world_says_so(ros: Ros) -> None:
    process = ros.start("-m", "rover_iface.mujoco.nav2_front", ros.folder / "nowhere")
    assert process.wait(timeout=60) == 2
    assert "nav2_front: " in ros.log()
    assert "Traceback" not in ros.log()
