"""Ground and rocks in a cloud: which point belongs to which.

Pedersen, Smith, Deans and others 2005, section 7: a ground plane by RANSAC, connected regions that do not
match it as first rocks, then expectation and maximisation in turns, "labeling points in the point cloud as
either ground or rocks, then fitting the parameters describing the ground plane and rocks given the
labeling", the number of rocks unknown beforehand. What the paper leaves open is filled in as follows.

- Ground: height over a smooth surface, normal with the spread of natural ground and the point's own error.
- Rock: its footprint (an ellipse along the plane) and its height; a height within is as likely as any other.
- Neighbouring points hang together: their labels pull at each other (mean field of a Potts model).
- A rock stays when it explains its points better than ground does by more than its parameters cost (BIC),
  points counted once for each patch that stereo smooths over; the same rule says whether two regions are one
  rock.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rover_iface.placement.cloud import SurfaceCloud
from rover_iface.placement.ground_plane import fit_ground_plane
from rover_iface.placement.rock_mixture import Mixture
from rover_iface.placement.rock_segments import GROUND, RockSegment, Segmentation
from rover_iface.placement.segmentation_options import SegmentationOptions

__all__ = ["GROUND", "RockSegment", "Segmentation", "SegmentationOptions", "segment"]


def segment(
    cloud: SurfaceCloud, options: SegmentationOptions | None = None, *, seed: int = 0
) -> Segmentation:
    """Return ground and rocks of a cloud.

    An empty cloud, or one without a ground plane, is a segmentation without rocks and without ground.
    """
    options = options or SegmentationOptions()
    if options.thinning > 1 and cloud.pixels is not None and len(cloud):
        return _of_thinned(cloud, options, seed)
    plane = fit_ground_plane(cloud, options.ground, seed=seed)
    if plane is None:
        nothing = np.zeros(len(cloud))
        return Segmentation(
            np.full(len(cloud), GROUND), nothing, nothing.copy(), (), None, math.nan, -math.inf, 0
        )
    return Mixture(cloud, plane, options).run()


def _of_thinned(cloud: SurfaceCloud, options: SegmentationOptions, seed: int) -> Segmentation:
    """Return the segmentation of every `thinning`-th column and row, spread over the points between."""
    from scipy.spatial import cKDTree

    assert cloud.pixels is not None
    kept = np.flatnonzero((cloud.pixels % options.thinning == 0).all(axis=1))
    part = segment(cloud.subset(kept), replace(options, thinning=1), seed=seed)
    if part.ground is None:
        nothing = np.zeros(len(cloud))
        return replace(
            part, labels=np.full(len(cloud), GROUND), rock_probability=nothing, height_m=nothing.copy()
        )
    nearest = cKDTree(cloud.points[kept]).query(cloud.points)[1]
    labels = part.labels[nearest]
    points = np.bincount(labels[labels >= 0], minlength=len(part.rocks))
    return replace(
        part,
        labels=labels,
        rock_probability=part.rock_probability[nearest],
        height_m=part.ground.height_over(cloud.points),
        rocks=tuple(replace(rock, points=int(points[rock.label])) for rock in part.rocks),
    )
