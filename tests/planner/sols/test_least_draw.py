"""The least cost of a success against integration on a fine grid of durations."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ndtr, ndtri

from planner.evaluate.model import log_normal
from planner.problem import Amount
from planner.sols.least_draw import least_draw

HOTEL_W = 38.0


@pytest.mark.parametrize("seed", range(6))
def test_no_charge_left_makes_a_success_cheaper(seed: int) -> None:
    """And what is called the least is within 0.05 % of the least of 200 charges."""
    rng = np.random.default_rng(seed)
    seconds = Amount(float(rng.uniform(100, 3000)), 0.0)
    joules = Amount(float(rng.uniform(5e3, 3e5)), 0.0)
    seconds = Amount(seconds.mean, float(rng.uniform(0.05, 0.8)) * seconds.mean)
    joules = Amount(joules.mean, float(rng.uniform(0.05, 0.8)) * joules.mean)
    amounts = np.array([seconds.mean, seconds.sd, joules.mean, joules.sd])
    ln = np.array([*log_normal(seconds), *log_normal(joules)])
    mean = HOTEL_W * seconds.mean + joules.mean

    q = (np.arange(20_000) + 0.5) / 20_000
    spent = HOTEL_W * np.exp(ln[0] + ln[1] * ndtri(q))
    ratios = []
    for left in mean * np.exp(np.linspace(-0.5, 3.0, 200)):
        rest = np.maximum(left - spent, 1e-9)
        z = (np.log(rest) - ln[2]) / ln[3]
        drawn = np.minimum(spent, left) + joules.mean * ndtr(z - ln[3]) + rest * ndtr(-z)
        ratios.append(drawn.mean() / max(float(ndtr(z).mean()), 1e-300))
    found = least_draw(amounts, ln, HOTEL_W)
    assert found <= min(ratios) * (1.0 + 1e-4)  # the midpoints above lose so much
    assert found >= min(ratios) * (1.0 - 5e-4)


def test_a_constant_costs_itself() -> None:
    ln = np.array([*log_normal(Amount(100.0)), *log_normal(Amount(5e3))])
    assert least_draw(np.array([100.0, 0.0, 5e3, 0.0]), ln, HOTEL_W) == pytest.approx(8_800.0)
