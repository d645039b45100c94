"""A stop on a map: found from metres away under another sun, or refused by a named rule."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from rover_iface.cameras.model import pinhole
from rover_iface.cameras.panorama import Panorama, StereoWedge
from rover_iface.errors import LocalizationError
from rover_iface.frames import Transform
from rover_iface.localization import stop_relief
from rover_iface.localization.bundle_adjustment import BundleAdjustment
from rover_iface.localization.ground_points import GroundPoints
from rover_iface.localization.pose_search import BOTH, FIRST, SearchReach, search
from rover_iface.localization.relief_map import ReliefMap, relief_map, relief_map_of_views
from rover_iface.localization.relocalisation import (
    Relocalisation,
    RelocalisationFault,
    RelocalisationOptions,
    RelocalisationPrior,
    RelocalisedPose,
    relocalise,
)
from rover_iface.localization.stop_relief import StopCells, StopView, stop_cells
from rover_iface.terrain.generate import generate_terrain
from tests.rover_iface.localization.stops_for_tests import AFTERNOON, MORNING, Ground

WRONG = (7.3, -8.6, math.radians(8.7))
EYE = (3.2, -4.1)


@pytest.fixture(scope="module")
def ground() -> Ground:
    return Ground.of(1)


def off(answer: Relocalisation, eye: tuple[float, float], turn: float) -> tuple[float, float]:
    """Return how far a pose is off, m and rad."""
    pose = answer.pose
    return math.hypot(pose.east_m - eye[0], pose.north_m - eye[1]), abs(pose.turn_rad - turn)


def faults(answer: Relocalisation) -> set[RelocalisationFault]:
    return {refusal.fault for refusal in answer.refusals}


# ---- found


@pytest.mark.parametrize("wrong", [WRONG, (0.0, 0.0, 0.0), (-9.9, 9.9, math.radians(-9.9))])
def test_stop_is_found_under_another_sun(ground: Ground, wrong: tuple[float, float, float]) -> None:
    answer = relocalise(ground.map(MORNING), ground.stop(EYE, wrong, AFTERNOON))
    error, turned = off(answer, EYE, wrong[2])
    assert error < 0.1
    assert turned < math.radians(0.3)
    height = float(ground.at(ground.heights, np.array([EYE[0]]), np.array([EYE[1]]))[0]) + 1.5
    assert answer.pose.up_m == pytest.approx(height, abs=0.05)
    assert answer.verdict.startswith("accepted")


def test_heights_alone_find_rough_ground(ground: Ground) -> None:
    answer = relocalise(ground.map(MORNING, image=False), ground.stop(EYE, WRONG, AFTERNOON))
    assert off(answer, EYE, WRONG[2])[0] < 0.2


def test_brightness_alone_finds_flat_ground() -> None:
    flat = Ground.of(2, relief=0.0)
    answer = relocalise(flat.map(MORNING), flat.stop(EYE, WRONG, AFTERNOON))
    assert off(answer, EYE, WRONG[2])[0] < 0.2


def test_map_of_earlier_stops_finds_a_later_one(ground: Ground) -> None:
    exact = (0.0, 0.0, 0.0)
    grid = relief_map_of_views(
        [ground.stop((0.0, 0.0), exact, MORNING, seed=5), ground.stop((9.0, 2.0), exact, MORNING, seed=6)]
    )
    assert off(relocalise(grid, ground.stop(EYE, WRONG, AFTERNOON)), EYE, WRONG[2])[0] < 0.15


def test_moving_map_and_stop_moves_the_answer(ground: Ground) -> None:
    grid, view = ground.map(MORNING), ground.stop(EYE, WRONG, AFTERNOON)
    shift = np.array([310.25, -120.5, 40.0])
    there = replace(
        grid,
        heights_m=grid.heights_m + np.float32(40.0),
        west_m=grid.west_m + 310.25,
        south_m=grid.south_m - 120.5,
    )
    moved = StopView(GroundPoints(view.seen.points + shift, view.seen.eye + shift), view.brightness)
    one, two = relocalise(grid, view).pose, relocalise(there, moved).pose
    assert (two.east_m - one.east_m, two.north_m - one.north_m, two.up_m - one.up_m) == pytest.approx(
        tuple(shift), abs=1e-3
    )
    assert two.turn_rad == pytest.approx(one.turn_rad, abs=1e-4)


def test_range_bias_is_taken_out(ground: Ground) -> None:
    """All ranges short by 0.1 px of disparity, on a stop that sees one side only: 0.2 m at 20 m."""
    view = ground.stop(EYE, WRONG, AFTERNOON)
    rays = view.seen.points - view.seen.eye
    ahead = rays[:, 0] > 0
    away = np.linalg.norm(rays, axis=1, keepdims=True)
    short = view.seen.eye + rays / (1.0 + 0.1 * away / view.seen.range_factor)
    assert view.brightness is not None
    half = StopView(GroundPoints(short[ahead], view.seen.eye), view.brightness[ahead])
    pose = relocalise(ground.map(MORNING), half).pose
    assert math.hypot(pose.east_m - EYE[0], pose.north_m - EYE[1]) < 0.08


# ---- refused, each by its rule


def test_another_ground_is_refused(ground: Ground) -> None:
    for seed in range(3):
        answer = relocalise(Ground.of(50 + seed).map(MORNING), ground.stop(EYE, WRONG, AFTERNOON))
        assert RelocalisationFault.NOTHING_ALIKE in faults(answer)
        with pytest.raises(LocalizationError, match="the stop was refused"):
            _ = answer.pose


def test_stop_beyond_the_reach_is_refused(ground: Ground) -> None:
    answer = relocalise(ground.map(MORNING), ground.stop(EYE, (19.0, 3.0, 0.0), AFTERNOON))
    assert RelocalisationFault.NOTHING_ALIKE in faults(answer)


def test_ground_that_repeats_is_refused() -> None:
    once = Ground.of(3)
    tile = 30  # posts: 7.5 m

    def repeated(values: np.ndarray) -> np.ndarray:
        return np.tile(values[:tile, :tile], (values.shape[0] // tile, values.shape[1] // tile))

    wallpaper = Ground(repeated(once.heights), repeated(once.albedo))
    answer = relocalise(wallpaper.map(MORNING), wallpaper.stop(EYE, WRONG, AFTERNOON))
    assert RelocalisationFault.AMBIGUOUS in faults(answer)


def test_halves_that_come_from_two_places_are_refused(ground: Ground) -> None:
    one, two = ground.stop(EYE, WRONG, AFTERNOON), ground.stop((9.2, -1.1), WRONG, AFTERNOON)
    moved = two.seen.points - two.seen.eye + one.seen.eye
    rays = one.seen.points - one.seen.eye
    second = np.floor(np.arctan2(rays[:, 1], rays[:, 0]) / (math.pi / 8)).astype(int) % 2 == 1
    assert one.brightness is not None
    assert two.brightness is not None
    mixed = StopView(
        GroundPoints(np.where(second[:, None], moved, one.seen.points), one.seen.eye),
        np.where(second, two.brightness, one.brightness),
    )
    assert RelocalisationFault.HALVES_DISAGREE in faults(relocalise(ground.map(MORNING), mixed))


def test_stop_of_which_one_half_saw_nothing_is_refused(ground: Ground) -> None:
    view = ground.stop(EYE, WRONG, AFTERNOON)
    rays = view.seen.points - view.seen.eye
    first = np.floor(np.arctan2(rays[:, 1], rays[:, 0]) / (math.pi / 8)).astype(int) % 2 == 0
    assert view.brightness is not None
    part = StopView(GroundPoints(view.seen.points[first], view.seen.eye), view.brightness[first])
    answer = relocalise(ground.map(MORNING), part)
    assert faults(answer) == {RelocalisationFault.NOTHING_ALIKE}


def test_image_that_lies_elsewhere_than_its_heights_is_refused(ground: Ground) -> None:
    grid = ground.map(MORNING)
    assert grid.brightness is not None
    slid = replace(grid, brightness=np.roll(grid.brightness, 16, axis=1))  # 4 m
    assert RelocalisationFault.KINDS_DISAGREE in faults(relocalise(slid, ground.stop(EYE, WRONG, AFTERNOON)))


def test_pose_at_the_rim_of_the_reach_is_refused(ground: Ground) -> None:
    answer = relocalise(ground.map(MORNING), ground.stop(EYE, (12.2, 0.0, 0.0), AFTERNOON))
    assert RelocalisationFault.AT_THE_RIM in faults(answer)


def test_map_that_covers_little_of_the_reach_is_refused(ground: Ground) -> None:
    grid = ground.map(MORNING)
    known = np.zeros(grid.heights_m.shape, dtype=bool)
    known[:, 287:] = True  # east of 11.9 m: some poses see a third of their cells on it
    assert grid.brightness is not None
    part = replace(
        grid,
        heights_m=np.where(known, grid.heights_m, np.nan).astype(np.float32),
        brightness=np.where(known, grid.brightness, np.nan).astype(np.float32),
    )
    answer = relocalise(part, ground.stop(EYE, WRONG, AFTERNOON))
    assert RelocalisationFault.OFF_THE_MAP in faults(answer)
    assert "% of the reach is on the map, limit 30 %" in answer.verdict


def test_map_elsewhere_is_refused(ground: Ground) -> None:
    away = replace(ground.map(MORNING), west_m=5_000.0)
    answer = relocalise(away, ground.stop(EYE, WRONG, AFTERNOON))
    assert faults(answer) == {RelocalisationFault.OFF_THE_MAP}
    assert answer.found is None


def test_pose_known_too_badly_is_refused(ground: Ground) -> None:
    strict = RelocalisationOptions(largest_sigma_m=0.05)
    answer = relocalise(ground.map(MORNING), ground.stop(EYE, WRONG, AFTERNOON), options=strict)
    assert faults(answer) == {RelocalisationFault.WEAK_GEOMETRY}


# ---- the search against its definition


def test_correlations_are_those_of_the_definition() -> None:
    """Twenty poses by loops over the cells, with gaps in the map; FFT and halves must give the same."""
    rng = np.random.default_rng(4)
    values = rng.standard_normal((90, 90)).astype(np.float32)
    values[20:35, 40:60] = np.nan
    grid = ReliefMap(np.nan_to_num(values), -22.0, -22.0, 0.5)
    places = np.column_stack([rng.uniform(-9, 9, (400, 2)), np.zeros(400)])
    cells = StopCells(places, np.full(400, 0.1), np.zeros((400, 3)), None, 0.5)
    own, weights = rng.standard_normal(400), rng.uniform(0.5, 2.0, 400)
    eye = np.array([0.3, -0.4])
    found = search(values, grid, eye, cells, own, weights, SearchReach(4.0, 0.06, 0.03), least_share=0.1)
    assert found is not None
    for half, which in ((FIRST, ~cells.second_half), (BOTH, np.ones(400, dtype=bool))):
        for flat in rng.integers(0, found.correlation[half].size, 10).tolist():
            east, north, turn = found.pose(flat)
            c, s = math.cos(turn), math.sin(turn)
            origin = np.rint((eye + 22.0) / 0.5), (eye + 22.0) / 0.5 - np.rint((eye + 22.0) / 0.5)
            x = c * places[:, 0] - s * places[:, 1]
            y = s * places[:, 0] + c * places[:, 1]
            column = origin[0][0] + np.rint(origin[1][0] + x / 0.5) + round(east / 0.5)
            row = origin[0][1] + np.rint(origin[1][1] + y / 0.5) + round(north / 0.5)
            seen = values[row.astype(int), column.astype(int)]
            use = which & np.isfinite(seen)
            pair = np.cov(np.stack([seen[use], own[use]]).astype(float), aweights=weights[use])
            rho = pair[0, 1] / math.sqrt(pair[0, 0] * pair[1, 1])
            assert found.correlation[half].reshape(-1)[flat] == pytest.approx(rho, abs=2e-3)


def test_likelihood_of_noise_stays_at_chance() -> None:
    """White noise on white noise: the best of so many poses stays near the logarithm of their number."""
    rng = np.random.default_rng(8)
    values = rng.standard_normal((200, 200)).astype(np.float32)
    grid = ReliefMap(values, -49.75, -49.75, 0.5)
    places = np.column_stack([rng.uniform(-15, 15, (2000, 2)), np.zeros(2000)])
    cells = StopCells(places, np.full(2000, 0.1), np.zeros((2000, 3)), None, 0.5)
    found = search(
        values, grid, np.zeros(2), cells, rng.standard_normal(2000), np.ones(2000), SearchReach(10.0, 0.1),
        least_share=0.5,
    )  # fmt: skip
    assert found is not None
    tried = math.log(found.likelihood[BOTH].size)
    assert 0.4 * tried < float(np.nanmax(found.likelihood[BOTH])) < tried + 2.0


# ---- brightness of a panorama


def test_points_take_the_brightness_of_the_left_image_they_fall_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """A pinhole looking along x: columns to the right are minus y, rows down minus z."""
    left = pinhole(focal_px=100.0, width=200, height=160)
    image = np.tile(np.arange(200, dtype=np.uint8), (160, 1))  # brightness is the column
    right = left.moved(np.eye(3), (0.0, -0.2, 0.0))
    panorama = Panorama([StereoWedge("0.0", image, np.zeros_like(image), left, right)])
    rng = np.random.default_rng(3)
    ahead = np.column_stack([np.full(250, 10.0), rng.uniform(-9, 9, 250), rng.uniform(-7, 7, 250)])
    points = np.concatenate([ahead, [[-10.0, 0.0, 0.0], [10.0, 30.0, 0.0]]])
    seen = GroundPoints(points, np.zeros(3))
    monkeypatch.setattr(stop_relief, "points_of_panorama", lambda _: seen)
    view = stop_relief.view_of_panorama(panorama)
    assert view.brightness is not None
    column = left.project(ahead)[:, 0]
    assert view.brightness[:250] == pytest.approx(column + 1.0, abs=0.6)
    assert np.isnan(view.brightness[250:]).all()  # behind, and beside


# ---- the maps


def test_relief_map_is_the_mean_of_a_finer_terrain() -> None:
    terrain = generate_terrain(3, 32.0, spacing_m=0.25, inner_m=8.0, inner_spacing_m=0.05, crater=False)
    grid = relief_map(terrain, (0.5, -0.25), 3.0)
    row, column = 7, 11
    x, y = grid.west_m + 0.25 * column, grid.south_m + 0.25 * row
    step = (np.arange(200) + 0.5) / 200 * 0.25 - 0.125
    mean = float(terrain.height(*np.meshgrid(x + step, y + step)).mean())
    assert grid.heights_m[row, column] == pytest.approx(mean, abs=0.01)
    assert grid.brightness is not None
    shown = terrain.orthos[0].colour(*np.meshgrid(x + step, y + step)).mean()
    assert grid.brightness[row, column] == pytest.approx(shown, rel=0.05)


def test_map_of_stops_has_their_heights_and_leaves_the_rest_unknown(ground: Ground) -> None:
    grid = relief_map_of_views([ground.stop((0.0, 0.0), (0.0, 0.0, 0.0), MORNING)])
    rows, columns = np.nonzero(np.isfinite(grid.heights_m))
    x, y = grid.west_m + 0.25 * columns, grid.south_m + 0.25 * rows
    off_m = grid.heights_m[rows, columns] + 0.6 - ground.at(ground.heights, x, y)  # stops believe 0.6 m low
    assert float(np.sqrt(np.mean(off_m**2))) < 0.02
    assert np.hypot(x, y).max() < 26.0
    assert 0.8 < len(rows) * 0.25**2 / (math.pi * 25.0**2) < 1.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"heights_m": np.zeros((3, 3), np.float32)}, "at least 8 x 8"),
        ({"spacing_m": 0.0}, "must be positive"),
        ({"brightness": np.zeros((9, 8), np.float32)}, "both must be of the same posts"),
        ({"heights_m": np.full((8, 8), np.nan, np.float32)}, "no known height"),
    ],
)
def test_map_that_is_none_is_refused(change: dict[str, Any], message: str) -> None:
    given: dict[str, Any] = {
        "heights_m": np.zeros((8, 8), np.float32),
        "west_m": 0.0,
        "south_m": 0.0,
    } | change
    with pytest.raises(LocalizationError, match=message):
        ReliefMap(**given)


def test_bad_prior_and_view_are_named() -> None:
    with pytest.raises(LocalizationError, match=r"sigma of the believed place is 0.1 m"):
        RelocalisationPrior(sigma_m=0.1)
    with pytest.raises(LocalizationError, match="sigma of the believed heading is 90 degrees"):
        RelocalisationPrior(sigma_turn_rad=math.radians(90))
    points = GroundPoints(np.random.default_rng(0).uniform(30, 40, (300, 3)), np.zeros(3))
    with pytest.raises(LocalizationError, match="one each is needed"):
        StopView(points, np.ones(5))
    with pytest.raises(LocalizationError, match="no point lies between 2 and 25 m"):
        stop_cells(StopView(points), 0.25, farthest_m=25.0)


# ---- as a factor


def test_fix_holds_a_pose_of_the_adjustment() -> None:
    """The covariance goes into GTSAM and comes out of it as the position covariance in site axes."""
    spread = np.array(
        [[0.04, 0.01, 0.0, 0.001], [0.01, 0.02, 0.0, 0.0], [0.0, 0.0, 0.09, 0.0], [0.001, 0.0, 0.0, 0.0004]]
    )
    fix = RelocalisedPose(12.0, -3.0, 1.5, math.radians(50.0), spread)
    adjustment = BundleAdjustment()
    adjustment.add_pose("stop", fix.map_from_stop, covariance=fix.pose_covariance(math.radians(0.3)))
    adjustment.add_pose("next", fix.map_from_stop * Transform(np.eye(3), np.array([5.0, 0.0, 0.0])))
    motion = Transform(np.eye(3), np.array([5.0, 0.0, 0.0]))
    adjustment.add_motion("stop", "next", motion, np.diag([1e-3] * 3 + [1e-2] * 3) ** 2)
    pose = adjustment.solve().poses["stop"]
    assert pose.site_from_rover.translation == pytest.approx([12.0, -3.0, 1.5], abs=1e-6)
    assert pose.position_covariance == pytest.approx(spread[:3, :3], abs=1e-6)
    assert pose.covariance[2, 2] == pytest.approx(0.0004, rel=1e-6)
    with pytest.raises(LocalizationError, match="sigma of roll and pitch is 0"):
        fix.pose_covariance(0.0)
