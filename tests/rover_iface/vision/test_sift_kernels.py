"""The gate of epipolar segments against distances worked out point by point."""

from __future__ import annotations

import numpy as np
import pytest

from rover_iface.vision.sift_kernels import END_PX, near_segments


@pytest.mark.parametrize("seed", range(3))
def test_a_pixel_is_near_a_segment_if_some_point_of_it_is(seed: int) -> None:
    rng = np.random.default_rng(seed)
    begin = rng.uniform(0, 60, (40, 2))
    end = begin + rng.normal(0, 20, (40, 2))
    pixels = rng.uniform(0, 60, (50, 2))
    found = np.empty((40, 50), np.bool_)
    near_segments(begin, end, pixels, 1.5, found)
    along = (end - begin) / np.linalg.norm(end - begin, axis=1, keepdims=True)
    for i in range(40):
        # as far as the rows go: a strip from END_PX before the segment to END_PX beyond it
        t = np.arange(-END_PX, np.linalg.norm(end[i] - begin[i]) + END_PX, 0.002)
        line = begin[i] + t[:, None] * along[i]
        away = np.linalg.norm(pixels[:, None] - line[None], axis=2).min(axis=1)
        ends = np.isclose(t[np.linalg.norm(pixels[:, None] - line[None], axis=2).argmin(axis=1)], t[[0]])
        ends |= np.linalg.norm(pixels - line[-1], axis=1) < 1.5
        sure = (np.abs(away - 1.5) > 0.01) & ~ends
        assert (found[i] == (away < 1.5))[sure].all()
    assert found.any()


def test_no_segment_has_nothing_beside_it() -> None:
    begin = np.array([[np.nan, 1.0], [5.0, 5.0]])
    end = np.array([[3.0, 1.0], [5.0, 5.0]])
    found = np.ones((2, 1), np.bool_)
    near_segments(begin, end, np.array([[5.0, 5.0]]), 2.0, found)
    assert not found.any()
