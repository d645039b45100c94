"""One place judged by all that look at it: the hazard cameras, and the mast's when their cloud is registered
to it.

Not to know is not a contradiction. A place is safe if one cloud alone keeps every limit and no other shows
anything that stands up, falls away or belongs to another rock; what one camera does not see behind a rock
the other may see to be free.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from rover_iface.frames import across
from rover_iface.placement.cloud import Array, SurfaceCloud
from rover_iface.placement.patch_check import Judged, PatchCheck
from rover_iface.placement.verdict import Finding, Reason

UNKNOWING = frozenset(
    {
        Reason.FEW_POINTS,
        Reason.STEREO_SHARE,
        Reason.STEREO_HOLE,
        Reason.STEP_NEAR,
        Reason.VIEW_ANGLE,
        Reason.NORMAL,
    }
)
"""Reasons by which a cloud says that it does not know the surface; all others say that it is bad."""

STRIP_M = 0.006
"""Half the width of the strip in which a crease is looked for, and the length of its parts."""

BEYOND_M = 0.06
"""So far beyond the designated point lines to a place begin."""

BEHIND_M = 0.06
"""What falls farther than this below a line is not a crease: the line passes before an edge of the rock."""

RELIEF = frozenset({Reason.EDGE, Reason.PROTRUSION, Reason.ROUGHNESS})
"""Reasons that points beside a step may give falsely."""

WAY_HEIGHTS = (0.2, 0.4, 0.6, 0.8, 1.0, 1.2)
"""Where the tool's path is looked at, shares of its length over the surface."""


class JointCheck:
    """Judges points of one rock by one check for each cloud; the first is the hazard cameras'."""

    def __init__(self, checks: Sequence[PatchCheck]) -> None:
        self.checks = tuple(checks)
        self.limits = checks[0].limits
        self.cloud = checks[0].cloud

    def candidates(self, at: Array, *, coarse: float = 2.5) -> list[Array]:
        """Return the points [3] to be tried: the surface at the designated one, `at` [3], then one for each
        cell of the rock in any cloud, by distance. Rover frame, m.
        """
        from scipy.spatial import cKDTree

        found = np.array(self.checks[0].candidates(at, coarse=coarse)[1:]).reshape(-1, 3)
        for check in self.checks[1:]:
            more = np.array(check.candidates(at, coarse=coarse)[1:]).reshape(-1, 3)
            if len(found) and len(more):
                more = more[cKDTree(found).query(more)[0] > self.limits.grid_m]
            found = np.vstack((found, more))
        order = np.argsort(np.linalg.norm(found - at, axis=1))
        return [at, *found[order]]

    def judge(self, point: Array, *, brief: bool = False) -> Judged:
        """Return the surface under the tool at a point [3] (rover frame, m) as the cloud that knows it best
        has it, and what is wrong with it.

        When it need be `brief`, a place that the mast's cloud alone refuses is not judged by the other.
        """
        last = self.checks[-1].judge(point)
        if brief and self._refused_alone(self.checks[-1], last):
            return last
        judged = [*(check.judge(point) for check in self.checks[:-1]), last]
        best = min(judged, key=_ignorance)
        against = {
            finding.reason: finding
            for one in judged
            for finding in one.findings
            if one is not best and finding.reason not in UNKNOWING
        }
        for finding in best.findings:
            against.pop(finding.reason, None)
        joint = replace(best, findings=(*best.findings, *against.values()))
        if best.normal is None or (joint.findings and len(self.checks) < 2):
            return joint
        strain = self._close_strain(judged, best)
        if joint.findings and strain > 1.0:
            return joint
        hidden = self.hidden_share(best.point, best.normal)
        if hidden > self.limits.most_hidden:
            return joint.with_finding(Finding(Reason.WAY_HIDDEN, hidden, self.limits.most_hidden))
        return replace(joint, close_strain=strain)

    def _refused_alone(self, check: PatchCheck, judged: Judged) -> bool:
        """Return whether a cloud knows a place and has it bad even in a close look."""
        reasons = {finding.reason for finding in judged.findings}
        if judged.measures is None or not reasons or reasons & UNKNOWING:
            return False
        return bool(reasons - RELIEF) or check.sound_relief(judged.measures) > self.limits.close_relief

    def _close_strain(self, judged: Sequence[Judged], best: Judged) -> float:
        """Return the largest share of the close limits that a place takes; infinite where something besides
        its relief is wrong, or with one cloud.

        Beside a step stereo draws the foreground over its edge, and a surface that ends there seems to be
        rough and deep. So the relief is that of the other points, and the clouds together must leave hardly
        a gap between them.
        """
        knowing = [one for one in judged if one is best or not _ignorance(one)[0]]
        if len(self.checks) < 2 or best.normal is None or best.measures is None:
            return math.inf
        if any(finding.reason not in RELIEF for one in knowing for finding in one.findings):
            return math.inf
        relief = max(
            check.sound_relief(one.measures)
            for check, one in zip(self.checks, judged, strict=True)
            if one.measures is not None and any(one is known for known in knowing)
        )
        doubt = best.measures.doubtful_share
        limits = self.limits
        if max(relief / limits.close_relief, doubt / limits.close_doubt) > 1.0:
            return math.inf
        points = np.vstack([check.sound_points(best.point, best.normal) for check in self.checks])
        hole = self.checks[0].hole_m(points, best.point, best.normal)
        return max(relief / limits.close_relief, doubt / limits.close_doubt, hole / limits.close_hole_m)

    def hidden_share(self, at: Array, normal: Array) -> float:
        """Return the share of the tool's path that something hides from a camera and none sees to be free.

        The way leads to a surface point `at` [3], rover frame, m, along its unit normal [3].
        """
        first, second = across(normal)
        turns = np.arange(12) * math.tau / 12.0
        ring = np.outer(np.cos(turns), first) + np.outer(np.sin(turns), second)
        disc = np.vstack((np.zeros(3), self.checks[0].radius_m * ring))
        heights = self.limits.tool_length_m * np.array(WAY_HEIGHTS)
        way = (at + disc[None] + heights[:, None, None] * normal).reshape(-1, 3)
        hidden, free = np.array([check.sight(way) for check in self.checks]).transpose(1, 0, 2)
        return float((hidden.any(axis=0) & ~free.any(axis=0)).mean())

    def crease_m(self, at: Array, place: Array) -> float:
        """Return how far the surface falls below the straight lines to a place (3,) from a point on it, `at`
        (3,), rover frame, m, and from what of the rock lies beyond that.

        That is measured towards the eye of the last cloud, the mast's, which looks down on both; towards the
        other where what is seen is far behind.
        """
        falls = [crease(check.cloud, check.labels == check.label, at, place) for check in self.checks]
        known = [fall for fall in reversed(falls) if fall is not None]
        return next((fall for fall in known if fall < BEHIND_M), min(known, default=0.0))


