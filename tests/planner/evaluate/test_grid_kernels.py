"""Kernels of a grid: no weight whose products are too small to be held as usual, and none missed."""

from __future__ import annotations

import numpy as np
import pytest

from planner.evaluate.grid import FAINT, FAINT_SINGLE, Grid, Rounding, mean_above, weights_from
from planner.evaluate.model import Model
from tests.planner.examples import example


@pytest.mark.parametrize("how", Rounding)
@pytest.mark.parametrize(("dtype", "faint"), [(np.float64, FAINT), (np.float32, FAINT_SINGLE)])
def test_kernels_hold_no_faint_weight(how: Rounding, dtype: type, faint: float) -> None:
    model = Model.of(example(spread=0.2, time_s=9000.0))
    grid = Grid(model, 97, 57, how, dtype)
    kernels = [grid.leg_t(0, 1, 1), grid.leg_g(0, 1), grid.obs_t(0), grid.obs_g(0)]
    assert all(kernel[kernel > 0.0].min() >= 0.999 * faint for kernel in kernels)


@pytest.mark.parametrize("sigma", [0.05, 0.4, 1.5])
def test_what_is_left_out_is_less_than_a_weight_is_rounded_by(sigma: float) -> None:
    step, mu = 0.25, 1.0
    kept = weights_from(0.0, 193, step, mu, sigma, 0.0, Rounding.MID)
    at = mean_above(np.linspace(-step, 193.0 * step, 195), mu, sigma)
    whole = np.maximum((at[:-2] - 2.0 * at[1:-1] + at[2:]) / step, 0.0)
    assert np.abs(kept - whole).sum() <= np.finfo(np.float64).eps
