"""How the arm gets to a target without touching anything but the target.

The links are capsules; what they must not touch is a cloud of surface points (the rover frame) and the rover
itself: its body, deck and mast, its wheels. A motion leads from where the arm is by way of a raised posture
to a stand-off above the surface, all joints at once and linear in their angles, and from there along the
normal. Each part is checked at steps of a few centimetres of the fastest link.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from rover_iface.placement.arm import Arm, ArmLimit, ArmRefusal, Posture
from rover_iface.profile import RoverProfile

Array = npt.NDArray[np.float64]

LINKS = ("upper arm", "forearm", "tool")
STEP_RAD = 0.05
APPROACH_STEP_M = 0.01
RAISED = ((-1.1, 2.0), (-0.6, 1.4), (-1.3, 2.6))
"""Shoulder and elbow of the postures that are tried on the way."""


@dataclass(frozen=True, eq=False)
class Obstacles:
    """What the arm must keep off, rover frame.

    Attributes
    ----------
    points
        (n, 3), of the surface that is known.
    boxes
        (m, 2, 3), least and largest corner of parts of the rover, and their names.
    margin_m
        What is kept off points besides the radius of a link.
    """

    points: Array
    boxes: Array
    names: tuple[str, ...]
    margin_m: float = 0.02

    @classmethod
    def of(cls, profile: RoverProfile, cloud: npt.ArrayLike, *, margin_m: float = 0.02) -> Obstacles:
        """Return the obstacles of a rover before a cloud (n, 3), rover frame, m, thinned to one point in 15
        mm.
        """
        points = np.asarray(cloud, dtype=np.float64).reshape(-1, 3)
        points = points[np.isfinite(points).all(axis=1)]
        away = np.linalg.norm(points - np.array(profile.arm.shoulder_m), axis=1)
        points = points[away < profile.arm.reach_m + 0.15]
        if len(points):
            cells = np.unique(np.floor(points / 0.015).astype(np.int64), axis=0, return_index=True)[1]
            points = points[np.sort(cells)]
        boxes, names = rover_boxes(profile)
        return cls(points, boxes, names, margin_m)


def rover_boxes(profile: RoverProfile) -> tuple[Array, tuple[str, ...]]:
    """Return boxes (m, 2, 3) round the parts of a rover that the arm might meet, and their names."""
    body, wheels, mast = profile.body, profile.wheels, profile.mast
    half = body.belly_length_m / 2, body.belly_width_m / 2
    boxes = [((-half[0], -half[1], body.clearance_m), (half[0], half[1], mast.base_m[2]))]
    names = ["body"]
    pole = 0.04
    x, y, low = mast.base_m
    boxes.append(((x - pole, y - pole, low), (x + pole, y + pole, mast.height_m)))
    names.append("mast")
    for side in (1, -1):
        for axle in wheels.axle_x_m:
            middle, r, w = side * wheels.track_m / 2, wheels.radius_m, wheels.width_m / 2
            boxes.append(((axle - r, middle - w, 0.0), (axle + r, middle + w, 2 * r)))
            names.append("wheel")
    return np.array(boxes), tuple(names)


@dataclass(frozen=True, eq=False)
class Motion:
    """A way of the arm that touches nothing before its end.

    Attributes
    ----------
    joints
        (n, 5), postures from start to contact, close enough to be joined linearly.
    approach
        Index of the posture at the stand-off; from there on the tool moves along the normal.
    duration_s
        Of the way to the contact.
    clearance_m
        Least distance to points and rover on the way to the stand-off, link radii taken off.
    tool_tilt_rad
        Angle between tool and normal.
    """

    joints: Array
    approach: int
    duration_s: float
    clearance_m: float
    tool_tilt_rad: float

    @property
    def contact(self) -> Array:
        """Return the posture at the expected contact (5,)."""
        return np.asarray(self.joints[-1])


def clearances(arm: Arm, obstacles: Obstacles, joints: npt.ArrayLike) -> tuple[Array, list[str]]:
    """Return what is left (n,), m, between the links and anything else in postures (n, 5), rad, and what is
    nearest.

    The tool's face may come to the surface: it is rounded off, so that a flat surface on which it stands is
    just touched.
    """
    q = np.atleast_2d(np.asarray(joints, dtype=np.float64))
    places = arm.joint_places(q)
    radii = (arm.profile.link_radius_m, arm.profile.link_radius_m, arm.profile.tool_radius_m)
    best = np.full(len(q), np.inf)
    what = ["nothing"] * len(q)

    def note(gap: Array, text: str) -> None:
        for k in np.flatnonzero(gap < best):
            best[k], what[k] = gap[k], text

    for number, radius in enumerate(radii):
        a, b = places[:, number], places[:, number + 1]
        if number == 2:
            b = b - radius * arm.tool_axis(q)
        if len(obstacles.points):
            gap = _segment_points(a, b, obstacles.points) - radius - obstacles.margin_m
            note(gap, f"the {LINKS[number]} and the ground")
        boxes = _segment_boxes(a, b, obstacles.boxes) - radius
        nearest = boxes.argmin(axis=1)
        for box in np.unique(nearest):
            mine = np.where(nearest == box, boxes[:, box], np.inf)
            note(mine, f"the {LINKS[number]} and the {obstacles.names[box]}")
    gap = _segments(places[:, 0], places[:, 1], places[:, 2], places[:, 3]) - radii[0] - radii[2]
    note(gap, "the tool and the upper arm")
    return best, what


def plan_motion(
    arm: Arm,
    obstacles: Obstacles,
    point: npt.ArrayLike,
    normal: npt.ArrayLike,
    *,
    start: npt.ArrayLike | None = None,
    max_tilt_rad: float | None = None,
) -> Motion | ArmRefusal:
    """Return a way that ends with the tool on a surface point (3,) along its normal (3,), rover frame, m.

    From `start` (5,), rad (the stowed posture when absent). A refusal names the limit, or what would be
    touched and by how much.
    """
    at = np.asarray(point, dtype=np.float64)
    found = arm.solve(at, normal, near=start, max_tilt_rad=max_tilt_rad)
    if isinstance(found, ArmRefusal):
        return found
    begin = np.array(arm.profile.stow_rad if start is None else start, dtype=np.float64)
    axis = arm.tool_axis(found.joints)
    last = _approach(arm, at, axis, found)
    if last is None:
        return ArmRefusal(
            ArmLimit.REACH,
            f"the tool reaches the surface but not the stand-off "
            f"{100 * arm.profile.standoff_m:.0f} cm above it",
        )
    worst = ArmRefusal(ArmLimit.COLLISION, "no way was tried")
    least = -math.inf
    for branch in last:
        gaps, what = clearances(arm, _without(obstacles, at, axis, arm), branch)
        if gaps.min() < 0.0:
            k = int(gaps.argmin())
            if gaps[k] > least:
                least, worst = float(gaps[k]), _touching(gaps[k], what[k], "on the way along the normal")
            continue
        for via in _vias(begin, branch[0]):
            way = np.concatenate([_joined(a, b)[:-1] for a, b in pairwise((begin, *via, branch[0]))])
            gaps, what = clearances(arm, obstacles, way)
            # the stowed posture is where it is, whatever is near
            ahead = gaps[1:]
            if not len(ahead) or ahead.min() >= 0.0:
                joints = np.concatenate((way, branch))
                seconds = np.abs(np.diff(np.vstack((way, branch[:1])), axis=0)).max(axis=1).sum()
                duration = (
                    seconds / arm.profile.joint_rate_rad_s + arm.profile.standoff_m / arm.profile.approach_m_s
                )
                room = float(ahead.min()) if len(ahead) else float(gaps.min())
                return Motion(joints, len(way), float(duration), room, found.tool_tilt_rad)
            k = 1 + int(ahead.argmin())
            if gaps[k] > least:
                least, worst = float(gaps[k]), _touching(gaps[k], what[k], "on the way to the stand-off")
    return worst


def _touching(gap: float, what: str, where: str) -> ArmRefusal:
    return ArmRefusal(
        ArmLimit.COLLISION, f"{what} would come {-1000 * gap:.0f} mm closer than allowed {where}"
    )


def _approach(arm: Arm, at: Array, axis: Array, found: Posture) -> list[Array] | None:
    """Return the ways from stand-off to contact (n, 5), one for each branch that is allowed throughout."""
    count = max(2, math.ceil(arm.profile.standoff_m / APPROACH_STEP_M) + 1)
    above = np.linspace(arm.profile.standoff_m, 0.0, count)
    ways = arm.inverse(at - above[:, None] * axis, np.broadcast_to(axis, (count, 3)))
    usable = ways.allowed.all(axis=0)
    out = []
    for branch in np.flatnonzero(usable):
        joints = ways.joints[:, branch]
        if np.abs(np.diff(joints, axis=0)).max() < 0.6:
            out.append(joints)
    out.sort(key=lambda joints: float(np.abs(joints[-1] - found.joints).max()))
    return out or None


def _vias(begin: Array, end: Array) -> list[list[Array]]:
    """Return lists of postures on the way: none, or the arm raised, turned, then lowered."""
    ways: list[list[Array]] = []
    for shoulder, elbow in RAISED:
        up = np.array([begin[0], shoulder, math.copysign(elbow, begin[2]), begin[3], begin[4]])
        over = np.array([end[0], shoulder, math.copysign(elbow, end[2]), end[3], end[4]])
        ways.append([up, over])
    return [*ways, []]


def _joined(a: Array, b: Array) -> Array:
    count = max(2, math.ceil(float(np.abs(b - a).max()) / STEP_RAD) + 1)
    return np.asarray(a + np.linspace(0.0, 1.0, count)[:, None] * (b - a))


def _without(obstacles: Obstacles, at: Array, axis: Array, arm: Arm) -> Obstacles:
    """Return the obstacles without the patch that the tool is put on: that it is flat is judged before."""
    away = obstacles.points - at
    along = away @ axis
    across = np.linalg.norm(away - along[:, None] * axis, axis=1)
    radius = arm.profile.tool_radius_m + obstacles.margin_m + 0.015
    patch = (across < radius) & (along > -obstacles.margin_m)
    return Obstacles(obstacles.points[~patch], obstacles.boxes, obstacles.names, obstacles.margin_m)


def _segment_points(a: Array, b: Array, points: Array) -> Array:
    """Return the least distance (n,) from segments a-b (n, 3) to points (m, 3)."""
    way = b - a
    length2 = np.maximum((way**2).sum(axis=1), 1e-12)
    out = np.empty(len(a))
    for k in range(len(a)):
        gap = points - a[k]
        t = np.clip(gap @ way[k] / length2[k], 0.0, 1.0)
        gap -= t[:, None] * way[k]
        out[k] = math.sqrt(float(np.einsum("ij,ij->i", gap, gap).min()))
    return out


def _segment_boxes(a: Array, b: Array, boxes: Array) -> Array:
    """Return distances (n, m) from segments a-b (n, 3) to boxes (m, 2, 3), sampled every few centimetres."""
    t = np.linspace(0.0, 1.0, 12)[:, None, None]
    at = a + t * (b - a)
    outside = np.maximum(0.0, np.maximum(boxes[:, 0] - at[:, :, None, :], at[:, :, None, :] - boxes[:, 1]))
    return np.asarray(np.linalg.norm(outside, axis=-1).min(axis=0))


def _segments(a: Array, b: Array, c: Array, d: Array) -> Array:
    """Return the least distance (n,) between segments a-b and c-d (n, 3), sampled along the first."""
    t = np.linspace(0.0, 1.0, 16)[:, None, None]
    at = a + t * (b - a)
    way = d - c
    s = np.clip(((at - c) * way).sum(axis=-1) / np.maximum((way**2).sum(axis=-1), 1e-12), 0.0, 1.0)
    return np.asarray(np.linalg.norm(at - c - s[..., None] * way, axis=-1).min(axis=0))