def crease(cloud: SurfaceCloud, own: npt.NDArray[np.bool_], at: Array, place: Array) -> float | None:
    """Return how far, m, a cloud falls below the straight lines to `place` (3,) from `at` (3,) and from the
    points of the rock, `own` (n,), up to `BEYOND_M` beyond it, seen from the cloud's eye.

    None without an eye or points there, or where `place` is `at`.

    One rock is about convex. Where two touch there is a crease; the designated point may lie in it, and only
    the lines from beyond it then pass over it.
    """
    length = float(np.linalg.norm(place - at))
    if cloud.eye is None or length < 2.0 * STRIP_M:
        return None
    along = (place - at) / length
    up = cloud.eye - 0.5 * (at + place)
    up -= (up @ along) * along
    up /= max(float(np.linalg.norm(up)), 1e-9)
    away = cloud.points - at
    way = away @ along
    strip = (np.abs(away @ np.cross(along, up)) < STRIP_M) & (way < length) & (way > -BEYOND_M - STRIP_M)
    strip &= own | (way > 0.0)
    part, height = np.floor(way[strip] / STRIP_M).astype(np.int64), away[strip] @ up
    known = [k for k in np.unique(part) if (part == k).sum() > 1]
    middle = np.array([(k + 0.5) * STRIP_M for k in known])
    level = np.array([np.median(height[part == k]) for k in known])
    falls = []
    for start, rise in [(0.0, 0.0), *zip(middle[middle < 0.0], level[middle < 0.0], strict=True)]:
        between = (middle > start) & (middle < length)
        line = rise * (length - middle[between]) / (length - start)
        falls.extend(line - level[between])
    return float(max(falls)) if falls else None


def _ignorance(judged: Judged) -> tuple[int, float]:
    """Return how little a cloud knows of a place: limits of knowing that it breaks, then its error."""
    unknown = sum(f.reason in UNKNOWING for f in judged.findings)
    return unknown, judged.measures.sigma_m if judged.measures is not None else math.inf
