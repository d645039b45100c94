"""What a patch of stereo shows: the body that fills a fifth of it, with the window of stereo or without."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rover_iface.localization.ground_points import GroundPoints, direction_raster
from studies.common.localization_legs import bodies_of

BODY = slice(40, 44)
"""Columns of the raster whose rays hit the body."""


@pytest.fixture(scope="module")
def points() -> GroundPoints:
    azimuth, elevation = np.meshgrid(np.arange(-0.12, 0.12, 0.00255), np.arange(-0.1, 0.0, 0.00255))
    rays = np.stack(
        (np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)), axis=-1
    )
    return GroundPoints(10.0 * rays.reshape(-1, 3), np.zeros(3))


def leg(columns: int) -> Any:
    """Return a leg whose scene has one body, seen in the columns of `BODY`, and ground."""

    def cast(_origins: Any, rays: np.ndarray) -> dict[str, np.ndarray]:
        column = np.arange(len(rays)) % columns
        return {"primID": ((column >= BODY.start) & (column < BODY.stop)).astype(np.int64)}

    return SimpleNamespace(scene=SimpleNamespace(cast=cast, objects=np.array([0, 1]), ids=["", "R1"]))


@pytest.mark.parametrize(
    ("first", "plain", "windowed"), [(40, True, True), (44, False, True), (46, False, False)]
)
def test_a_patch_beside_its_body_shows_it_within_the_window_of_stereo(
    points: GroundPoints, first: int, plain: bool, windowed: bool
) -> None:
    rows, columns = direction_raster(points, farthest_m=32.0).inverse.shape
    patch = np.array([r * columns + c for r in range(10, 14) for c in range(first, first + 4)])
    assert patch.max() < rows * columns
    rock: Any = SimpleNamespace(cells=patch)
    for reach, shown in ((0, plain), (1, windowed)):
        found = bodies_of(leg(columns), np.zeros(3), points, [rock], reach=reach)
        assert found == [frozenset({"R1"}) if shown else frozenset()]
