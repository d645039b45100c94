"""The engines behind one Protocol, and the choice among them."""

from __future__ import annotations

import time
from dataclasses import replace
from functools import lru_cache
from typing import Protocol

from planner.errors import RoutingError
from planner.orienteering.check import route_value
from planner.orienteering.problem import Experiment, RoutingProblem, RoutingSolution

AUTO = "auto"


class RoutingEngine(Protocol):
    """Solve a routing problem.

    An implementer promises: the route passes `route_value`, `value` is what it is worth, no route is worth
    more than `upper`, and the answer is the same for the same seed when `iterations` is what stops it.
    """

    def __call__(
        self, problem: RoutingProblem, *, time_limit_s: float, iterations: int | None, seed: int, threads: int
    ) -> RoutingSolution: ...


def solve_exact(
    problem: RoutingProblem, *, time_limit_s: float, iterations: int | None, seed: int, threads: int
) -> RoutingSolution:
    """Return the answer of the exact engine (one thread)."""
    from planner.orienteering.exact import ExactSolver

    if not ExactSolver.fits(problem):
        raise RoutingError("the exact engine needs moves that take time and at most 512 experiments")
    begin = time.perf_counter()
    solver = ExactSolver(problem)
    solution = solver.solve(time_limit_s=time_limit_s, iterations=iterations, seed=seed)
    return replace(solution, wall_s=time.perf_counter() - begin)


def solve_by_model(
    problem: RoutingProblem, *, time_limit_s: float, iterations: int | None, seed: int, threads: int
) -> RoutingSolution:
    """Return the answer of CP-SAT; a greedy route is its hint."""
    from planner.orienteering.cp_sat import solve_cp_sat

    return solve_cp_sat(problem, time_limit_s=time_limit_s, iterations=iterations, seed=seed, threads=threads)


def solve_by_survey(
    problem: RoutingProblem, *, time_limit_s: float, iterations: int | None, seed: int, threads: int
) -> RoutingSolution:
    """Return the answer of the local search (one thread)."""
    from planner.orienteering.survey import is_survey, solve_survey

    if not is_survey(problem):
        raise RoutingError(
            "the survey engine takes symmetric problems with one time budget and no other rule"
        )
    return solve_survey(problem, time_limit_s=time_limit_s, iterations=iterations, seed=seed)


ENGINES: dict[str, RoutingEngine] = {
    "exact": solve_exact,
    "cp-sat": solve_by_model,
    "survey": solve_by_survey,
}


@lru_cache(maxsize=1)
def warm_up() -> None:
    """Load the compiled kernels (compiling them when this machine never has); `solve` calls it by itself.

    A process that must answer its first problem quickly calls it at start-up.
    """
    import numpy as np

    from planner.orienteering.exact import ExactSolver
    from planner.orienteering.survey import solve_survey

    roads = np.array([[0, 5, 9], [5, 0, 6], [9, 6, 0]], dtype=np.int64)
    for prize in (2, 2**33):  # 32-bit and 64-bit tables
        tiny = RoutingProblem(roads, roads, (Experiment("a", 1, prize), Experiment("b", 2, 1)), 20, 20)
        ExactSolver(tiny).solve()
    plain = RoutingProblem(roads, roads * 0, (Experiment("a", 1, 2),), 20, end_site=2)
    solve_survey(plain, time_limit_s=60.0, iterations=2)


def solve(
    problem: RoutingProblem,
    *,
    time_limit_s: float = 10.0,
    iterations: int | None = None,
    seed: int = 0,
    threads: int = 1,
    engine: str = AUTO,
) -> RoutingSolution:
    """Return the best route found within the limits, with a bound where there is one.

    Parameters
    ----------
    time_limit_s
        Wall seconds, looked at between steps.
    iterations
        A limit in the engine's own steps (labels, search steps, thousandths of deterministic time); with
        it and a generous `time_limit_s` the answer does not depend on the machine.
    engine
        `exact`, `cp-sat`, `survey`, or `auto`: surveys go to the local search (and, when small, on to the
        exact engine for a bound), all else to the exact engine, and to CP-SAT what that cannot take.

    Raises
    ------
    RoutingError
        If the engine is unknown or cannot take the problem.
    """
    if engine != AUTO:
        if engine not in ENGINES:
            raise RoutingError(f"engine is {engine!r}; {', '.join(ENGINES)} and {AUTO} are known")
        if engine != "cp-sat":
            warm_up()
        return ENGINES[engine](
            problem, time_limit_s=time_limit_s, iterations=iterations, seed=seed, threads=threads
        )
    from planner.orienteering.exact import ExactSolver
    from planner.orienteering.survey import is_survey

    if not problem.experiments:
        return _nothing_to_do(problem, seed)
    warm_up()
    begin = time.perf_counter()
    if is_survey(problem):
        return _survey_then_bound(problem, time_limit_s, iterations, seed, begin)
    if ExactSolver.fits(problem):
        return solve_exact(
            problem, time_limit_s=time_limit_s, iterations=iterations, seed=seed, threads=threads
        )
    return solve_by_model(
        problem, time_limit_s=time_limit_s, iterations=iterations, seed=seed, threads=threads
    )


def _nothing_to_do(problem: RoutingProblem, seed: int) -> RoutingSolution:
    try:
        value = route_value(problem, ())
    except RoutingError:
        return RoutingSolution(None, None, True, (), "none", seed)
    return RoutingSolution(value, value, True, (), "none", seed)


def _survey_then_bound(
    problem: RoutingProblem, time_limit_s: float, iterations: int | None, seed: int, begin: float
) -> RoutingSolution:
    """Return the local search's route with the bound of the exact engine's table where that is affordable."""
    from planner.orienteering.exact import ExactSolver
    from planner.orienteering.survey import solve_survey

    count = len(problem.experiments)
    affordable = count <= 200 and time_limit_s >= 0.5 and ExactSolver.fits(problem)
    share = 0.5 if affordable and count <= 70 else 0.7 if affordable else 1.0
    found = solve_survey(problem, time_limit_s=share * time_limit_s, iterations=iterations, seed=seed)
    if affordable and found.value is not None and not found.proven:
        left = time_limit_s - (time.perf_counter() - begin)
        solver = ExactSolver(problem)
        solver.prepare(0.6 * left)
        left = time_limit_s - (time.perf_counter() - begin)
        closed = solver.solve(time_limit_s=left, iterations=iterations, hint=found.route, seed=seed)
        if closed.value is not None and closed.value >= found.value:
            found = replace(closed, engine="survey+exact" if closed.route == found.route else closed.engine)
    return replace(found, wall_s=time.perf_counter() - begin)
