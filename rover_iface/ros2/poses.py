"""Poses between the site frame and the frames of ROS, and the newest transforms of `/tf`."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from rover_iface.errors import FrameError
from rover_iface.frames import Pose, Transform, quaternion_of, rotation_from_quaternion, rotation_rpy
from rover_iface.ros2.field_paths import AbsentError
from rover_iface.ros2.mapping import Site

FARTHEST_M = 1e7
"""Coordinates beyond are not places: the circumference of Mars is 2.1e7 m."""
LONGEST_CHAIN = 100
"""Frames from one end of a tree to the other; a longer way is a circle."""


@dataclass(frozen=True, slots=True)
class RosPose:
    """A pose as ROS has it: position, metres, and quaternion (w, x, y, z), in a frame."""

    frame: str
    position: tuple[float, float, float]
    quaternion: tuple[float, float, float, float]


def ros_from_site(site: Site) -> Transform:
    """Return the transform from the site frame to the frame of ROS in which it lies."""
    return Transform(rotation_rpy(0, 0, site.yaw_rad), np.array([site.x_m, site.y_m, site.z_m]))


def ros_pose(site: Site, x: float, y: float, heading_rad: float) -> RosPose:
    """Return the pose for ROS of a place in the site frame, metres and radians."""
    place = ros_from_site(site) * Pose(x, y, 0.0, heading_rad).site_from_rover
    px, py, pz = (float(v) for v in place.translation)
    return RosPose(site.frame, (px, py, pz), quaternion_of(place.rotation))


def transform_of(message: Any) -> Transform:
    """Return the transform in a Pose, PoseWithCovariance, Transform or their stamped forms.

    Raises
    ------
    AbsentError
        If it is none of them, or no rigid motion: a NaN, a quaternion of no length, a place off the planet.
    """
    for inner in ("pose", "transform", "pose"):
        message = getattr(message, inner, message)
    place: Any = getattr(message, "position", getattr(message, "translation", None))
    turn: Any = getattr(message, "orientation", getattr(message, "rotation", None))
    try:
        numbers = [float(v) for v in (place.x, place.y, place.z, turn.w, turn.x, turn.y, turn.z)]
    except (AttributeError, TypeError, ValueError) as err:
        raise AbsentError(f"a {type(message).__name__} is not a pose") from err
    if not all(map(math.isfinite, numbers)):
        raise AbsentError("the pose has a number that is not finite")
    if max(map(abs, numbers)) > FARTHEST_M:
        raise AbsentError(f"the pose lies farther than {FARTHEST_M:g} m away")
    try:
        return Transform(rotation_from_quaternion(*numbers[3:]), np.array(numbers[:3]))
    except FrameError as err:
        raise AbsentError(str(err)) from err


class TransformTree:
    """The newest transforms that were told, and ways through them; nothing is interpolated."""

    def __init__(self) -> None:
        self._above: dict[str, tuple[str, Transform]] = {}
        """For each frame its parent and `parent_from_frame`."""

    def take(self, messages: Iterable[Any]) -> list[str]:
        """Take in messages of the type TFMessage; return what could not be used."""
        wrong = []
        for message in messages:
            for stamped in getattr(message, "transforms", ()):
                child, parent = _bare(stamped.child_frame_id), _bare(stamped.header.frame_id)
                try:
                    self._above[child] = (parent, transform_of(stamped))
                except AbsentError as err:
                    wrong.append(f"the transform from {parent} to {child}: {err}")
        return wrong

    def find(self, to: str, of: str) -> Transform | None:
        """Return `to_from_of`, None if the two are not joined."""
        ups, downs = self._way_up(_bare(of)), self._way_up(_bare(to))
        for frame, up in ups.items():
            if frame in downs:
                return downs[frame].inverse() * up
        return None

    def _way_up(self, frame: str) -> dict[str, Transform]:
        """Return each frame above one with `above_from_frame`, the frame itself first."""
        way = {frame: Transform.identity()}
        while frame in self._above and len(way) < LONGEST_CHAIN:
            parent, step = self._above[frame]
            if parent in way:
                break
            way[parent] = step * way[frame]
            frame = parent
        return way


def _bare(frame: str) -> str:
    return frame.removeprefix("/")


def pose_in_site(site: Site, tree: TransformTree, frame: str, there: Transform) -> Pose:
    """Return a pose that was told in some frame of ROS.

    Raises
    ------
    AbsentError
        If no transform leads from that frame to that of the site.
    """
    known = Transform.identity() if _bare(frame) == _bare(site.frame) else tree.find(site.frame, frame)
    if known is None:
        raise AbsentError(f"the pose is in frame {frame!r}, and no transform leads to {site.frame!r}")
    return Pose.from_transform(ros_from_site(site).inverse() * known * there)


def part(pose: Pose, of: str) -> float:
    """Return x, y, z (m) or heading (rad)."""
    return float(getattr(pose, of))
