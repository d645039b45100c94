"""Navigator: clouds to hazards, hazards to arcs, arcs to drives."""

from __future__ import annotations

import math
import os
from dataclasses import astuple, replace

import numpy as np
import pytest

from rover_iface.errors import RoverError
from rover_iface.frames import Pose
from rover_iface.mobility import settle, settled_pose
from rover_iface.navigation.footing import FootingLimits, filled, free_lengths, under_body
from rover_iface.navigation.hazard_map import HazardMap, MapParameters
from rover_iface.navigation.kernels import cast_ranges, cost_to_go, obstacle_distance, try_ways
from rover_iface.navigation.navigator import Navigator, NavigatorParameters, Progress, Way, end_of
from rover_iface.navigation.registration import RegistrationParameters, register
from rover_iface.navigation.sensor import GroundRaster, StereoSensor
from rover_iface.profile import load_profile
from rover_iface.simulator.chassis import Chassis
from rover_iface.simulator.traverse import drive
from rover_iface.simulator.world import Soil
from studies.common.random_drives import traverse_study
from tests.rover_iface.worlds import bumpy, plane

K9 = load_profile("k9")
TRAVERSES = int(os.environ.get("OUTCROP_TRAVERSES", "25"))
"""Drives of the long study: a hundred, of which three had collided once, where there is time."""


def looked(ground: GroundRaster, pose: Pose, looks: int = 2) -> HazardMap:
    sensor = StereoSensor(K9)
    rng = np.random.default_rng(1)
    hazards = HazardMap(K9, (pose.x, pose.y), 16.0)
    for k in range(looks):
        site = pose.site_from_rover
        clouds = [site.apply(c) for c in sensor.look(ground, pose, rng, around=k == 0)]
        hazards.update(clouds, site.apply(sensor.eye))
    return hazards


def test_a_ray_straight_down_and_one_aslant_have_the_range_of_the_plane() -> None:
    ground = GroundRaster.of(plane(0.1, 0.0), 9.0)
    eye = np.array([0.0, 0.0, 2.0])
    ways = np.array([[0.0, 0.0, -1.0], [0.8, 0.0, -0.6], [0.0, 0.0, 1.0]])
    ranges = cast_ranges(ground.heights, ground.west, ground.south, ground.spacing, eye, ways, 10.0)
    assert ranges[0] == pytest.approx(2.0, abs=1e-6)
    assert ranges[1] == pytest.approx(2.0 / 0.68, abs=0.01)
    assert math.isnan(ranges[2])


def test_a_raster_gives_the_heights_of_its_terrain() -> None:
    terrain = bumpy(lambda x, y: 0.2 * np.sin(x) * np.cos(y))
    ground = GroundRaster.of(terrain, 5.0)
    rng = np.random.default_rng(0)
    x, y = rng.uniform(-4.5, 4.5, (2, 100))
    assert np.allclose(ground.height(x, y), terrain.height(x, y), atol=2e-3)
    assert math.isnan(float(ground.height(99.0, 0.0)))


def test_level_ground_is_harmless_and_a_rock_is_an_obstacle() -> None:
    rock = bumpy(lambda x, y: np.where(np.hypot(x - 2.5, y) < 0.25, 0.25, 0.0))
    hazards = looked(GroundRaster.of(rock, 5.9), Pose(0, 0))
    assert hazards.at(2.3, 0.0) >= 1.0
    assert hazards.at(2.0, 1.5) < 0.6
    assert math.isnan(hazards.at(-5.0, 0.0))
    assert math.isnan(hazards.at(500.0, 0.0))
    row, column = (round((v - o) / hazards.cell) for v, o in ((1.5, hazards.south), (2.0, hazards.west)))
    assert hazards.confidence[row, column] > 0.5
    assert hazards.picture().shape == (*hazards.hazard.shape, 3)


def test_a_slope_beyond_the_rovers_is_an_obstacle() -> None:
    gentle = looked(GroundRaster.of(plane(0.2, 0.0), 9.0), Pose(0, 0, 0, 0.0, pitch=-math.atan(0.2)))
    steep = looked(GroundRaster.of(plane(0.6, 0.0), 9.0), Pose(0, 0, 0, 0.0, pitch=-math.atan(0.6)))
    assert gentle.at(2.0, 0.0) < 1.0
    assert steep.at(2.0, 0.0) >= 1.0


