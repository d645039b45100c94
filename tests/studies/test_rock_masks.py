"""Rocks drawn to their edges in an image whose truth is known in closed form."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt
import pytest

from rover_iface.errors import PlacementError
from rover_iface.placement import SurfaceCloud, cloud_of_points
from rover_iface.placement.segmentation import Segmentation, segment
from studies.common.rock_masks import MaskOptions, rock_masks
from tests.rover_iface.test_placement_safety import EYE, ROCKS, raster

Array = npt.NDArray[np.float64]


@lru_cache(maxsize=1)
def scene() -> tuple[Array, SurfaceCloud, Segmentation, npt.NDArray[np.int64]]:
    """Domes darker than the ground, their cloud smeared over the edges by a block of 7 pixels and with holes;
    image, cloud, segments and the dome behind each pixel."""
    points, body = raster()
    rng = np.random.default_rng(8)
    far = np.linalg.norm(points - EYE, axis=-1)
    ray = (points - EYE) / far[..., None]
    near = far.copy()
    for dy in range(-3, 4):
        for dx in range(-3, 4):
            near = np.minimum(near, np.roll(far, (dy, dx), axis=(0, 1)))
    edge = far - near > 0.05
    smeared = EYE + ray * np.where(edge, near, far)[..., None]
    smeared[60:64, 100:180] = np.nan
    smeared[(body == 0) & (rng.random(body.shape) < 0.3)] = np.nan
    image = np.where(body >= 0, 0.25, 0.45) + rng.normal(0.0, 0.02, body.shape)
    cloud = cloud_of_points(smeared, sigma_m=0.002, eye=EYE)
    return np.clip(image, 0.0, 1.0), cloud, segment(cloud), body


def overlap(labels: npt.NDArray[np.int64], body: npt.NDArray[np.int64], number: int) -> float:
    own = body == number
    label = np.bincount(labels[own & (labels >= 0)]).argmax()
    return float((own & (labels == label)).sum() / (own | (labels == label)).sum())


def test_masks_reach_the_edges_of_the_image_where_the_cloud_does_not() -> None:
    image, cloud, found, body = scene()
    masks = rock_masks(image, cloud, found)
    assert cloud.pixels is not None
    drawn = np.full(body.shape, -1)
    drawn[cloud.pixels[:, 1], cloud.pixels[:, 0]] = found.labels
    before = [overlap(drawn, body, number) for number in range(len(ROCKS))]
    after = [overlap(masks, body, number) for number in range(len(ROCKS))]
    assert max(before) < 0.85
    assert min(after) > 0.88


def test_holes_of_the_cloud_are_filled_and_pixels_beside_rocks_are_not() -> None:
    image, cloud, found, body = scene()
    masks = rock_masks(image, cloud, found)
    assert (masks[body == 0] >= 0).mean() > 0.95
    first = masks == np.bincount(masks[(body == 0) & (masks >= 0)]).argmax()
    assert first[body != 0].sum() < 0.1 * first.sum()
    assert set(np.unique(masks)) <= {-1, *range(len(found.rocks))}


def test_no_rocks_no_masks() -> None:
    image, cloud, _, _ = scene()
    flat = cloud.subset(cloud.points[:, 2] < 0.01)
    masks = rock_masks(image, flat, segment(flat))
    assert (masks == -1).all()


def test_misuse_of_masks_names_the_value() -> None:
    image, cloud, found, _ = scene()
    unordered = cloud_of_points(cloud.points[:100], eye=EYE)
    with pytest.raises(PlacementError, match="no pixels"):
        rock_masks(image, unordered, found)
    with pytest.raises(PlacementError, match="100 points"):
        rock_masks(image, cloud.subset(np.arange(100)), found)
    with pytest.raises(PlacementError, match="outside the image of 50 x 170"):
        rock_masks(image[:, :50], cloud, found)
    with pytest.raises(PlacementError, match=r"noise is 0\.0; it must be positive"):
        MaskOptions(noise=0.0)
    with pytest.raises(PlacementError, match="0 rounds"):
        MaskOptions(rounds=0)
