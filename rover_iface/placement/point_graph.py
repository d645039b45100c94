"""Which points of a cloud are neighbours, and which of them touch."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from rover_iface.placement.cloud import Array, SurfaceCloud

Index = npt.NDArray[np.int64]


def neighbours(cloud: SurfaceCloud) -> Index:
    """Return pairs (m, 2) of neighbouring points: to the right and below on a raster, the eight nearest
    else.
    """
    if cloud.pixels is None:
        if len(cloud) < 2:
            return np.empty((0, 2), np.int64)
        many = min(9, len(cloud))
        near = cloud.tree.query(cloud.points, many)[1][:, 1:]
        pairs = np.column_stack((np.repeat(np.arange(len(cloud)), many - 1), near.ravel()))
        return np.unique(np.sort(pairs, axis=1), axis=0).astype(np.int64)
    step = raster_step(cloud.pixels)
    x, y = ((cloud.pixels - cloud.pixels.min(axis=0)) // step).T
    raster = np.full((int(y.max()) + 1, int(x.max()) + 1), -1, np.int64)
    raster[y, x] = np.arange(len(cloud))
    found = []
    for one, two in ((raster[:, :-1], raster[:, 1:]), (raster[:-1], raster[1:])):
        both = (one >= 0) & (two >= 0)
        found.append(np.column_stack((one[both], two[both])))
    return np.concatenate(found)


def raster_step(pixels: Index) -> int:
    """Return the distance, px, between used columns of a raster: 1, or more for a thinned one.

    `pixels` [n, 2] are (sample, line) of the points.
    """
    columns = np.unique(pixels[:, 0])
    return int(np.diff(columns).min()) if len(columns) > 1 else 1


def touching(cloud: SurfaceCloud, edges: Index, jump: float) -> npt.NDArray[np.bool_]:
    """Return which neighbours lie on one surface, by the distance between them and what they err.

    `edges` [m, 2] are pairs of points of the cloud by index; answered is [m]. `jump` is in spacings of the
    points.
    """
    if not len(edges):
        return np.empty(0, bool)
    a, b = edges.T
    apart = np.linalg.norm(cloud.points[a] - cloud.points[b], axis=1)
    spacing = np.maximum(cloud.spacing_m[a], cloud.spacing_m[b])
    error = np.sqrt(np.trace(cloud.covariances, axis1=1, axis2=2))
    step = raster_step(cloud.pixels) if cloud.pixels is not None else 1
    return np.asarray(apart < jump * step * spacing + 2.0 * np.maximum(error[a], error[b]))


def adjacency(cloud: SurfaceCloud, a: Index, b: Index, coupling: float) -> tuple[Index, Index, Array]:
    """Return for each point where its neighbours start, the neighbours, and how much each pulls.

    `a` and `b` [m] are the two points of each edge by index. Answered are [n + 1], [2 m] and [2 m]: the
    neighbours of point i are those from entry i of the first up to entry i + 1. An edge pulls `coupling`,
    less where the brightness changes across it.
    """
    weight = np.full(len(a), coupling)
    if cloud.intensity is not None and len(a):
        change = np.sqrt(cloud.intensity[a]) - np.sqrt(cloud.intensity[b])
        weight *= 0.15 + 0.85 * np.exp(-0.5 * change**2 / max(2.0 * float(np.mean(change**2)), 1e-9))
    one, two, pull = np.r_[a, b], np.r_[b, a], np.r_[weight, weight]
    order = np.argsort(one, kind="stable")
    starts = np.concatenate(([0], np.cumsum(np.bincount(one, minlength=len(cloud)))))
    return starts.astype(np.int64), two[order].astype(np.int64), pull[order]


def renumbered(label: Index) -> Index:
    """Return labels [n] 0..k-1 in place of any numbers; -1 stays."""
    out = np.full(len(label), -1, dtype=np.int64)
    at = label >= 0
    out[at] = np.unique(label[at], return_inverse=True)[1]
    return out
