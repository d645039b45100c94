"""The engines behind one Protocol, and the choice among them."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Protocol

from mission.errors import PluginError
from mission.plugins import Registry
from planner.errors import RoutingError
from planner.orienteering.check import route_value
from planner.orienteering.problem import Experiment, RoutingProblem, RoutingSolution
from planner.tally import uncounted

AUTO = "auto"

ROADS = [[0, 5, 9], [5, 0, 6], [9, 6, 0]]
"""Of the small problems that load the compiled kernels."""
SHORT_PRIZE, LONG_PRIZE = 2, 2**33
"""Prizes with which their tables are of 32 and of 64 bits."""


@dataclass(frozen=True, slots=True)
class Effort:
    """What an engine may spend: seconds of a processor as `planner.tally` reckons them, and a limit in its
    own steps; `threads` only where an engine has use for more than one.
    """

    time_limit_s: float
    iterations: int | None = None
    seed: int = 0
    threads: int = 1


class RoutingEngine(Protocol):
    """Solve a routing problem.

    An implementer promises: the route passes `route_value`, `value` is what it is worth, no route is worth
    more than `upper`, and the answer is the same for the same seed, effort and one thread.
    """

    def __call__(self, problem: RoutingProblem, effort: Effort) -> RoutingSolution: ...


def solve_exact(problem: RoutingProblem, effort: Effort) -> RoutingSolution:
    """Return the answer of the exact engine (one thread)."""
    from planner.orienteering.exact import ExactSolver

    if not ExactSolver.fits(problem):
        raise RoutingError("the exact engine needs moves that take time and at most 512 experiments")
    begin = time.perf_counter()
    solver = ExactSolver(problem)
    solution = solver.solve(time_limit_s=effort.time_limit_s, iterations=effort.iterations, seed=effort.seed)
    return replace(solution, wall_s=time.perf_counter() - begin)


def solve_by_model(problem: RoutingProblem, effort: Effort) -> RoutingSolution:
    """Return the answer of CP-SAT; a greedy route is its hint."""
    from planner.orienteering.cp_sat import solve_cp_sat

    return solve_cp_sat(
        problem,
        time_limit_s=effort.time_limit_s,
        iterations=effort.iterations,
        seed=effort.seed,
        threads=effort.threads,
    )


def solve_by_survey(problem: RoutingProblem, effort: Effort) -> RoutingSolution:
    """Return the answer of the local search (one thread)."""
    from planner.orienteering.survey import solve_survey

    _needs_survey("survey", problem)
    return solve_survey(
        problem, time_limit_s=effort.time_limit_s, iterations=effort.iterations, seed=effort.seed
    )


def solve_by_cuts(problem: RoutingProblem, effort: Effort) -> RoutingSolution:
    """Return the answer of the local search with a bound or proof by branch-and-cut (one thread)."""
    from planner.orienteering.proof import solve_with_proof

    _needs_survey("branch-and-cut", problem)
    return solve_with_proof(
        problem, time_limit_s=effort.time_limit_s, iterations=effort.iterations, seed=effort.seed
    )


def _needs_survey(engine: str, problem: RoutingProblem) -> None:
    from planner.orienteering.survey import is_survey

    if not is_survey(problem):
        raise RoutingError(
            f"the {engine} engine takes symmetric problems with one time budget and no other rule"
        )


ENGINES = Registry(
    "engine",
    "outcrop.engines",
    {
        "exact": "planner.orienteering.engines:solve_exact",
        "cp-sat": "planner.orienteering.engines:solve_by_model",
        "survey": "planner.orienteering.engines:solve_by_survey",
        "branch-and-cut": "planner.orienteering.engines:solve_by_cuts",
    },
)


def engine_named(name: str) -> Callable[[RoutingProblem, Effort], RoutingSolution]:
    """Return the engine of that name.

    Raises
    ------
    RoutingError
        If there is none, or its package cannot be imported; the message names it and what is known.
    """
    try:
        found = ENGINES.load(name)
    except PluginError as err:
        raise RoutingError(f"{err} (or {AUTO}, which chooses)") from err
    if not callable(found):
        raise RoutingError(f'engine "{name}" is {found!r}, which cannot be called')
    return found


def warm_up() -> None:
    """Load the compiled kernels (compiling them when this machine never has); `solve` loads those that it
    needs by itself.

    A process that must answer its first problem quickly calls it at start-up.
    """
    for prize in (SHORT_PRIZE, LONG_PRIZE):
        warm_up_exact(prize)
    warm_up_survey()


@lru_cache(maxsize=2)
def warm_up_exact(prize: int) -> None:
    """Load the kernels of the exact engine, for tables of 32 or of 64 bits as a prize (an integer) asks."""
    import numpy as np

    from planner.orienteering.exact import ExactSolver

    roads = np.array(ROADS, dtype=np.int64)
    tiny = RoutingProblem(roads, roads, (Experiment("a", 1, prize), Experiment("b", 2, 1)), 20, 20)
    with uncounted():
        ExactSolver(tiny).solve()


@lru_cache(maxsize=1)
def warm_up_survey() -> None:
    """Load the kernels of the survey engine and of branch-and-cut."""
    import numpy as np

    from planner.orienteering.proof import solve_with_proof

    roads = np.array(ROADS, dtype=np.int64)
    plain = RoutingProblem(roads, roads * 0, (Experiment("a", 1, 2),), 20, end_site=2)
    with uncounted():
        solve_with_proof(plain, time_limit_s=60.0, iterations=2)


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
        Seconds of a processor, reckoned from the steps that are done: the answer does not depend on what
        else the machine does.
    iterations
        A limit in the engine's own steps (labels, search steps, thousandths of deterministic time).
    engine
        A name in `ENGINES` (`exact`, `cp-sat`, `survey`, `branch-and-cut`, or an installed package's), or
        `auto`: surveys go to branch-and-cut, all else to the exact engine, or to CP-SAT.

    Raises
    ------
    RoutingError
        If the engine is unknown or cannot take the problem.
    """
    effort = Effort(time_limit_s, iterations, seed, threads)
    if engine != AUTO:
        chosen = engine_named(engine)
        if engine == "exact":
            warm_up_exact(SHORT_PRIZE)
        elif engine in ("survey", "branch-and-cut"):
            warm_up_survey()
        return chosen(problem, effort)
    from planner.orienteering.exact import ExactSolver
    from planner.orienteering.survey import is_survey

    if not problem.experiments:
        return _nothing_to_do(problem, seed)
    if is_survey(problem):
        warm_up_survey()
        return solve_by_cuts(problem, effort)
    if not ExactSolver.fits(problem):
        return solve_by_model(problem, effort)
    warm_up_exact(SHORT_PRIZE)
    return solve_exact(problem, effort)


def _nothing_to_do(problem: RoutingProblem, seed: int) -> RoutingSolution:
    try:
        value = route_value(problem, ())
    except RoutingError:
        return RoutingSolution(None, None, True, (), "none", seed)
    return RoutingSolution(value, value, True, (), "none", seed)