def test_distance_to_obstacles_is_that_of_geometry_within_six_per_cent() -> None:
    blocked = np.zeros((60, 60), dtype=bool)
    blocked[30, 20] = True
    distance = obstacle_distance(blocked, 0.1)
    r, c = np.mgrid[0:60, 0:60]
    true = 0.1 * np.hypot(r - 30, c - 20)
    assert np.all(np.abs(distance - true) <= 0.06 * true + 1e-9)


def test_the_way_to_the_goal_goes_round_a_wall() -> None:
    price = np.ones((41, 41))
    price[20, :30] = np.inf
    cost = cost_to_go(price, 1.0, 10, 5)
    assert cost[30, 5] > 40.0
    assert cost[10, 15] == pytest.approx(10.0)
    assert math.isinf(cost[20, 5])


def test_an_arc_ends_where_the_circle_says() -> None:
    x, y, heading = end_of(Pose(0, 0), 0.0, 1.0, math.pi / 2)
    assert (x, y, heading) == pytest.approx((1.0, 1.0, math.pi / 2))
    assert end_of(Pose(1, 2), math.pi / 2, 0.0, 2.0) == pytest.approx((1.0, 4.0, math.pi / 2))


def test_the_rover_comes_near_the_tracked_targets_own_rock() -> None:
    rock = bumpy(lambda x, y: np.where(np.hypot(x - 1.6, y) < 0.3, 0.3, 0.0))
    hazards = looked(GroundRaster.of(rock, 5.9), Pose(0, 0))
    # planes alone: nowhere does the rover stand well 50 m to either side
    planes = NavigatorParameters(footing=FootingLimits(astray=100.0, aside_m=50.0))
    navigator = Navigator(K9, hazards, planes, step_m=0.6)
    before = navigator.choose(Pose(0, 0), (0.6, 0.0))
    navigator.ignore = (1.6, 0.0, 0.6)
    after = navigator.choose(Pose(0, 0), (0.6, 0.0))
    assert after is not None
    assert abs(after.turn_rad) < 0.3
    assert end_of(Pose(0, 0), *astuple(after))[0] > 0.4
    assert before is None or before.length_m < after.length_m or abs(before.turn_rad) > 0.3


def test_a_way_ends_at_the_tracked_targets_own_rock_and_not_before() -> None:
    rock = bumpy(lambda x, y: np.where(np.hypot(x - 1.6, y) < 0.2, 0.3, 0.0))
    seen = looked(GroundRaster.of(rock, 5.9), Pose(0, 0))
    half_m, aside_m, margin_m = K9.body.length_m / 2, K9.body.width_m / 2, 0.13

    def free(*own: float) -> float:
        ways = np.array([[0.0, 0.0, 2.0]])
        at = (seen.west, seen.south, seen.cell, 0.0, 0.0, 0.0)
        return float(try_ways(seen.hazard, *at, ways, half_m, aside_m, margin_m, 0.35, *own)[0, 0])

    other, own = free(0.0, 0.0, -1.0), free(1.6, 0.0, 0.45)
    face_m = 1.4 - half_m  # where the bumper meets it
    assert other <= own
    assert face_m - 0.35 < own < face_m + 0.05


def test_slip_grows_uphill_and_the_rover_falls_short_of_what_it_believes() -> None:
    level = Chassis(plane(), K9, Pose(0, 0), rng=np.random.default_rng(0))
    assert level.slip(0.0) == pytest.approx(0.02)
    assert level.slip(0.3) > level.slip(0.1)
    short = []
    for seed in range(20):
        hill = Chassis(plane(0.25, 0.0), K9, Pose(0, 0), rng=np.random.default_rng(seed))
        for _ in range(4):
            hill.follow(Way(0.0, 0.0, 0.75))
        short.append(hill.believed.x - hill.pose.x)
    assert np.mean(short) > 0.4


