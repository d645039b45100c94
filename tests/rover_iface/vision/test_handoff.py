"""Hand-off between cameras on one rendered stop: the methods, the cascade, and when it refuses."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
import pytest

from rover_iface.cameras.stereo import PointMatch
from rover_iface.errors import TrackerError
from rover_iface.frames import Pose, Transform
from rover_iface.simulator.render.picture import Frame
from rover_iface.vision import drape, handoff, handoff_cascade, shape_draped
from rover_iface.vision.drape import TEMPLATE_PX, Draped, DrapeOptions, find_many, find_patches
from rover_iface.vision.handoff import METHODS, Handoff, Side, hand_off, scaled_window
from rover_iface.vision.handoff_cascade import CascadeOptions, cascade
from rover_iface.vision.narrow.recall import LAID
from rover_iface.vision.resection import resect
from rover_iface.vision.shape_draped import lay, register_views
from rover_iface.vision.sift_motion import small_rotation
from rover_iface.vision.template import NccOptions, Template, TemplateMatcher
from rover_iface.vision.tracker import StereoView
from studies.common.mast_error import mast_error
from tests.rover_iface.render.scenes import PIVOT, SUN, picture, rig, rock_renderer

POSE = Pose(-1.75, 0.0, 0.0)
TILT = math.radians(0.8)


def _pair(left: Frame, right: Frame) -> StereoView:
    return StereoView(left.unit, right.unit, left.camera, right.camera)


@lru_cache(maxsize=1)
def world() -> tuple[Side, Side, Frame, np.ndarray]:
    """Return near navcams, hazcams, the left navcam's frame and the true target."""
    left = picture(POSE, half=200, seed=5)
    right = picture(POSE, "navcam_right", half=200, exposure=left.exposure, seed=6)
    cameras = rig()
    haz: list[Frame] = []
    for n, name in enumerate(("hazcam_left", "hazcam_right")):
        exposure = haz[0].exposure if haz else None
        haz.append(
            rock_renderer().render(
                cameras.camera(name),
                POSE,
                SUN,
                sensor=cameras.mounted(name).sensor,
                exposure=exposure,
                seed=7 + n,
            )
        )
    target = np.asarray(left.truth.point_site[270, 180])
    return Side(_pair(left, right), 0.8), Side(_pair(haz[0], haz[1]), 0.3), left, target


def given(tilt: float = TILT) -> tuple[Handoff, np.ndarray]:
    near, haz, left, target = world()
    pivot = np.asarray(POSE.site_from_rover.apply(np.array(PIVOT)))
    turn = small_rotation(tilt * left.camera.horizontal)
    wrong = Transform(turn, pivot - turn @ pivot)
    pixel = np.array([180.0, 270.0])
    return Handoff(haz, near.moved(wrong), pixel, near.moved(wrong), pixel), np.asarray(
        haz.view.left_camera.project(target)
    )


