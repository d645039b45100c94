"""Straight segments that see each other past obstacles.

Nodes are the places and the convex corners of the obstacles. A shortest route bends only at such corners,
and only so that it hugs them, so a segment is kept when it is tangent at every corner that it ends in
(Lozano-Perez and Wesley 1979; the pruned form is the tangent graph of Liu and Arimoto 1991).

A place inside a margin has nodes of its own, the corners of its opening: only routes that begin or end there
pass them. With many corners not all pairs are looked at: near ones in all directions, and the edges of a
constrained Delaunay triangulation of the free ground, which keep every connection that there is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numba
import numpy as np
import numpy.typing as npt
import shapely

from planner.path_network.near_pairs import hugs, near_pairs, tangent_pairs
from planner.path_network.obstacles import Obstacles, outline_of, ring_corners
from planner.path_network.shortest_routes import EVERYBODY, ShortestRoutes
from planner.path_network.values import FloatArray, IntArray

_EPS = 1e-9

OPEN_GROUND_M = 20.0
"""Without an edge of the map, ground so far round everything is looked at."""


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
    owner
        Shape (nodes,): the place whose routes alone may pass a node, or `EVERYBODY`.
    """

    xy: FloatArray
    places: int
    edges: IntArray
    length_m: FloatArray
    owner: IntArray

    def shared(self) -> npt.NDArray[np.bool_]:
        """Return which edges (edges,) every route may use."""
        return np.asarray((self.owner[self.edges] == EVERYBODY).all(axis=1))


@dataclass(frozen=True, slots=True)
class _Nodes:
    """Nodes with the corner before and after each, shapes (n, 2); NaN for places and for plain vertices."""

    xy: FloatArray
    before: FloatArray
    after: FloatArray

    def tangent(self, first: IntArray, second: IntArray) -> npt.NDArray[np.bool_]:
        """Return which segments hug the corners that they end in."""
        return _hugging(self.xy, self.before, self.after, first, second)

    def length_m(self, edges: IntArray) -> FloatArray:
        return np.asarray(np.hypot(*(self.xy[edges[:, 0]] - self.xy[edges[:, 1]]).T))

    def lines(self, first: IntArray, second: IntArray) -> npt.NDArray[np.object_]:
        return np.asarray(shapely.linestrings(np.stack([self.xy[first], self.xy[second]], axis=1)))


@numba.njit(cache=True, nogil=True)
def _hugging(
    xy: FloatArray, before: FloatArray, after: FloatArray, first: IntArray, second: IntArray
) -> npt.NDArray[np.bool_]:
    """Return which segments pass by the corners in which they end, on one side of both their edges."""
    good = np.empty(len(first), np.bool_)
    for k in range(len(first)):
        a, b = first[k], second[k]
        good[k] = hugs(xy, before, after, a, b) and hugs(xy, before, after, b, a)
    return good


def build_visibility_graph(
    places: FloatArray,
    obstacles: Obstacles,
    bounds_m: tuple[float, float, float, float] | None,
    most_corners: int,
) -> VisibilityGraph:
    """Return the tangent graph of places (n, 2), site frame, m, and obstacles.

    With more than `most_corners` convex corners only near pairs are looked at, and of a place inside a margin
    those with so many nearest.
    """
    n = len(places)
    corners = _convex(*ring_corners(obstacles.blocked), bounds_m)
    none = np.full((n, 2), np.nan)
    nodes = _Nodes(*(np.concatenate(pair) for pair in zip((places, none, none), corners, strict=True)))
    owner = np.full(len(nodes.xy), EVERYBODY, dtype=np.int64)
    narrow = [i for i in range(n) if (float(places[i, 0]), float(places[i, 1])) in obstacles.openings]
    owner[narrow] = narrow
    own = [_own_corners(obstacles, places[i], bounds_m) for i in narrow]
    everybody = np.flatnonzero(owner == EVERYBODY)
    many = len(corners[0]) > most_corners
    if many:
        nodes, owner, safe = _with_triangles(nodes, owner, obstacles, bounds_m)
    look = near_pairs if many else tangent_pairs
    found = look(nodes.xy[everybody], nodes.before[everybody], nodes.after[everybody])
    edges = _seen(nodes, everybody[_distinct(found, len(everybody))], obstacles)
    if many:
        edges = _distinct(np.concatenate([edges, safe]), len(nodes.xy))
    if narrow:
        nodes, owner, private = _private(nodes, owner, narrow, own, obstacles, most_corners)
        edges = np.concatenate([edges, private])
    graph = VisibilityGraph(nodes.xy, n, edges, nodes.length_m(edges), owner)
    if many:
        graph = _with_all_pairs_in_use(graph, nodes, obstacles)
    return graph


