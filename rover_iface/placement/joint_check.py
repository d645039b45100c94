"""One place judged by all that look at it: the hazard cameras, and the mast's when their cloud is laid on.

Not to know is no contradiction. A place is safe if one cloud alone keeps every limit and no other shows
anything that stands up, falls away or belongs to another rock; what one camera does not see behind a rock
the other may see to be free.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rover_iface.placement.cloud import Array
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

WAY_HEIGHTS = (0.2, 0.4, 0.6, 0.8, 1.0, 1.2)
"""Where the tool's way is looked at, shares of its length over the surface."""


class JointCheck:
    """Judges points of one rock by one check for each cloud; the first is the hazard cameras'."""

    def __init__(self, checks: Sequence[PatchCheck]) -> None:
        self.checks = tuple(checks)
        self.limits = checks[0].limits
        self.cloud = checks[0].cloud

    def candidates(self, at: Array, *, coarse: float = 2.5) -> list[Array]:
        """Return the points to be tried: the surface at the designated one, then one for each cell of the
        rock in any cloud, by distance."""
        from scipy.spatial import cKDTree

        found = np.array(self.checks[0].candidates(at, coarse=coarse)[1:]).reshape(-1, 3)
        for check in self.checks[1:]:
            more = np.array(check.candidates(at, coarse=coarse)[1:]).reshape(-1, 3)
            if len(found) and len(more):
                more = more[cKDTree(found).query(more)[0] > self.limits.grid_m]
            found = np.vstack((found, more))
        order = np.argsort(np.linalg.norm(found - at, axis=1))
        return [at, *found[order]]

    def judge(self, point: Array) -> Judged:
        """Return the surface under the tool as the cloud that knows it best has it, and what is wrong
        with it."""
        judged = [check.judge(point) for check in self.checks]
        best = min(judged, key=_ignorance)
        against = [
            f for other in judged if other is not best for f in other.findings if f.reason not in UNKNOWING
        ]
        if against:
            best = replace(best, findings=(*best.findings, *against))
        if not best.findings and best.normal is not None:
            hidden = self.hidden_share(best.point, best.normal)
            if hidden > self.limits.most_hidden:
                best = best.with_finding(Finding(Reason.WAY_HIDDEN, hidden, self.limits.most_hidden))
        return best

    def hidden_share(self, at: Array, normal: Array) -> float:
        """Return the share of the tool's way that something hides from a camera and none sees to be free."""
        first = np.cross(normal, np.eye(3)[int(np.abs(normal).argmin())])
        first /= np.linalg.norm(first)
        turns = np.arange(12) * math.tau / 12.0
        ring = np.outer(np.cos(turns), first) + np.outer(np.sin(turns), np.cross(normal, first))
        disc = np.vstack((np.zeros(3), self.checks[0].radius_m * ring))
        heights = self.limits.tool_length_m * np.array(WAY_HEIGHTS)
        way = (at + disc[None] + heights[:, None, None] * normal).reshape(-1, 3)
        hidden, free = np.array([check.sight(way) for check in self.checks]).transpose(1, 0, 2)
        return float((hidden.any(axis=0) & ~free.any(axis=0)).mean())


def _ignorance(judged: Judged) -> tuple[int, float]:
    """Return how little a cloud knows of a place: limits of knowing that it breaks, then its error."""
    unknown = sum(f.reason in UNKNOWING for f in judged.findings)
    return unknown, judged.measures.sigma_m if judged.measures is not None else math.inf
