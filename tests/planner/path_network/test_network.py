"""Properties of the path network, and its answers to wrong input."""

from __future__ import annotations

import math
import time
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from mission import TerrainGrid
from planner.errors import NetworkError
from planner.path_network import (
    KeepOut,
    NetworkOptions,
    NetworkRequest,
    ObservationPoint,
    Pose,
    RoverParameters,
    Target,
    build_network,
)
from tests.planner.path_network.worlds import random_world

PLAIN = NetworkOptions(stretch=0.0, maximum_loss=1.0)
SEEDS = st.integers(0, 10_000)


@settings(max_examples=25, deadline=None)
@given(SEEDS)
def test_no_route_crosses_a_keep_out(seed: int) -> None:
    request = random_world(seed)
    network = build_network(request)
    solid = [shapely.Polygon(k.polygon_m) for k in request.keep_outs]
    assert network.routes
    for route in network.routes:
        line = shapely.LineString(route.points)
        for polygon in solid:
            assert line.intersection(polygon).length < 1e-6


@settings(max_examples=25, deadline=None)
@given(SEEDS)
def test_routes_keep_the_clearance_except_round_their_own_narrow_places(seed: int) -> None:
    request = random_world(seed)
    clearance = request.rover.clearance_m
    network = build_network(request)
    spots = [shapely.Point(p.east_m, p.north_m) for p in network.places.values()]
    open_ground = shapely.union_all([s.buffer(clearance * 1.01) for s in spots])
    for route in network.routes:
        line = shapely.LineString(route.points).difference(open_ground)
        if line.is_empty:
            continue
        for keep_out in request.keep_outs:
            assert line.distance(shapely.Polygon(keep_out.polygon_m)) >= clearance - 2e-3


@settings(max_examples=15, deadline=None)
@given(SEEDS)
def test_lengths_and_losses_are_the_same_in_both_directions(seed: int) -> None:
    network = build_network(replace(random_world(seed), options=NetworkOptions(maximum_loss=1.0)))
    for route in network.routes:
        back = network.route(route.destination, route.origin)
        assert back is not None
        assert back.length_m == pytest.approx(route.length_m, abs=1e-9)
        assert back.points == route.points[::-1]
        assert dict(back.p_lose) == pytest.approx(dict(route.p_lose))


@settings(max_examples=15, deadline=None)
@given(SEEDS)
def test_a_further_keep_out_never_shortens_a_route(seed: int) -> None:
    more = replace(random_world(seed, keep_outs=9), options=PLAIN)
    fewer = replace(more, keep_outs=more.keep_outs[:-1])
    wide, tight = build_network(fewer), build_network(more)
    for route in tight.routes:
        before = wide.route(route.origin, route.destination)
        assert before is not None
        assert route.length_m >= before.length_m - 1e-3


@settings(max_examples=15, deadline=None)
@given(SEEDS, st.sampled_from([0.02, 0.05, 0.2]))
def test_consolidation_has_fewer_segments_and_keeps_every_route_within_its_stretch(
    seed: int, stretch: float
) -> None:
    request = random_world(seed)
    full = build_network(replace(request, options=PLAIN))
    thin = build_network(replace(request, options=NetworkOptions(stretch=stretch, maximum_loss=1.0)))
    assert len(thin.segments) <= len(full.segments)
    assert {(r.origin, r.destination) for r in thin.routes} == {
        (r.origin, r.destination) for r in full.routes
    }
    for route in thin.routes:
        shortest = full.route(route.origin, route.destination)
        assert shortest is not None
        assert shortest.length_m - 1e-6 <= route.length_m <= (1 + stretch) * shortest.length_m + 1e-6
        assert thin.shortest_m[route.origin, route.destination] == pytest.approx(shortest.length_m, abs=1e-5)


@settings(max_examples=15, deadline=None)
@given(SEEDS)
def test_segments_of_a_route_are_its_polyline(seed: int) -> None:
    network = build_network(random_world(seed))
    for route in network.routes:
        assert sum(network.segments[s].length_m for s in route.segments) == pytest.approx(route.length_m)
        keep = np.prod([1 - network.segments[s].worst_loss for s in route.segments])
        assert max(route.p_lose.values(), default=0.0) <= 1 - keep + 1e-9
    assert all(s.routes > 0 for s in network.segments)


def test_a_wall_is_passed_at_its_nearer_end() -> None:
    request = NetworkRequest(
        Pose(0, 0),
        (Target("T", 10, 0),),
        (ObservationPoint("O", "T", Pose(9, 0)),),
        (KeepOut("wall", [(4.9, -1), (5.1, -1), (5.1, 8), (4.9, 8)]),),
        rover=RoverParameters(clearance_m=0.0),
    )
    drive = build_network(request).route("start", "O")
    assert drive is not None
    expected = math.hypot(4.9, 1) + 0.2 + math.hypot(3.9, 1)
    assert drive.length_m == pytest.approx(expected, abs=2e-3)
    assert all(north <= 1e-9 for _, north in drive.points)
    lean = math.atan2(1, 4.9)
    assert drive.turn_rad == pytest.approx(lean + lean + 2 * math.atan2(1, 3.9), abs=2e-3)


