"""Hashed numbers are uniform and normal, and independent of one another."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numba import njit, uint64
from scipy import stats

from planner.evaluate.hashing import EDGES, LAYERS, TAIL, mix, normal, uniform

COUNT = 400_000


@njit
def _draw(seed: Any, normals: Any, uniforms: Any) -> Any:
    key = mix(uint64(seed))
    for k in range(normals.shape[0]):
        normals[k] = normal(key, k)
        uniforms[k] = uniform(key, k)


@pytest.fixture(scope="module")
def drawn() -> tuple[Any, Any]:
    normals, uniforms = np.empty(COUNT), np.empty(COUNT)
    _draw(7, normals, uniforms)
    return normals, uniforms


def test_normals_have_the_normal_distribution_out_to_the_tails(drawn: tuple[Any, Any]) -> None:
    normals, _ = drawn
    assert stats.kstest(normals, "norm").pvalue > 1e-3
    for edge in (1.0, 2.5, TAIL, 4.0):
        for side in (normals > edge, normals < -edge):
            expected = COUNT * stats.norm.sf(edge)
            assert abs(int(side.sum()) - expected) < 4.0 * np.sqrt(expected) + 1.0
    assert float(np.mean(normals)) == pytest.approx(0.0, abs=4.0 / np.sqrt(COUNT))
    assert float(np.std(normals)) == pytest.approx(1.0, abs=4.0 / np.sqrt(2.0 * COUNT))


def test_every_layer_of_the_ziggurat_has_the_same_area() -> None:
    heights = np.exp(-0.5 * EDGES[1:] ** 2)
    areas = EDGES[1:LAYERS] * np.diff(heights)
    assert np.allclose(areas, areas[0], rtol=1e-8)
    tail = np.sqrt(2.0 * np.pi) * stats.norm.sf(TAIL)
    assert TAIL * np.exp(-0.5 * TAIL**2) + tail == pytest.approx(areas[0], rel=1e-8)


def test_neighbours_are_uncorrelated(drawn: tuple[Any, Any]) -> None:
    for values in drawn:
        for lag in (1, 2, 16):
            r = float(np.corrcoef(values[:-lag], values[lag:])[0, 1])
            assert abs(r) < 4.5 / np.sqrt(COUNT)


def test_uniforms_fill_the_unit_interval(drawn: tuple[Any, Any]) -> None:
    _, uniforms = drawn
    assert stats.kstest(uniforms, "uniform").pvalue > 1e-3
    assert 0.0 < float(uniforms.min()) < 1e-4
    assert 1.0 - 1e-4 < float(uniforms.max()) < 1.0