def test_what_a_pair_ranges_is_worked_out_once_whatever_frame_it_is_asked_in(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    near, *_ = world()
    side = Side(near.view, near.nearest_m)
    asked = list[str]()

    def counted(name: str, given: Callable[..., object]) -> Callable[..., object]:
        def call(*arguments: object, **options: object) -> object:
            asked.append(name)
            return given(*arguments, **options)

        return call

    for name in ("dense_stereo", "find_features"):
        monkeypatch.setattr(handoff, name, counted(name, getattr(handoff, name)))
    turn = Transform.from_rpy(0.0, 0.0, 0.3, (1.0, -2.0, 0.1))
    for other in (side.moved(turn), side.moved(turn).moved(turn.inverse()), side.moved(turn.inverse())):
        assert other.cloud is not None
        assert other.surface is not None
        assert len(other.features) > 20
    assert sorted(asked) == ["dense_stereo", "find_features"]
    back = side.moved(turn).moved(turn.inverse())
    assert back.cloud is not None
    assert side.cloud is not None
    assert np.abs(back.cloud.points - side.cloud.points).max() < 1e-9
    expected = turn.apply(side.features.points)
    assert np.abs(side.moved(turn).features.points - expected).max() < 1e-9


def test_a_corner_is_ranged_once_for_all_pictures_that_are_laid_over_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    setting, _ = given(0.0)
    scene = Side(setting.hazcam.view, 0.3)
    asked = list[tuple[float, ...]]()
    ranged = drape.range_pixel

    def counted(view: StereoView, pixel: np.ndarray, *arguments: float) -> PointMatch | None:
        asked.append((*pixel, *arguments))
        return ranged(view, pixel, *arguments)

    monkeypatch.setattr(drape, "range_pixel", counted)
    side, pixel = setting.source("near")
    first = lay(side, scene, pixel, DrapeOptions())
    many = len(asked)
    again = lay(side, scene, pixel, DrapeOptions())
    assert first is not None
    assert again is not None
    assert many > 30
    assert len(asked) == many
    assert (first.points == again.points).all()


def test_patches_are_found_together_where_the_tracker_finds_each() -> None:
    """The reference is the tracker's matcher, one patch after the other."""
    setting, _ = given(0.3 * TILT)
    side, scene, pixel = setting.near, setting.hazcam, setting.near_pixel
    assert side is not None
    match = None if pixel is None else side.point(pixel)
    assert match is not None
    camera, view = side.view.left_camera, scene.view
    patches = find_patches(scene, match.point, camera, DrapeOptions(reach_m=0.8))
    source_px = camera.project(np.array([patch.point for patch in patches]))
    pixels, scores, _ = find_many(side.view.left, camera, source_px, view, patches, 14, 25)
    matcher = TemplateMatcher(NccOptions(search_px=14, template_px=TEMPLATE_PX, context_px=25, coarse=False))
    found = 0
    for n, patch in enumerate(patches):
        toward = camera.C - patch.point
        away = float(np.linalg.norm(toward))
        source = Template(side.view.left, camera, source_px[n], patch.point, patch.normal, away)
        expected = np.asarray(view.left_camera.project(patch.point))
        template = matcher.predict(source, view.left_camera, expected, patch.point)
        other = None if template is None else matcher.search(view.left, template, expected)
        flat = min(float(patch.normal @ toward) / away, _facing(patch, view.left_camera.C)) <= 0.2
        if flat or other is None or np.abs(other.pixel - expected).max() > 15.0:
            assert scores[n] == -2.0
            continue
        assert np.abs(pixels[n] - other.pixel).max() < 1e-6
        assert scores[n] == pytest.approx(other.score, abs=1e-6)
        found += 1
    assert found > 20


def _facing(patch: PointMatch, eye: np.ndarray) -> float:
    toward = eye - patch.point
    return float(patch.normal @ toward) / float(np.linalg.norm(toward))


def test_a_guess_that_leads_to_a_pose_found_already_is_not_followed(monkeypatch: pytest.MonkeyPatch) -> None:
    setting, _ = given(0.0)
    laid = list[Transform]()
    drape_from = shape_draped.drape

    def counted(*arguments: Any) -> Draped | None:
        laid.append(arguments[4])
        return drape_from(*arguments)

    monkeypatch.setattr(shape_draped, "drape", counted)
    side, pixel = setting.source("near")
    never_enough = DrapeOptions(enough=10_000, believed_first=True)
    found = lay(side, setting.hazcam, pixel, never_enough)
    assert found is not None
    # of three guesses features and registered surfaces have it at one place within a search window
    assert len(laid) == 2


def test_every_method_is_near_the_truth_with_a_well_known_mast() -> None:
    setting, true = given(0.0)
    for name in METHODS:
        found = hand_off(name, "near", setting)
        assert found is not None, name
        limit = 12.0 if name == "registration" else 4.0
        assert np.hypot(*(found.pixel - true)) < limit, name


def test_a_wrong_mast_misleads_kinematics_but_not_the_cascade() -> None:
    setting, true = given()
    blind = hand_off("pure kinematic", "near", setting)
    assert blind is not None
    assert np.hypot(*(blind.pixel - true)) > 4.0
    answer = cascade(setting, "near")
    assert answer.accepted, answer.reasons
    assert np.hypot(*(answer.pixel - true)) < 1.0
    assert answer.error_px < 1.5
    _, _, left, target = world()
    assert np.linalg.norm(answer.position - target) < 0.02
    pivot = POSE.site_from_rover.apply(np.array(PIVOT))
    side, _ = setting.source("near")
    found = mast_error(side, setting.hazcam, answer, pivot, left.camera.horizontal, (0.0, 0.0, 1.0))
    assert found is not None
    assert math.degrees(abs(found.tilt_rad + TILT)) < 0.1
    assert abs(found.disparity_px) < 1.0


def test_a_pair_that_ranges_wrongly_misleads_neither_the_cascade_nor_the_mast() -> None:
    setting, true = given()
    side, pixel = setting.source("near")
    right = side.view.right_camera
    turn = small_rotation(0.004 * np.cross(right.A, right.horizontal))
    toed = right.transformed(Transform(turn, right.C - turn @ right.C))
    wrong = replace(setting, near=Side(replace(side.view, right_camera=toed), 0.8))
    _, _, left, target = world()
    ranged = wrong.source("near")[0].point(pixel)
    told = side.point(pixel)
    assert ranged is not None
    assert told is not None
    assert np.linalg.norm(ranged.point - told.point) > 0.04
    answer = cascade(wrong, "near")
    assert answer.accepted, answer.reasons
    assert np.hypot(*(answer.pixel - true)) < 1.0
    assert np.linalg.norm(answer.position - target) < 0.02
    pivot = POSE.site_from_rover.apply(np.array(PIVOT))
    near = wrong.source("near")[0]
    found = mast_error(near, wrong.hazcam, answer, pivot, left.camera.horizontal, (0.0, 0.0, 1.0))
    assert found is not None
    assert math.degrees(abs(found.tilt_rad + TILT)) < 0.1
    assert abs(abs(found.disparity_px) - 0.004 * right.hs) < 1.0


def test_patches_register_what_surfaces_alone_lay_a_centimetre_off() -> None:
    near, haz, _, target = world()
    turn = small_rotation(np.array([0.08, -0.1, 0.1]))
    start = Transform(turn, target - turn @ target + np.array([0.12, -0.15, 0.08]))
    found = register_views(near, haz, start, target)
    assert found.accepted, found.reasons
    assert np.linalg.norm(found.scene_from_model.apply(target) - target) < 0.006


def test_resection_finds_a_camera_among_wrong_matches() -> None:
    near, _, _, target = world()
    rng = np.random.default_rng(4)
    points = target + rng.uniform(-0.2, 0.2, (40, 3))
    camera = near.view.left_camera
    turn = small_rotation(np.array([0.03, -0.02, 0.04]))
    wrong = camera.transformed(Transform(turn, np.array([0.1, -0.05, 0.02])))
    pixels = camera.project(points) + rng.normal(0.0, 0.2, (40, 2))
    pixels[:15] += rng.uniform(20.0, 60.0, (15, 2))
    settled = resect(points, 1e-8 * np.tile(np.eye(3), (40, 1, 1)), pixels, wrong, reach_px=2.0, sigma_px=0.3)
    assert settled is not None
    motion, agree = settled
    assert not agree[:15].any()
    assert agree[15:].all()
    back = wrong.transformed(motion.new_from_old.inverse())
    assert np.abs(back.project(points[15:]) - camera.project(points[15:])).max() < 0.3
    assert resect(points[:3], np.zeros((3, 3, 3)), pixels[:3], wrong, reach_px=2.0, sigma_px=0.3) is None


def test_points_on_a_line_or_in_one_place_tell_no_camera_and_raise_nothing() -> None:
    near, _, _, target = world()
    camera = near.view.left_camera
    for seed in range(200):
        rng = np.random.default_rng(seed)
        count, off_m = int(rng.integers(4, 9)), 10.0 ** rng.uniform(-13.0, -5.0)
        points = np.tile(target, (count, 1))
        if seed % 4 == 0:
            points += np.linspace(0.0, 0.3, count)[:, None] * rng.normal(size=3)
        elif seed % 4 > 1:
            away = seed % 4 - 1
            points[-away:] += rng.normal(0.0, 0.1, (away, 3))
        points += rng.normal(0.0, off_m, (count, 3))
        unit = 1e-8 * np.tile(np.eye(3), (count, 1, 1))
        settled = resect(points, unit, camera.project(points), camera, reach_px=4.0, sigma_px=0.3)
        if settled is not None:
            assert np.linalg.eigvalsh(settled[0].covariance)[0] > 0.0


def test_the_cascade_refuses_what_the_hazcams_do_not_show() -> None:
    setting, _ = given()
    haz = setting.hazcam.view
    rng = np.random.default_rng(0)
    noise = rng.uniform(0.2, 0.8, haz.left.shape).astype(np.float32)
    blind = replace(setting, hazcam=Side(replace(haz, left=noise, right=noise), 0.3))
    answer = cascade(blind, "near")
    assert not answer.accepted
    assert np.isnan(answer.pixel).all()
    assert "agree" in answer.reasons[0] or "missing stereo" in answer.reasons[0]


def test_the_cascade_says_where_stereo_is_missing() -> None:
    setting, true = given()
    haz = setting.hazcam.view
    right = haz.right.copy()
    origin, ray = haz.left_camera.back_project(true)
    for away in np.arange(0.3, 4.0, 0.02):
        x, y = (round(float(v)) for v in haz.right_camera.project(origin + away * ray))
        right[max(0, y - 45) : y + 46, max(0, x - 45) : x + 46] = 0.4
    answer = cascade(replace(setting, hazcam=Side(replace(haz, right=right), 0.3)), "near")
    assert not answer.accepted
    assert "missing stereo" in answer.reasons[0]


def test_the_cascade_refuses_a_target_that_has_been_covered() -> None:
    setting, true = given()
    haz = setting.hazcam.view
    left, right = haz.left.copy(), haz.right.copy()
    x, y = (round(float(v)) for v in true)
    patch = np.random.default_rng(3).uniform(0.2, 0.6, (31, 31)).astype(np.float32)
    left[y - 15 : y + 16, x - 15 : x + 16] = patch
    covered = replace(setting, hazcam=Side(replace(haz, left=left, right=right), 0.3))
    answer = cascade(covered, "near")
    assert not answer.accepted
    assert answer.reasons


def _shaded(pair: StereoView, place: np.ndarray, beside_m: float = 0.0) -> StereoView:
    """Return a pair in which 1.5 cm round a surface point (3,), m, moved to the right, lie in shade."""
    pictures = []
    for image, camera in ((pair.left, pair.left_camera), (pair.right, pair.right_camera)):
        x, y = (float(v) for v in camera.project(place))
        px_of_m = camera.hs / float(np.linalg.norm(place - camera.C))
        rows, columns = np.indices(image.shape)
        shade = np.hypot(columns - x - px_of_m * beside_m, rows - y) < 0.015 * px_of_m
        pictures.append(np.where(shade, 0.15 * image, image).astype(np.float32))
    return replace(pair, left=pictures[0], right=pictures[1])


def test_many_patches_overrule_a_shadow_that_has_gone_on() -> None:
    setting, true = given()
    near, haz, _, target = world()
    side, _ = setting.source("near")
    shaded = _shaded(near.view, target)
    before = Side(replace(side.view, left=shaded.left, right=shaded.right), 0.8)
    after = Side(_shaded(haz.view, target, 0.01), 0.3)
    moved = replace(setting, hazcam=after, near=before)
    refused = cascade(moved, "near")
    assert not refused.accepted
    assert "own patch are" in refused.reasons[0]
    answer = cascade(moved, "near", CascadeOptions(overrule=12))
    assert answer.accepted, answer.reasons
    assert np.hypot(*(answer.pixel - true)) < 1.0
    assert not cascade(moved, "near", CascadeOptions(overrule=10_000)).accepted


@pytest.mark.parametrize(("along_px", "off_px"), [(0.6, (0.0, 1.0)), (0.02, (2.0, 3.0))])
def test_an_own_patch_counts_along_a_border_by_what_it_knows_there(
    along_px: float, off_px: tuple[float, float]
) -> None:
    """It is found 2.9 px beside consensus, along the border of a shadow, or at a corner."""
    expected, border = np.array([40.0, 50.0]), np.array([0.49, -0.87])
    along, across = np.outer(border, border), np.eye(2) - np.outer(border, border)
    consensus = 1.2**2 * along + 0.2**2 * across
    own = expected + 2.9 * border, 0.97, along_px**2 * along + 0.1**2 * across
    at, left_px = handoff_cascade._joined(expected, consensus, own)
    least, most = off_px
    assert least <= np.hypot(*(at - expected)) <= most
    assert 0.0 < left_px < 1.0


def test_a_pancam_window_is_found_in_the_navcam() -> None:
    pose = Pose(-4.5, 0.0, 0.0)
    navcam = picture(pose, half=150, seed=2)
    cameras = rig()
    pan, tilt = cameras.point_at(np.array([4.5, 0.0, 0.4]), "pancam_left")
    camera = cameras.camera("pancam_left", pan, tilt)
    pancam = rock_renderer().render(camera, pose, SUN, window=(392, 264, 240, 240), seed=3)
    pixel = np.array([120.0, 120.0])
    point = np.asarray(pancam.truth.point_site[120, 120])
    true = navcam.camera.project(point)
    believed = point + 0.02 * (point - pancam.camera.C) + np.array([0.0, 0.03, 0.0])
    found = scaled_window(pancam.unit, pancam.camera, pixel, navcam.unit, navcam.camera, believed)
    assert found is not None
    assert found.score > 0.7
    assert np.hypot(*(found.pixel - true)) < 0.5


def test_misuse_is_refused() -> None:
    setting, _ = given()
    with pytest.raises(TrackerError, match='no hand-off "magic"'):
        hand_off("magic", "near", setting)
    with pytest.raises(TrackerError, match="not given"):
        hand_off("pure kinematic", "far", replace(setting, far=None))


def test_a_surface_that_stereo_has_at_two_ranges_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a day that was flown a shaded edge was 5.6 cm nearer one pixel further (302701810)."""
    setting, _ = given()
    told = handoff_cascade.range_pixel

    def nearer(view: StereoView, at: np.ndarray, away_m: float, spread: float = 0.3) -> PointMatch | None:
        found = told(view, at, away_m, spread)
        if found is None:
            return None
        ray = found.point - view.left_camera.C
        return replace(found, point=found.point - 0.08 * ray / np.linalg.norm(ray))

    monkeypatch.setattr(handoff_cascade, "range_pixel", nearer)
    answer = cascade(setting, "near")
    assert not answer.accepted
    assert re.search(r"at two ranges, (7\.9|8\.0|8\.1) cm apart", answer.reasons[0])


def test_a_pixel_beside_an_outline_is_refused_where_two_pairs_have_two_surfaces_under_it() -> None:
    """Its own stereo has the rock, its picture the ground 8 cm behind, which a pair from the side finds."""
    sides = []
    for x, y in ((-2.2, 0.0), (-2.1, 0.6)):
        pose = Pose(x, y, math.atan2(-y, -x))
        left = picture(pose, half=200, seed=5)
        right = picture(pose, "navcam_right", half=200, exposure=left.exposure, seed=6)
        sides.append((Side(_pair(left, right), 0.6), left.truth.range_m))
    (side, true_m), (scene, _) = sides
    beside, on_it = np.array([53.0, 336.0]), np.array([65.0, 336.0])
    for pixel, gap_m in ((beside, 0.08), (on_it, 0.0)):
        told = side.point(pixel)
        assert told is not None
        away = float(np.linalg.norm(told.point - side.view.left_camera.C))
        assert true_m[int(pixel[1]), int(pixel[0])] - away == pytest.approx(gap_m, abs=0.01)
    answer = cascade(Handoff(scene, side, beside), "near", LAID)
    assert not answer.accepted
    assert "the two pairs have its surface 8." in answer.reasons[0]
    assert cascade(Handoff(scene, side, on_it), "near", LAID).accepted
