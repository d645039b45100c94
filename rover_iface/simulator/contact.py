"""What happens to the arm on the true ground: contact of the tool, and links that touch what they should not.

The tool's face carries three spring-loaded sensors; moving along its axis stops at the first that touches
(Pedersen, Smith, Deans and others 2005, section 3: they "report contact with a target").
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_iface.frames import Transform
from rover_iface.placement.arm import Arm, ArmRefusal
from rover_iface.placement.arm_motion import LINKS, Motion
from rover_iface.profile.parts import Arm as ArmFigures
from rover_iface.simulator.render.scene import Scene

Array = npt.NDArray[np.float64]

SENSORS = 3
EARLY_M = 0.03
"""Contact so far before the expected surface is not a placement: something else was touched."""


@dataclass(frozen=True, eq=False)
class Touch:
    """How a placement ended.

    Attributes
    ----------
    made
        Whether the tool stands on the surface.
    reason
        Why not.
    point
        (3,), surface point under the middle of the tool, true site frame; NaN without one.
    site_from_tool
        Where the tool stopped, true site frame.
    beyond_m
        How far beyond the expected surface it stopped (negative: before).
    """

    made: bool
    reason: str
    point: Array
    site_from_tool: Transform
    beyond_m: float


def place_tool(
    scene: Scene, arm: Arm, site_from_rover: Transform, motion: Motion, *, rng: np.random.Generator
) -> Touch:
    """Return what comes of a planned motion on the true ground; `site_from_rover` is where the rover is.

    The arm's error is drawn once, normal with half of `accuracy_m` along each axis and cut off at it.
    """
    profile = arm.profile
    error = np.clip(0.5 * rng.standard_normal(3), -1.0, 1.0) * profile.accuracy_m
    off = Transform(np.eye(3), error)
    at_standoff = site_from_rover * off * arm.tool_pose(motion.joints[motion.approach])
    hit = links_hit(scene, arm, site_from_rover, motion.joints[: motion.approach + 1])
    if hit:
        return Touch(False, hit, np.full(3, np.nan), at_standoff, math.nan)
    return press(scene, profile, at_standoff)


def press(scene: Scene, profile: ArmFigures, at_standoff: Transform) -> Touch:
    """Return what comes of moving a tool along its axis (x) from its stand-off until a sensor touches."""
    axis = at_standoff.rotation[:, 0]
    angles = math.tau * np.arange(SENSORS) / SENSORS
    ring = 0.8 * profile.tool_radius_m * np.stack((np.zeros(SENSORS), np.cos(angles), np.sin(angles)), axis=1)
    starts = np.vstack((at_standoff.translation, at_standoff.apply(ring)))
    ranges = scene.ranges(starts, np.broadcast_to(axis, starts.shape))
    expected = profile.standoff_m
    travel = float(ranges[1:].min())
    if not travel <= expected + profile.overtravel_m:
        moved = expected + profile.overtravel_m
        stopped = Transform(at_standoff.rotation, at_standoff.translation + moved * axis)
        over = 1000 * profile.overtravel_m
        return Touch(
            False,
            f"no contact within {over:.0f} mm beyond the expected surface",
            np.full(3, np.nan),
            stopped,
            profile.overtravel_m,
        )
    stopped = Transform(at_standoff.rotation, at_standoff.translation + travel * axis)
    beyond = travel - expected
    point = starts[0] + float(ranges[0]) * axis
    if beyond < -EARLY_M:
        why = f"contact {-1000 * beyond:.0f} mm before the expected surface; {1000 * EARLY_M:.0f} are allowed"
        return Touch(False, why, point, stopped, beyond)
    return Touch(True, "", point, stopped, beyond)


def held(scene: Scene, arm: Arm, site_from_rover: Transform, point: Array, normal: Array) -> Transform | str:
    """Return the pose of the tool at its stand-off over a surface point (3,) with the outward unit normal
    (3,), site frame, m, or why the arm cannot hold it there.

    Of the postures from which the tool can be moved to the surface, one in which no link meets the ground.
    """
    rover_from_site = site_from_rover.inverse()
    at = np.asarray(rover_from_site.apply(point), dtype=np.float64)
    found = arm.solve(at, rover_from_site.rotate(normal))
    if isinstance(found, ArmRefusal):
        return found.reason
    axis = arm.tool_axis(found.joints)
    ways = arm.inverse(np.stack((at - arm.profile.standoff_m * axis, at)), np.stack((axis, axis)))
    branches = np.flatnonzero(ways.allowed.all(axis=0))
    hit = f"the arm does not reach the stand-off {100 * arm.profile.standoff_m:.0f} cm above the surface"
    for branch in branches:
        joints = ways.joints[0, branch]
        hit = links_hit(scene, arm, site_from_rover, joints)
        if not hit:
            return site_from_rover * arm.tool_pose(joints)
    return hit


def links_hit(scene: Scene, arm: Arm, site_from_rover: Transform, joints: npt.ArrayLike) -> str:
    """Return which link meets the true ground in postures (n, 5), or an empty string.

    Six lines along the outside of each link and its middle line are cast.

    Joints in rad, in the order of `Arm`.
    """
    q = np.atleast_2d(np.asarray(joints, dtype=np.float64))
    places = np.asarray(site_from_rover.apply(arm.joint_places(q)), dtype=np.float64)
    radii = (arm.profile.link_radius_m, arm.profile.link_radius_m, arm.profile.tool_radius_m)
    turns = math.tau * np.arange(6) / 6
    for number, radius in enumerate(radii):
        a, b = places[:, number], places[:, number + 1]
        length = np.linalg.norm(b - a, axis=1)
        axis = (b - a) / length[:, None]
        side = np.cross(axis, np.where(np.abs(axis[:, 2:]) < 0.9, (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)))
        side /= np.linalg.norm(side, axis=1, keepdims=True)
        other = np.cross(axis, side)
        rim = np.cos(turns)[:, None, None] * side + np.sin(turns)[:, None, None] * other
        starts = np.concatenate((a[None], a + radius * rim)).reshape(-1, 3)
        ways = np.broadcast_to(axis, (7, *axis.shape)).reshape(-1, 3)
        far = scene.ranges(starts, np.ascontiguousarray(ways)).reshape(7, -1)
        if (far < length).any():
            return f"the {LINKS[number]} touched the ground on the way"
    return ""
