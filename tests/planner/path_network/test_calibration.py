"""Fitting finds the rates that made the data; the file form survives a round trip."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planner.errors import ProblemError
from planner.path_network import (
    CALIBRATIONS,
    K9_CALIBRATION,
    calibration_document,
    fit_calibration,
    fit_loss,
    fit_mean,
)


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
    assert json.loads(path.read_text())["format"] == "calibration/2"


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
    fitted = fit_calibration(**given, failures=int(short.sum()), tried_m=float(driven.sum()))
    assert abs(fitted.fail_per_m - 0.03) < 3 * fitted.fail_se_per_m < 0.006
    document = calibration_document(fitted)
    assert document["format"] == "calibration/2"
    assert CALIBRATIONS.from_document(document) == fitted
    path = Path(__file__).parents[3] / "docs/formats/calibration-2.schema.json"
    pytest.importorskip("jsonschema").validate(document, json.loads(path.read_text(encoding="utf-8")))
    none = fit_calibration(**given, failures=0, tried_m=100.0)
    assert (none.fail_per_m, none.fail_se_per_m) == (0.0, 0.01)
    assert calibration_document(none)["format"] == "calibration/1"
