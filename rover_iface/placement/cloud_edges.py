"""Where a cloud ends: points beside a step in depth, whose surface stereo draws over the edge."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from rover_iface.placement.cloud import Array, SurfaceCloud


def away_from_edges(cloud: SurfaceCloud, edge_px: int, jump_m: float) -> npt.NDArray[np.bool_]:
    """Return which points (n,) have nothing `jump_m` farther away within `edge_px` pixels.

    A gap counts as far as the farther of its two ends along the row. Clouds without order have no edges.
    """
    from scipy.ndimage import maximum_filter

    if cloud.pixels is None or cloud.eye is None or edge_px < 1 or len(cloud) == 0:
        return np.ones(len(cloud), bool)
    x, y = (cloud.pixels - cloud.pixels.min(axis=0)).T
    far = np.linalg.norm(cloud.points - cloud.eye, axis=1)
    raster = np.full((int(y.max()) + 1, int(x.max()) + 1), np.nan)
    raster[y, x] = far
    ends = np.fmax(_carried(raster), _carried(raster[:, ::-1])[:, ::-1])
    filled = np.where(np.isnan(raster), np.nan_to_num(ends, nan=0.0), raster)
    behind = maximum_filter(filled, size=2 * edge_px + 1)
    return np.asarray(behind[y, x] < far + jump_m)


def _carried(raster: Array) -> Array:
    """Return the raster with each gap filled by the last known value to its left."""
    known = ~np.isnan(raster)
    last = np.maximum.accumulate(np.where(known, np.arange(raster.shape[1]), 0), axis=1)
    return np.take_along_axis(raster, last, axis=1)
