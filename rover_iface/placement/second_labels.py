"""The rock that the tool is meant for, in the cloud of a second pair."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from rover_iface.placement.cloud import Array, SurfaceCloud
from rover_iface.placement.rock_segments import GROUND, Segmentation
from rover_iface.placement.segmentation import segment
from rover_iface.placement.segmentation_options import SegmentationOptions

Labels = npt.NDArray[np.int64]

OPTIONS = SegmentationOptions(thinning=3, roughness_m=0.006, rounds=4)

SECOND_EDGE_PX = 2
"""So far beside a step the second cloud, whose pixels are fine, is not trusted."""

SAME_PLANE_RAD, SAME_HEIGHT_M = math.radians(12.0), 0.03
"""The two clouds have one ground when their planes lie within this."""

SAME_PLACE_M = 0.015
"""A point of the second cloud is on the rock if a point of the first that is lies within this."""


def second_labels(
    second: SurfaceCloud, at: Array, first: SurfaceCloud, found: Segmentation, label: int
) -> Labels:
    """Return (n,) `label` where the second cloud shows the rock of that label in the first, -1 elsewhere.

    The second cloud is segmented on its own, so that two rocks that one pair takes for one may be parted by
    the other. A subframe may show no ground, or take a face of the rock for it: where the grounds of the two
    clouds are not the same, or it has no rock near `at` (3,), the labels of the first are carried over.
    """
    own = segment(second, OPTIONS)
    if label != GROUND and _same_ground(own, found, at):
        near = np.flatnonzero(own.labels != GROUND)
        if len(near):
            away = np.linalg.norm(second.points[near] - at, axis=1)
            if float(away.min()) < SAME_PLACE_M:
                return np.where(own.labels == own.labels[near[away.argmin()]], label, GROUND)
    distance, nearest = first.tree.query(second.points, distance_upper_bound=SAME_PLACE_M)
    same = np.append(found.labels, GROUND)[nearest]
    return np.where(np.isfinite(distance) & (same == label), label, GROUND)


def first_label(second: SurfaceCloud, at: Array, first: SurfaceCloud, found: Segmentation) -> int:
    """Return the label in the first cloud of the rock that the second shows at a point (3,) where the first
    has a hole; GROUND where it shows none.

    That is what the first has most of the second's rock as. Where the two have not the same ground it is the
    label of the nearest point of the first.
    """
    own = segment(second, OPTIONS)
    if not _same_ground(own, found, at):
        return int(found.labels[int(first.tree.query(at)[1])])
    here = own.labels[int(second.tree.query(at)[1])]
    if here == GROUND:
        return GROUND
    away, nearest = first.tree.query(second.points[own.labels == here], distance_upper_bound=SAME_PLACE_M)
    labels, counts = np.unique(found.labels[nearest[np.isfinite(away)]], return_counts=True)
    return int(labels[counts.argmax()]) if len(labels) else GROUND


def _same_ground(own: Segmentation, found: Segmentation, at: Array) -> bool:
    if own.plane is None or found.plane is None:
        return False
    turn = math.acos(float(np.clip(own.plane.normal @ found.plane.normal, -1.0, 1.0)))
    heights = [float(plane.local(at[None])[0, 2]) for plane in (own.plane, found.plane)]
    return turn < SAME_PLANE_RAD and abs(heights[0] - heights[1]) < SAME_HEIGHT_M