def test_odometry_is_off_by_about_its_share_of_the_distance() -> None:
    errors = []
    for seed in range(200):
        chassis = Chassis(plane(), K9, Pose(0, 0), rng=np.random.default_rng(seed))
        chassis.follow(Way(0.0, 0.0, 0.75))
        errors.append((chassis.pose.x - chassis.believed.x) / 0.75)
    assert np.std(errors) == pytest.approx(K9.mobility.odometry_error, rel=0.2)
    assert abs(np.mean(errors)) < 0.01


def test_a_drive_into_a_boulder_is_a_collision_and_spinning_wheels_are_stuck() -> None:
    boulder = bumpy(lambda x, y: np.where(np.hypot(x - 1.5, y) < 0.3, 0.5, 0.0))
    chassis = Chassis(boulder, K9, Pose(0, 0), soil=Soil(), rng=np.random.default_rng(0))
    driven = chassis.follow(Way(0.0, 0.0, 2.0))
    assert driven.collision == "belly"
    assert chassis.pose.x < 1.3
    stuck = Chassis(plane(), K9, Pose(0, 0), rng=np.random.default_rng(0))
    stuck.extra_slip = 1.0
    assert stuck.follow(Way(0.0, 0.0, 1.0)).stuck
    assert stuck.pose.x < 0.1


