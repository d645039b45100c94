"""The contest of descriptors judges by geometry, and what trains on some worlds reports on others."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from rover_iface.cameras.model import CameraModel, pinhole
from rover_iface.vision.learned.descriptor import PATCH_PX, cut
from rover_iface.vision.sift_features import detect, mutual, stretched
from studies.common.domain_split import TUNING_SEEDS, tuning
from studies.common.perception_worlds import Shot
from studies.learned_matcher.contest import (
    Matches,
    Outcome,
    both,
    by_place,
    either,
    itself,
    judged,
    matchable,
    ranked,
    ratio_like,
    sums,
)
from studies.learned_matcher.kept_pairs import PatchPairs
from studies.learned_matcher.pairs import TRAINING_SEEDS, half_camera, pairs_of, put
from studies.learned_matcher.patches import Keys, find_keys, single, upright_sift
from studies.learned_matcher.sights import Sight
from studies.learned_matcher.table import report
from studies.learned_matcher.training import rivals_of
from tests.rover_iface.vision.pictures import picture


def keys(pixels: list[tuple[float, float]]) -> Keys:
    count = len(pixels)
    blank = np.zeros((50, 50), np.float32)
    return Keys(
        blank,
        blank,
        np.array(pixels, dtype=float).reshape(-1, 2),
        np.full(count, 4.0),
        np.zeros(count, np.int64),
        np.zeros((count, 128), np.float32),
    )


def looking_down(x: float) -> CameraModel:
    """Return a camera 4 m above the plane z = 0, tilted by 45 degrees."""
    axis = np.array([1.0, 0.0, -1.0]) / np.sqrt(2.0)
    down = np.array([-1.0, 0.0, -1.0]) / np.sqrt(2.0)
    right = np.cross(down, axis)
    model = pinhole(focal_px=200.0, width=160, height=120, center=(x, 0.0, 4.0))
    h, v = 200.0 * right + 79.5 * axis, 200.0 * down + 59.5 * axis
    return CameraModel(model.kind, 160, 120, C=np.array([x, 0.0, 4.0]), A=axis, H=h, V=v)


def shot(camera: CameraModel) -> Shot:
    """Return a picture of the plane z = 0."""
    u, v = np.meshgrid(np.arange(160.0), np.arange(120.0))
    origin, rays = camera.back_project(np.stack((u, v), axis=-1))
    range_m = (-origin[..., 2] / rays[..., 2]).astype(np.float32)
    held = np.ones(range_m.shape, bool)
    return Shot(np.zeros(range_m.shape, np.uint8), camera, camera, range_m, held, held)


def test_keypoints_are_those_of_the_product() -> None:
    image = picture(1)
    pixels, descriptors = detect(image, 2500)
    found = find_keys(image)
    own = {(*p, *d) for p, d in zip(found.pixels.tolist(), found.sift.tolist(), strict=True)}
    assert own == {(*p, *d) for p, d in zip(pixels.tolist(), descriptors.tolist(), strict=True)}
    assert len(found) > 50


def test_upright_descriptors_are_the_products_where_that_is_upright() -> None:
    """What the product finds turned by 3 degrees and less is nearly the same without the turn."""
    image = picture(2)
    found = find_keys(image)
    angles = np.array(
        [k.angle for k in cv2.SIFT.create(enable_precise_upscale=True).detect(stretched(image))]
    )
    strengths = np.array(
        [k.response for k in cv2.SIFT.create(enable_precise_upscale=True).detect(stretched(image))]
    )
    angles = angles[np.argsort(-strengths, kind="stable")]
    upright = np.flatnonzero(np.minimum(angles, 360.0 - angles) < 3.0)
    assert len(upright) >= 3
    given, turned = found.sift[upright], upright_sift(found)[upright]
    cosine = (given * turned).sum(1) / np.linalg.norm(given, axis=1) / np.linalg.norm(turned, axis=1)
    assert cosine.min() > 0.95


def test_a_place_with_two_orientations_is_described_once() -> None:
    assert single(keys([(3, 4), (3, 4), (5, 6)])).tolist() == [0, 2]


def test_surface_points_are_put_where_the_other_camera_shows_them() -> None:
    one, other = shot(looking_down(0.0)), shot(looking_down(1.0))
    pixels = np.array([[40.0, 20.0], [40.0, 30.0], [10.0, 12.0]])
    points, there, growth = put(one, pixels, other)
    assert np.abs(points[:, 2]).max() < 0.05
    origin, rays = half_camera(one.true).back_project(pixels)
    exact = origin - origin[..., 2:] / rays[:, 2:] * rays
    assert np.abs(there - half_camera(other.true).project(exact)).max() < 0.6
    away = [np.linalg.norm(points - s.true.C, axis=1) for s in (one, other)]
    assert np.allclose(growth, away[0] / away[1])
    assert growth.min() > 1.0  # the other is a metre nearer


def test_hidden_points_are_put_nowhere() -> None:
    one, other = shot(looking_down(0.0)), shot(looking_down(1.0))
    other.range_m[:] *= 0.9  # something stands in front
    assert np.isnan(put(one, np.array([[40.0, 20.0]]), other)[1]).all()


def test_only_training_seeds_train() -> None:
    assert set(TRAINING_SEEDS) < set(TUNING_SEEDS)
    with pytest.raises(ValueError, match="no training seed"):
        pairs_of(0, "own", Path("none"))
    with pytest.raises(ValueError, match="no training seed"):
        pairs_of(123_456, "own", Path("none"))


def test_tuned_figures_are_not_written(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="not reported"):
        report("", tuning(2), "", "", tmp_path)


def test_what_shows_the_same_surface_is_no_rival() -> None:
    points = np.array([[0.0, 0, 0], [0.01, 0, 0], [1.0, 0, 0], [0.01, 0, 0]])
    rivals = rivals_of(points, np.array([0.05, 0.02, 0.05, 0.05]), np.array([0, 0, 0, 1]))
    assert not rivals.diagonal().any()
    assert (rivals == rivals.T).all()
    assert not rivals[0, 1]
    assert rivals[0, 2]
    assert rivals[0, 3]  # another world's


def test_kept_pairs_are_read_as_written(tmp_path: Path) -> None:
    patches = np.arange(2 * PATCH_PX**2, dtype=np.uint32).astype(np.uint8).reshape(2, PATCH_PX, PATCH_PX)
    made = PatchPairs(patches, patches[::-1], np.eye(3)[:2], np.ones(2), np.array([0, 1]))
    made.save(tmp_path / "pairs_own_500.npz")
    read = PatchPairs.load(tmp_path / "pairs_own_500.npz")
    assert all((getattr(read, name) == getattr(made, name)).all() for name in PatchPairs.__slots__)
    assert [p.name for p in tmp_path.iterdir()] == ["pairs_own_500.npz"]


def test_ranking_below_a_ratio_is_the_match_of_the_product() -> None:
    rng = np.random.default_rng(6)
    old = rng.normal(0, 1.0, (60, 16)).astype(np.float32)
    new = np.vstack((old[:40] + rng.normal(0, 0.4, (40, 16)), rng.normal(0, 1.0, (30, 16)))).astype(
        np.float32
    )
    pairs, ratio = ranked(old, new)
    for limit in (0.5, 0.8, 0.95):
        assert pairs[ratio < limit].tolist() == mutual(old, new, limit).tolist()


def test_a_patch_as_its_own_descriptor_is_correlation() -> None:
    patches = cut(picture(7), np.array([[60.0, 60.0], [150.0, 150.0]]), np.array([40.0, 40.0]))
    one, other = itself(patches), itself(3.0 * patches + 1.0)
    assert np.allclose((one * other).sum(axis=1), 1.0, atol=1e-5)


def sight() -> Sight:
    old, new = (
        keys([(10, 10), (10, 10), (20, 20), (30, 30)]),
        keys([(12, 10.5), (22, 20), (40, 40), (22, 26)]),
    )
    return Sight(old, new, np.array([[12.0, 10.0], [12.0, 10.0], [22.0, 20.0], [np.nan, np.nan]]))


def test_matches_are_judged_by_where_things_are() -> None:
    matches = Matches(np.array([[0, 0], [2, 1], [2, 3], [3, 2]]), np.array([0.4, 0.5, 0.6, 1.2]))
    told = judged(sight(), "some", matches, matchable(sight()), 0.1)
    assert told.offs == [0.5, 0.0, 6.0, np.inf]
    assert told.shown == 2
    assert told.count() == (2, 1)  # the last is not believed
    assert (told.agree, told.target_px) == (None, None)


def test_along_a_line_only_the_distance_from_it_counts() -> None:
    level = np.tile([0.0, 1.0, -10.0], (4, 1))
    given = sight()
    by_line = Sight(given.old, given.new, given.expected, level)
    off = by_line.off(np.array([0, 0, 0]), np.array([[18.0, 10.4], [40.0, 10.0], [12.0, 15.0]]))
    assert off.tolist() == pytest.approx([0.4, np.inf, 5.0])


def test_a_place_matches_another_once() -> None:
    found = by_place(sight(), Matches(np.array([[1, 0], [0, 0], [2, 1]]), np.array([0.3, 0.7, 0.5])))
    assert found.pairs.tolist() == [[0, 0], [2, 1]]
    assert found.doubt.tolist() == [0.3, 0.5]


def test_second_opinion_adds_or_confirms() -> None:
    one = Matches(np.array([[0, 0], [2, 1]]), np.array([0.5, 0.9]))
    other = Matches(np.array([[0, 0], [2, 3], [3, 2]]), np.array([0.8, 0.6, 0.7]))
    joined, shared = either(one, other), both(one, other)
    assert joined.pairs.tolist() == [[0, 0], [2, 3], [3, 2]]
    assert joined.doubt.tolist() == [0.5, 0.6, 0.7]
    assert (shared.pairs.tolist(), shared.doubt.tolist()) == ([[0, 0]], [0.8])
    nothing = both(one, Matches(np.empty((0, 2), np.int64), np.empty(0)))
    assert nothing.pairs.shape == (0, 2)


def outcome(doubts: list[float], offs: list[float], **rest: Any) -> Outcome:
    return Outcome("some", doubts, offs, 50, 0.1, **rest)


def test_share_at_95_percent_precision_stops_where_wrong_ones_come_in() -> None:
    right = outcome([0.01 * n for n in range(40)], [0.2] * 40)
    mixed = outcome([0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 2.0], [0.2, 9.0, 9.0, 9.0, 0.2, 2.0, 0.2])
    total = sums([right, mixed])
    assert (total.right, total.wrong, total.shown) == (42, 3, 100)  # 2 px off is neither
    # 41 right and two wrong are 95.3 %; with a third wrong one and all right ones it is 93.5 %
    assert total.curve == pytest.approx(0.41)
    assert sums([outcome([0.1, 0.2], [9.0, 0.1])]).curve == 0.0


@pytest.mark.parametrize(
    ("agree", "target_px", "posed", "misled"),
    [(14, 3.0, 1, 0), (14, 9.0, 0, 1), (13, 3.0, 0, 0), (99, 7.0, 1, 0)],
)
def test_pose_counts_with_enough_features_near_enough(
    agree: int, target_px: float, posed: int, misled: int
) -> None:
    total = sums([outcome([0.1], [0.1], agree=agree, target_px=target_px)])
    assert (total.posed, total.misled) == (posed, misled)


def test_ratio_is_set_where_precision_is_the_products() -> None:
    product = outcome([0.5] * 10, [0.1] * 9 + [9.0])  # 90 %
    other = outcome([0.1 * n for n in range(1, 13)], [0.1] * 9 + [9.0, 9.0, 9.0])
    assert ratio_like([other], [product]) == pytest.approx(1.0)
