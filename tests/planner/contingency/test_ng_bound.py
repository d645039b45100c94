"""The bound that remembers by place: never below the best policy, whatever multipliers and memory are."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from planner.contingency.by_place.bound import ng_bound
from planner.contingency.by_place.layout import Memory, Wanted
from planner.contingency.by_place.masses_above import masses_above
from planner.contingency.by_place.relaxation import NgRelaxation
from planner.contingency.policy import Moves, Policy
from planner.contingency.priced_relaxation import Weights
from planner.evaluate.grid import Grid, Rounding
from planner.evaluate.model import Model
from planner.problem import Problem, problem_from_dict
from planner.tally import tallied
from tests.planner.examples import observation, problem_document
from tests.planner.reference.optimum import optimum
from tests.planner.reference.problems import FAMILIES, generated

SLACK = 1e-4
"""Relative to all that is summed: single precision, without the margin that `ng_bound` adds."""


def _any_memory(model: Model, rng: np.random.Generator) -> Memory:
    """Return a memory of each place drawn at random, in any order; its own observations are in it."""
    place = Wanted.of(model).place
    memory: Memory = []
    for p in range(model.n + 1):
        some = set(rng.permutation(len(place))[: rng.integers(len(place) + 1)].tolist())
        every = sorted(some | set(np.nonzero(place == p)[0].tolist()))
        memory.append(tuple(rng.permutation(every).tolist()))
    return memory


def _any_relaxation(model: Model, rng: np.random.Generator) -> float:
    """Return the bound of a relaxation with memory, count, prices, resource and grid drawn at random."""
    weights = Weights.of(model, float(rng.choice([0.0, 0.3, 1.0])))
    steps, most = int(rng.choice([16, 32, 64])), int(rng.integers(5))
    relaxation = NgRelaxation(model, weights, steps, _any_memory(model, rng), most)
    worth = relaxation.wanted.worth
    return relaxation.bound(rng.choice([0.0, 1.0]) * worth * rng.uniform(0.0, 1.2, len(worth)))


@pytest.mark.parametrize("family", FAMILIES)
def test_no_policy_earns_more_where_all_is_certain(family: str) -> None:
    rng = np.random.default_rng(70 + FAMILIES.index(family))
    for seed in range(20):
        problem = generated(family, 3000 + seed)
        best, model = optimum(problem), Model.of(problem)
        for _ in range(2):
            assert _any_relaxation(model, rng) >= best - SLACK * (best + model.penalty), (family, seed)
        if seed < 3:
            with tallied():
                assert ng_bound(model, limit_s=1.0) >= best - 1e-6, (family, seed)


@pytest.mark.parametrize("family", FAMILIES)
def test_no_policy_earns_more_where_amounts_vary(family: str) -> None:
    rng = np.random.default_rng(90 + FAMILIES.index(family))
    for seed in range(3):
        problem = generated(family, 4000 + seed, spread=0.4)
        model = Model.of(problem)
        earned = Policy(Grid(model, 33, 21, Rounding.UP), moves=Moves.ALL).best()
        for _ in range(6):
            assert _any_relaxation(model, rng) >= earned - SLACK * (earned + model.penalty), (family, seed)


def _timed(family: str, seed: int) -> Problem:
    """Return a problem in which time alone is short."""
    problem = generated(family, seed, spread=0.3)
    budget = dataclasses.replace(problem.budget, energy_j=1e9)
    return dataclasses.replace(problem, hotel_w=0.0, budget=budget)


@pytest.mark.parametrize("family", ["plain", "hub", "tracking", "penalty", "through"])
def test_with_everything_remembered_it_is_the_optimal_value(family: str) -> None:
    """On coarse grids too it is never below the value, and on finer ones hardly above it."""
    for seed in range(3):
        model = Model.of(_timed(family, 5000 + seed))
        value = Policy(Grid(model, 161, 2), moves=Moves.ALL).best()
        every = tuple(range(len(Wanted.of(model).number)))
        memory = [every] * (model.n + 1)
        for steps, above in ((16, math.inf), (24, math.inf), (48, 0.08), (192, 0.01)):
            relaxation = NgRelaxation(model, Weights.of(model, 1.0), steps, memory, len(every))
            bound = relaxation.bound(np.zeros(len(every)))
            assert value - 2e-4 * (value + model.penalty) <= bound <= (1.0 + above) * value + 0.01


def test_an_expectation_lies_below_the_chords_between_its_nodes() -> None:
    """For one concave kink, and for the end of the day, at every fine cell between two nodes."""
    rng = np.random.default_rng(5)
    each, steps, knot = 8, 6, 4
    cells = np.zeros(each * steps + 1)
    cells[each : 5 * each // 2] = rng.uniform(0.0, 1.0, 3 * each // 2) ** 6  # takes 1 to 2.5 nodes
    cells /= cells.sum()
    masses, fine = masses_above([cells], steps + 1, drives=False), np.arange(each * steps + 1)
    kink = np.minimum(0.0, knot - np.arange(steps + 1.0))
    bulge = np.append(masses.bulge[0], 0.0)  # what lies before the action ends adds nothing
    node = [
        masses.hat[0, : steps + 1 - k] @ kink[k:] + max(bulge[knot - k], bulge[knot - k - 1])
        for k in range(4)
    ]
    for t in range(3 * each):
        true = float(cells @ np.minimum(0.0, knot - (t + fine) / each))
        assert np.interp(t / each, range(4), node) >= true - 1e-6, t
    for left in fine:
        within = np.interp(left / each, range(steps + 1), masses.within[0])
        assert within >= cells[: left + 1].sum() - 1e-6, left


def test_only_what_is_tracked_is_owed_for() -> None:
    """Where two tracks do not fit into the day, no day owes the multipliers of two."""
    rows = [[observation(f"O{k}", "place", utility=5.0)] for k in range(2)]
    document = problem_document(places=[(9.0, 0.0)] * 2, observations=rows, time_s=9000.0)
    problem = dataclasses.replace(problem_from_dict(document), track_start_time_s=5000.0)
    model = Model.of(problem)
    relaxation = NgRelaxation(model, Weights.of(model, 1.0), 64, [(), (0,), (1,)], 2)
    owed = relaxation.wanted.worth * relaxation.wanted.chance
    assert relaxation.bound(relaxation.wanted.worth) == pytest.approx(owed.max(), rel=1e-3)


def _day() -> Problem:
    rows = [[observation(f"O{k}", "image", utility=4.0 + k)] for k in range(6)]
    places = [(4.0 * k - 10.0, 6.0 * (-1) ** k) for k in range(6)]
    return problem_from_dict(
        problem_document(places=places, observations=rows, spread=0.3, time_s=9000.0, energy_j=1e8)
    )


def test_it_comes_near_the_best_policy_and_is_the_same_again() -> None:
    model = Model.of(_day())
    earned = Policy(Grid(model, 97, 3), moves=Moves.ALL).best()
    found = []
    for _ in range(2):
        with tallied():
            found.append(ng_bound(model, limit_s=4.0))
    assert 0.999 * earned <= found[0] <= 1.03 * earned
    assert found[0] == found[1]


def test_what_takes_too_much_is_not_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    model = Model.of(_day())
    monkeypatch.setattr("planner.contingency.by_place.bound.LARGEST_MB", 0.01)
    with tallied():
        assert ng_bound(model, limit_s=4.0) == math.inf
