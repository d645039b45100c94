"""The survey engine's parts: what is taken of a tour against every subset, annealing, limits and stops."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations, pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner.orienteering import Experiment, RoutingProblem
from planner.orienteering.selection_kernels import part_within, tour_with
from planner.orienteering.survey import SurveyMap, solve_survey
from planner.orienteering.tour_kernels import (
    COUNT,
    KINDS,
    LABEL,
    STEP,
    cheapest,
    put_in,
    route_of,
    shorten,
    take_out,
    tour_of,
    undo,
)
from planner.tally import StoppedError, tallied

Array = npt.NDArray[Any]


def _problem(seed: int, nodes: int, budget: int, spread: float = 60.0) -> RoutingProblem:
    rng = np.random.default_rng(seed)
    at = rng.uniform(0.0, spread, (nodes, 2))
    roads = np.rint(np.hypot(*(at[:, None] - at[None]).transpose(2, 0, 1))).astype(np.int64)
    prizes = tuple(Experiment(k, k, int(rng.integers(1, 30))) for k in range(1, nodes))
    return RoutingProblem(roads, roads * 0, prizes, budget, end_site=0)


def _length(m: SurveyMap, route: Array) -> int:
    return int(m.length[route[:-1], route[1:]].sum())


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32), st.integers(3, 9), st.integers(0, 200), st.integers(0, 60))
def test_the_best_part_of_a_tour_is_that_of_every_subset(
    seed: int, nodes: int, budget: int, least: int
) -> None:
    m = SurveyMap.of(_problem(seed, nodes, budget))
    tour = np.array([0, *np.random.default_rng(seed).permutation(np.arange(1, nodes)), m.nodes - 1])
    work = np.zeros(KINDS, dtype=np.int64)
    part = part_within(m.length, m.prize, tour, budget, budget + 1, least, work)
    best = max(
        int(m.prize[list(chosen)].sum())
        for size in range(nodes)
        for chosen in combinations(tour[1:-1].tolist(), size)
        if _length(m, np.array([0, *chosen, m.nodes - 1])) <= budget
    )
    assert _length(m, part) <= budget
    assert [v for v in tour if v in set(part.tolist())] == part.tolist()
    found = int(m.prize[part].sum())
    assert found == best if least <= best else found <= best


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("least", [0, 10**6])
def test_the_best_part_of_a_longer_tour_is_that_of_every_length(seed: int, least: int) -> None:
    """The most for each length, place by place; where a part worth `least` is asked for, nearly as much."""
    m = SurveyMap.of(_problem(seed, 60, 170))
    tour = np.array([0, *np.random.default_rng(seed).permutation(np.arange(1, 60)), m.nodes - 1])
    most = np.full((len(tour), m.budget + 1), -1)
    most[0, 0] = 0
    for j in range(1, len(tour)):
        for i in range(j):
            step = m.length[tour[i], tour[j]]
            reached = most[i, : max(0, m.budget + 1 - step)]
            gained = np.where(reached >= 0, reached + m.prize[tour[j]], -1)
            most[j, step:] = np.maximum(most[j, step:], gained)
    work = np.zeros(KINDS, dtype=np.int64)
    part = part_within(m.length, m.prize, tour, m.budget, m.budget + 1, least, work)
    assert _length(m, part) <= m.budget
    found, best = int(m.prize[part].sum()), int(most[-1].max())
    assert found == best if not least else 0.8 * best < found <= best
    assert not least or work[LABEL] == 0


def test_a_tour_with_more_nodes_has_them_all_once() -> None:
    m = SurveyMap.of(_problem(3, 40, 500))
    route = m.first_route(m.usable[:5])
    state = np.array([np.uint64(1)])
    tour = tour_with(m.length, m.near, m.apart, m.usable, route, state, np.zeros(KINDS, dtype=np.int64))
    assert sorted(tour.tolist()) == list(range(m.nodes))
    assert (tour[0], tour[-1]) == (0, m.nodes - 1)


def _nodes_of(tour: Array) -> Array:
    route = np.empty(len(tour), dtype=np.int64)
    return route[: route_of(tour, route)].copy()


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32), st.integers(4, 30))
def test_a_step_changes_the_length_as_it_says_and_can_be_undone(seed: int, nodes: int) -> None:
    """Taken out, put in again where it costs least and shortened; the lengths added up anew each time."""
    m = SurveyMap.of(_problem(seed, nodes, 10_000))
    rng = np.random.default_rng(seed)
    begun = np.array([0, *rng.permutation(np.arange(1, nodes)), m.nodes - 1])
    tour, was = tour_of(m.length, begun)
    was[0, STEP], was[0, COUNT] = 1, 0
    work = np.zeros(KINDS, dtype=np.int64)
    v = int(rng.integers(1, nodes))
    length = _length(m, begun) + take_out(tour, was, m.length, v)
    left = _nodes_of(tour)
    assert v not in left
    assert length == _length(m, left)
    after, extra = cheapest(m.length, m.near, m.apart, tour, len(left), v, work)
    detours = m.length[left[:-1], v] + m.length[v, left[1:]] - m.length[left[:-1], left[1:]]
    if len(left) <= 12:  # a longer tour is looked at near the node alone
        assert extra == detours.min()
    assert extra == detours[left[:-1] == after]
    put_in(tour, was, after, v, m.length[after, v], m.length[v, left[1:][left[:-1] == after][0]])
    queue, waits = np.arange(4 * m.nodes + 8), np.zeros(m.nodes, dtype=np.bool_)
    waits[:] = True
    change = shorten(m.length, m.near, m.apart, tour, was, queue, waits, m.nodes, work)
    found = _nodes_of(tour)
    assert length + extra + change == _length(m, found) <= length + extra
    assert sorted(found.tolist()) == list(range(m.nodes))
    undo(tour, was)
    assert _nodes_of(tour).tolist() == begun.tolist()
    fresh, _ = tour_of(m.length, begun)
    assert (tour[1:, :3] == fresh[1:, :3]).all()


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32), st.integers(5, 10))
def test_no_string_has_a_better_place_beside_either_of_its_ends(seed: int, nodes: int) -> None:
    """Strings were moved to where their first node is next to a neighbour, never their last one."""
    m = SurveyMap.of(_problem(seed, nodes, 10_000))
    begun = np.array([0, *np.random.default_rng(seed).permutation(np.arange(1, nodes)), m.nodes - 1])
    tour, was = tour_of(m.length, begun)
    work, d = np.zeros(KINDS, dtype=np.int64), m.length
    change = -1
    while change < 0:
        was[0, STEP], was[0, COUNT] = was[0, STEP] + 1, 0
        queue, waits = np.arange(4 * m.nodes + 8), np.ones(m.nodes, dtype=np.bool_)
        change = shorten(m.length, m.near, m.apart, tour, was, queue, waits, m.nodes, work)
    route = _nodes_of(tour)
    strings = [route[i : i + size] for size in (1, 2, 3) for i in range(1, len(route) - size)]
    for string in strings:
        rest = route[~np.isin(route, string)]
        out = _length(m, route) - _length(m, rest) - _length(m, string)
        for a, other in ((string[0], string[-1]), (string[-1], string[0])):
            for c, e in [*pairwise(rest), *pairwise(rest[::-1])]:
                beside_usable = c not in (0, m.nodes - 1) and d[a, c] < out
                assert not beside_usable or d[a, c] + d[other, e] - d[c, e] >= out


@pytest.mark.parametrize("budget", [0, 20, 150, 400])
def test_a_tour_stays_within_its_budget_while_steps_go_beyond(budget: int) -> None:
    m = SurveyMap.of(_problem(5, 60, budget))
    route = m.first_route(m.usable)
    best, value = m.improve(route, 3000, 1) if len(m.usable) else (route, 0)
    assert _length(m, best) <= budget
    assert value == m.prize[best].sum() >= m.prize[route].sum()
    assert len(set(best.tolist())) == len(best)


def test_everything_is_visited_where_it_fits_and_the_search_ends() -> None:
    problem = _problem(7, 50, 100_000)
    found = solve_survey(problem, time_limit_s=30.0, seed=2)
    assert found.proven
    assert found.value == sum(e.prize for e in problem.experiments)
    assert found.iterations is not None
    assert found.iterations < 20_000


def test_a_child_reaches_what_lies_in_another_cluster() -> None:
    """Two clusters too far apart for single nodes to pay: the far one is worth three times the near one."""
    rng = np.random.default_rng(11)
    at = np.vstack([[0.0, 0.0], rng.uniform(5, 25, (20, 2)), rng.uniform(300, 330, (20, 2))])
    roads = np.rint(np.hypot(*(at[:, None] - at[None]).transpose(2, 0, 1))).astype(np.int64)
    prizes = tuple(Experiment(k, k, 1 if k <= 20 else 3) for k in range(1, 41))
    problem = RoutingProblem(roads, roads * 0, prizes, 1100, end_site=0)
    found = solve_survey(problem, time_limit_s=30.0, iterations=8000, seed=1)
    assert found.value == 80
    near = replace(problem, time_budget=800)
    assert solve_survey(near, time_limit_s=30.0, iterations=8000, seed=1).value == 20


def test_a_stop_is_heard_while_tours_are_made() -> None:
    with tallied() as tally:
        tally.stop = lambda: tally.seconds > 0.3
        with pytest.raises(StoppedError):
            solve_survey(_problem(9, 200, 700, 200.0), time_limit_s=60.0, seed=1)
        assert tally.seconds < 1.0


@pytest.mark.parametrize("limit", [0.1, 0.5])
def test_a_limit_is_spent_and_kept(limit: float) -> None:
    with tallied() as tally:
        solve_survey(_problem(13, 150, 600, 200.0), time_limit_s=limit, seed=1)
    assert 0.9 * limit < tally.seconds < 1.1 * limit
