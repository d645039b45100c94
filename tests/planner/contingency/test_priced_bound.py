"""The bound by prices and a small memory: never below the best policy, whatever prices and memory are."""

from __future__ import annotations

import dataclasses
import math
import tracemalloc

import numpy as np
import pytest

from planner.contingency.policy import Moves, Policy
from planner.contingency.priced_bound import priced_bound
from planner.contingency.priced_relaxation import Relaxation, Weights, reckoned_mb
from planner.evaluate.grid import Grid, Rounding
from planner.evaluate.model import Model
from planner.problem import Problem, problem_from_dict
from planner.tally import tallied
from tests.planner.examples import observation, problem_document
from tests.planner.reference.optimum import optimum
from tests.planner.reference.problems import FAMILIES, generated

SLACK = 1e-4
"""Relative to all that is summed: single precision, without the margin that `priced_bound` adds."""


def _any_relaxation(model: Model, rng: np.random.Generator) -> float:
    """Return the bound of a relaxation with a memory, count, prices, resource and grid drawn at random."""
    alone = [
        m
        for m in range(model.m)
        if not model.is_place[m] or int(model.place_bits[model.obs_place[m]]).bit_count() == 1
    ]
    memory = tuple(int(m) for m in rng.permutation(alone)[: rng.integers(len(alone) + 1)])
    memory = tuple(m for m in memory if model.utility[m] > 0.0)
    share = float(rng.choice([0.0, 0.3, 1.0]))
    most = int(rng.integers(3))
    relaxation = Relaxation(model, Weights.of(model, share), int(rng.choice([24, 64])), memory, most)
    prices = np.where(relaxation.priced, relaxation.worth * rng.uniform(0.0, 1.2, len(relaxation.wanted)), 0)
    return relaxation.bound(prices)


@pytest.mark.parametrize("family", FAMILIES)
def test_no_policy_earns_more_where_all_is_certain(family: str) -> None:
    rng = np.random.default_rng(FAMILIES.index(family))
    for seed in range(45):
        problem = generated(family, 1000 + seed)
        best, model = optimum(problem), Model.of(problem)
        assert _any_relaxation(model, rng) >= best - SLACK * (best + model.penalty), (family, seed)
        if seed < 12:
            with tallied():
                assert priced_bound(model, limit_s=0.3) >= best - 1e-6, (family, seed)


@pytest.mark.parametrize("family", FAMILIES)
def test_no_policy_earns_more_where_amounts_vary(family: str) -> None:
    rng = np.random.default_rng(50 + FAMILIES.index(family))
    for seed in range(4):
        problem = generated(family, 2000 + seed, spread=0.4)
        model = Model.of(problem)
        earned = Policy(Grid(model, 33, 21, Rounding.UP), moves=Moves.ALL).best()
        for _ in range(8):
            assert _any_relaxation(model, rng) >= earned - SLACK * (earned + model.penalty), (family, seed)


def test_tracks_may_be_given_up_on_the_way() -> None:
    """A track that every drive pays for may be dropped, so remembering it cannot lower the bound."""
    problem = generated("tracking", 5)
    dear = dataclasses.replace(problem, track_overhead_s_per_leg=600.0)
    model, best = Model.of(dear), optimum(dear)
    every = tuple(range(model.m))
    relaxation = Relaxation(model, Weights.of(model, 1.0), 128, every)
    assert relaxation.bound(np.zeros(len(relaxation.wanted))) >= best - SLACK * (best + 1.0)


def _day() -> Problem:
    rows = [[observation(f"O{k}", "image", utility=4.0 + k)] for k in range(6)]
    places = [(4.0 * k - 10.0, 6.0 * (-1) ** k) for k in range(6)]
    return problem_from_dict(
        problem_document(places=places, observations=rows, spread=0.3, time_s=9000.0, energy_j=1e8)
    )


def test_it_comes_near_the_best_policy() -> None:
    """Remembering what is dear leaves a few per cent between the bound and what a policy earns."""
    model = Model.of(_day())
    earned = Policy(Grid(model, 97, 3), moves=Moves.ALL).best()  # energy is plenty
    everything = float((model.utility * model.p_success).sum())
    with tallied():
        bound = priced_bound(model, limit_s=2.0)
    assert earned < 0.9 * everything  # the day holds some of it only
    assert 0.999 * earned <= bound <= 1.05 * earned


def test_counted_tracks_are_paid_for_on_every_drive() -> None:
    """Without their targets counted tracks cost what they cost remembered, where all targets are alike."""
    rows = [[observation(f"O{k}", "place", utility=5.0)] for k in range(3)]
    document = problem_document(places=[(9.0, 0.0)] * 3, observations=rows, spread=0.3, time_s=9000.0)
    problem = dataclasses.replace(problem_from_dict(document), track_overhead_s_per_leg=500.0)
    model = Model.of(problem)
    prices = np.zeros(3)

    def bound(memory: tuple[int, ...], most: int) -> float:
        return Relaxation(model, Weights.of(model, 1.0), 128, memory, most).bound(prices)

    remembered = bound((0, 1, 2), 0)
    assert remembered * (1.0 - SLACK) <= bound((), 3) <= bound((), 0)
    assert bound((0, 1), 1) == pytest.approx(remembered, rel=SLACK)


@pytest.mark.parametrize("nodes", [128, 1024])
def test_a_relaxation_takes_no_more_memory_than_was_reckoned(nodes: int) -> None:
    """Of 61 targets and more the lists of masses took gigabytes that no limit knew of."""
    rows = [[observation(f"O{k}", "image", utility=4.0)] for k in range(16)]
    places = [(4.0 * (k % 4) - 8.0, 6.0 * (k // 4) - 9.0) for k in range(16)]
    document = problem_document(places=places, observations=rows, spread=0.3, time_s=9000.0)
    model = Model.of(problem_from_dict(document))
    once = Relaxation(model, Weights.of(model, 1.0), 64, (0, 1))  # compiled code is loaded once
    once.bound(np.zeros(len(once.wanted)))
    once.made()
    tracemalloc.start()
    relaxation = Relaxation(model, Weights.of(model, 1.0), nodes, (0, 1))
    relaxation.bound(np.zeros(len(relaxation.wanted)))
    relaxation.made()
    most_mb = tracemalloc.get_traced_memory()[1] / 1e6
    tracemalloc.stop()
    assert most_mb <= 1.1 * reckoned_mb(model, nodes, (0, 1)) + 1.0


def test_what_takes_too_much_memory_is_not_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    model = Model.of(_day())
    monkeypatch.setattr("planner.contingency.priced_bound.LARGEST_MB", 0.01)
    with tallied():
        assert priced_bound(model, limit_s=2.0) == math.inf


def test_the_same_limit_gives_the_same_bound() -> None:
    model = Model.of(_day())
    found = []
    for _ in range(2):
        with tallied():
            found.append(priced_bound(model, limit_s=0.4))
    assert found[0] == found[1]
