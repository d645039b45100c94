"""Cutting planes against all tours of small maps; proofs against brute force and known optima."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations, permutations
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner.errors import RoutingError
from planner.orienteering import Experiment, RoutingProblem, read_routing_file, route_value, solve
from planner.orienteering.branch_and_cut import BranchAndCut, _Branch
from planner.orienteering.cut_kernels import cut_tree, sets_below
from planner.orienteering.cut_relaxation import Box, Relaxation, Tours
from planner.orienteering.cuts import FractionalTour, Separator, leaving_row
from planner.orienteering.proof import solve_with_proof, tours_of
from planner.tally import tallied
from tests.planner.orienteering.brute_force import optimum
from tests.shared import shared

Array = npt.NDArray[Any]


@st.composite
def surveys(draw: st.DrawFn, most: int = 7) -> RoutingProblem:
    """Points on a small map, some of them in clusters; the end is the start or a site of its own."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    n = draw(st.integers(3, most))
    at = rng.uniform(0.0, 60.0, (n, 2))
    if draw(st.booleans()):
        at[n // 2 :] = at[n // 2] + rng.uniform(0.0, 4.0, (n - n // 2, 2))
    roads = np.rint(np.hypot(*(at[:, None] - at[None]).transpose(2, 0, 1))).astype(np.int64)
    joined = draw(st.booleans())
    inner = range(1, n - 1 if joined else n)
    prizes = rng.integers(0, 12, n)
    experiments = tuple(Experiment(k, k, int(prizes[k])) for k in inner)
    budget = int(roads[0, n - 1]) * joined + draw(st.integers(0, 160))
    return RoutingProblem(
        roads, roads * 0, experiments, budget, end_site=n - 1 if joined else 0, base_prize=3
    )


def _every_tour(tours: Tours) -> list[tuple[int, ...]]:
    """Return all tours of three nodes and more within the budget, node 0 left out."""
    found = []
    inner = range(1, tours.nodes)
    for size in range(2, tours.nodes):
        for chosen in combinations(inner, size):
            for order in permutations(chosen):
                if order[0] > order[-1] or (tours.joined and tours.nodes - 1 not in (order[0], order[-1])):
                    continue
                ring = np.array([0, *order, 0])
                if tours.length[ring[:-1], ring[1:]].sum() <= tours.budget:
                    found.append(order)
    return found


def _point(tours: Tours, order: tuple[int, ...]) -> FractionalTour:
    ring = np.array([0, *order, 0])
    ends = np.sort(np.stack([ring[:-1], ring[1:]]), axis=0)
    visits = np.zeros(tours.nodes)
    visits[ring] = 1.0
    return FractionalTour(ends[0], ends[1], np.ones(len(ends[0])), visits)


@settings(max_examples=60, deadline=None)
@given(surveys(), st.integers(0, 2**32))
def test_no_row_cuts_off_a_tour(problem: RoutingProblem, seed: int) -> None:
    tours = tours_of(problem)
    rng = np.random.default_rng(seed)
    separator = Separator(tours.length, tours.home, tours.prize, tours.budget)
    known = _every_tour(tours)
    tail, head = np.triu_indices(tours.nodes, 1)
    for _ in range(4):  # points that nobody would call a tour, and mixtures of tours
        x = rng.choice([0.0, 0.25, 0.5, 0.75, 1.0], len(tail))
        y = rng.choice([0.25, 0.5, 1.0], tours.nodes)
        y[0] = 1.0
        worth = int(rng.integers(0, tours.prize.sum() + 1))
        rows = separator.rows(FractionalTour.of(tail, head, x, y), worth, thorough=True)
        for order in known:
            if tours.prize[list(order)].sum() > worth:
                point = _point(tours, order)
                assert all(point.lacks(row) <= 0.0 for row in rows)


@settings(max_examples=80, deadline=None)
@given(surveys())
def test_a_proof_is_what_brute_force_finds(problem: RoutingProblem) -> None:
    best = optimum(problem)
    found = solve_with_proof(problem, time_limit_s=60.0, iterations=200)
    if best is None:
        assert found.value is None
        return
    assert found.upper is not None
    assert found.proven
    assert found.value == found.upper == best == route_value(problem, found.route)


@settings(max_examples=40, deadline=None)
@given(surveys(8))
def test_the_tree_finds_the_best_tour_by_itself(problem: RoutingProblem) -> None:
    tours = tours_of(problem)
    every = [int(tours.prize[list(order)].sum()) for order in _every_tour(tours)]
    with tallied():
        proof = BranchAndCut(tours, (-1, ()), lambda visits: (-1, ())).run(60.0)
    assert proof.value == proof.upper == max([-1, *every])


def test_the_same_search_takes_the_same_steps() -> None:
    rng = np.random.default_rng(5)
    middles = rng.uniform(0.0, 300.0, (6, 2))
    at = np.vstack([middles[k % 6] + rng.uniform(0.0, 30.0, 2) for k in range(42)])
    roads = np.rint(np.hypot(*(at[:, None] - at[None]).transpose(2, 0, 1))).astype(np.int64)
    tours = Tours(np.array([0, *rng.integers(1, 30, 41).tolist()]), roads, roads[0], 800, joined=False)
    steps = []
    for _ in range(2):
        with tallied() as tally:
            proof = BranchAndCut(tours, (-1, ()), lambda visits: (-1, ())).run(3.0)
        steps.append((proof.value, proof.upper, proof.nodes, tally.seconds))
    assert steps[0] == steps[1]
    assert steps[0][2] > 9  # of the tree: its rows hold in some boxes only


def test_a_side_on_which_a_visit_must_and_may_not_be_is_empty() -> None:
    flags = [np.zeros(3, np.int8), np.ones(3, np.int8), np.zeros(4, np.int8), np.ones(4, np.int8)]
    box = Box(*flags)
    box.y_low[2] = 1
    side = np.array([False, True, True, False])
    none, some = _Branch(side=side, row=leaving_row(side)).parts(box)
    assert none.empty
    assert not some.empty
    assert not box.empty


@pytest.mark.parametrize("seed", range(4))
def test_any_multipliers_give_a_bound(seed: int) -> None:
    rng = np.random.default_rng(seed)
    at = rng.uniform(0.0, 60.0, (8, 2))
    roads = np.rint(np.hypot(*(at[:, None] - at[None]).transpose(2, 0, 1))).astype(np.int64)
    prize = np.array([0, *rng.integers(1, 20, 7).tolist()])
    tours = Tours(prize, roads, roads[0], 150, joined=False)
    tail, head = np.triu_indices(8, 1)
    best = max(int(prize[list(order)].sum()) for order in _every_tour(tours))
    box = Box(np.zeros(28, np.int8), np.ones(28, np.int8), np.zeros(8, np.int8), np.ones(8, np.int8))
    box.y_low[0] = 1
    separator = Separator(tours.length, tours.home, tours.prize, tours.budget)
    few = Relaxation(tours, tail, head, np.arange(0, 28, 3))  # most edges are no columns
    for _ in range(6):
        point = few.solve(box)
        assert few.bound(box).prize >= best
        few.add_rows(separator.rows(point, best - 1, thorough=True))


def test_least_cuts_are_those_of_every_subset() -> None:
    rng = np.random.default_rng(5)
    tail, head = np.triu_indices(7, 1)
    weight = rng.choice([0.0, 0.1, 0.5, 1.0], len(tail))

    def crossing(side: Array) -> float:
        return float(weight[side[tail] != side[head]].sum())

    subsets = [np.array([0, *bits], dtype=bool) for bits in np.ndindex(*(2,) * 6) if any(bits)]
    sides, _ = cut_tree(7, tail, head, weight)
    assert min(map(crossing, sides)) == pytest.approx(min(map(crossing, subsets)))
    visit = np.full(7, 1.5)
    sets, witness, _ = sets_below(7, tail, head, weight, visit, np.arange(1, 7), 1e-6, 50)
    for v in range(1, 7):
        least = min(crossing(s) for s in subsets if s[v])
        assert (least < 3.0 - 1e-6) == any(s[v] for s in sets)
    for side, v in zip(sets, witness.tolist(), strict=True):
        assert side[v]
        assert not side[0]
        assert crossing(side) == pytest.approx(min(crossing(s) for s in subsets if s[v]))


def test_a_short_limit_gives_a_bound_that_holds() -> None:
    file = read_routing_file(shared("benchmarks/orienteering/oplib/st70-gen2-50.oplib"))
    found = solve(file.problem, time_limit_s=0.6, seed=1)
    assert found.value is not None
    assert found.upper is not None
    assert found.value <= 2286 <= found.upper <= 1.1 * 2286


def test_a_worse_start_ends_at_the_known_optimum() -> None:
    file = read_routing_file(shared("benchmarks/orienteering/oplib/berlin52-gen3-50.oplib"))
    tours = tours_of(file.problem)
    with tallied():
        proof = BranchAndCut(tours, (1030, ()), lambda visits: (0, ())).run(60.0)
    assert proof.value == proof.upper == 1036


def test_what_is_no_survey_is_refused() -> None:
    roads = np.array([[0, 4], [5, 0]], dtype=np.int64)
    problem = RoutingProblem(roads, roads * 0, (Experiment("a", 1, 3),), 20, end_site=0)
    with pytest.raises(RoutingError, match="branch-and-cut engine takes symmetric"):
        solve(problem, engine="branch-and-cut")
    assert solve(replace(problem, travel_time=np.maximum(roads, roads.T)), engine="branch-and-cut").value == 3
