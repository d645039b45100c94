"""Odds, times and energies of activities: from what runs made of them, drawn to what was believed."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy import stats

from planner.errors import ProblemError
from planner.path_network import (
    CALIBRATIONS,
    K9_CALIBRATION,
    ActivityFit,
    Calibration,
    NetworkRequest,
    ObservationPoint,
    Pose,
    Target,
    build_network,
    calibration_document,
    fit_activity,
    fit_calibration,
)
from planner.path_network.activity_fit import BELIEVED

BELIEF = ActivityFit("mi", 0.9, 504.0, 120.0, 15_400.0, 2000.0)


def test_what_was_not_seen_stays_as_believed() -> None:
    assert fit_activity(BELIEF, [], [], []) is BELIEF


@pytest.mark.parametrize(("tried", "succeeded"), [(1, 0), (20, 13), (400, 300)])
def test_odds_are_the_mean_and_deviation_of_bayes_rule_on_a_grid(tried: int, succeeded: int) -> None:
    p = np.linspace(0.0, 1.0, 200_001)[1:-1]
    weight = stats.beta.pdf(p, BELIEVED * BELIEF.p_success, BELIEVED * (1 - BELIEF.p_success))
    weight = weight * stats.binom.pmf(succeeded, tried, p)
    weight /= weight.sum()
    mean = float(weight @ p)
    seen = [k < succeeded for k in range(tried)]
    found = fit_activity(BELIEF, seen, [500.0] * tried, [1.0] * tried)
    assert found.p_success == pytest.approx(mean, abs=1e-5)
    assert found.p_se == pytest.approx(float(np.sqrt(weight @ (p - mean) ** 2)), rel=1e-3)
    assert (found.tried, found.succeeded) == (tried, succeeded)


@pytest.mark.parametrize("certain", [0.0, 1.0])
def test_no_odds_are_certain_after_few_that_went_as_believed(certain: float) -> None:
    sure = replace(BELIEF, p_success=certain)
    few, many = (fit_activity(sure, [certain == 1.0] * n, [1.0] * n, [1.0] * n) for n in (3, 300))
    assert 0.03 < abs(few.p_success - certain) < 0.1
    assert 0.0 < abs(many.p_success - certain) < 0.003
    assert few.p_se > abs(few.p_success - certain) / 2


def test_many_runs_outweigh_what_was_believed_and_few_do_not() -> None:
    rng = np.random.default_rng(4)
    times, energies = rng.normal(700.0, 200.0, 2000).clip(1.0), rng.normal(9000.0, 500.0, 2000)
    many = fit_activity(BELIEF, [True] * 2000, times.tolist(), energies.tolist())
    assert many.time_mean_s == pytest.approx(times.mean(), rel=0.002)
    assert many.time_sd_s == pytest.approx(times.std(), rel=0.02)
    assert many.energy_mean_j == pytest.approx(energies.mean(), rel=0.002)
    one = fit_activity(BELIEF, [True], [5000.0], [15_400.0])
    assert 504.0 < one.time_mean_s < 504.0 + 5000.0 / 5
    assert one.time_sd_s > 1000.0  # one that took ten times as long says that it may


def test_outcomes_without_their_times_and_impossible_times_are_refused() -> None:
    with pytest.raises(ProblemError, match="activity mi: 2 outcomes"):
        fit_activity(BELIEF, [True, False], [1.0], [1.0, 1.0])
    with pytest.raises(ProblemError, match="negative or not finite"):
        fit_activity(BELIEF, [True], [float("nan")], [1.0])


def _fitted(tracks: list[float] | None, each_s: float) -> Calibration:
    rng = np.random.default_rng(6)
    length = rng.uniform(1, 9, 60)
    watched = np.array(tracks if tracks is not None else [0.0] * 60)
    return fit_calibration(
        name="run", source="drawn", prior=K9_CALIBRATION, length_m=length, turn_rad=np.zeros(60),
        duration_s=300 + 100 * length + each_s * watched, energy_j=50 * (300 + 100 * length),
        speed_m_s=0.05, turn_rate_rad_s=0.1, drive_power_w=70.0, tracked=tracks, track_overhead_s=45.0,
    )  # fmt: skip


def test_what_a_track_adds_to_a_drive_is_fitted_where_their_number_differs() -> None:
    found = _fitted([float(k % 4) for k in range(60)], 130.0)
    assert (found.track_s, found.fixed_s, found.drive_factor) == pytest.approx((130, 300, 5), rel=1e-6)
    assert found.energy_factor == pytest.approx(50 / 70, rel=1e-6)
    assert found.duration_cv == pytest.approx(0.0, abs=1e-6)


def test_energy_that_goes_with_looks_is_not_left_out_of_the_sum() -> None:
    rng = np.random.default_rng(12)
    length, tracks = rng.uniform(1, 12, 900), rng.integers(1, 4, 900).astype(float)
    seconds = 130 + 145 * length + 585 * tracks
    joules = 29.0 * seconds * rng.lognormal(-0.02, 0.2, 900)
    found = fit_calibration(
        name="run", source="drawn", prior=K9_CALIBRATION, length_m=length, turn_rad=np.zeros(900),
        duration_s=seconds, energy_j=joules, speed_m_s=0.06, turn_rate_rad_s=0.1, drive_power_w=105.0,
        tracked=tracks,
    )  # fmt: skip
    said = found.fixed_j + found.energy_factor * 105.0 * (found.fixed_s + found.drive_factor * length / 0.06)
    assert said.sum() == pytest.approx(joules.sum(), rel=0.03)


def test_what_scatters_is_the_drive_and_not_what_tracks_add() -> None:
    rng = np.random.default_rng(15)
    length, tracks = rng.uniform(0.5, 12, 4000), rng.integers(1, 6, 4000).astype(float)
    drive_s = 60 + 150 * length
    found = fit_calibration(
        name="run", source="drawn", prior=K9_CALIBRATION, length_m=length, turn_rad=np.zeros(4000),
        duration_s=drive_s * rng.lognormal(-0.045, 0.3, 4000) + 585 * tracks, energy_j=50 * drive_s,
        speed_m_s=0.06, turn_rate_rad_s=0.1, drive_power_w=105.0, tracked=tracks,
    )  # fmt: skip
    assert found.track_s == pytest.approx(585, rel=0.02)
    assert found.duration_cv == pytest.approx(0.307, rel=0.05)  # sqrt(exp(0.3^2) - 1)


def test_a_track_that_takes_no_time_is_kept_in_the_document() -> None:
    alike = replace(_fitted(None, 0.0), track_s=0.0)
    assert CALIBRATIONS.from_document(calibration_document(alike)) == alike


def test_as_many_tracks_on_every_drive_leave_the_figure_that_was_believed() -> None:
    found = _fitted([3.0] * 60, 45.0)
    assert found.track_s is None
    assert (found.fixed_s, found.drive_factor) == pytest.approx((300, 5), rel=1e-6)


def test_losses_on_arrival_are_told_from_those_by_the_metre() -> None:
    rng = np.random.default_rng(9)
    metres, own = rng.uniform(1, 8, 8000), rng.random(8000) < 0.4
    lost = rng.random(8000) < -np.expm1(-(0.01 * metres + 0.15 * own))
    given: dict[str, Any] = {
        "name": "run", "source": "drawn", "prior": K9_CALIBRATION, "length_m": metres,
        "turn_rad": np.zeros(8000), "duration_s": 100 * metres, "energy_j": 100 * metres,
        "speed_m_s": 0.05, "turn_rate_rad_s": 0.1, "drive_power_w": 70.0, "lost": lost,
        "exposure_m": np.column_stack([metres, np.zeros(8000)]),
    }  # fmt: skip
    found = fit_calibration(**given, own=own)
    assert abs(found.arrival_rate - 0.15) < 3 * found.arrival_se < 0.05
    assert abs(found.inside_per_m - 0.01) < 3 * found.inside_se_per_m < 0.004
    blind = fit_calibration(**given)
    assert blind.arrival_rate == 0.0
    assert blind.inside_per_m > 0.02


def test_an_arrival_adds_to_the_odds_of_its_own_target_alone() -> None:
    request = NetworkRequest(
        start=Pose(0.0, 0.0, 0.0),
        targets=(Target("T1", 6.0, 1.0), Target("T2", 8.0, -2.0)),
        observation_points=(
            ObservationPoint("P1", "T1", Pose(5.2, 0.9, 0.0)),
            ObservationPoint("P2", "T2", Pose(7.3, -1.7, 0.0)),
        ),
    )
    arriving = replace(request, calibration=replace(request.calibration, arrival_rate=0.3))
    before, after = build_network(request), build_network(arriving)
    for route in before.routes:
        other = after.route(route.origin, route.destination)
        assert other is not None
        for target, p in route.p_lose.items():
            own = target == after.target_of.get(route.destination)
            kept = (1.0 - p) * (np.exp(-0.3) if own else 1.0)
            assert other.p_lose[target] == pytest.approx(1.0 - kept)


def test_a_document_is_of_the_oldest_version_that_says_all_of_it() -> None:
    learned = _fitted([float(k % 4) for k in range(60)], 130.0)
    assert calibration_document(learned)["format"] == "calibration/3"
    assert CALIBRATIONS.from_document(calibration_document(learned)) == learned
    bare = calibration_document(_fitted(None, 0.0))
    assert bare["format"] == "calibration/1"
    assert {"track_s", "activities"}.isdisjoint(bare)
