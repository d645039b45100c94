"""What the mast's narrow pair says of a place before the tool touches it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from rover_iface.placement.cloud import Array, SurfaceCloud
from rover_iface.placement.fused_check import FusedOptions, FusedSurface, carried_labels, fuse
from rover_iface.placement.joint_check import JointCheck
from rover_iface.placement.patch_check import Judged, PatchCheck
from rover_iface.placement.second_labels import SAME_PLACE_M, SECOND_EDGE_PX
from rover_iface.placement.verdict import Finding, Reason
from rover_iface.profile import RoverProfile

NarrowLook = Callable[[Array], SurfaceCloud | None]
"""Asked for a point (3,), rover frame, m: gives what the narrow pair ranges round it, registered to the other
clouds, None where that is not to be had."""

LOOK_REACH_M = 0.025
"""A look tells of places up to so far from where it was pointed: both frames hold 13 cm there, and the mast
points to a centimetre."""

MOST_LOOKS = 6
"""How often the narrow pair is pointed for one placement."""


class Sight(StrEnum):
    """What a narrow look says of a place."""

    GOOD = "good"
    BAD = "bad"
    UNKNOWN = "unknown"


@dataclass(frozen=True, eq=False)
class Opinion:
    """What a narrow look says of a place; where that is good, the place as it has it."""

    sight: Sight
    judged: Judged | None = None
    finding: Finding | None = None


UNSEEN = Opinion(Sight.UNKNOWN)


class NarrowLooks:
    """Asks for narrow looks as they are needed and judges places by them.

    Parameters
    ----------
    joint
        The check by the other clouds.
    look
        Asked at most `MOST_LOOKS` times; None where there is no narrow pair.
    """

    def __init__(
        self,
        joint: JointCheck,
        look: NarrowLook | None,
        profile: RoverProfile,
        options: FusedOptions | None = None,
    ) -> None:
        self.joint, self.look, self.profile = joint, look, profile
        self.options = options or FusedOptions()
        self._looks: list[tuple[Array, PatchCheck | None]] = []
        self._known: dict[tuple[int, bytes], Opinion] = {}

    @property
    def left(self) -> int:
        """Return how many more looks may be asked for."""
        return 0 if self.look is None else MOST_LOOKS - len(self._looks)

    def told(self, point: Array) -> bool:
        """Return whether a look was pointed near a place (3,), whatever it told."""
        return bool(self._near(point))

    @property
    def blind(self) -> bool:
        """Return whether there is no narrow pair. One that brought nothing of a place does not know it."""
        return self.look is None

    def opinion(self, point: Array, *, anew: bool = False) -> Opinion:
        """Return what the looks say of a place (3,), rover frame, m; `anew` asks for one where none tells."""
        near = self._near(point)
        if not near and anew and self.left > 0:
            near = [self._pointed(point)]
        check = next((one for one in near if one is not None), None)
        if check is None:
            return UNSEEN
        # the search comes by the same places more than once
        key = id(check), point.tobytes()
        if key not in self._known:
            self._known[key] = self._judged(check, point)
        return self._known[key]

    def _near(self, point: Array) -> list[PatchCheck | None]:
        away = [(float(np.linalg.norm(at - point)), k) for k, (at, _) in enumerate(self._looks)]
        return [self._looks[k][1] for far, k in sorted(away) if far <= LOOK_REACH_M]

    def _pointed(self, point: Array) -> PatchCheck | None:
        assert self.look is not None
        cloud = self.look(point)
        check = None
        if cloud is not None and len(cloud) and cloud.eye is not None:
            known = self.joint.checks[-1]
            labels = carried_labels(cloud, known, SAME_PLACE_M)
            limits = replace(self.joint.limits, edge_px=SECOND_EDGE_PX)
            check = PatchCheck(cloud, labels, known.label, self.profile, limits, known.axis)
        self._looks.append((np.asarray(point), check))
        return check

    def _judged(self, narrow: PatchCheck, point: Array) -> Opinion:
        surface = fuse([narrow, *reversed(self.joint.checks)], point, self.options)
        if surface is None or surface.narrow_share < self.options.least_narrow_share:
            return UNSEEN
        why = self._relief(surface)
        if why is not None:
            return Opinion(Sight.BAD, finding=why)
        if (
            surface.hole_m > self.options.most_hole_m
            or surface.ending_m > self.options.most_ending_m
            or surface.rock_share < self.options.least_rock_share
            or not self._free(narrow, surface)
        ):
            return UNSEEN
        judged = self._as_judged(narrow, surface)
        return UNSEEN if judged is None else Opinion(Sight.GOOD, judged)

    def _relief(self, surface: FusedSurface) -> Finding | None:
        options, sure = self.options, self._sure(surface)
        for reason, value, limit in (
            (Reason.EDGE, surface.depth_m + sure, options.most_depth_m),
            (Reason.EDGE, surface.rim_depth_m, options.most_rim_depth_m),
            (Reason.PROTRUSION, surface.protrusion_m + sure, options.most_protrusion_m),
            (Reason.ROUGHNESS, surface.rms_m, self.joint.limits.most_rms_m),
        ):
            if not value <= limit:
                return Finding(reason, value, limit, "m")
        return None

    def _sure(self, surface: FusedSurface) -> float:
        """Return what of the relief a plane that leans otherwise may hide, m."""
        return self.joint.limits.sigmas * surface.relief_sigma_m

    def _strain(self, surface: FusedSurface) -> float:
        """Return the largest share of a limit that a place takes which nobody asked for: of those of its
        relief, and of its holes, both somewhat beyond the tool.
        """
        options, sure = self.options, self._sure(surface)
        return max(
            max(surface.hole_m, surface.ending_m) / options.most_hole_m,
            (surface.wide_depth_m + sure) / options.most_depth_m,
            (surface.wide_protrusion_m + sure) / options.most_protrusion_m,
            surface.rms_m / self.joint.limits.most_rms_m,
        )

    def _free(self, narrow: PatchCheck, surface: FusedSurface) -> bool:
        """Return whether the tool's path is free, some cloud has the surface on the rock alone, and it faces
        the axis of approach if there is one.
        """
        every = [*self.joint.checks, narrow]
        measures = [check.judge(surface.point).measures for check in every]
        known = [one for one in measures if one is not None]
        limits = self.joint.limits
        if narrow.axis is not None:
            tilt = float(np.arccos(np.clip(surface.normal @ narrow.axis, -1.0, 1.0)))
            if tilt + limits.sigmas * surface.normal_sigma_rad > limits.most_slope_rad:
                return False
        return (
            max((one.beside_m for one in known), default=np.inf) <= limits.most_beside_m
            and max(one.rock_share for one in known) >= self.options.least_rock_share
            and JointCheck(every).hidden_share(surface.point, surface.normal) <= limits.most_hidden
        )

    def _as_judged(self, narrow: PatchCheck, surface: FusedSurface) -> Judged | None:
        measures = narrow.judge(surface.point).measures
        if measures is None:
            return None
        measures = replace(
            measures,
            protrusion_m=surface.protrusion_m,
            depth_m=surface.depth_m,
            rms_m=surface.rms_m,
            hole_m=surface.hole_m,
            rock_share=surface.rock_share,
            normal_sigma_rad=surface.normal_sigma_rad,
        )
        return Judged(surface.point, surface.normal, measures, (), self._strain(surface))
