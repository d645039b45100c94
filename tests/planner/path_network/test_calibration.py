"""Fitting finds the rates that made the data; the file form survives a round trip."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

from planner.errors import ProblemError
from planner.path_network import (
    CALIBRATIONS,
    K9_CALIBRATION,
    calibration_document,
    fit_calibration,
    fit_failures,
    fit_loss,
    fit_mean,
)
from planner.path_network.day_factor import fit_day_factor, kinds_of_days


def test_maximum_likelihood_finds_the_loss_rates() -> None:
    rng = np.random.default_rng(1)
    exposure = rng.uniform(0, 6, (20_000, 2)) * (rng.random((20_000, 2)) < 0.7)
    exposure[:, 0] += 0.1
    lost = rng.random(20_000) < -np.expm1(-exposure @ np.array([0.01, 0.08]))
    fit = fit_loss(exposure, lost)
    for rate, error, truth in zip(fit.rate_per_m, fit.standard_error, (0.01, 0.08), strict=True):
        assert abs(rate - truth) < 4 * error
        assert error < 0.1 * truth + 0.001


def test_one_circumstance_has_its_closed_form() -> None:
    lost = np.array([1, 0, 0, 0])
    fit = fit_loss(np.full((4, 1), 2.0), lost)
    assert fit.rate_per_m[0] == pytest.approx(-np.log(3 / 4) / 2, rel=1e-5)


def test_no_loss_at_all_gives_rate_zero() -> None:
    assert fit_loss(np.ones((5, 2)), np.zeros(5)).rate_per_m == pytest.approx((0.0, 0.0))


def test_regression_finds_coefficients_and_spread() -> None:
    rng = np.random.default_rng(2)
    features = np.column_stack([np.ones(4000), rng.uniform(1, 10, 4000)])
    mean = features @ np.array([300.0, 165.0])
    sigma = np.sqrt(np.log1p(0.3**2))
    measured = mean * rng.lognormal(-(sigma**2) / 2, sigma, 4000)
    fit = fit_mean(features, measured)
    assert fit.coefficients == pytest.approx((300, 165), rel=0.08)
    assert fit.cv == pytest.approx(0.3, rel=0.06)


def test_a_fitted_calibration_keeps_what_the_runs_do_not_tell() -> None:
    rng = np.random.default_rng(3)
    length, turn = rng.uniform(1, 12, 500), rng.uniform(0, 3, 500)
    duration = 200 + 8.0 * length / 0.06 + 2.0 * turn / 0.1
    fitted = fit_calibration(
        name="run",
        source="simulated legs",
        prior=K9_CALIBRATION,
        length_m=length,
        turn_rad=turn,
        duration_s=duration,
        energy_j=70.0 * duration,
        speed_m_s=0.06,
        turn_rate_rad_s=0.1,
        drive_power_w=70.0,
    )
    assert (fitted.fixed_s, fitted.drive_factor, fitted.turn_factor) == pytest.approx((200, 8, 2), rel=1e-6)
    assert (fitted.duration_cv, fitted.energy_factor) == pytest.approx((0, 1), abs=1e-6)
    assert fitted.outside_per_m == K9_CALIBRATION.outside_per_m
    assert (fitted.legs, fitted.tracks) == (500, 0)


def test_the_file_form_survives_a_round_trip(tmp_path: Path) -> None:
    path = tmp_path / "c.json"
    path.write_text(CALIBRATIONS.write(K9_CALIBRATION), encoding="utf-8")
    assert CALIBRATIONS.read_file(path) == K9_CALIBRATION
    assert json.loads(path.read_text())["format"] == "calibration/4"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"format": "calibration/9"}, "calibration/9"),
        ({"fixed_s": None}, "fixed_s must be a number, found null"),
        ({"energy_cv": -1}, "energy_cv is -1"),
        ({"colour": 1}, "colour is not a known member"),
    ],
)
def test_a_broken_file_is_refused(change: dict[str, object], message: str) -> None:
    data = {**CALIBRATIONS.document(K9_CALIBRATION), **change}
    with pytest.raises(ProblemError, match=message):
        CALIBRATIONS.read(json.dumps(data))


def test_a_file_that_lacks_a_member_or_is_no_json_is_refused() -> None:
    data = CALIBRATIONS.document(K9_CALIBRATION)
    del data["inside_per_m"]
    with pytest.raises(ProblemError, match="inside_per_m is missing"):
        CALIBRATIONS.read(json.dumps(data))
    with pytest.raises(ProblemError, match="not JSON"):
        CALIBRATIONS.read("{")


def test_arrays_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ProblemError, match="needed"):
        fit_loss(np.ones((3, 2)), np.zeros(2))
    with pytest.raises(ProblemError, match="negative"):
        fit_loss(-np.ones((3, 2)), np.zeros(3))
    with pytest.raises(ProblemError, match="over 0 m"):
        fit_loss(np.zeros((1, 2)), np.ones(1))
    with pytest.raises(ProblemError, match="positive"):
        fit_mean(np.ones((3, 1)), np.zeros(3))
    with pytest.raises(ProblemError, match="duration_cv"):
        replace(K9_CALIBRATION, duration_cv=float("nan"))


def test_fitted_rates_come_with_their_errors() -> None:
    rng = np.random.default_rng(5)
    inside, outside = rng.uniform(1, 5, 2000), rng.uniform(0, 3, 2000)
    exposure = np.column_stack([inside, outside, np.zeros(2000)])
    lost = rng.random(2000) < -np.expm1(-(0.01 * inside + 0.1 * outside))
    fitted = fit_calibration(
        name="run", source="drawn", prior=K9_CALIBRATION,
        length_m=inside, turn_rad=outside, duration_s=300 + 100 * inside, energy_j=1000 + 100 * inside,
        speed_m_s=0.06, turn_rate_rad_s=0.1, drive_power_w=70.0, exposure_m=exposure, lost=lost,
    )  # fmt: skip
    assert abs(fitted.inside_per_m - 0.01) < 3 * fitted.inside_se_per_m < 0.02
    assert abs(fitted.outside_per_m - 0.1) < 3 * fitted.outside_se_per_m < 0.05
    assert fitted.occluded_per_m == K9_CALIBRATION.occluded_per_m
    assert fitted.occluded_se_per_m == 0.0
    assert (fitted.tracks, fitted.losses) == (2000, int(lost.sum()))


def test_without_a_loss_the_rate_comes_down_from_what_was_believed_and_stays_uncertain() -> None:
    fitted = fit_calibration(
        name="run", source="drawn", prior=K9_CALIBRATION,
        length_m=np.linspace(1, 5, 20), turn_rad=np.zeros(20), duration_s=np.full(20, 500.0),
        energy_j=np.full(20, 500.0), speed_m_s=0.06, turn_rate_rad_s=0.1, drive_power_w=70.0,
        exposure_m=np.column_stack([np.full(20, 10.0), np.zeros(20)]), lost=np.zeros(20),
    )  # fmt: skip
    assert 0.0 < fitted.inside_per_m < K9_CALIBRATION.inside_per_m
    assert fitted.inside_per_m < 1 / 200
    assert 0.5 * fitted.inside_per_m < fitted.inside_se_per_m < 1 / 50
    assert fitted.outside_per_m == K9_CALIBRATION.outside_per_m


def test_one_loss_over_centimetres_leaves_a_finite_rate() -> None:
    exposure = np.column_stack([np.full(200, 3.0), np.zeros(200)])
    exposure[0] = 0.0, 0.04
    lost = np.zeros(200)
    lost[:10] = 1.0
    alone = fit_loss(exposure, lost)
    believed = fit_loss(exposure, lost, (0.0048, 0.15))
    assert alone.rate_per_m[1] > 10.0
    assert 0.15 < believed.rate_per_m[1] < 2.0
    assert believed.standard_error[1] > 0.5 * believed.rate_per_m[1]
    assert believed.rate_per_m[0] == pytest.approx(alone.rate_per_m[0], rel=0.08)
    with pytest.raises(ProblemError, match="2 positive ones"):
        fit_loss(exposure, lost, (0.0, 0.15))


@pytest.mark.parametrize("lost", [0, 2, 10])
def test_a_rate_and_its_error_are_those_of_bayes_rule_on_a_grid(lost: int) -> None:
    log_rate = np.linspace(-15.0, 3.0, 40_001)
    rate = np.exp(log_rate)
    deviation = math.hypot(math.log(4.0), math.log(2.0))
    posterior = lost * np.log(-np.expm1(-3.0 * rate)) - 3.0 * rate * (30 - lost)
    posterior -= 0.5 * ((log_rate - math.log(0.05)) / deviation) ** 2
    weight = np.exp(posterior - posterior.max())
    weight /= weight.sum()
    found = fit_loss(np.full((30, 1), 3.0), np.arange(30) < lost, [0.05])
    assert found.rate_per_m[0] == pytest.approx(rate[posterior.argmax()], rel=2e-3)
    spread = math.sqrt(float(weight @ (log_rate - weight @ log_rate) ** 2))
    assert found.standard_error[0] / found.rate_per_m[0] == pytest.approx(spread, rel=0.1)


@pytest.mark.parametrize("times", [0.1, 1.0, 5.0])
def test_odds_learned_from_twenty_days_are_within_their_error_of_the_truth(times: float) -> None:
    rng = np.random.default_rng(round(10 * times))
    believed = np.array([0.0048, 0.05, 0.15, 1.0 / 26.0])
    errors, least = [], math.inf
    for _ in range(60):
        rates = times * believed * rng.lognormal(0.0, 0.7, 4)
        exposure = np.column_stack([  # seven tracks a day, as on the days of three targets
            rng.uniform(0, 8, 140), rng.exponential(5.0, 140), rng.exponential(0.1, 140),
            rng.random(140) < 0.4,
        ])  # fmt: skip
        chance = -np.expm1(-exposure @ rates)
        found = fit_loss(exposure, rng.random(140) < chance, believed)
        said = -np.expm1(-exposure @ np.array(found.rate_per_m))
        errors.append((said.sum() - chance.sum()) / math.sqrt(float((chance * (1 - chance)).sum())))
        least = min(least, float(said.sum()))
    assert 0.5 < math.sqrt(float(np.square(errors).mean())) < 1.25
    assert abs(float(np.mean(errors))) < 0.6
    assert least > 0.2


def test_what_is_written_keeps_to_the_published_schema() -> None:
    jsonschema = pytest.importorskip("jsonschema")
    path = Path(__file__).parents[3] / "docs/formats/calibration-1.schema.json"
    schema = json.loads(path.read_text(encoding="utf-8"))
    document = calibration_document(K9_CALIBRATION)
    jsonschema.validate(document, schema)
    assert CALIBRATIONS.from_document(document) == K9_CALIBRATION
    assert set(schema["properties"]) == set(document)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({**document, "inside_per_m": -1}, schema)


def test_drives_that_failed_have_a_rate_and_older_programs_read_what_has_none() -> None:
    given = {
        "name": "run", "source": "drawn", "prior": K9_CALIBRATION,
        "length_m": np.linspace(1, 5, 20), "turn_rad": np.zeros(20), "duration_s": np.full(20, 500.0),
        "energy_j": np.full(20, 500.0), "speed_m_s": 0.06, "turn_rate_rad_s": 0.1, "drive_power_w": 70.0,
    }  # fmt: skip
    rng = np.random.default_rng(8)
    goal = rng.uniform(2.0, 12.0, 4000)
    stopped = rng.exponential(1.0 / 0.03, 4000)
    driven, short = np.minimum(goal, stopped), stopped < goal
    fitted = fit_calibration(**given, failures=int(short.sum()), tried_m=driven)
    assert abs(fitted.fail_per_m - 0.03) < 3 * fitted.fail_se_per_m < 0.006
    document = calibration_document(fitted)
    assert document["format"] == "calibration/2"
    assert CALIBRATIONS.from_document(document) == fitted
    path = Path(__file__).parents[3] / "docs/formats/calibration-2.schema.json"
    pytest.importorskip("jsonschema").validate(document, json.loads(path.read_text(encoding="utf-8")))
    unknown = fit_calibration(**given)
    assert (unknown.fail_per_m, unknown.fail_se_per_m) == (0.0, 0.0)
    assert calibration_document(unknown)["format"] == "calibration/1"


def test_no_failure_in_few_metres_says_little_and_in_many_much() -> None:
    few, few_error = fit_failures(0, [3.0] * 2)
    many, many_error = fit_failures(0, [3.0] * 400)
    assert 0.05 < -math.expm1(-3.0 * few) < 0.1  # of one drive; one of ten was believed
    assert 0.0 < -math.expm1(-3.0 * many) < 0.002
    assert few_error > few
    assert many_error < 0.002
    rates = [fit_failures(0, [3.0] * n)[0] for n in range(1, 40)]
    assert rates == sorted(rates, reverse=True)


@pytest.mark.parametrize(("failures", "believed"), [(0, 0.0), (4, 0.0), (4, 0.05)])
def test_a_rate_of_failures_is_that_of_bayes_rule_on_a_grid(failures: int, believed: float) -> None:
    tried = np.linspace(1.0, 9.0, 30)
    worth = 5.0 * 5.0  # five drives of the mean length
    rate = np.linspace(0.0, 1.0, 400_001)[1:]
    weight = stats.gamma.pdf(rate, believed * worth if believed else 0.5, scale=1.0 / worth)
    weight = weight * stats.poisson.pmf(failures, rate * tried.sum())
    weight /= weight.sum()
    mean = float(weight @ rate)
    found, error = fit_failures(failures, tried, believed)
    assert found == pytest.approx(mean, rel=2e-2)
    assert error == pytest.approx(math.sqrt(float(weight @ (rate - mean) ** 2)), rel=2e-2)


def drives_of_days(
    seed: int, *, days: int, each: int, time_sd: float, energy_sd: float, apart: float = 1.0
) -> dict[str, Any]:
    """Return drives whose times and energies have a factor of the day each, moved by one normal number."""
    rng = np.random.default_rng(seed)
    day = np.repeat(np.arange(days), each)
    u = rng.standard_normal(days)[day]
    length = rng.uniform(2.0, 12.0, len(day))
    mean_s = 300.0 + 150.0 * length
    duration = mean_s * np.exp(time_sd * u + 0.2 * rng.standard_normal(len(day)))
    energy = 70.0 * mean_s * np.exp(apart * energy_sd * u + 0.1 * rng.standard_normal(len(day)))
    return {
        "name": "runs", "source": "drawn", "prior": K9_CALIBRATION, "length_m": length,
        "turn_rad": np.zeros(len(day)), "duration_s": duration, "energy_j": energy, "speed_m_s": 0.06,
        "turn_rate_rad_s": 0.1, "drive_power_w": 70.0, "day": day.tolist(),
    }  # fmt: skip


def test_days_that_differ_have_a_factor_within_its_error() -> None:
    errors = []
    for seed in range(40):
        found = fit_calibration(**drives_of_days(seed, days=20, each=5, time_sd=0.3, energy_sd=0.2))
        assert found.days == 20
        assert found.duration_cv == pytest.approx(0.2, abs=0.06)
        errors.append((found.day_time_sd - 0.3) / found.day_time_se)
        assert found.day_energy_sd == pytest.approx(0.2, abs=0.15)
    assert abs(float(np.mean(errors))) < 0.6
    assert 0.6 < float(np.std(errors)) < 1.6


def test_what_scatters_within_days_is_not_counted_between_them() -> None:
    rng = np.random.default_rng(4)
    day = np.repeat(np.arange(40), 3)
    squares = []
    for _ in range(200):
        ratios = 0.15 * rng.standard_normal(40)[day] + 0.2 * rng.standard_normal(120)
        found = fit_day_factor(ratios, day.tolist())
        assert found.within_sd == pytest.approx(0.2, rel=0.35)
        squares.append(found.between_sd**2)
    assert np.mean(squares) == pytest.approx(0.15**2, rel=0.12)


def test_days_that_are_alike_have_none() -> None:
    adopted = 0
    for seed in range(200):
        given = drives_of_days(seed, days=10, each=4, time_sd=0.0, energy_sd=0.0)
        found = fit_calibration(**given)
        adopted += found.days > 0
        assert found.days or calibration_document(found)["format"] == "calibration/1"
        if not found.days:
            alone = fit_calibration(**{k: v for k, v in given.items() if k != "day"})
            assert found == alone
    assert adopted <= 12  # two tests of 1 % each: 4 are expected, 12 come once in a thousand
    one = fit_calibration(**drives_of_days(1, days=1, each=20, time_sd=0.5, energy_sd=0.5))
    single = fit_calibration(**drives_of_days(1, days=20, each=1, time_sd=0.5, energy_sd=0.5))
    assert one.days == single.days == 0


def test_an_energy_that_does_not_go_with_the_time_is_left_out() -> None:
    found = fit_calibration(**drives_of_days(3, days=20, each=6, time_sd=0.3, energy_sd=0.3, apart=-1.0))
    assert found.day_time_sd > 0.1
    assert (found.day_energy_sd, found.day_energy_se) == (0.0, 0.0)


def test_a_day_factor_is_three_kinds_of_sols_with_its_moments() -> None:
    kinds = kinds_of_days(0.3, 0.1)
    assert [k.name for k in kinds] == ["slow", "usual", "quick"]
    p = np.array([k.p for k in kinds])
    times, energies = (
        np.array([getattr(k, name) for k in kinds]) for name in ("drive_time_factor", "drive_energy_factor")
    )
    assert p.sum() == pytest.approx(1.0)
    assert (p @ times, p @ energies) == (pytest.approx(1.0, abs=1e-5), pytest.approx(1.0, abs=1e-5))
    logs = np.log(times)
    assert p @ (logs - p @ logs) ** 2 == pytest.approx(0.3**2, rel=1e-4)
    assert p @ times**2 == pytest.approx(np.exp(0.3**2), rel=2e-3)
    assert [k.name for k in kinds_of_days(0.0, 0.2)] == ["hungry", "usual", "sparing"]
    assert {k.drive_time_factor for k in kinds_of_days(0.0, 0.2)} == {1.0}
    assert kinds_of_days(0.0, 0.0) == ()
    assert max(k.drive_time_factor for k in kinds_of_days(9.0, 0.0)) < 10.0


def test_a_calibration_with_days_is_read_again() -> None:
    found = fit_calibration(**drives_of_days(5, days=20, each=5, time_sd=0.3, energy_sd=0.2))
    document = calibration_document(found)
    assert document["format"] == "calibration/2"
    assert CALIBRATIONS.from_document(document) == found
    path = Path(__file__).parents[3] / "docs/formats/calibration-2.schema.json"
    pytest.importorskip("jsonschema").validate(document, json.loads(path.read_text(encoding="utf-8")))
    with pytest.raises(ProblemError, match=r"log ratios have shape \(3,\), days 2"):
        fit_day_factor([0.0, 0.1, 0.2], [1, 2])
