"""Surveys with a proof: the local search's route, closed or bounded by branch-and-cut."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from planner.orienteering.branch_and_cut import BranchAndCut
from planner.orienteering.check import checked
from planner.orienteering.cut_relaxation import Tours
from planner.orienteering.problem import RoutingProblem, RoutingSolution
from planner.orienteering.survey import SurveyMap, solve_survey
from planner.tally import tallied

ENGINE = "branch-and-cut"

Array = npt.NDArray[Any]

_SURVEY = 0.35  # share of the limit that the local search has first, where a proof is tried. By hand
_SEARCHED_S = 3e-4  # reckoned seconds for each pair of nodes after which the local search may stop. By hand
_ROOT_S = 8e-5  # processor seconds of the root for each pair of nodes, measured on kroA150
_WORTH = 0.5  # share of the root that the rest of the limit must pay for, or all goes to the local search
_POLISH = 400  # steps of the local search from a route of the relaxation


def solve_with_proof(
    problem: RoutingProblem,
    *,
    time_limit_s: float = 10.0,
    iterations: int | None = None,
    seed: int = 0,
) -> RoutingSolution:
    """Return the best route found with a bound; the same for the same seed and limits on every machine.

    Parameters
    ----------
    time_limit_s
        Seconds of a processor as `planner.tally` reckons them.
    iterations
        Limit in steps of the local search.
    """
    begin = time.perf_counter()
    with tallied() as tally:
        until = tally.seconds + time_limit_s
        rest = (1.0 - _SURVEY) * time_limit_s
        small = rest >= _WORTH * _ROOT_S * (len(problem.experiments) + 1) ** 2
        nodes = len(problem.experiments) + 1
        first = min(_SURVEY * time_limit_s, max(1.0, _SEARCHED_S * nodes**2)) if small else time_limit_s
        found = solve_survey(problem, time_limit_s=first, iterations=iterations, seed=seed)
        if small and found.value is not None and not found.proven:
            found = _proven(problem, found, until, seed)
    return checked(problem, replace(found, wall_s=time.perf_counter() - begin))


def _proven(p: RoutingProblem, found: RoutingSolution, until: float, seed: int) -> RoutingSolution:
    m = SurveyMap.of(p)
    tours = tours_of(p)
    rng = np.random.default_rng(np.random.SeedSequence([seed, 11]))

    def polish(visits: Array) -> tuple[int, tuple[int, ...]]:
        full = np.zeros(m.nodes)
        full[: tours.nodes] = visits
        order = m.usable[np.argsort(-full[m.usable], kind="stable")]
        route = m.first_route(order[full[order] > 0.0])
        best, value = m.improve(route, _POLISH, int(rng.integers(1, 2**62)))
        return value, tuple(best[1:-1].tolist())

    tour = tuple(i + 1 for i in found.route)
    known = int(m.prize[list(tour)].sum()), tour
    for v in m.usable.tolist():  # there and back is no tour of three nodes, which the tree looks at
        known = max(known, (int(m.prize[v]), (v,)), key=lambda k: k[0])
    proof = BranchAndCut(tours, known, polish).run(until)
    route = tuple(v - 1 for v in proof.tour if v <= len(p.experiments))
    return replace(
        found,
        value=proof.value + p.base_prize,
        upper=proof.upper + p.base_prize,
        proven=proof.closed,
        route=route,
        engine=ENGINE,
    )


def tours_of(p: RoutingProblem) -> Tours:
    """Return a survey's tours: start, experiments, and the end if it is another site."""
    m = SurveyMap.of(p)
    joined = p.start_site != p.end_site
    n = m.nodes if joined else m.nodes - 1
    length = m.length[:n, :n].copy()
    ends = [0, n - 1] if joined else [0]
    if joined:
        length[0, n - 1] = length[n - 1, 0] = 0
    home = _home(length, ends)
    budget = m.budget
    return Tours(m.prize[:n], length, home, budget, joined)


def _home(length: Array, ends: list[int]) -> Array:
    """Return the least length (n,) from each node to one of the ends by way of any others (Dijkstra 1959).

    SciPy's takes a road of no length for none.
    """
    home = np.full(len(length), np.iinfo(np.int64).max // 4, dtype=np.int64)
    home[ends] = 0
    left = np.ones(len(length), dtype=np.bool_)
    for _ in range(len(length)):
        v = int(np.argmin(np.where(left, home, np.iinfo(np.int64).max)))
        left[v] = False
        home = np.minimum(home, home[v] + length[v])
    return home