def _seen(nodes: _Nodes, pairs: IntArray, obstacles: Obstacles) -> IntArray:
    """Return the pairs (p, 2) of nodes that see each other."""
    return np.asarray(pairs[~obstacles.outline.stops(nodes.xy[pairs[:, 0]], nodes.xy[pairs[:, 1]])])


def _convex(
    here: FloatArray,
    before: FloatArray,
    after: FloatArray,
    bounds_m: tuple[float, float, float, float] | None,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the corners that a shortest route may bend at."""
    if not len(here):
        return here, before, after
    keep = _cross(here - before, after - here) > _EPS
    if bounds_m is not None:
        west, south, east, north = bounds_m
        keep &= (here[:, 0] >= west) & (here[:, 0] <= east) & (here[:, 1] >= south) & (here[:, 1] <= north)
    return here[keep], before[keep], after[keep]


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


# --------------------------------------------------------------------------- places inside a margin


def _own_corners(
    obstacles: Obstacles, place: FloatArray, bounds_m: tuple[float, float, float, float] | None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the convex corners that the obstacles have in the opening of a place."""
    opening = obstacles.openings[float(place[0]), float(place[1])]
    spot = shapely.Point(place)
    reach = float(shapely.hausdorff_distance(spot, opening.envelope))
    near = obstacles.blocked.intersection(spot.buffer(3.0 * reach)).difference(opening)
    here, before, after = _convex(*ring_corners(near), bounds_m)
    inside = np.flatnonzero(shapely.dwithin(opening, shapely.points(here), 1e-6))
    return here[inside], before[inside], after[inside]


def _private(
    nodes: _Nodes,
    owner: IntArray,
    narrow: list[int],
    own: list[tuple[FloatArray, FloatArray, FloatArray]],
    obstacles: Obstacles,
    most: int,
) -> tuple[_Nodes, IntArray, IntArray]:
    """Return nodes and owners with those of the openings behind, and the segments that end in one."""
    count = len(nodes.xy)
    parts = [np.concatenate([np.zeros((0, 2)), *(o[k] for o in own)]) for k in range(3)]
    nodes = _Nodes(
        np.concatenate([nodes.xy, parts[0]]),
        np.concatenate([nodes.before, parts[1]]),
        np.concatenate([nodes.after, parts[2]]),
    )
    owner = np.concatenate([owner, np.repeat(narrow, [len(o[0]) for o in own])]).astype(np.int64)
    everybody = np.flatnonzero(owner[:count] == EVERYBODY)
    discs = shapely.union_all([obstacles.openings[tuple(nodes.xy[i].tolist())] for i in narrow])
    outside = outline_of(obstacles.blocked.difference(shapely.buffer(discs, 0.01)))
    found = [np.zeros((0, 3), dtype=np.int64)]
    for place in narrow:
        mine = np.flatnonzero(owner == place)
        others = np.flatnonzero((owner > place) & (owner != EVERYBODY))
        away = np.hypot(*(nodes.xy[everybody] - nodes.xy[place]).T)
        near = everybody if len(everybody) <= most else everybody[np.argsort(away, kind="stable")[:most]]
        a, b = np.meshgrid(mine, np.concatenate([near, others]), indexing="ij")
        inner = np.triu_indices(len(mine), 1)
        first = np.concatenate([a.ravel(), mine[inner[0]]])
        second = np.concatenate([b.ravel(), mine[inner[1]]])
        kept = nodes.tangent(first, second)
        first, second = first[kept], second[kept]
        free = ~outside.stops(nodes.xy[first], nodes.xy[second])
        first, second = first[free], second[free]
        found.append(np.stack([first, second, np.full(len(first), place)], axis=1))
    first, second, place = np.concatenate(found).T
    end = np.where(owner[second] == EVERYBODY, place, owner[second])
    free = obstacles.free(nodes.lines(first, second), nodes.xy[place], nodes.xy[end])
    return nodes, owner, np.sort(np.stack([first, second], axis=1)[free], axis=1)


# --------------------------------------------------------------------------- many corners


def _with_triangles(
    nodes: _Nodes,
    owner: IntArray,
    obstacles: Obstacles,
    bounds_m: tuple[float, float, float, float] | None,
) -> tuple[_Nodes, IntArray, IntArray]:
    """Return the nodes with all vertices of the free ground behind, and edges that keep it connected."""
    if bounds_m is None:
        ground = shapely.union_all([obstacles.blocked, shapely.MultiPoint(nodes.xy)]).envelope
        ground = ground.buffer(OPEN_GROUND_M, join_style="mitre")
    else:
        ground = shapely.box(*bounds_m)
    free = ground.difference(obstacles.blocked)
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(free))
    rings = shapely.get_coordinates(triangles).reshape(-1, 4, 2)[:, :3]
    corner, more = _numbered(nodes.xy, rings.reshape(-1, 2))
    corner = corner.reshape(-1, 3)
    pairs = [corner[:, [0, 1]], corner[:, [1, 2]], corner[:, [2, 0]]]
    spots = np.flatnonzero(np.isnan(nodes.before[:, 0]) & (owner == EVERYBODY))
    points = shapely.points(nodes.xy[spots])
    place, triangle = shapely.STRtree(triangles).query(points, predicate="intersects")
    pairs += [np.stack([spots[place], corner[triangle, k]], axis=1) for k in range(3)]
    edges = _distinct(np.concatenate(pairs), len(nodes.xy) + len(more))
    edges = edges[edges[:, 0] != edges[:, 1]]
    none = np.full((len(more), 2), np.nan)
    nodes = _Nodes(
        np.concatenate([nodes.xy, more]),
        np.concatenate([nodes.before, none]),
        np.concatenate([nodes.after, none]),
    )
    return nodes, np.concatenate([owner, np.full(len(more), EVERYBODY)]), edges


