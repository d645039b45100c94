"""Errors inside actions: each ends its own action as failed, and nothing else."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from executive.ports import Command, CommandId, Result
from rover_iface.contract import write_contract_world
from rover_iface.simulator.engine import INTERNAL_ERROR
from rover_iface.simulator.subframe_rover import make_rover
from rover_iface.simulator.terrain_rover import TerrainRover
from rover_iface.vision.tracker import StereoView


def do(rover: TerrainRover, name: str, action: str, **parameters: Any) -> Result:
    rover.send(Command(CommandId("run", name, 1), action, parameters))
    while True:
        event = rover.next_event(None)
        assert event is not None
        if isinstance(event, Result) and event.command.task == name:
            return event


@pytest.fixture
def rover(tmp_path: Path) -> TerrainRover:
    return make_rover(write_contract_world(tmp_path / "world"), seed=4, out=tmp_path / "run")


def test_an_error_in_an_action_ends_it_with_its_reason_and_is_logged(
    rover: TerrainRover, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert do(rover, "see", "trackstart", target="T1").success

    def broken(target: str, view: StereoView) -> None:
        raise AssertionError("no anchor")

    with monkeypatch.context() as patched:
        patched.setattr(rover.repertoire.follower.tracker, "update", broken)
        answer = do(rover, "go", "navigate", target="T1", mode="track")
    assert (answer.success, answer.reason) == (False, INTERNAL_ERROR)
    told = (tmp_path / "run" / "rover.log").read_text(encoding="utf-8")
    assert "navigate of task go" in told
    assert "AssertionError: no anchor" in told
    assert do(rover, "on", "navigate", target="T1", mode="track").success


def test_an_error_while_an_action_is_given_up_does_not_get_out(
    rover: TerrainRover, monkeypatch: pytest.MonkeyPatch
) -> None:
    inner = rover.hardware.drive

    def drive(way: Any) -> Any:
        try:
            return (yield from inner(way))
        finally:
            raise RuntimeError("brakes")

    monkeypatch.setattr(rover.hardware, "drive", drive)
    going = Command(CommandId("run", "go", 1), "navigate", {"x": 5.0, "y": 0.0, "mode": "blind"})
    rover.send(going)
    while rover.next_event(5_000) is not None:
        pass
    rover.abort(going.id)
    assert rover.next_event(5_000) is not None
    assert do(rover, "wait", "wait", duration_s=1.0).success
