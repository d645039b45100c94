"""Drives keep clear of hazards on maps with many of them, and are there where the ground is open."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
import shapely
from scipy import ndimage

from planner.path_network import (
    DriveRule,
    KeepOut,
    NetworkOptions,
    NetworkRequest,
    ObservationPoint,
    PathNetwork,
    Pose,
    Target,
    build_network,
)
from planner.path_network.hazards import hazard_polygons
from planner.path_network.obstacles import build_obstacles, check_request
from tests.planner.path_network.worlds import random_world, rocky_world

APPROACH_M = 1.2
CELL_M = 0.25


def _hazards(request: NetworkRequest) -> list[shapely.Polygon]:
    assert request.terrain is not None
    return hazard_polygons(request.terrain, request.rover, request.options)


def _lengths_over(network: PathNetwork, other: PathNetwork) -> list[float]:
    """Return how long each drive is over the same one of another network, which must have it."""
    ratios = []
    for route in network.routes:
        same = other.route(route.origin, route.destination)
        assert same is not None
        ratios.append(route.length_m / same.length_m)
    return ratios


def _least_clearance(network: PathNetwork, bodies: list[shapely.Polygon]) -> float:
    """Return the least distance from a body of the samples of all drives, their approaches left out."""
    samples = []
    for route in network.routes:
        line = shapely.LineString(route.points)
        if line.length > 2 * APPROACH_M:
            samples.append(
                shapely.line_interpolate_point(line, np.arange(APPROACH_M, line.length - APPROACH_M, 0.05))
            )
    points = np.concatenate(samples)
    near, body = shapely.STRtree(bodies).query(points, predicate="dwithin", distance=1.0)
    return float(shapely.distance(points[near], np.array(bodies, dtype=object)[body]).min())


def _connected(
    request: NetworkRequest, bodies: list[shapely.Polygon], clearance_m: float
) -> npt.NDArray[np.int64]:
    """Return the number of the open area that each place lies in on a grid; 0 where it is in none."""
    west, south, east, north = request.terrain.bounds_m  # type: ignore[union-attr]
    columns, rows = round((east - west) / CELL_M), round((north - south) / CELL_M)
    e, n = np.meshgrid(west + (np.arange(columns) + 0.5) * CELL_M, south + (np.arange(rows) + 0.5) * CELL_M)
    points = shapely.points(np.stack([e.ravel(), n.ravel()], axis=1))
    near, _ = shapely.STRtree(bodies).query(points, predicate="dwithin", distance=clearance_m)
    free = np.ones(rows * columns, dtype=bool)
    free[near] = False
    label, _ = ndimage.label(free.reshape(rows, columns), np.ones((3, 3)))
    places = [request.start, *(p.pose for p in request.observation_points)]
    cells = [(int((p.north_m - south) / CELL_M), int((p.east_m - west) / CELL_M)) for p in places]
    return np.array([label[cell] for cell in cells])


@pytest.fixture(scope="module", params=[1, 2])
def rocky(request: pytest.FixtureRequest) -> tuple[NetworkRequest, PathNetwork]:
    world = rocky_world(request.param, rocks=200, points=16, size_m=110.0)
    return world, build_network(world)


def test_no_drive_meets_a_hazard_and_all_keep_clear(rocky: tuple[NetworkRequest, PathNetwork]) -> None:
    world, network = rocky
    bodies = _hazards(world)
    blocked = build_obstacles(world, check_request(world))[0].blocked
    assert shapely.get_num_coordinates(blocked) > world.options.maximum_corners
    solid = shapely.union_all(bodies)
    assert all(shapely.LineString(r.points).intersection(solid).length < 1e-9 for r in network.routes)
    assert _least_clearance(network, bodies) >= world.rover.clearance_m


def test_there_is_a_drive_exactly_where_the_ground_is_open(rocky: tuple[NetworkRequest, PathNetwork]) -> None:
    world, network = rocky
    bodies = _hazards(world)
    tight, wide = (_connected(world, bodies, clearance_m) for clearance_m in (0.35, 0.85))
    names = list(network.places)
    for i, a in enumerate(names):
        for j in range(i):
            driven = network.route(a, names[j]) is not None
            if driven and tight[i] and tight[j]:
                assert tight[i] == tight[j]
            if wide[i] and wide[i] == wide[j]:
                assert driven


def test_drives_are_hardly_longer_than_those_over_all_pairs_of_corners() -> None:
    world = rocky_world(3, rocks=60, points=8, size_m=60.0)
    plain = replace(world, options=NetworkOptions(stretch=0.0))
    whole = build_network(replace(plain, options=NetworkOptions(stretch=0.0, maximum_corners=10_000)))
    near = build_network(replace(plain, options=NetworkOptions(stretch=0.0, maximum_corners=8, all_pairs=8)))
    assert {(r.origin, r.destination) for r in near.routes} == {
        (r.origin, r.destination) for r in whole.routes
    }
    ratios = _lengths_over(near, whole)
    assert max(ratios) < 1.03
    assert np.mean(ratios) < 1.01


@pytest.mark.parametrize("outward_m", [0.02, 0.08, 0.5])
def test_an_outline_made_simpler_leaves_nothing_within_the_clearance_open(outward_m: float) -> None:
    world = rocky_world(4, rocks=80, points=0, size_m=60.0)
    options = NetworkOptions(maximum_corners=8, outward_m=outward_m)
    blocked = build_obstacles(replace(world, options=options), ())[0].blocked
    clear = shapely.buffer(np.array(_hazards(world), dtype=object), world.rover.clearance_m, quad_segs=32)
    assert shapely.union_all(clear).difference(blocked).area < 1e-9


@pytest.mark.parametrize("seed", [0, 7])
def test_drives_among_few_rocks_are_as_short_as_over_exact_outlines(seed: int) -> None:
    world = rocky_world(seed, rocks=80, points=16, size_m=60.0)
    usual, exact = (
        build_network(replace(world, options=NetworkOptions(stretch=0.0, maximum_corners=most)))
        for most in (NetworkOptions().maximum_corners, 100_000)
    )
    assert max(_lengths_over(usual, exact)) < 1.01


@pytest.mark.parametrize("most", [8, 1_000])
@pytest.mark.parametrize("outline", ["two bodies", "one body"])
def test_a_gap_of_a_little_over_twice_the_clearance_stays_open(outline: str, most: int) -> None:
    half = 0.605
    if outline == "two bodies":
        walls = ([(0, half), (3, half), (3, 20), (0, 20)], [(0, -20), (3, -20), (3, -half), (0, -half)])
    else:  # round a room, with a mouth to the west
        room = [(0, half), (3, half), (3, 5), (9, 5), (9, -5), (3, -5), (3, -half), (0, -half)]
        walls = ([*room, (0, -20), (12, -20), (12, 20), (0, 20)],)
    kept = tuple(KeepOut(f"K{k}", wall) for k, wall in enumerate(walls))
    options = NetworkOptions(maximum_corners=most)
    request = NetworkRequest(Pose(-2.0, 0.0), (), (), kept, options=options)
    blocked = build_obstacles(request, check_request(request))[0].blocked
    assert not shapely.LineString([(-2.0, 0.0), (6.0, 0.0)]).intersects(blocked)
    clear = shapely.buffer([shapely.Polygon(wall) for wall in walls], 0.6, quad_segs=32)
    assert shapely.union_all(clear).difference(blocked).area < 1e-9


def test_only_its_own_drives_come_as_near_to_a_rock_as_an_observation_point() -> None:
    rock = KeepOut("rock", [(9.0, -0.3), (10.0, -0.3), (10.0, 1.0), (9.0, 1.0)])
    network = build_network(
        NetworkRequest(
            Pose(0.0, -0.6),
            (Target("near", 9.5, -0.4, tracked=False), Target("far", 20.0, -0.6, tracked=False)),
            (ObservationPoint("N", "near", Pose(9.5, -0.5)), ObservationPoint("F", "far", Pose(19.0, -0.6))),
            (rock,),
        )
    )
    own, passing = network.route("start", "N"), network.route("start", "F")
    assert own is not None
    assert passing is not None
    body = shapely.Polygon(rock.polygon_m)
    assert 0.18 - 1e-6 <= shapely.LineString(own.points).distance(body) <= 0.2 + 1e-6
    assert shapely.LineString(passing.points).distance(body) >= 0.6


def test_a_place_in_a_margin_is_no_way_through_for_others() -> None:
    # Two walls with a gap of 0.9 m: too narrow to pass with a clearance of 0.6 m, wide enough to stand in.
    walls = (
        KeepOut("south", [(9.9, -30.0), (10.1, -30.0), (10.1, -0.45), (9.9, -0.45)]),
        KeepOut("north", [(9.9, 0.45), (10.1, 0.45), (10.1, 30.0), (9.9, 30.0)]),
    )
    request = NetworkRequest(
        Pose(0.0, 0.0),
        (Target("gap", 12.0, 0.0, tracked=False), Target("behind", 21.0, 0.0, tracked=False)),
        (ObservationPoint("G", "gap", Pose(10.0, 0.0)), ObservationPoint("B", "behind", Pose(20.0, 0.0))),
        walls,
        bounds_m=(-5.0, -25.0, 25.0, 25.0),
    )
    network = build_network(request)
    assert network.route("start", "G") is not None
    assert network.route("G", "B") is not None
    assert network.route("start", "B") is None
    drawn = replace(request, drive_rules=(DriveRule("start", "behind", ((10.0, 0.0),)),))
    assert "comes too near" in build_network(drawn).missing[0].reason


def test_drives_in_both_directions_are_one_route_also_at_places_in_margins() -> None:
    for seed in range(6):
        world = random_world(seed, keep_outs=14)
        bodies = [shapely.Polygon(k.polygon_m) for k in world.keep_outs]
        stands = []
        for point, body in zip(world.observation_points, bodies, strict=False):
            at = np.asarray(body.exterior.interpolate(0.3, normalized=True).coords)[0]
            out = at - np.asarray(body.centroid.coords)[0]
            east, north = at + 0.3 * out / math.hypot(*out)
            if min(b.distance(shapely.Point(east, north)) for b in bodies) > 0.05:
                point = replace(point, pose=Pose(float(east), float(north)))
            stands.append(point)
        options = NetworkOptions(maximum_loss=1.0)  # else the safest route for a track is another one
        network = build_network(replace(world, observation_points=tuple(stands), options=options))
        assert network.routes
        for route in network.routes:
            back = network.route(route.destination, route.origin)
            if back is not None:
                assert back.points == route.points[::-1]
            assert not any(shapely.LineString(route.points).crosses(body) for body in bodies)
        assert _least_clearance(network, bodies) >= 0.6 - 1e-9
