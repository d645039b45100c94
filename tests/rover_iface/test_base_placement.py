"""Observation points: the arm's reach, the ground, the side one comes from."""

from __future__ import annotations

import contextlib
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_iface.errors import OutsideTerrainError, PlacementError, ProfileError
from rover_iface.frames import Pose
from rover_iface.mobility import settle, settled_pose
from rover_iface.placement import base_placement, check_observation_point, place_base
from rover_iface.placement.arm import Arm, Posture
from rover_iface.placement.base_placement import inside_polygon
from rover_iface.placement.room import room_to_stand
from rover_iface.profile import load_profile
from tests.rover_iface.worlds import bumpy, generated, plane
from tests.shared import shared

K9 = load_profile("k9")


# ---- standing


@given(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.floats(-3, 3))
def test_on_a_plane_the_rover_stands_along_the_plane(a: float, b: float, heading: float) -> None:
    ground = plane(a, b)
    pose = settled_pose(ground, K9, 1.0, -1.0, heading)
    up = pose.site_from_rover.rotate([0.0, 0.0, 1.0])
    expected = np.array([-a, -b, 1.0]) / math.sqrt(a * a + b * b + 1)
    assert math.acos(min(1.0, float(up @ expected))) < 0.03
    assert pose.z == pytest.approx(a - b, abs=0.02)


def test_one_wheel_on_a_stone_lifts_the_body_by_less_than_the_stone() -> None:
    half = K9.wheels.track_m / 2
    stone = bumpy(lambda x, y: np.where(np.hypot(x - 0.39, y - half) < 0.15, 0.1, 0.0))
    pose = settled_pose(stone, K9, 0.0, 0.0, 0.0)
    assert 0.01 < pose.z < 0.06
    assert pose.pitch < 0
    assert pose.roll > 0


def test_a_rock_under_the_belly_takes_the_clearance_it_has_height() -> None:
    rock = bumpy(lambda x, y: np.where(np.hypot(x, y) < 0.15, 0.12, 0.0))
    standing = settle(rock, K9, [0.0], [0.0], [0.0])
    assert float(standing.belly_gap[0]) == pytest.approx(K9.body.clearance_m - 0.12, abs=0.01)


def test_off_the_terrain_the_pose_is_unknown() -> None:
    assert math.isnan(settled_pose(plane(), K9, 50.0, 0.0, 0.0).z)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("instrument", ["mi", "scicam"])
def test_a_stand_with_a_wheel_off_the_terrain_is_refused_for_that(instrument: str) -> None:
    edge = plane().bounds[2] - 0.05
    with pytest.raises(PlacementError, match="the rover would stand off the terrain"):
        check_observation_point(plane(), K9, Pose(edge, 0.0, 0.0), (edge, 0.0, 0.0), instrument=instrument)


# ---- placing


@settings(max_examples=40, deadline=None)
@given(st.floats(-6, 6), st.floats(-6, 6), st.floats(-0.15, 0.15), st.floats(-0.15, 0.15))
def test_every_pose_given_passes_the_check_by_itself(x: float, y: float, a: float, b: float) -> None:
    ground = plane(a, b)
    point = (x, y, a * x + b * y)
    for found in place_base(ground, K9, point):
        again = check_observation_point(ground, K9, found.pose, point)
        assert again.reach_m == pytest.approx(found.reach_m)
        assert found.reach_m <= K9.arm.reach_m
        assert found.tool_tilt_rad <= K9.arm.max_tool_tilt_rad
        assert found.slope_rad <= K9.mobility.max_slope_rad


def test_reach_is_measured_from_the_shoulder_to_the_target() -> None:
    (best, *_) = place_base(plane(), K9, (5.0, 0.0, 0.0))
    shoulder = best.pose.site_from_rover.apply(K9.arm.shoulder_m)
    assert float(np.linalg.norm(shoulder - [5.0, 0.0, 0.0])) == pytest.approx(best.reach_m)


def test_the_best_pose_is_on_the_side_the_rover_comes_from() -> None:
    (best, *_) = place_base(plane(), K9, (5.0, 0.0, 0.0), start=Pose(0.0, 0.0))
    assert best.pose.x < 5.0
    assert abs(best.pose.y) < 0.3
    (best, *_) = place_base(plane(), K9, (5.0, 0.0, 0.0), start=Pose(9.0, 0.0))
    assert best.pose.x > 5.0


def test_a_steep_face_is_approached_from_the_side_that_it_looks_to() -> None:
    """A face that looks north-west."""
    normal = np.array([-0.6, 0.6, 0.53])
    best, *others = place_base(plane(), K9, (4.0, 0.0, 0.2), normal)
    for found in (best, *others):
        assert found.tool_tilt_rad <= K9.arm.max_tool_tilt_rad
    side = np.array([best.pose.x - 4.0, best.pose.y])
    assert float(side @ normal[:2]) > 0