def _numbered(nodes: FloatArray, points: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return the number of each point (p, 2) among nodes (n, 2), and the points that are none of them.

    Those have the numbers from n on, in the order in which they first come.
    """
    n = len(nodes)
    xy = np.concatenate([nodes, points])
    # As one complex number each: sorting rows takes five times as long.
    distinct, first, which = np.unique(xy[:, 0] + 1j * xy[:, 1], return_index=True, return_inverse=True)
    number = np.full(len(distinct), -1, dtype=np.int64)
    number[which[:n]] = np.arange(n)
    new = np.flatnonzero(number < 0)
    new = new[np.argsort(first[new])]
    number[new] = n + np.arange(len(new))
    return number[which[n:]], xy[first[new]]


def _distinct(pairs: IntArray, nodes: int) -> IntArray:
    """Return each pair (p, 2) of so many nodes once, lower node first, in order."""
    low, high = pairs.min(axis=1), pairs.max(axis=1)
    return np.stack(np.divmod(np.unique(low * nodes + high), nodes), axis=1)


def _with_all_pairs_in_use(graph: VisibilityGraph, nodes: _Nodes, obstacles: Obstacles) -> VisibilityGraph:
    """Return the graph with all tangent pairs of those corners that its shortest routes pass."""
    places = np.arange(graph.places, dtype=np.int64)
    routes = ShortestRoutes(graph.owner, graph.edges, graph.length_m, places)
    passed: set[int] = set()
    for a, b in zip(*np.nonzero(np.triu(np.isfinite(routes.distance), 1)), strict=True):
        passed.update(routes.route(int(a), int(b)))
    used = np.array(sorted(passed), dtype=np.int64)
    used = used[graph.owner[used] == EVERYBODY]
    pairs = used[tangent_pairs(nodes.xy[used], nodes.before[used], nodes.after[used])]
    edges = _distinct(np.concatenate([graph.edges, _seen(nodes, pairs, obstacles)]), len(nodes.xy))
    return replace(graph, edges=edges, length_m=nodes.length_m(edges))
