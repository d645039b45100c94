"""The fast parts of the visibility graph against exact geometry and plain definitions."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import shapely

from planner.errors import NetworkError
from planner.path_network import KeepOut, NetworkOptions, Target, build_network
from planner.path_network.consolidation import greedy_spanner
from planner.path_network.near_pairs import LOOKED_AT, NEAREST, SECTORS, near_pairs, tangent_pairs
from planner.path_network.obstacles import build_obstacles, check_request, clear_of, ring_corners
from planner.path_network.shortest_routes import EVERYBODY, ShortestRoutes
from planner.path_network.sight import Outline
from planner.path_network.values import FloatArray, IntArray
from planner.path_network.visibility_graph import _numbered
from tests.planner.path_network.worlds import random_world, rocky_world


@pytest.mark.parametrize("corners", [500, 8])
@pytest.mark.parametrize("seed", range(3))
def test_an_outline_stops_the_segments_that_exact_geometry_stops(seed: int, corners: int) -> None:
    world = rocky_world(seed, rocks=40, points=0, size_m=60.0)
    wall = KeepOut("wall", ((70.0, -20.0), (90.0, 10.0), (60.0, 60.0)))  # its edges pass many cells
    world = replace(world, keep_outs=(wall,), options=NetworkOptions(maximum_corners=corners))
    obstacles, _ = build_obstacles(world, check_request(world))
    rng = np.random.default_rng(seed)
    ends = rng.uniform(-15.0, 100.0, (2, 6000, 2))  # some leave the grid
    ends[1, :500] = ends[0, :500] + rng.normal(0.0, 0.3, (500, 2))
    ends[1, 500:600] = ends[0, 500:600]  # of no length
    ends[1, 600:900, 0] = ends[0, 600:900, 0]  # along a column of cells
    ends[1, 900:1200, 1] = ends[0, 900:1200, 1]
    corner = ring_corners(obstacles.blocked)[0]
    ends[0, 1200:3000] = corner[rng.integers(len(corner), size=1800)]  # from corners, half of them to corners
    ends[1, 1200:2100] = corner[rng.integers(len(corner), size=900)]
    here, _, after = ring_corners(obstacles.blocked)
    ends = np.concatenate([ends, np.stack([here, after])], axis=1)  # along the edges
    outside = ~shapely.contains_xy(obstacles.blocked, *ends[0].T) & ~shapely.contains_xy(
        obstacles.blocked, *ends[1].T
    )
    first, second = ends[0, outside], ends[1, outside]
    stopped = obstacles.outline.stops(first, second)
    free = clear_of(obstacles.blocked, shapely.linestrings(np.stack([first, second], axis=1)))
    assert np.array_equal(stopped, ~free)
    assert stopped.sum() > 1000
    assert free.sum() > 1000


def test_each_piece_of_an_outline_stops_what_meets_it_in_any_cell() -> None:
    # Ends lie on both sides, so that no other piece stops a segment for the one that it meets.
    rng = np.random.default_rng(8)
    triangle = shapely.Polygon([(70.0, -20.0), (90.0, 10.0), (60.0, 60.0)])
    edge = np.asarray(shapely.boundary(triangle))
    along = shapely.line_interpolate_point(edge, rng.uniform(0.0, shapely.length(edge), 3000))
    ends = shapely.get_coordinates(along) + rng.normal(0.0, 0.3, (2, 3000, 2))
    meets = shapely.intersects(edge, shapely.linestrings(np.stack([ends[0], ends[1]], axis=1)))
    assert np.array_equal(Outline(triangle).stops(ends[0], ends[1]), meets)
    assert 1000 < meets.sum() < 2000


def test_where_nothing_is_blocked_no_segment_is_stopped() -> None:
    ends = np.array([[[-1.0, 0.5], [2.0, 0.5]]])
    assert Outline(shapely.box(0.0, 0.0, 1.0, 1.0)).stops(ends[:, 0], ends[:, 1]).all()
    assert not Outline(shapely.Polygon()).stops(ends[:, 0], ends[:, 1]).any()


def test_points_are_numbered_as_the_nodes_that_they_are_and_then_as_they_come() -> None:
    nodes = np.array([[0.0, 0.0], [5.0, 1.0], [2.0, 2.0]])
    points = np.array([[9.0, 9.0], [2.0, 2.0], [-1.0, 0.0], [9.0, 9.0], [0.0, -0.0]])
    number, more = _numbered(nodes, points)
    assert number.tolist() == [3, 2, 4, 3, 0]
    assert more.tolist() == [[9.0, 9.0], [-1.0, 0.0]]


def test_a_keep_out_that_a_target_lies_in_is_named_as_the_first() -> None:
    world = random_world(3)
    box = ((-2.0, -2.0), (32.0, -2.0), (32.0, 32.0), (-2.0, 32.0))
    inside = replace(world, keep_outs=(*world.keep_outs, KeepOut("big", box), KeepOut("bigger", box)))
    with pytest.raises(NetworkError, match=r"^start \(15, 15\) lies inside keep-out big$"):
        build_network(inside)
    small = KeepOut("small", ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)))
    aim = Target("inner", 0.5, 0.5)
    with pytest.raises(NetworkError, match=r"^target inner \(0.5, 0.5\) lies inside keep-out small$"):
        build_network(replace(world, targets=(*world.targets, aim), keep_outs=(*world.keep_outs, small)))


def _corners(seed: int, rocks: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return places and corners of blocked ground, with the corners before and after each."""
    world = rocky_world(seed, rocks=rocks, points=0, size_m=60.0)
    corners = ring_corners(build_obstacles(world, ())[0].blocked)
    places = np.random.default_rng(seed).uniform(0.0, 60.0, (5, 2))
    none = np.full((5, 2), np.nan)
    xy, before, after = (np.concatenate(pair) for pair in zip((places, none, none), corners, strict=True))
    return xy, before, after