def test_the_rover_drives_round_a_row_of_rocks() -> None:
    def row(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.where((np.abs(x - 2.5) < 0.25) & (np.abs(y) < 1.2), 0.4, 0.0)

    ground = GroundRaster.of(bumpy(row), 5.9)
    chassis = Chassis(ground, K9, Pose(0, 0), rng=np.random.default_rng(3))
    went = drive(chassis, ground, (4.5, 0.0))
    assert went.arrived, went.reason
    assert not went.collided
    assert went.length_m > 5.0
    assert went.worst_gap_m > 0.0


def test_a_goal_behind_a_ring_of_boulders_is_given_up_without_a_collision() -> None:
    def ring(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.where(np.abs(np.hypot(x, y) - 3.0) < 0.35, 0.6, 0.0)

    ground = GroundRaster.of(bumpy(ring), 5.9)
    chassis = Chassis(ground, K9, Pose(0, 0), rng=np.random.default_rng(3))
    went = drive(chassis, ground, (5.0, 0.0), most_looks=25)
    assert not went.arrived
    assert not went.collided


def test_a_look_is_laid_onto_the_map_to_two_centimetres() -> None:
    def hills(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        rocks = sum(
            np.where(np.hypot(x - a, y - b) < 0.2, 0.2, 0.0)
            for a, b in ((2.0, 0.6), (3.0, -1.0), (2.4, 2.0), (1.6, -2.0), (4.0, 1.4))
        )
        return rocks + 0.05 * np.sin(1.7 * x) * np.cos(1.3 * y)

    ground = GroundRaster.of(bumpy(hills), 5.9)
    sensor, rng = StereoSensor(K9), np.random.default_rng(4)
    navigator = Navigator.fresh(K9, (0.0, 0.0), (4.0, 0.0))
    start = settled_pose(ground, K9, 0.0, 0.0, 0.0)
    navigator.look(sensor.look(ground, start, rng, around=True), sensor.eye, start)
    true = settled_pose(ground, K9, 0.6, 0.1, 0.15)
    believed = replace(true, x=0.66, y=0.05, heading=0.165, z=true.z + 0.03)
    navigator.look(sensor.look(ground, true, rng), sensor.eye, believed)
    here = navigator.where(believed)
    assert navigator.correction.made
    assert math.hypot(here.x - true.x, here.y - true.y) < 0.02
    assert abs(here.heading - true.heading) < 0.006
    assert navigator.sigma_m < 0.02
    # A place beside the rover stays beside it, whatever frame it is told in.
    aside = believed.site_from_rover.apply(np.array([1.0, 0.5, 0.0]))
    expected = true.site_from_rover.apply(np.array([1.0, 0.5, 0.0]))
    assert navigator.on_map(float(aside[0]), float(aside[1])) == pytest.approx(tuple(expected[:2]), abs=0.03)


def test_looks_tell_a_way_apart_from_what_the_wheels_say() -> None:
    """The wheels claim a third more than each way, and the gyroscope is off by a tenth of a degree."""
    ground = GroundRaster.of(bumpy(lambda x, y: 0.08 * np.sin(2.1 * x + y) * np.cos(1.7 * y)), 9.0)
    sensor = StereoSensor(K9)
    off, squared = list[float](), list[float]()
    for seed in range(6):
        rng = np.random.default_rng(seed)
        navigator = Navigator.fresh(K9, (-4.0, 0.0), (4.0, 0.0))
        true = settled_pose(ground, K9, -2.0, 0.0, 0.4)
        believed = replace(true, x=5.0, y=2.0, heading=1.3)
        navigator.look(sensor.look(ground, true, rng, around=True), sensor.eye, believed)
        for k in range(3):
            began, stood = believed, true
            true = settled_pose(ground, K9, true.x + 0.6, true.y + 0.1 * k, true.heading + 0.1)
            came = stood.site_from_rover.inverse() * true.site_from_rover
            there = Pose.from_transform(began.site_from_rover * came)
            wheels = began.site_from_rover.apply(came.translation * (4.0 / 3.0, 1.0, 1.0))
            believed = replace(
                true, x=float(wheels[0]), y=float(wheels[1]), heading=there.heading + math.radians(0.1)
            )
            navigator.look(sensor.look(ground, true, rng), sensor.eye, believed)
            way = navigator.way
            assert way is not None
            assert way.began == began
            gap = np.array([getattr(way.ended, a) - getattr(there, a) for a in ("x", "y", "z", "heading")])
            off.append(math.hypot(gap[0], gap[1]))
            squared.append(float(gap @ np.linalg.solve(way.covariance, gap)))
    assert np.median(off) < 0.015
    assert max(off) < 0.04
    assert np.mean(np.array(squared) < 9.49) > 0.9  # 95 % of chi square with four degrees of freedom


def test_looks_at_flat_ground_tell_no_way() -> None:
    """What the wheels say must not come back as something seen."""
    ground = GroundRaster.of(plane(), 9.0)
    sensor, rng = StereoSensor(K9), np.random.default_rng(4)
    navigator = Navigator.fresh(K9, (0.0, 0.0), (4.0, 0.0))
    for x in (0.0, 0.75):
        navigator.look(sensor.look(ground, Pose(x, 0.0), rng, around=x == 0), sensor.eye, Pose(x, 0.0))
    assert navigator.way is not None
    sigma_m = np.sqrt(np.linalg.eigvalsh(navigator.way.covariance[:2, :2]))
    assert sigma_m[0] > 0.1
    assert np.sqrt(navigator.way.covariance[2, 2]) < 0.02


def test_flat_ground_leaves_the_pose_to_dead_reckoning_and_its_doubt_grows() -> None:
    ground = GroundRaster.of(plane(), 9.0)
    sensor, rng = StereoSensor(K9), np.random.default_rng(4)
    navigator = Navigator.fresh(K9, (0.0, 0.0), (4.0, 0.0))
    doubts = []
    for x in (0.0, 0.75, 1.5):
        navigator.look(sensor.look(ground, Pose(x, 0.0), rng, around=x == 0), sensor.eye, Pose(x, 0.0))
        here = navigator.where(Pose(x, 0.0))
        assert math.hypot(here.x - x, here.y) < 0.05
        doubts.append(navigator.sigma_m)
    assert doubts[0] < doubts[1] < doubts[2]


def test_too_little_overlap_is_no_registration() -> None:
    heights, known = np.zeros((40, 40)), np.zeros((40, 40), dtype=bool)
    fresh = np.column_stack((np.arange(30.0), np.arange(30.0), np.zeros(30), np.ones(30)))
    assert not register(heights, known, 0.1, fresh, (10.0, 10.0), 0.05).made
    with pytest.raises(RoverError, match="registration takes residuals"):
        RegistrationParameters(noise_m=0.1, outlier_m=0.05)


def ways_over(hazard: np.ndarray, *ways: tuple[float, float, float]) -> list[float]:
    seen = try_ways(
        hazard, -2.0, -2.0, 0.1, 0.0, 0.0, 0.0, np.array(ways), 0.525, 0.425, 0.13, 0.35, 0.0, 0.0, -1.0
    )
    return [float(v) for v in seen[:, 0]]


def test_a_rock_beside_the_rover_forbids_the_turn_that_would_sweep_it() -> None:
    hazard = np.zeros((41, 41))
    assert ways_over(hazard, (1.0, 0.0, 0.5)) == [0.5]
    hazard[25, 20] = 2.0  # half a metre to the left: beside the body, within reach of its corners
    turned, ahead = ways_over(hazard, (1.0, 0.0, 0.5), (0.0, 0.0, 0.5))
    assert turned == 0.0
    assert ahead == 0.5


def test_ground_never_seen_is_not_driven_onto_but_left() -> None:
    hazard = np.zeros((41, 41))
    hazard[18:23, 28:30] = np.nan
    (free,) = ways_over(hazard, (0.0, 0.0, 1.0))
    assert 0.0 < free < 0.35
    hazard[:] = 0.0
    hazard[20, 21] = np.nan  # under the mast, where no camera looks
    assert ways_over(hazard, (0.0, 0.0, 1.0)) == [1.0]


def test_beyond_the_map_the_ground_counts_as_never_seen() -> None:
    (free,) = ways_over(np.zeros((41, 41)), (0.0, 0.0, 3.0))
    assert 1.2 < free < 1.6  # the nose is at the map's edge, 2.05 m away


def ledge(rise_m: float) -> GroundRaster:
    """Return level ground with a ledge across all of it at x = 2 m."""
    return GroundRaster.of(bumpy(lambda x, y: np.where(x > 2.0, rise_m, 0.0) + 0.0 * y), 9.0)


@pytest.mark.parametrize(("rise_m", "crossed"), [(0.05, True), (0.12, True), (0.25, False)])
def test_a_ledge_that_the_wheels_climb_is_crossed_and_a_wall_is_not(rise_m: float, crossed: bool) -> None:
    ground = ledge(rise_m)
    chassis = Chassis(ground, K9, Pose(0.0, 0.0), rng=np.random.default_rng(1))
    run = drive(chassis, ground, (5.0, 0.0))
    assert run.arrived == crossed, run.reason
    assert not run.collided or run.reason == "collision: edge"  # of the terrain, on the way round
    assert run.straight_m == 5.0
    assert chassis.pose.x > 4.0 if crossed else chassis.pose.x < 1.6


def test_the_tracked_targets_own_rock_is_not_driven_over_though_wheels_would_climb_it() -> None:
    ground = GroundRaster.of(bumpy(lambda x, y: np.where(np.hypot(x - 1.6, y) < 0.3, 0.115, 0.0)), 5.9)
    navigator = Navigator(K9, looked(ground, Pose(0, 0)), step_m=1.5)
    navigator.ignore = (1.6, 0.0, 0.6)
    ahead = np.array([[0.0, 0.0, 2.0]])
    assert navigator._footing(Pose(0, 0), ahead)[0] > 1.5
    assert navigator._clear(navigator.map.hazard, Pose(0, 0), ahead)[0] < 0.85  # its nose at the rock


def test_a_target_that_lies_flat_on_the_way_is_driven_round() -> None:
    """Day 728380: the rover crossed the slab that it was to measure to come to its stand behind it."""
    ground, sensor, rng = GroundRaster.of(plane(), 9.0), StereoSensor(K9), np.random.default_rng(1)
    target, goal, here = (2.0, 0.1), (4.0, 0.0), Pose(0.0, 0.0)
    navigator = Navigator.fresh(K9, (0.0, 0.0), goal)
    navigator.ignore, navigator.keep_off = (*target, 0.45), [target]
    clearance = []
    for _ in range(20):
        navigator.look(sensor.look(ground, here, rng, around=not navigator.map.updates), sensor.eye, here)
        way = navigator.choose(here, goal)
        assert way is not None
        for share in np.linspace(0.0, 1.0, 20):
            x, y, heading = end_of(here, way.turn_rad, way.curvature_1_m, share * way.length_m)
            ahead = np.exp(-1j * heading) * complex(target[0] - x, target[1] - y)
            nose_m, side_m = abs(ahead.real) - K9.body.length_m / 2, abs(ahead.imag) - K9.body.width_m / 2
            clearance.append(max(nose_m, side_m))
        here = Pose(x, y, heading=heading)
        if math.hypot(here.x - goal[0], here.y) < 0.25:
            break
    assert math.hypot(here.x - goal[0], here.y) < 0.25
    assert min(clearance) > 0.0


def test_a_rover_that_stands_on_a_target_may_leave_it() -> None:
    navigator = Navigator(K9, looked(GroundRaster.of(plane(), 9.0), Pose(0.0, 0.0)))
    navigator.keep_off = [(0.2, 0.1)]
    way = navigator.choose(Pose(0.0, 0.0), (3.0, 0.0))
    assert way is not None
    assert abs(way.length_m) > 0.3


def test_where_no_way_is_safe_only_a_turn_that_touches_nothing_is_made() -> None:
    navigator = Navigator.fresh(K9, (0.0, 0.0), (4.0, 0.0))
    assert navigator.look_aside(Pose(0.0, 0.0)) is None  # nothing has been seen
    ground, sensor = GroundRaster.of(plane(), 9.0), StereoSensor(K9)
    here = Pose(0.0, 0.0)
    navigator.look(sensor.look(ground, here, np.random.default_rng(1), around=True), sensor.eye, here)
    turn = navigator.look_aside(here)
    assert turn is not None
    assert turn.length_m == 0.0


def test_footing_holds_wheels_tilt_and_belly_and_not_where_nothing_is_known() -> None:
    def free(height: np.ndarray, *way: float) -> float:
        ground = GroundRaster(height, -4.0, -4.0, 0.1)
        return float(free_lengths(ground, K9, Pose(0.0, 0.0), np.array([way]), FootingLimits())[0])

    y, x = np.mgrid[-4.0:4.05:0.1, -4.0:4.05:0.1]
    level = np.zeros_like(x)
    assert free(level, 0.0, 0.0, 1.0) == pytest.approx(1.0)
    assert free(level, 0.0, 0.5, -0.7) == pytest.approx(0.7)
    assert free(level, 2.0, 0.0, 0.0) == 0.0
    stone = np.where(np.hypot(x - 1.0, y) < 0.12, 0.19, 0.0)  # between the wheels, below the belly
    assert 0.2 < free(stone, 0.0, 0.0, 1.0) < 0.6
    kerb = np.where(y > 0.6, 0.3, 0.0)  # beside it, within reach of a wheel that turns
    assert free(kerb, 0.0, 0.0, 1.0) == pytest.approx(1.0)
    assert free(kerb, 1.2, 0.0, 0.5) == -1.0
    assert free(np.where(x > 0.0, 0.7 * x, 0.0), 0.0, 0.0, 1.0) < 0.8  # 35 degrees
    dark = np.where(x > 0.8, np.nan, 0.0)
    assert 0.0 < free(dark, 0.0, 0.0, 1.0) < 0.4
    below = np.where(np.hypot(x, y) < 0.3, np.nan, 0.0)  # where it stands no camera looks
    assert free(below, 0.0, 0.0, 1.0) == pytest.approx(1.0)
    off = HazardMap(K9, (90.0, 0.0), 8.0).ground(0.0, 0.0, 2.0).heights
    assert free(off, 0.0, 0.0, 1.0) == -1.0


def test_what_is_below_the_rover_is_the_plane_that_it_stands_on() -> None:
    ground = GroundRaster.of(plane(0.2, 0.1), 5.0)
    pose = settled_pose(ground, K9, 0.0, 0.0, 0.4)
    dark = GroundRaster(np.full((81, 81), np.nan), -4.0, -4.0, 0.1)
    known = under_body(dark, K9, pose).heights
    rows, columns = np.nonzero(np.isfinite(known))
    assert len(rows) == pytest.approx(K9.body.length_m * K9.body.width_m / 0.01, rel=0.1)
    expected = 0.2 * (columns * 0.1 - 4.0) + 0.1 * (rows * 0.1 - 4.0)
    assert known[rows, columns] == pytest.approx(expected, abs=0.02)


def test_holes_of_a_cell_are_filled_by_their_highest_neighbour_and_wide_ones_at_their_rim() -> None:
    heights = np.zeros((9, 9))
    heights[4, 3] = 0.3
    heights[4, 4] = np.nan
    assert filled(heights)[4, 4] == 0.3
    wide = np.zeros((9, 9))
    wide[:, 5:] = np.nan
    assert np.isnan(filled(wide)[:, 6:]).all()
    assert np.isfinite(filled(wide)[1:-1, 5]).all()


def test_the_map_tells_how_high_the_points_of_a_cell_reach() -> None:
    """A stone 9 cm wide and 20 cm high in one cell: its mean says 10 cm, the belly would meet 20."""
    hazards = HazardMap(K9, (0.0, 0.0), 4.0)
    x, y = (v.ravel() for v in np.meshgrid(np.arange(-1.0, 1.0, 0.02), np.arange(-1.0, 1.0, 0.02)))
    middle = hazards.west + hazards.cell * round(-hazards.west / hazards.cell)
    stone = (np.abs(x - middle) < 0.05) & (y - middle > 0.0) & (y - middle < 0.05)
    hazards.update([np.column_stack([x, y, np.where(stone, 0.2, 0.0)])], np.array([0.0, 0.0, 1.5]))
    ground = hazards.ground(0.0, 0.0, 1.0)
    assert 0.15 < float(ground.height(middle, middle)) < 0.3
    assert abs(float(ground.height(middle + 0.5, middle))) < 1e-6


def test_a_rover_at_the_edge_of_what_is_known_stands_where_it_still_was() -> None:
    ground = GroundRaster.of(plane(), 3.0)
    chassis = Chassis(ground, K9, Pose(1.5, 0.0), rng=np.random.default_rng(1))
    driven = chassis.follow(Way(0.0, 0.0, 3.0))
    assert driven.collision == "edge"
    for pose in (chassis.pose, chassis.believed):
        assert np.isfinite([pose.x, pose.y, pose.z, pose.heading, pose.pitch, pose.roll]).all()
    assert 2.0 < chassis.pose.x < 3.0
    standing = settle(ground, K9, *(np.array([v]) for v in (chassis.pose.x, 0.0, 0.0)))
    assert np.isfinite(standing.z).all()


def test_a_drive_that_is_shut_out_far_from_its_goal_has_not_arrived() -> None:
    ground = ledge(0.4)
    run = drive(Chassis(ground, K9, Pose(0.0, 0.0), rng=np.random.default_rng(2)), ground, (5.0, 0.0))
    assert run.error_m > 2.0
    assert not run.arrived


def test_parameters_out_of_range_are_refused() -> None:
    with pytest.raises(RoverError, match="cell of the hazard map is 5"):
        MapParameters(cell_m=5)
    with pytest.raises(RoverError, match="discount"):
        MapParameters(discount=0)
    with pytest.raises(RoverError, match="margins"):
        NavigatorParameters(margin_m=0.01)


def test_four_random_traverses_arrive_without_a_collision() -> None:
    study, runs = traverse_study(K9, runs=4, seed=1000, length_m=14.0, drives_per_terrain=4)
    assert study.collided == 0
    assert study.arrived >= 3
    assert len(runs) == 4


@pytest.mark.slow
def test_many_random_traverses_of_twenty_metres() -> None:
    study, _ = traverse_study(K9, runs=TRAVERSES, seed=1000)
    assert study.collided == 0
    assert study.arrived >= 0.95 * TRAVERSES


def test_a_way_round_may_lead_away_for_long_but_not_close_to_the_goal() -> None:
    far = Progress(near_m=1.0)
    assert not any(far.stalled(left) for left in [5.0, *[6.0] * 40])
    shut_in = Progress(near_m=1.0, far_patience=20)
    assert [shut_in.stalled(3.0 + 0.01 * k) for k in range(22)] == [False] * 20 + [True] * 2
    by_what_is_left = Progress(near_m=1.0, far_patience=4, looks_per_m=3.0)
    assert [by_what_is_left.stalled(2.0) for _ in range(12)] == [False] * 10 + [True] * 2
    near = Progress(near_m=1.0)
    assert [near.stalled(left) for left in [0.9] * 8] == [False] * 6 + [True] * 2
    gaining = Progress(near_m=1.0)
    assert not any(gaining.stalled(0.95 - 0.11 * (k // 5)) for k in range(40))
