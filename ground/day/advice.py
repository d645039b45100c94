"""What can be told of a target before a day: is it in sight, how well is it known, does the arm get there.

Advice to the person who picks; nothing here keeps a target out of a plan. What the rover then finds it tells
as the reason of the task's result.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ground.day.prepare import stands_of
from mission import KeepOut, Pose, Target
from rover_iface.cameras.rig import rig_of
from rover_iface.errors import CameraError, PlacementError
from rover_iface.mobility import settled_pose
from rover_iface.terrain import stereo_covariance

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rover_iface.placement.base_placement import ObservationPoint
    from rover_iface.profile import RoverProfile
    from rover_iface.terrain import Terrain

CAMERA = "navcam"


@dataclass(frozen=True)
class TargetAdvice:
    """What the map says of a target.

    Attributes
    ----------
    range_m
        From the left mast camera at the start.
    hidden
        Why the mast cannot look at it from the start; empty if it can.
    error_m
        95 % error of a first stereo look across and along the line of sight.
    stands
        Where the rover can stand for the instrument, best first.
    refusal
        Why there is no such place; empty if there is one.
    """

    range_m: float
    hidden: str
    error_m: tuple[float, float]
    stands: tuple[ObservationPoint, ...]
    refusal: str

    def lines(self) -> list[str]:
        """Return the advice in sentences for a person."""
        across, along = (100 * e for e in self.error_m)
        told = [
            f"visibility    {self.hidden or f'in sight of the start, {self.range_m:.2f} m away'}",
            f"error         first look {across:.1f} cm across, {along:.1f} cm along the line of sight (95 %)",
        ]
        if not self.stands:
            return [*told, f"reachability  {self.refusal}", "room          none can be told without a stand"]
        best = self.stands[0]
        pose = best.pose
        return [
            *told,
            f"reachability  {best.reach_m:.2f} m from ({pose.x:.2f}, {pose.y:.2f}) heading "
            f"{math.degrees(pose.heading):.0f} degrees, {math.degrees(best.tool_tilt_rad):.0f} degrees "
            "off the surface normal",
            f"room          {len(self.stands)} places to stand, the best worth {best.score:.2f} of 1; "
            f"{100 * best.clearance_m:.0f} cm under the body, slope "
            f"{math.degrees(best.slope_rad):.0f} degrees",
        ]


def target_advice(
    terrain: Terrain,
    profile: RoverProfile,
    start: Pose,
    target: Target,
    *,
    instrument: str = "",
    keep_outs: Sequence[KeepOut] = (),
    count: int = 4,
) -> TargetAdvice:
    """Return what the map says of a target for an instrument, the usual contact instrument when absent.

    Raises
    ------
    OutsideTerrainError
        If target or start lie outside the terrain.
    ProfileError
        If the rover has no such instrument.
    """
    stand = settled_pose(terrain, profile, start.east_m, start.north_m, start.heading_rad)
    point = np.asarray(target.point_site, dtype=np.float64)
    rig, names = rig_of(profile), (f"{CAMERA}_left", f"{CAMERA}_right")
    local = stand.site_from_rover.inverse().apply(point)
    hidden = ""
    try:
        pan, tilt = rig.point_at(local, names[0])
    except CameraError as err:
        # the rover turns for it, so its range and error are those of straight ahead
        hidden, pan, tilt = f"not without a turn of the rover: {err}", 0.0, 0.0
    left, right = (rig.camera(name, pan, tilt).transformed(stand.site_from_rover) for name in names)
    away = float(np.linalg.norm(point - left.C))
    if not hidden and not bool(terrain.line_of_sight(left.C, point)):
        hidden = "the ground hides it from the mast at the start"
    ray = (point - left.C) / away
    spread = stereo_covariance(
        left.C, point, focal_px=left.hs, baseline_m=float(np.linalg.norm(right.C - left.C))
    )
    along = 1.96 * math.sqrt(float(ray @ spread @ ray))
    flat = np.eye(3) - np.outer(ray, ray)
    across = 1.96 * math.sqrt(float(np.linalg.eigvalsh(flat @ spread @ flat)[-1]))
    stands: list[ObservationPoint] = []
    refusal = ""
    try:
        stands = stands_of(terrain, profile, start, target, instrument, keep_outs=keep_outs, count=count)
    except PlacementError as err:
        refusal = str(err)
    return TargetAdvice(away, hidden, (across, along), tuple(stands), refusal)