def _one_side(xy: FloatArray, before: FloatArray, after: FloatArray, a: int, b: int) -> bool:
    for end, other in ((a, b), (b, a)):
        if not np.isnan(before[end, 0]):
            turn = np.cross(
                np.append(xy[other] - xy[end], 0.0),
                [np.append(before[end] - xy[end], 0.0), np.append(after[end] - xy[end], 0.0)],
            )[:, 2]
            if turn[0] * turn[1] < -1e-9:
                return False
    return True


def test_all_tangent_pairs_are_those_of_the_definition() -> None:
    xy, before, after = (part[:120] for part in _corners(1, rocks=6))
    expected = [[a, b] for a in range(120) for b in range(a + 1, 120) if _one_side(xy, before, after, a, b)]
    assert tangent_pairs(xy, before, after).tolist() == expected


@pytest.mark.parametrize(("rocks", "away_m"), [(6, 0.0), (60, 0.0), (60, 2000.0)])
def test_near_pairs_are_the_nearest_tangent_ones_in_each_direction(rocks: int, away_m: float) -> None:
    """Of fewer nodes than are looked at, of more, and of those with one far from all others."""
    xy, before, after = _corners(2, rocks)
    xy[0] += away_m
    found: dict[int, list[int]] = {}
    for a, b in near_pairs(xy, before, after).tolist():
        found.setdefault(a, []).append(b)
    assert (len(xy) > LOOKED_AT) == (rocks > 6)
    for a in range(0, len(xy), 17):
        expected, taken = [], [0] * SECTORS
        for b in np.argsort(np.hypot(*(xy - xy[a]).T), kind="stable")[:LOOKED_AT].tolist():
            east, north = xy[b] - xy[a]
            sector = int((np.arctan2(north, east) + np.pi) / (2 * np.pi) * SECTORS) % SECTORS
            if b != a and taken[sector] < NEAREST and _one_side(xy, before, after, a, b):
                taken[sector] += 1
                expected.append(b)
        assert sorted(found.get(a, [])) == sorted(expected)


def _segments(seed: int, nodes: int) -> tuple[FloatArray, IntArray, FloatArray]:
    """Return nodes, pairs of near ones and their distances."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform(0.0, 10.0, (nodes, 2))
    first, second = np.triu_indices(nodes, 1)
    length = np.hypot(*(xy[first] - xy[second]).T)
    near = length < 2.0
    return xy, np.stack([first[near], second[near]], axis=1), length[near]


def test_shortest_routes_are_dijkstras_and_pass_no_node_of_another_place() -> None:
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import dijkstra

    _, edges, length = _segments(3, 150)
    places = np.arange(8)
    owner = np.full(150, EVERYBODY)
    owner[[2, 20, 21, 22]] = 2
    owner[[5, 30, 31]] = 5
    routes = ShortestRoutes(owner, edges, length, places)
    weight = {(int(u), int(v)): float(w) for (u, v), w in zip(edges, length, strict=True)}
    for a in places.tolist():
        for b in range(a):
            mine = (owner == EVERYBODY) | (owner == a) | (owner == b)
            kept = mine[edges].all(axis=1)
            graph = coo_matrix((length[kept], edges[kept].T), shape=(150, 150))
            assert routes.distance[a, b] == pytest.approx(dijkstra(graph, directed=False, indices=a)[b])
            nodes = routes.route(a, b)
            assert (nodes[0], nodes[-1]) == (a, b)
            assert nodes == routes.route(b, a)[::-1]
            assert mine[nodes].all()
            whole = sum(weight[min(u, v), max(u, v)] for u, v in pairwise(nodes))
            assert whole == pytest.approx(routes.distance[a, b])


def test_places_that_no_segment_joins_have_no_route() -> None:
    routes = ShortestRoutes(np.full(3, EVERYBODY), np.array([[0, 1]]), np.array([1.0]), np.arange(3))
    assert routes.distance.tolist() == [[0.0, 1.0, np.inf], [1.0, 0.0, np.inf], [np.inf, np.inf, 0.0]]


@pytest.mark.parametrize("stretch", [0.015, 0.3])
def test_a_spanner_keeps_a_segment_exactly_where_the_shorter_ones_kept_make_too_long_a_detour(
    stretch: float,
) -> None:
    xy, edges, length = _segments(4, 80)
    keep = greedy_spanner(xy, edges, length, stretch)
    away = np.full((80, 80), np.inf)
    np.fill_diagonal(away, 0.0)
    for e in np.argsort(length, kind="stable"):
        a, b = edges[e]
        assert keep[e] == (away[a, b] > (1.0 + stretch) * length[e])
        if keep[e]:  # Floyd and Warshall, one segment at a time
            there, back = away[:, [a]] + length[e] + away[b], away[:, [b]] + length[e] + away[a]
            away = np.minimum(away, np.minimum(there, back))
    assert 0 < keep.sum() < len(keep)
