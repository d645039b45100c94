"""What is told of errors: widened where checks miss, and honest though few parts tell it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rover_iface.cameras.stereo_kernels import few_parts
from rover_iface.vision.coverage_watch import INSIDE, CoverageWatch


@pytest.mark.parametrize("understated", [1.0, 2.0, 6.0])
def test_in_the_long_run_95_percent_of_the_checks_hold_whatever_the_noise(understated: float) -> None:
    rng = np.random.default_rng(7)
    watch = CoverageWatch()
    for squared in understated * rng.chisquare(2, 4000):
        watch.see(float(squared), 2)
    assert watch.coverage == pytest.approx(0.95, abs=0.025)
    assert watch.factor > 0.6 * understated


def test_what_is_told_is_never_narrowed_and_no_check_is_no_news() -> None:
    watch = CoverageWatch()
    assert math.isnan(watch.coverage)
    watch.see(math.nan, 2)
    assert watch.checks == 0
    for _ in range(100):
        watch.see(0.0, 1)
    assert watch.factor == 1.0
    for _ in range(100):
        watch.see(1e6, 1)
    assert watch.factor == pytest.approx(watch.most)


@pytest.mark.parametrize(("parts", "held"), [(3, 0.937), (5, 0.95), (9, 0.95)])
def test_a_mean_of_few_parts_is_told_so_that_95_percent_hold(parts: int, held: float) -> None:
    rng = np.random.default_rng(3)
    values = rng.normal(0.0, 1.0, (20000, parts))
    mean = values.mean(axis=1)
    sandwich = ((values - mean[:, None]) ** 2).sum(axis=1) / parts**2
    told = few_parts(np.ones(parts)) * sandwich
    assert float(np.mean(mean**2 < INSIDE[1] * told)) == pytest.approx(held, abs=0.012)
