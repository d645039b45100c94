"""The bound from expected drives: never below the optimal policy, exact where nothing is uncertain."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings

from planner.contingency.flow_bound import flow_bound, least_energy, least_time
from planner.contingency.policy import Policy
from planner.evaluate.grid import Grid, Rounding
from planner.evaluate.model import Model, best_survival, log_normal
from planner.problem import Amount, Problem, load_problem, problem_from_dict
from tests.planner.examples import example, observation, problem_document, problems
from tests.shared import shared


@settings(max_examples=15, deadline=None)
@given(problems())
def test_no_policy_earns_more(problem: Problem) -> None:
    model = Model.of(problem)
    earned = Policy(Grid(model, 33, 21, Rounding.UP)).best()
    assert flow_bound(model, limit_s=10.0) >= earned * (1.0 - 1e-9)


@pytest.mark.parametrize("name", ["dev-reserve-5", "dev-tracking-5", "dev-windows-4", "dev-mixed-5"])
def test_the_optimum_of_reference_problems_is_below(name: str) -> None:
    model = Model.of(load_problem(shared(f"contingency/instances/{name}.json")))
    optimum = Policy(Grid(model, 49, 29, Rounding.MID)).best()
    assert optimum <= flow_bound(model, limit_s=10.0) <= float((model.utility * model.p_success).sum()) + 1e-6


@pytest.mark.parametrize("sigma", [0.05, 0.4, 1.0, 1.8])
def test_a_success_costs_at_least_what_is_said(sigma: float) -> None:
    mean = 100.0
    mu = math.log(mean) - sigma**2 / 2
    cost = least_time(mean, mu, sigma)
    draws = np.random.default_rng(1).lognormal(mu, sigma, 400_000)
    ratios = [
        np.minimum(draws, r).mean() / max((draws <= r).mean(), 1e-9) for r in np.geomspace(0.5, 5e4, 90)
    ]
    assert cost <= min(ratios) * 1.01
    assert cost == pytest.approx(min(ratios), rel=0.02)


@pytest.mark.parametrize(
    ("time_sd", "energy_sd"), [(30.0, 2000.0), (90.0, 9000.0), (0.0, 3000.0), (60.0, 0.0)]
)
def test_so_does_the_energy_of_an_action(time_sd: float, energy_sd: float) -> None:
    seconds, joules, hotel_w = Amount(100.0, time_sd), Amount(6000.0, energy_sd), 40.0
    ln = np.array([*log_normal(seconds), *log_normal(joules)])
    row = np.array([100.0, time_sd, 6000.0, energy_sd])
    rng = np.random.default_rng(2)
    draws = hotel_w * rng.lognormal(ln[0], ln[1], 300_000) + rng.lognormal(ln[2], ln[3], 300_000)
    cost = least_energy(row, ln, hotel_w, 64, 129)
    ratios = [
        np.minimum(draws, r).mean() / max((draws <= r).mean(), 1e-9) for r in np.geomspace(500, 5e5, 80)
    ]
    assert 0.97 * min(ratios) <= cost <= 1.005 * min(ratios)
    assert least_energy(row, ln, hotel_w, 8, 33) <= cost * (1.0 + 1e-9)


def test_without_uncertainty_it_is_that_of_the_best_tour_with_room_for_all() -> None:
    rows = [[observation(f"O{k}", "image", utility=3.0 + k)] for k in range(4)]
    places = [(2.0, 0.0), (4.0, 0.0), (6.0, 0.0), (8.0, 0.0)]
    document = problem_document(places=places, observations=rows, spread=1e-6, time_s=1e5, energy_j=1e8)
    model = Model.of(problem_from_dict(document))
    assert flow_bound(model, limit_s=5.0) == pytest.approx(3 + 4 + 5 + 6, rel=1e-5)


def test_far_targets_are_not_reached_in_circles() -> None:
    """Two targets near each other and far away are worth nothing when the way there takes the whole day."""
    rows = [[observation("A", "image")], [observation("B", "image")]]
    document = problem_document(places=[(40.0, 0.0), (41.0, 0.0)], observations=rows, spread=0.01)
    model = Model.of(problem_from_dict({**document, "budget": {"time_s": 4000.0, "energy_j": 1e7}}))
    assert flow_bound(model, limit_s=5.0) < 0.6 * 10.0


def test_a_track_survives_the_best_way_at_most() -> None:
    model = Model.of(example(loss=0.2))
    assert best_survival(model)[[1, 3]] == pytest.approx(0.8)  # an image has no track to lose
    legs = list(itertools.product(range(model.n + 1), range(1, model.n + 1)))
    for a, b in legs:
        if a:
            model.loss[0, b, 1], model.loss[a, b, 1] = 0.5, 0.1
    assert best_survival(model)[1] == pytest.approx(0.5)
