"""What a placement of the tool must keep."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rover_iface.errors import PlacementError


@dataclass(frozen=True, slots=True)
class SafetyLimits:
    """What a placement must keep.

    Attributes
    ----------
    tool_radius_m
        Of the circle round the contact face; the profile's when None.
    margin_m, calm_margin_m
        Added to the radius: the tool may come down this far from where it was meant to. The first holds for
        what is safe, the second for what is calm.
    most_protrusion_m, most_depth_m
        How far the surface under the tool may stand over the plane, and fall below it.
    most_beside_m
        How far anything in the ring of `calm_margin_m` round a safe surface, or leaning over it, may stand
        over the plane.
    most_rms_m
        Root mean square deviation from the plane, above what stereo errs.
    calm, calm_hole_m, calm_doubt, calm_normal_rad
        A surface is calm if, within `calm_margin_m` of the tool, its relief (protrusion, depth, roughness)
        keeps this share of its limits, no hole is wider and no larger share lies beside a step; and if its
        normal is that certain. The nearest calm point is taken, and where there is none the safe one of
        least strain.
    most_strain
        Largest share of any limit that a safe surface which is not calm may take, the designated point or
        another; those of relief and holes are taken to `calm_margin_m`.
    close_relief, close_hole_m, close_doubt
        With a second cloud, where nothing is safe, points beside steps are left out of the relief, and a
        cloud that does not know the place is not asked (`JointCheck.close_strain`): the relief may then take
        this share of its limits, the largest hole of both clouds together and the share beside a step may
        be no more than these.
    sigmas, beside_sigmas
        How many standard deviations of stereo's error are counted against the placement; of the normal by the
        narrow pair at a place beside the designated point. That is the first of dozens which keep the limits,
        so it errs in its own favour more often than one that was drawn: rock 43134, 20.7 degrees steep. Both
        `most_normal_rad` and the slope are asked with them: rock 44440, over a slit, had 4.6 degrees.
    most_normal_rad
        Uncertainty of the normal, that many standard deviations.
    least_share, most_hole_m
        Share of the area with valid stereo, diameter of the largest hole; where a step is near (more than
        `calm_doubt`), `calm_hole_m` holds, because the surface may end in the hole.
    edge_px, edge_jump_m, most_doubt
        Points within so many pixels of a step of this size behind them are not counted as seen: block
        matching draws the foreground over its edge. At most this share of the surface may be such.
    most_view_rad
        Angle between line of sight and normal.
    least_rock_share
        Share of the points under the tool that belong to the same rock.
    most_slope_rad, calm_slope_rad
        Angle between normal and approach axis, or between normal and tool as the arm can hold it; the
        normal's uncertainty is added. A calm point where the tool stands steeper than the second is taken
        only if there is no other.
    tool_length_m, clear_m
        Up to this height over the surface, and so much further, nothing may stand beside the tool or over the
        surface.
    most_hidden
        Share of the tool's path that may lie behind what the camera sees.
    most_crease_m
        How far the surface may fall below straight lines from the designated point, and from beyond it, to
        another: where two rocks touch it falls into a crease.
    search_m
        How far from the designated point another may be taken.
    grid_m
        Distance between the points that are tried.
    """

    tool_radius_m: float | None = None
    margin_m: float = 0.004
    calm_margin_m: float = 0.008
    most_protrusion_m: float = 0.018
    most_depth_m: float = 0.0225
    most_beside_m: float = 0.030
    most_rms_m: float = 0.008
    calm: float = 0.66
    calm_hole_m: float = 0.012
    calm_doubt: float = 0.01
    calm_normal_rad: float = math.radians(10.0)
    most_strain: float = 0.85
    close_relief: float = 0.85
    close_hole_m: float = 0.0085
    close_doubt: float = 0.085
    sigmas: float = 2.0
    beside_sigmas: float = 3.0
    most_normal_rad: float = math.radians(12.0)
    least_share: float = 0.90
    most_hole_m: float = 0.024
    edge_px: int = 3
    edge_jump_m: float = 0.035
    most_doubt: float = 0.20
    most_view_rad: float = math.radians(70.0)
    least_rock_share: float = 0.985
    most_slope_rad: float = math.radians(14.0)
    calm_slope_rad: float = math.radians(11.0)
    tool_length_m: float = 0.14
    clear_m: float = 0.03
    most_hidden: float = 0.04
    most_crease_m: float = 0.015
    search_m: float = 0.15
    grid_m: float = 0.008

    def __post_init__(self) -> None:
        if self.tool_radius_m is not None and not self.tool_radius_m > 0:
            raise PlacementError(f"tool radius is {self.tool_radius_m} m; it must be positive")
        for name in ("margin_m", "calm_margin_m", "search_m", "calm_hole_m", "calm_doubt"):
            if getattr(self, name) < 0:
                raise PlacementError(f"{name} is {getattr(self, name)} m; it must not be negative")
        for name in (
            "most_protrusion_m",
            "most_depth_m",
            "most_beside_m",
            "most_rms_m",
            "most_hole_m",
            "grid_m",
        ):
            if not getattr(self, name) > 0:
                raise PlacementError(f"{name} is {getattr(self, name)} m; it must be positive")
        if not 0 <= self.calm <= 1:
            raise PlacementError(f"calm is {self.calm}; it must lie between 0 and 1")
        if not 0 < self.least_share <= 1 or not 0 <= self.least_rock_share <= 1:
            raise PlacementError(
                f"shares of valid stereo {self.least_share} and of rock {self.least_rock_share} "
                "must lie between 0 and 1"
            )