def test_costs_follow_the_stated_model() -> None:
    request = NetworkRequest(Pose(0, 0), (Target("T", 9, 0),), (ObservationPoint("O", "T", Pose(8, 0)),))
    drive = build_network(request).route("start", "O")
    assert drive is not None
    model, rover = request.calibration, request.rover
    assert drive.duration_mean_s == pytest.approx(300 + 9.9 * 8 / 0.06)
    assert drive.duration_sd_s == pytest.approx(0.88 * drive.duration_mean_s)
    assert drive.energy_mean_j == pytest.approx(rover.drive_power_w * drive.duration_mean_s)
    assert drive.p_lose["T"] == pytest.approx(1 - math.exp(-8 * model.inside_per_m))


def test_a_k9_leg_costs_what_the_paper_prints() -> None:
    request = NetworkRequest(Pose(0, 0), (Target("T", 8, 0),), (ObservationPoint("O", "T", Pose(7, 0)),))
    drive = build_network(request).route("start", "O")
    assert drive is not None
    total_j = drive.energy_mean_j + request.rover.hotel_w * drive.duration_mean_s
    total_sd = math.hypot(drive.energy_sd_j, request.rover.hotel_w * drive.duration_sd_s)
    assert drive.duration_mean_s == pytest.approx(1457, rel=0.01)  # Pedersen et al. 2005, CRL example
    assert drive.duration_sd_s == pytest.approx(1280, rel=0.01)
    assert total_j == pytest.approx(174_345, rel=0.01)
    assert total_sd == pytest.approx(49_250, rel=0.01)


def test_leaving_the_cone_costs_the_track_more_than_staying_in_it() -> None:
    targets = (Target("ahead", 10, 0), Target("left", 0, 10))
    points = (ObservationPoint("A", "ahead", Pose(9, 0)), ObservationPoint("L", "left", Pose(0, 9)))
    drive = build_network(NetworkRequest(Pose(0, 0), targets, points)).route("start", "A")
    assert drive is not None
    assert drive.p_lose["ahead"] < 0.05 < drive.p_lose["left"]


def test_ground_between_camera_and_target_hides_it() -> None:
    heights = np.zeros((80, 80))
    heights[:, 38:42] = 3.0  # a ridge at 9.5 to 10.5 m east
    grid = TerrainGrid(0.125, 19.875, 0.25, heights)
    targets = (Target("behind", 18, 10),)
    points = (ObservationPoint("P", "behind", Pose(17, 10)), ObservationPoint("Q", "behind", Pose(6, 10)))
    blind = NetworkRequest(
        Pose(2, 10),
        targets,
        points,
        terrain=grid,
        rover=RoverParameters(maximum_slope_rad=1.5, maximum_step_m=9),
    )
    hidden = build_network(blind).route("start", "Q")
    seen = build_network(replace(blind, terrain=None)).route("start", "Q")
    assert hidden is not None
    assert seen is not None
    assert hidden.p_lose["behind"] > 5 * seen.p_lose["behind"]


def test_a_drive_that_very_likely_loses_its_own_track_is_taken_out_with_its_reason() -> None:
    targets = (Target("near", 0, 8), Target("far", 30, 0))
    points = (ObservationPoint("N", "near", Pose(0, 7)), ObservationPoint("F", "far", Pose(29, 0)))
    strict = NetworkRequest(Pose(0, 0), targets, points, options=NetworkOptions(maximum_loss=0.4))
    network = build_network(strict)
    gone = {(m.origin, m.destination): m.reason for m in network.missing}
    assert "track of near" in gone["F", "N"]
    assert "limit 0.4" in gone["F", "N"]
    assert network.route("start", "N") is not None
    untracked = replace(strict, targets=(replace(targets[0], tracked=False), targets[1]))
    assert build_network(untracked).route("F", "N") is not None


def test_a_steep_bank_is_driven_round_and_a_moat_makes_a_point_unreachable() -> None:
    heights = np.zeros((120, 120))
    heights[40:80, 58:62] = 4.0
    grid = TerrainGrid(0.125, 29.875, 0.25, heights)
    request = NetworkRequest(
        Pose(5, 15), (Target("T", 25, 15),), (ObservationPoint("O", "T", Pose(24, 15)),), terrain=grid
    )
    network = build_network(request)
    drive = network.route("start", "O")
    assert drive is not None
    assert network.hazards
    assert drive.length_m > 19 + 1
    heights = np.zeros((120, 120))
    row, column = np.mgrid[0:120, 0:120]
    ring = np.hypot(row - 59.5, column - 96) * 0.25
    heights[(ring > 3) & (ring < 4)] = -5
    closed = build_network(replace(request, terrain=TerrainGrid(0.125, 29.875, 0.25, heights)))
    assert [u.id for u in closed.unreachable] == ["O"]
    assert "close every path" in closed.unreachable[0].reason
    assert closed.route("start", "O") is None


