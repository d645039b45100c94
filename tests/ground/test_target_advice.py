"""Advice on targets before a day: figures where it can be done, the reason where it cannot."""

from __future__ import annotations

import math

import numpy as np
import pytest
from typer.testing import CliRunner

from ground.cli.main import app, register_all
from ground.day.advice import target_advice
from mission import Pose, Target
from rover_iface.errors import OutsideTerrainError
from rover_iface.profile import load_profile
from tests.rover_iface.worlds import plane

START = Pose(0.0, 0.0, 0.0)


def target(east: float, north: float, normal: tuple[float, float, float] = (0.0, 0.0, 1.0)) -> Target:
    return Target("T", "T", (east, north, 0.0), normal)


def test_a_target_on_flat_ground_is_in_sight_reached_and_known_by_its_range() -> None:
    profile = load_profile("k9")
    near, far = (target_advice(plane(), profile, START, target(x, 0.0)) for x in (4.0, 8.0))
    assert near.hidden == ""
    assert near.stands
    assert near.refusal == ""
    # along the line of sight the error grows with the square of the range
    ratio = (far.range_m / near.range_m) ** 2
    assert far.error_m[1] / near.error_m[1] == pytest.approx(ratio, rel=0.02)
    assert far.error_m[0] / near.error_m[0] == pytest.approx(far.range_m / near.range_m, rel=0.02)
    for stand in near.stands:
        assert math.hypot(stand.pose.x - 4.0, stand.pose.y) < 1.7


def test_a_face_that_no_tool_meets_is_told_and_still_has_its_other_figures() -> None:
    down = target(4.0, 0.0, (0.0, 0.0, -1.0))
    advice = target_advice(plane(), load_profile("k9"), START, down)
    assert not advice.stands
    assert "off the surface normal" in advice.refusal
    assert any("surface normal" in line for line in advice.lines())
    assert np.isfinite(advice.error_m).all()


def test_a_target_behind_the_mast_is_told_to_need_a_turn() -> None:
    advice = target_advice(plane(), load_profile("k9"), START, target(-5.0, 0.0))
    assert "turn of the rover" in advice.hidden
    assert advice.stands


def test_a_target_outside_the_terrain_is_refused() -> None:
    with pytest.raises(OutsideTerrainError):
        target_advice(plane(), load_profile("k9"), START, target(500.0, 0.0))


def test_the_command_says_the_four_things() -> None:
    register_all()
    told = CliRunner().invoke(app, ["target", "check", "4", "1", "--seed", "3"])
    assert told.exit_code == 0, told.output
    assert [line.split()[0] for line in told.output.splitlines()] == [
        "visibility",
        "error",
        "reachability",
        "room",
    ]
