"""Patches that stereo's window made too wide, cut where the picture shows that the rock ends."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import binary_dilation, maximum_filter

from rover_iface.errors import LocalizationError
from rover_iface.localization.ground_points import GroundPoints, direction_raster
from rover_iface.localization.rock_chance import OUTLINED_ENOUGH, weighed_by_outlines
from rover_iface.localization.rock_extraction import extract_rocks
from rover_iface.localization.rock_outlines import OutlineOptions, cut_at_outlines
from rover_iface.localization.seen_rock import SeenRock
from tests.rover_iface.localization.rocks_for_tests import seen_rock
from tests.rover_iface.localization.test_rock_extraction import EYE, FACTOR, seen_field
from tests.seeds import drawn_seed

SHAPE = (40, 60)
OPTIONS = OutlineOptions()


def ground_picture(seed: int) -> np.ndarray:
    """Return bright ground of little contrast."""
    return np.asarray(0.6 + 0.02 * np.random.default_rng(seed).standard_normal(SHAPE))


def block(row: int, column: int, height: int, width: int) -> np.ndarray:
    mask = np.zeros(SHAPE, dtype=bool)
    mask[row : row + height, column : column + width] = True
    return mask


def fattened(mask: np.ndarray, cells: int = 2) -> np.ndarray:
    return np.asarray(binary_dilation(mask, np.ones((3, 3), dtype=bool), iterations=cells))


def cut(raised: np.ndarray, picture: np.ndarray) -> list[tuple[np.ndarray, bool]]:
    """Return the parts as masks, and whether each is outlined."""
    parts = []
    for cells, outlined in cut_at_outlines(np.flatnonzero(raised), raised, picture, 10, OPTIONS):
        mask = np.zeros(SHAPE, dtype=bool)
        mask.ravel()[cells] = True
        parts.append((mask, outlined))
    return parts


@pytest.mark.parametrize("darker", [0.25, -0.2])
def test_a_patch_that_grew_ends_where_its_rock_does(darker: float) -> None:
    picture, rock = ground_picture(drawn_seed()), block(15, 25, 4, 5)
    picture[rock] -= darker
    ((found, outlined),) = cut(fattened(rock), picture)
    assert outlined
    # three deviations of a Gaussian: a cell of the ring at most by chance
    assert (found & rock).sum() == 20
    assert (found & ~rock).sum() <= 2


def test_a_patch_like_its_ground_stays_whole() -> None:
    raised = block(15, 25, 5, 6)
    ((found, outlined),) = cut(raised, np.clip(ground_picture(drawn_seed()), 0.55, 0.65))
    assert not outlined
    assert np.array_equal(found, raised)


def test_two_rocks_in_one_patch_are_two() -> None:
    picture, one, two = ground_picture(drawn_seed()), block(15, 20, 4, 4), block(16, 30, 3, 4)
    picture[one | two] = 0.3
    parts = cut(fattened(one | two, 3), picture)
    assert [outlined for _, outlined in parts] == [True, True]
    for rock in (one, two):
        assert sorted(int((found & rock).sum()) for found, _ in parts) == [0, rock.sum()]


def test_a_patch_that_the_window_moved_off_its_rock_is_moved_back() -> None:
    picture, rock = ground_picture(drawn_seed()), block(17, 25, 3, 4)
    picture[rock] = 0.3
    ((found, outlined),) = cut(block(13, 22, 5, 5), picture)
    assert outlined
    assert (found & rock).sum() >= 8
    assert (found & ~rock).sum() <= 2


def test_a_rise_with_a_rock_on_it_is_told_apart_from_the_rock() -> None:
    picture, rock, rise = ground_picture(drawn_seed()), block(12, 15, 4, 4), block(12, 15, 6, 30)
    picture[rock] = 0.3
    picture = np.where(rock, picture, np.clip(picture, 0.55, 0.65))
    (first, outlined), (rest, other) = cut(rise, picture)
    assert (outlined, other) == (True, False)
    assert np.array_equal(first, rock)
    assert not (rest & fattened(rock, OPTIONS.reach_cells)).any()


def test_without_ground_to_compare_with_a_patch_stays_whole() -> None:
    picture, rock = ground_picture(drawn_seed()), block(15, 25, 4, 5)
    picture[rock] = 0.3
    raised = fattened(rock)
    picture[~raised] = np.nan
    ((found, outlined),) = cut(raised, picture)
    assert not outlined
    assert np.array_equal(found, raised)


def test_outlines_without_reach_are_refused() -> None:
    with pytest.raises(LocalizationError, match="less than the ring"):
        OutlineOptions(reach_cells=8, ring_cells=8)


def fat_field(rock: tuple[float, float, float, float]) -> tuple[GroundPoints, GroundPoints]:
    """Return a dark half round as stereo sees it, two cells too wide, with its picture and without."""
    true = direction_raster(seen_field([rock]))
    there = np.isfinite(true.inverse)
    rays = true.directions()[there]
    fat = maximum_filter(np.where(there, true.inverse, 0.0), size=5)[there]
    # level ground is nowhere nearer than this
    on_rock = true.inverse[there] > -rays[:, 2] / EYE[2] + 0.001
    picture = np.where(on_rock, 0.3, 0.6)
    picture += 0.02 * np.random.default_rng(drawn_seed()).standard_normal(len(picture))
    points = GroundPoints(EYE + rays / fat[:, None], EYE, FACTOR, picture)
    return points, replace(points, brightness=None)


def test_a_far_rock_has_its_own_width_where_there_is_a_picture() -> None:
    with_picture, without = fat_field((17.0, 0.0, 0.25, 0.35))
    (rock,), (fat,) = extract_rocks(with_picture, models=False), extract_rocks(without, models=False)
    assert rock.outlined
    assert fat.outlined is None
    # its foot does not stand out from the ground, and the outermost cells do not count
    assert rock.width_m == pytest.approx(0.44, abs=0.09)
    # a cell is 0.043 m there
    assert fat.width_m > rock.width_m + 0.12
    assert np.linalg.det(rock.covariance) < np.linalg.det(fat.covariance)


def stop(outlined: int, *, others: bool = False) -> list[SeenRock]:
    rocks = [replace(seen_rock((8.0, y, -1.5), 0.2, 0.3), probability=0.95) for y in range(12)]
    return [rock.with_outline(True) for rock in rocks[:outlined]] + [
        rock.with_outline(others) for rock in rocks[outlined:]
    ]


def test_where_rocks_have_outlines_a_patch_without_one_is_hardly_a_rock() -> None:
    weighed = weighed_by_outlines(stop(OUTLINED_ENOUGH), 0.05)
    assert all(rock.probability > 0.9 for rock in weighed if rock.outlined)
    assert all(rock.probability < 0.2 for rock in weighed if not rock.outlined)
    assert all(rock.probability < 0.5 for rock in weighed_by_outlines(stop(OUTLINED_ENOUGH), 0.05)[6:])


def test_where_few_rocks_have_outlines_none_is_needed() -> None:
    rocks = stop(OUTLINED_ENOUGH - 1)
    assert weighed_by_outlines(rocks, 0.05) == rocks


def test_a_patch_without_outline_is_left_away_below_the_least_probability() -> None:
    assert len(weighed_by_outlines(stop(OUTLINED_ENOUGH), 0.3)) == OUTLINED_ENOUGH