def test_climbing_costs_time_and_energy_uphill_only() -> None:
    east = np.arange(120) * 0.25
    grid = TerrainGrid(0.0, 29.75, 0.25, np.tile(0.1 * east, (120, 1)))
    request = NetworkRequest(
        Pose(5, 15), (Target("T", 21, 15),), (ObservationPoint("O", "T", Pose(20, 15)),), terrain=grid
    )
    network = build_network(request)
    up, down = network.route("start", "O"), network.route("O", "start")
    assert up is not None
    assert down is not None
    assert up.climb_m == pytest.approx(1.5, rel=0.05)
    assert down.climb_m == pytest.approx(0.0, abs=1e-6)
    assert up.energy_mean_j > down.energy_mean_j


def test_unreachable_points_and_the_best_of_several_candidates_are_named() -> None:
    request = NetworkRequest(
        Pose(0, 0),
        (Target("T", 10, 0), Target("U", 0, 10)),
        (
            ObservationPoint("in", "T", Pose(8.5, 0)),
            ObservationPoint("far", "T", Pose(10, 6)),
            ObservationPoint("good", "T", Pose(9.4, 0.3)),
            ObservationPoint("u", "U", Pose(0, 8.5)),
        ),
        (
            KeepOut("box", [(8, -1), (9, -1), (9, 1), (8, 1)]),
            KeepOut("lid", [(-1, 8), (1, 8), (1, 9), (-1, 9)]),
        ),
    )
    network = build_network(request)
    assert {u.id for u in network.unreachable} == {"in", "u"}
    assert "keep-out box" in next(u.reason for u in network.unreachable if u.id == "in")
    assert network.best_points() == {"T": "good"}
    assert {m.destination for m in network.missing if m.origin == "start"} == {"in", "u"}


BASE = NetworkRequest(
    Pose(0, 0),
    (Target("T", 10, 0),),
    (ObservationPoint("O", "T", Pose(9, 0)),),
    (KeepOut("K", [(4, -1), (5, -1), (5, 1)]),),
    bounds_m=(-20, -20, 20, 20),
)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"start": Pose(4.8, -0.5)}, r"start \(4.8, -0.5\) lies inside keep-out K"),
        ({"targets": (Target("T", 4.8, -0.5),)}, "target T .* lies inside keep-out K"),
        ({"keep_outs": (KeepOut("K", [(4, -1), (5, -1)]),)}, "keep-out K has 2 corners; at least 3"),
        ({"keep_outs": (KeepOut("K", [(0, 5), (2, 7), (2, 5), (0, 7)]),)}, "keep-out K crosses itself"),
        ({"keep_outs": (KeepOut("K", [(5, 5), (6, 6), (7, 7)]),)}, "keep-out K"),
        ({"keep_outs": (KeepOut("K", [(4, -1), (math.nan, -1), (5, 1)]),)}, "keep-out K holds nan"),
        ({"start": Pose(math.nan, 0)}, "start holds nan"),
        ({"targets": (Target("T", math.inf, 0),)}, "target T holds inf"),
        (
            {"observation_points": (ObservationPoint("O", "T", Pose(25, 0)),)},
            "observation point O .* off the map",
        ),
        ({"observation_points": (ObservationPoint("O", "X", Pose(9, 0)),)}, "target 'X', which is not given"),
        ({"observation_points": (ObservationPoint("start", "T", Pose(9, 0)),)}, "may not be called 'start'"),
        ({"targets": (Target("T", 10, 0), Target("T", 9, 0))}, "target T is given twice"),
        ({"bounds_m": (5, 0, -5, 9)}, "west < east"),
        ({"bounds_m": None, "terrain": TerrainGrid(0, 0, 0.0, np.zeros((9, 9)))}, "spacing_m"),
        ({"bounds_m": None, "terrain": TerrainGrid(0, 0, 1.0, np.zeros(9))}, "two dimensions"),
        (
            {"bounds_m": None, "terrain": TerrainGrid(-9, 9, 1.0, np.full((19, 29), np.nan))},
            "no height at all",
        ),
    ],
)
def test_a_wrong_request_is_refused_with_name_value_and_limit(
    change: dict[str, object], message: str
) -> None:
    with pytest.raises(NetworkError, match=message):
        build_network(replace(BASE, **change))  # type: ignore[arg-type]


def test_wrong_rover_parameters_are_refused() -> None:
    with pytest.raises(NetworkError, match="speed_m_s is 0"):
        RoverParameters(speed_m_s=0.0)
    with pytest.raises(NetworkError, match="stretch is -1"):
        NetworkOptions(stretch=-1)


def test_forty_targets_and_thirty_keep_outs_take_less_than_a_second() -> None:
    request = random_world(3, targets=40, keep_outs=30, size_m=64.0)
    build_network(request)
    began = time.process_time()
    network = build_network(request)
    assert len(network.routes) > 1000
    assert time.process_time() - began < 1.0
