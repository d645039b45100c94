"""Two engines that others wrote, as unified-planning starts them."""

from __future__ import annotations

import warnings
from typing import Any

with warnings.catch_warnings():  # that it runs without its compiled core
    warnings.simplefilter("ignore", UserWarning)
    from tamerlite.engine import TamerLite

ENGINES = ("tamerlite", "aries")
SECONDS = 40.0


class Tamer(TamerLite):
    """TamerLite without its step that fills in numbers without a value: unified-planning 1.3.0 has no such
    compiler, and our problems have no such numbers.
    """

    def _compile_problem(self, problem: Any) -> Any:
        factory = problem.environment.factory
        with factory.Compiler(compilation_kind="GROUNDING", problem_kind=problem.kind) as compiler:
            found = compiler.compile(problem)
        return problem, found.problem, found.map_back_action_instance


def solved(problem: Any, engine: str, seconds: float = SECONDS) -> Any:
    """Return an engine's result.

    Aries does not list sums of numeric fluents among what it takes, and takes them; it is not asked first.
    """
    env = problem.environment
    env.credits_stream = None
    if "tamerlite" not in env.factory.engines:
        env.factory.add_engine("tamerlite", "tests.neighbours.planning.engines", "Tamer")
    with env.factory.OneshotPlanner(name=engine) as planner:
        planner.skip_checks = engine == "aries"
        return planner.solve(problem, timeout=seconds)
