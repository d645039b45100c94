"""The search of draped patches, held to its definition."""

from __future__ import annotations

import numpy as np
import pytest

from rover_iface.vision import drape_kernels


@pytest.mark.parametrize("half", [2, 7])
def test_likeness_at_whole_pixels_is_the_correlation_of_the_two_windows(half: int) -> None:
    rng = np.random.default_rng()
    picture = rng.random((60, 70)).astype(np.float32)
    picture[:, 50:] = 0.5  # flat: alike to nothing
    side = 2 * half + 1
    window = rng.random((side, side))
    core = window - window.mean()
    score, left, top = np.empty((21, 38)), 17, 9
    drape_kernels._alike(picture, core, float(np.linalg.norm(core)), left, top, score)
    for y in range(score.shape[0]):
        for x in range(score.shape[1]):
            part = picture[top + y : top + y + side, left + x : left + x + side].astype(float)
            flat = part.std() < 1e-6
            expected = 0.0 if flat else np.corrcoef(part.ravel(), window.ravel())[0, 1]
            assert score[y, x] == pytest.approx(expected, abs=1e-9)
    assert np.ptp(score) > 0.1


def test_the_best_place_of_a_template_is_where_it_was_cut_from() -> None:
    picture = np.random.default_rng().random((80, 90)).astype(np.float32)
    template = picture[30 : 30 + 25, 40 : 40 + 25].copy()
    at = drape_kernels._best_place(picture, template, np.array([48.4, 45.7]), 7, 12, 14)
    assert at == (52.0, 42.0)