@settings(max_examples=60, deadline=None)
@given(st.floats(0.0, 1.4), st.floats(-1.5, 1.5), st.floats(0.35, 0.6), st.floats(0.1, 0.3))
def test_a_face_is_in_reach_where_the_joints_hold_the_tool_on_it(
    slope: float, aside: float, away: float, height: float
) -> None:
    """The twist of the forearm turns the tool to either side: no plane of the arm has to hold the normal."""
    point = (K9.arm.shoulder_m[0] + away, 0.1, height)
    normal = np.array(
        [-math.sin(slope) * math.cos(aside), math.sin(slope) * math.sin(aside), math.cos(slope)]
    )
    held = isinstance(by_joints := Arm(K9.arm).solve(point, normal), Posture)
    tilt_rad = math.nan
    with contextlib.suppress(PlacementError):
        tilt_rad = check_observation_point(plane(0.0, 0.0), K9, Pose(0.0, 0.0), point, normal).tool_tilt_rad
    assert held is not math.isnan(tilt_rad)
    assert not held or tilt_rad == pytest.approx(by_joints.tool_tilt_rad)


def test_a_face_across_the_arm_is_in_reach_and_one_that_looks_away_is_not() -> None:
    point, here = (0.9, 0.0, 0.25), Pose(0.0, 0.0)
    across = check_observation_point(plane(0.0, 0.0), K9, here, point, (-0.1, 0.98, 0.17))
    assert across.tool_tilt_rad == 0.0
    assert across.score < check_observation_point(plane(0.0, 0.0), K9, here, point, (-0.98, 0.1, 0.17)).score
    with pytest.raises(PlacementError, match="which looks away from the rover"):
        check_observation_point(plane(0.0, 0.0), K9, here, point, (0.98, 0.1, 0.17))


def test_a_stand_from_which_the_arm_tilts_the_tool_is_worth_less() -> None:
    up = (0.0, 0.0, 1.0)
    near, far = (
        check_observation_point(plane(0.0, 0.0), K9, Pose(0.0, 0.0), (x, 0.0, 0.3), up) for x in (0.7, 1.1)
    )
    assert near.tool_tilt_rad == 0.0
    assert 0.0 < far.tool_tilt_rad <= K9.arm.max_tool_tilt_rad
    assert far.score < 0.9 * near.score


def test_a_normal_that_the_joints_do_not_hold_is_refused_with_the_joint() -> None:
    with pytest.raises(PlacementError, match="the wrist would have to be"):
        check_observation_point(plane(0.0, 0.0), K9, Pose(0.0, 0.0), (1.15, 0.1, 0.5), (0.0, 0.0, 1.0))


def test_out_of_reach_is_refused_with_both_figures() -> None:
    with pytest.raises(PlacementError) as caught:
        check_observation_point(plane(), K9, Pose(3.0, 0.0), (5.0, 0.0, 0.0), target="T-3")
    assert "observation point (3.00, 0.00) for target T-3" in str(caught.value)
    assert "the target is 1.65 m from the arm's shoulder; the arm reaches 0.79 m" in str(caught.value)


def test_a_target_high_on_a_wall_has_no_observation_point_and_says_why() -> None:
    tower = bumpy(lambda x, y: np.where(np.hypot(x - 2, y) < 0.3, 2.5, 0.0))
    with pytest.raises(PlacementError, match=r"target T-1 has no observation point for mi: .*; the arm"):
        place_base(tower, K9, (2.0, 0.0, 2.5), (0, 0, 1), target="T-1")


def test_ground_too_steep_is_the_reason_given() -> None:
    expected = r"slopes by 3\d degrees or more; the rover stands on 25"
    with pytest.raises(PlacementError, match=expected) as caught:
        place_base(plane(0.65, 0.0), K9, (2.0, 0.0, 1.3))
    assert "slope" in caught.value.reasons


def test_keep_out_regions_are_not_stood_in() -> None:
    square = [(-10, -10), (4.2, -10), (4.2, 10), (-10, 10)]
    for found in place_base(plane(), K9, (4.5, 0.0, 0.0), keep_out=[square]):
        assert found.pose.x > 4.2
    everywhere = [(-20, -20), (20, -20), (20, 20), (-20, 20)]
    with pytest.raises(PlacementError, match="keep-out region"):
        place_base(plane(), K9, (4.5, 0.0, 0.0), keep_out=[everywhere])
    with pytest.raises(PlacementError, match="at least three corners"):
        place_base(plane(), K9, (4.5, 0.0, 0.0), keep_out=[[(0, 0), (1, 1)]])


