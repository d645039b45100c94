"""Whether a placement can truly be done is read off the triangles and the arm's joints alone."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from rover_iface.frames import Pose
from rover_iface.placement.arm import Arm
from rover_iface.profile import load_profile
from rover_iface.simulator.render.scene import Material, Scene, SceneMesh
from studies.common.true_surface import (
    OUT_OF_REACH,
    SAFE,
    UNSAFE,
    TrueLimits,
    body_at,
    possible,
    true_patch,
)

ARM = Arm(load_profile("k9").arm)
AHEAD_M, TOP_M = 1.05, 0.25
HERE = Pose(0.0, 0.0)
BOX = trimesh.creation.box((1.0, 1.0, 1.0))
SIDES = np.asarray(BOX.faces)
AHEAD, LEFT, UP = np.eye(3)
CORNERS = np.asarray(BOX.vertices) + 0.5 * UP
TOP = AHEAD_M * AHEAD + TOP_M * UP


def block(name: str, x: float, y: float, z: float, side: float, height: float) -> SceneMesh:
    return SceneMesh(CORNERS * (side, side, height) + (x, y, z), SIDES, name, Material.ROCK, smooth=False)


def scene(*others: SceneMesh) -> Scene:
    ground = block("", 0.0, 0.0, -1.0, 18.0, 1.0)
    return Scene([ground, block("rock", AHEAD_M, 0.0, 0.0, 0.3, TOP_M), *others])


def asked(where: Scene, point: np.ndarray, *stands: Pose) -> tuple[str, str]:
    found = possible(where, ARM, stands or (HERE,), point, 0.01, TrueLimits())
    return found.answer, found.why


def test_the_body_and_normal_under_a_point_are_told() -> None:
    body, normal = body_at(scene(), TOP)
    assert body == 1
    assert normal == pytest.approx((0.0, 0.0, 1.0))
    side, normal = body_at(scene(), np.array([AHEAD_M - 0.15, 0.0, 0.1]))
    assert side == 1
    assert normal == pytest.approx((-1.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="no surface"):
        body_at(scene(), TOP + 0.05 * UP)


def test_the_middle_of_a_flat_top_is_safe_and_in_reach() -> None:
    assert asked(scene(), TOP) == (SAFE, "")


def test_a_rim_is_unsafe_but_a_place_just_within_the_distance_is_taken() -> None:
    radius_m = ARM.profile.tool_radius_m
    rim = TOP + (0.15 - radius_m + 0.012) * LEFT
    assert asked(scene(), rim) == (UNSAFE, "missed, edge")
    assert asked(scene(), rim - 0.008 * LEFT) == (SAFE, "")


def test_what_stands_beside_the_tool_is_unsafe() -> None:
    knob = block("other", AHEAD_M + 0.015, 0.0, TOP_M, 0.02, 0.03)
    answer, why = asked(scene(knob), TOP - 0.01 * AHEAD)
    assert answer == UNSAFE
    assert "protrusion" in why


def test_a_safe_place_is_out_of_reach_from_afar_and_in_reach_from_the_other_stand() -> None:
    afar = Pose(-2.0, 0.0)
    answer, why = asked(scene(), TOP, afar)
    assert answer == OUT_OF_REACH
    assert "shoulder" in why
    assert asked(scene(), TOP, afar, HERE) == (SAFE, "")


def test_an_arm_that_would_meet_the_ground_does_not_reach() -> None:
    # a wall between the rover and the rock, higher than the arm can come over
    wall = SceneMesh(
        CORNERS * (0.05, 3.0, 1.5) + (AHEAD_M - 0.3, 0.0, 0.0), SIDES, "wall", Material.ROCK, smooth=False
    )
    answer, why = asked(scene(wall), TOP)
    assert answer == OUT_OF_REACH
    assert "touched the ground" in why


def test_a_step_under_the_tool_is_measured_as_it_is() -> None:
    step = block("rock2", AHEAD_M, 0.0, TOP_M, 0.3, 0.01)
    found = true_patch(scene(step), 2, TOP + 0.01 * UP, UP, 0.03, TrueLimits())
    assert found.wrong == ()
    assert found.protrusion_m == pytest.approx(0.0, abs=1e-4)
