"""How far successes of a day go together: learned from drawn days, and by another reckoning."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from planner.errors import ProblemError
from planner.path_network import (
    CALIBRATIONS,
    K9_CALIBRATION,
    ActivityFit,
    calibration_document,
    fit_activity,
    fit_intraday_correlation,
)
from planner.path_network.intraday_correlation import BELIEVED_MEAN, UNKNOWN, design_effect

BELIEF = ActivityFit("mi", 0.9, 504.0, 120.0, 15_400.0, 2000.0)
Drawn = tuple[list[bool], list[int]]


def drawn_days(rho: float, days: int, rng: np.random.Generator, p: float = 0.8) -> Drawn:
    """Return successes and their days: the odds of each a beta draw, one to four tries by them."""
    size = (1.0 - rho) / rho if rho else math.inf
    odds = rng.beta(p * size, (1.0 - p) * size, days) if rho else np.full(days, p)
    day = [d for d in range(days) for _ in range(rng.integers(1, 5))]
    return (rng.random(len(day)) < odds[day]).tolist(), day


def by_analysis_of_variance(success: list[bool], day: list[int]) -> float:
    """Return the estimate from the mean squares between days and within (Ridout et al. 1999, eq. 1)."""
    n, y = np.bincount(day).astype(float), np.bincount(day, np.asarray(success, float))
    total, days = n.sum(), len(n)
    between = (n * (y / n - y.sum() / total) ** 2).sum() / (days - 1)
    within = (y * (n - y) / n).sum() / (total - days)
    usual = (total - (n**2).sum() / total) / (days - 1)
    return float((between - within) / (between + (usual - 1.0) * within))


@pytest.mark.parametrize("rho", [0.05, 0.15, 0.4])
def test_the_correlation_of_drawn_days_is_found_within_its_error(rho: float) -> None:
    away = []
    for seed in range(25):
        success, day = drawn_days(rho, 400, np.random.default_rng([seed, int(100 * rho)]))
        found = fit_intraday_correlation(success, day)
        away.append((found.mean - rho) / found.error)
        assert found.error < 0.06
    assert abs(float(np.mean(away))) < 0.7  # 25 of them: what was believed pulls by less than an error
    assert 0.6 < math.sqrt(float(np.square(away).mean())) < 1.4


@pytest.mark.parametrize("rho", [0.0, 0.15, 0.4])
def test_many_days_say_what_the_analysis_of_variance_says(rho: float) -> None:
    success, day = drawn_days(rho, 8000, np.random.default_rng([11, int(100 * rho)]))
    found = fit_intraday_correlation(success, day)
    assert found.mean == pytest.approx(by_analysis_of_variance(success, day), abs=2.0 * found.error)
    assert found.error < 0.015


def test_days_that_have_nothing_in_common_have_nearly_no_correlation() -> None:
    found = fit_intraday_correlation(*drawn_days(0.0, 2000, np.random.default_rng(7)))
    assert 0.0 < found.mean < 0.02
    assert found.mean < 2.0 * found.error


def test_the_mean_is_that_of_bayes_rule_on_another_grid() -> None:
    tried, succeeded = (3, 3, 2, 4, 1), (3, 0, 1, 4, 1)
    day = [d for d, n in enumerate(tried) for _ in range(n)]
    success = [k < y for n, y in zip(tried, succeeded, strict=True) for k in range(n)]
    p, rho = np.meshgrid(np.linspace(0.0, 1.0, 502)[1:-1], np.linspace(0.0, 1.0, 502)[1:-1], indexing="ij")
    size = (1.0 - rho) / rho
    weight = stats.beta.pdf(p, 4.5, 0.5) * stats.beta.pdf(rho, 1.0, 1.0 / BELIEVED_MEAN - 1.0)
    for n, y in zip(tried, succeeded, strict=True):
        weight *= stats.betabinom.pmf(y, n, p * size, (1.0 - p) * size)
    mean = float((weight * rho).sum() / weight.sum())
    spread = math.sqrt(float((weight * (rho - mean) ** 2).sum() / weight.sum()))
    found = fit_intraday_correlation(success, day, (4.5, 0.5))
    assert (found.mean, found.error) == pytest.approx((mean, spread), rel=0.01)
    assert found.days == 4  # on one of the five there was one try


def test_few_days_move_what_was_believed_little_and_many_outweigh_it() -> None:
    apart = [True, True, True, False, False, False]
    few = fit_intraday_correlation(apart, [1, 1, 1, 2, 2, 2])
    many = fit_intraday_correlation(apart * 60, [d for k in range(60) for d in [2 * k] * 3 + [2 * k + 1] * 3])
    assert BELIEVED_MEAN < few.mean < 2.0 * BELIEVED_MEAN
    assert many.mean > 0.8
    assert fit_intraday_correlation([True, False], [1, 2]) == UNKNOWN
    assert fit_intraday_correlation([], []) == UNKNOWN


def test_impossible_days_are_refused() -> None:
    with pytest.raises(ProblemError, match="2 outcomes and 1 days"):
        fit_intraday_correlation([True, False], [1])
    with pytest.raises(ProblemError, match="both must be positive"):
        fit_intraday_correlation([True, False], [1, 1], (1.0, 0.0))


def test_days_leave_the_odds_and_widen_their_error() -> None:
    success, day = drawn_days(0.4, 100, np.random.default_rng(5))
    zeros = [0.0] * len(success)
    blind = fit_activity(BELIEF, success, zeros, zeros)
    told = fit_activity(BELIEF, success, zeros, zeros, day)
    assert told.p_success == blind.p_success
    assert (blind.intraday_correlation, blind.days) == (0.0, 0)
    assert told.intraday_correlation == pytest.approx(0.4, abs=4 * told.intraday_correlation_se)
    assert told.days == sum(n > 1 for n in np.bincount(day))
    assert told.p_se == pytest.approx(blind.p_se * math.sqrt(design_effect(told.intraday_correlation, day)))


def test_the_stated_error_of_odds_is_that_of_days_that_go_together() -> None:
    away: dict[bool, list[float]] = {True: [], False: []}
    for seed in range(60):
        success, day = drawn_days(0.3, 150, np.random.default_rng([seed, 2]))
        zeros = [0.0] * len(success)
        for told in (True, False):
            found = fit_activity(BELIEF, success, zeros, zeros, day if told else ())
            away[told].append((found.p_success - 0.8) / found.p_se)
    rms = {told: math.sqrt(float(np.square(z).mean())) for told, z in away.items()}
    assert 0.8 < rms[True] < 1.2
    assert rms[False] > 1.2


def test_days_to_come_go_together_as_the_odds_of_all_are_not_known_either() -> None:
    """Of odds by Bayes' rule after ten tries two coins of a day to come agree more than one by one."""
    rng = np.random.default_rng(17)
    success, day = [True] * 6 + [False] * 4, [k // 2 for k in range(10)]
    told = fit_activity(BELIEF, success, [0.0] * 10, [0.0] * 10, day)
    known = rng.beta(6 + 4.5, 4 + 0.5, 400_000)  # had days nothing in common
    alone = replace(told, intraday_correlation=0.0, p_se=float(known.std()))
    coins = rng.random((2, len(known))) < known
    assert alone.expected_correlation == pytest.approx(np.corrcoef(coins[0], coins[1])[0, 1], abs=0.006)
    rho = told.intraday_correlation
    assert rho < told.expected_correlation < rho + told.p_se**2 / (told.p_success * (1 - told.p_success))
    assert BELIEF.expected_correlation == 0.0
    assert replace(told, days=0).expected_correlation == 0.0


def test_a_document_says_what_goes_together_and_older_programs_read_what_does_not() -> None:
    alone = replace(K9_CALIBRATION, activities=(replace(BELIEF, tried=4, succeeded=3, p_se=0.1),))
    document = calibration_document(alone)
    assert document["format"] == "calibration/3"
    assert "days" not in document["activities"][0]
    assert CALIBRATIONS.from_document(document) == alone
    told = replace(BELIEF, intraday_correlation=0.2, intraday_correlation_se=0.1, days=7)
    together = replace(alone, activities=(told,))
    document = calibration_document(together)
    assert document["format"] == "calibration/4"
    assert CALIBRATIONS.from_document(document) == together
    jsonschema = pytest.importorskip("jsonschema")
    formats = Path(__file__).parents[3] / "docs/formats"
    for one in (alone, together):
        document = calibration_document(one)
        name = document["format"].replace("/", "-")
        jsonschema.validate(document, json.loads((formats / f"{name}.schema.json").read_text("utf-8")))
    with pytest.raises(ProblemError, match="intraday_correlation"):
        CALIBRATIONS.from_document(
            {**document, "activities": [{**document["activities"][0], "intraday_correlation": 1.2}]}
        )
