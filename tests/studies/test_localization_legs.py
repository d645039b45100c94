"""What a patch of stereo shows, with the window of stereo or without; how far off disparities are."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rover_iface.localization.ground_points import GroundPoints, direction_raster
from studies.common import localization_legs as legs
from studies.common import localization_noise as noise_module
from studies.common.localization_legs import RANGE_FACTOR, Sight, StereoNoise, bodies_of, stereo_points
from studies.common.localization_noise import LAGS, Kind, parted, wedge_errors
from tests.seeds import drawn_seed

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


NOISE = StereoNoise(0.12, 0.10, 0.30, 0.20, bias_px=0.0, width_cells=1.0, grown=0.0)


def modelled_errors(noise: StereoNoise, seed: int) -> dict[str, np.ndarray]:
    """Return a modelled stop's errors as `wedge_errors` tells them: a wall 10 m away, one half a rock."""
    azimuth, elevation = np.meshgrid(np.arange(-0.4, 0.4, 0.00255), np.arange(0.2, -0.2, -0.00255))
    level = np.cos(elevation)
    rays = np.stack((level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)), axis=-1)
    ranges, rock = np.full(azimuth.shape, 10.0), azimuth < 0.0
    sight = Sight(np.zeros(3), rays, ranges, np.zeros(azimuth.shape, np.int32), rock)
    points = stereo_points(sight, np.random.default_rng(seed), noise).points
    away = np.linalg.norm(points, axis=1)
    column = np.rint((np.arctan2(points[:, 1], points[:, 0]) + 0.4) / 0.00255).astype(int)
    row = np.rint((0.2 - np.arcsin(points[:, 2] / away)) / 0.00255).astype(int)
    error = np.full(azimuth.shape, np.nan)
    error[row, column] = RANGE_FACTOR / away - RANGE_FACTOR / 10.0
    return {"error": error, "range": ranges, "rock": rock, "ground": ~rock}


def test_the_noise_of_modelled_stereo_is_measured_as_it_was_set() -> None:
    found = modelled_errors(NOISE, drawn_seed())
    told = []
    for on, together, white in (("rock", 0.12, 0.10), ("ground", 0.30, 0.20)):
        kind = Kind(on, 0.0, 15.0)
        kind.add(found)
        told.append(kind.figures())
        # 25 000 cells, some 3000 of them independent: 2 % of deviation
        assert told[-1]["rms"] == pytest.approx(np.hypot(together, white), rel=0.08)
    width, shares = parted([one["correlation"] for one in told])
    assert width == pytest.approx(1.0, abs=0.15)
    assert shares == pytest.approx([0.0144 / 0.0244, 0.09 / 0.13], abs=0.08)


def test_the_bias_of_a_stop_is_told_apart_from_its_scatter() -> None:
    biases, scatters = [], []
    first = drawn_seed()
    for seed in range(first, first + 40):
        kind = Kind("rock", 0.0, 15.0)
        kind.add(modelled_errors(StereoNoise(0.12, 0.10, bias_px=0.5, width_cells=1.0, grown=0.0), seed))
        biases.append(kind.figures()["bias_rms"])
        scatters.append(kind.figures()["rms"])
    # forty draws of one deviation: 11 %, here four times that
    assert np.sqrt(np.mean(np.square(biases))) == pytest.approx(0.5, rel=0.45)
    assert np.mean(scatters) == pytest.approx(np.hypot(0.12, 0.10), rel=0.05)


def test_noise_without_neighbours_hangs_together_over_nothing() -> None:
    _, shares = parted([dict.fromkeys(LAGS, 0.0)])
    assert shares == [0.0]


def test_a_kept_leg_of_another_noise_is_not_taken(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    before = legs.noise_name()
    assert before == legs.noise_name()
    monkeypatch.setattr(legs, "StereoNoise", lambda: StereoNoise(rock_px=0.5))
    assert legs.noise_name() != before
    monkeypatch.setattr(legs, "make_leg", lambda *_: pytest.fail("drawn anew"))
    (tmp_path / f"leg_7_26.00_m_{before}.pickle").write_bytes(b"the leg of the noise before")
    with pytest.raises(pytest.fail.Exception, match="drawn anew"):
        legs.leg_record(7, cache=tmp_path)


def test_errors_of_a_pair_are_seen_less_true_on_rock_and_ground_apart(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    azimuth, elevation = np.meshgrid(np.arange(2.9, 3.4, 0.00255), np.arange(0.1, -0.1, -0.00255))
    level = np.cos(elevation)
    rays = np.stack((level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)), axis=-1)
    rock = azimuth > 3.15
    # a rock 8 m away before a wall at 10 m, across the seam of azimuths; the rock 0.5 px too near
    seen = RANGE_FACTOR / np.where(rock, RANGE_FACTOR / 8.0 + 0.5, RANGE_FACTOR / 10.0)
    points = GroundPoints((seen[..., None] * rays).reshape(-1, 3), np.zeros(3), RANGE_FACTOR)
    monkeypatch.setattr(noise_module, "points_of_panorama", lambda _: points)

    def cast(_origins: Any, along: np.ndarray) -> dict[str, np.ndarray]:
        on = np.mod(np.arctan2(along[:, 1], along[:, 0]), 2 * np.pi) > 3.15
        return {"tfar": np.where(on, 8.0, 10.0), "primID": on.astype(np.int64)}

    scene = SimpleNamespace(cast=cast, objects=np.array([0, 1]), ids=["", "R1"])
    wedge: Any = None
    scenery: Any = SimpleNamespace(scene=scene)
    found = wedge_errors(scenery, wedge, np.zeros(3))
    assert found["error"].shape == azimuth.shape
    assert found["rock"].sum() > 7000
    assert found["error"][found["rock"]] == pytest.approx(0.5, abs=1e-6)
    assert found["error"][found["ground"]] == pytest.approx(0.0, abs=1e-6)
    # the wall's cells beside the rock: seen where they are
    assert np.nanmax(found["grown"]) == pytest.approx(0.0, abs=0.01)
