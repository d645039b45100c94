"""Straight segments that see each other past obstacles, and the shortest ways along them.

Nodes are the places and the convex corners of the obstacles. A shortest way bends only at such corners,
and only so that it hugs them, so a segment is kept when it is tangent at every corner that it ends in
(Lozano-Perez and Wesley 1979; the pruned form is the tangent graph of Liu and Arimoto 1991).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry.base import BaseGeometry

from planner.path_network.obstacles import ring_corners
from planner.path_network.values import FloatArray

IntArray = npt.NDArray[np.int64]

_SHRINK_M = 1e-6  # a segment along an obstacle's edge is free, one through its inside is not
_EPS = 1e-9


@dataclass(frozen=True, slots=True)
class VisibilityGraph:
    """Nodes (places first) and the free segments between them.

    Parameters
    ----------
    xy
        Shape (nodes, 2), site metres.
    places
        The first `places` nodes are places.
    edges
        Shape (edges, 2), lower node first.
    length_m
        Shape (edges,).
    """

    xy: FloatArray
    places: int
    edges: IntArray
    length_m: FloatArray


def build_visibility_graph(
    places: FloatArray, blocked: BaseGeometry, bounds_m: tuple[float, float, float, float] | None
) -> VisibilityGraph:
    """Return the tangent graph of places (n, 2) and obstacles; segments never enter `blocked`."""
    corners, before, after = ring_corners(blocked)
    if len(corners):
        turn = _cross(corners - before, after - corners)
        keep = turn > _EPS
        if bounds_m is not None:
            west, south, east, north = bounds_m
            keep &= (corners[:, 0] >= west) & (corners[:, 0] <= east)
            keep &= (corners[:, 1] >= south) & (corners[:, 1] <= north)
        corners, before, after = corners[keep], before[keep], after[keep]
    n = len(places)
    xy = np.concatenate([places, corners])
    first, second = np.triu_indices(len(xy), 1)
    tangent = np.ones(len(first), dtype=bool)
    for end, other in ((first, second), (second, first)):
        at = end >= n
        c = end[at] - n
        along = xy[other[at]] - corners[c]
        tangent[at] &= _cross(along, before[c] - corners[c]) * _cross(along, after[c] - corners[c]) >= -_EPS
    first, second = first[tangent], second[tangent]
    if not blocked.is_empty and len(first):
        free = clear_of(blocked, shapely.linestrings(np.stack([xy[first], xy[second]], axis=1)))
        first, second = first[free], second[free]
    edges = np.stack([first, second], axis=1).astype(np.int64)
    return VisibilityGraph(xy, n, edges, np.hypot(*(xy[first] - xy[second]).T))


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def clear_of(blocked: BaseGeometry, lines: Any) -> npt.NDArray[np.bool_]:
    """Return which straight lines (an array of shapely's) stay outside `blocked` or on its edge."""
    body = shapely.buffer(blocked, -_SHRINK_M, join_style="mitre")
    return ~_hits(body, np.asarray(lines))


def _hits(body: BaseGeometry, lines: npt.NDArray[np.object_]) -> npt.NDArray[np.bool_]:
    """Return which lines meet the body: a tree over its parts finds the few that each line may meet."""
    parts = shapely.get_parts(body)
    hit = np.zeros(len(lines), dtype=bool)
    shapely.prepare(parts)
    tree = shapely.STRtree(lines)
    # Large parts first: most lines fall to them and need no further test.
    for part in sorted(parts.tolist(), key=lambda g: -g.area):
        found = tree.query(part)
        found = found[~hit[found]]
        if found.size:
            hit[found] = shapely.intersects(part, lines[found])
    return hit


def shortest_ways(
    nodes: int, edges: IntArray, weight: FloatArray, sources: IntArray
) -> tuple[FloatArray, IntArray]:
    """Return Dijkstra's distances and predecessors from each source, shapes (sources, nodes).

    An unreachable node has infinite distance; predecessor -9999 means none.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import dijkstra

    both = np.concatenate([edges, edges[:, ::-1]])
    graph = coo_matrix(
        (np.concatenate([weight, weight]), (both[:, 0], both[:, 1])), shape=(nodes, nodes)
    ).tocsr()
    distance, previous = dijkstra(graph, directed=True, indices=sources, return_predecessors=True)
    return distance, previous.astype(np.int64)


def walk(previous: IntArray, source: int, destination: int) -> list[int]:
    """Return the nodes from source to destination along one row of predecessors."""
    nodes = [destination]
    while nodes[-1] != source:
        nodes.append(int(previous[nodes[-1]]))
    return nodes[::-1]