def test_a_remote_instrument_stands_off_with_a_free_view() -> None:
    def wall(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.where((np.abs(x - 3.0) < 0.1) & (np.abs(y) < 4), 2.5, 0.0)

    ground = bumpy(wall, spacing=0.1)
    for found in place_base(ground, K9, (4.0, 0.0, 0.0), instrument="scicam"):
        eye = [found.pose.x, found.pose.y, found.pose.z + K9.mast.height_m]
        assert bool(ground.line_of_sight(eye, [4.0, 0.0, 0.0]))
        assert math.hypot(found.pose.x - 4, found.pose.y) > 1.0


def test_bad_requests_are_named() -> None:
    with pytest.raises(OutsideTerrainError, match="target T-9"):
        place_base(plane(), K9, (99.0, 0.0, 0.0), target="T-9")
    with pytest.raises(ProfileError, match="no instrument"):
        place_base(plane(), K9, (1.0, 0.0, 0.0), instrument="drill")
    with pytest.raises(PlacementError, match="normal"):
        place_base(plane(), K9, (1.0, 0.0, 0.0), (0, 0, 0))


def test_rocks_of_a_generated_site_and_spots_of_murray_buttes_are_mostly_reachable() -> None:
    ground = generated()
    rocks = [r for r in ground.rocks if r.diameter > 0.25 and max(abs(r.x), abs(r.y)) < 10][:30]
    found = 0
    for rock in rocks:
        try:
            found += bool(place_base(ground, K9, (rock.x, rock.y, ground.height_at(rock.x, rock.y))))
        except PlacementError:
            continue
    assert found >= 0.8 * len(rocks)
    buttes = load_terrain_of_murray()
    rng = np.random.default_rng(2)
    for x, y in rng.uniform(-8, 8, (10, 2)):
        place_base(buttes, K9, (x, y, buttes.height_at(x, y)))


def load_terrain_of_murray():  # type: ignore[no-untyped-def]
    from rover_iface.terrain import load_terrain

    return load_terrain(shared("data/terrain/msl_onsight/murray_buttes"))


@given(st.floats(-2, 2), st.floats(-2, 2))
def test_inside_a_polygon_agrees_with_shapely(x: float, y: float) -> None:
    from shapely import Point, Polygon

    corners = [(-1.0, -1.0), (1.5, -0.5), (0.2, 0.1), (1.0, 1.5), (-1.2, 0.8)]
    shape = Polygon(corners)
    if shape.boundary.distance(Point(x, y)) > 1e-9:
        assert bool(inside_polygon(np.array([x]), np.array([y]), corners)[0]) == shape.contains(Point(x, y))


def test_a_stand_over_a_stone_that_the_navigator_would_not_take_is_worth_little() -> None:
    target = (3.0, 0.0, 0.0)
    bare = place_base(plane(0.0, 0.0), K9, target, start=Pose(0.0, 0.0), count=1)[0]
    x, y = bare.pose.x, bare.pose.y
    stony = bumpy(lambda u, v: np.where(np.hypot(u - x, v - y) < 0.12, 0.12, 0.0))
    over = check_observation_point(stony, K9, bare.pose, target)
    assert over.score < 0.4 * check_observation_point(plane(0.0, 0.0), K9, bare.pose, target).score
    beside = place_base(stony, K9, target, start=Pose(0.0, 0.0), count=1)[0]
    assert beside.score > over.score
    away = np.hypot(beside.pose.x - x, beside.pose.y - y)
    assert away > K9.body.width_m / 2 or abs(beside.pose.heading) > 0.3


def test_on_a_slope_the_ground_itself_is_no_obstacle_to_stand() -> None:
    for a, b in ((0.15, 0.0), (0.0, -0.15), (0.1, 0.1)):
        ground = plane(a, b)
        x, heading = np.array([0.5]), np.array([0.7])
        standing = settle(ground, K9, x, x, heading)
        room = room_to_stand(ground, K9, np.array([5.0, 5.0, 0.0]), x, x, heading, standing)
        assert room[0] == 1.0


@pytest.mark.parametrize("instrument", ["mi", "scicam"])
@pytest.mark.parametrize("count", [1, 4])
def test_what_is_not_looked_at_would_not_have_been_chosen(
    instrument: str, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Poses are the same, to the bit, whether a few candidates are settled and looked at first or all."""
    ground, rng = generated(), np.random.default_rng(11)

    def poses(settled: int, looked_at: int) -> list[object]:
        monkeypatch.setattr(base_placement, "FIRST_SETTLED", settled)
        monkeypatch.setattr(base_placement, "FIRST_LOOK", looked_at)
        found: list[object] = []
        for x, y in places:
            try:
                place = (x, y, ground.height_at(x, y))
                found.append(place_base(ground, K9, place, instrument=instrument, count=count))
            except PlacementError as err:
                found.append(str(err))
        return found

    places = rng.uniform(-10.0, 10.0, (12, 2)).tolist()
    assert poses(7, 1) == poses(216, 24) == poses(10**6, 10**6)
