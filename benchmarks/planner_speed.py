"""Processor seconds to the first plan, to the final one, of a re-plan, and of a what-if.

Each problem is planned in a fresh process (imports counted) and once more in the same, warm one. Processor
seconds are what a quiet core would need; the wall beside them depends on what else the machine does. The
re-plan is from the plan at hand after the time budget fell by 7 %; the what-if asks what the same change is
worth to the plan as it is kept, and to one planned anew.
"""

from __future__ import annotations

import json
import math
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.common.clock import spent
from benchmarks.common.figure import Figure, command
from benchmarks.common.instances import reference

if TYPE_CHECKING:
    from planner.plan_tree import Plan
    from planner.problem import Problem

LARGE = 12
"""From so many targets on, the problem is of two observations a target, made here."""
NAMES = {
    "fresh_first_s": "first plan, fresh process",
    "warm_first_s": "first plan, warm",
    "fresh_final_s": "final plan, fresh process",
    "warm_final_s": "final plan, warm",
    "replan_s": "re-plan",
    "kept_s": "what-if, the plan kept",
    "anew_s": "what-if, planned anew",
}
MOST_S = {
    (8, "fresh_first_s"): 1.0,
    (8, "warm_final_s"): 10.0,
    (30, "fresh_first_s"): 3.0,
    (10, "kept_s"): 0.15,
    (30, "kept_s"): 0.4,
    (10, "anew_s"): 0.7,
    (30, "anew_s"): 0.7,
}
QUICK = {"targets": (4,), "time_limit": 5.0}
BUDGET_S = 900.0
CHILD = "import sys; from benchmarks.planner_speed import child; child(sys.argv[1], float(sys.argv[2]))"


def document(targets: int, seed: int) -> dict[str, Any]:
    """Return a problem of so many targets: of the `reserve` family, or a large one with two requests each."""
    generate = reference("instance").generate
    found: dict[str, Any] = generate(f"reserve-{targets}", "reserve", min(targets, LARGE), seed)
    return found if targets <= LARGE else _large(found, targets, seed)


def _large(sample: dict[str, Any], targets: int, seed: int) -> dict[str, Any]:
    """Return a problem with one image and one placement a target, of the same rover as the sample."""
    import numpy

    rng = numpy.random.default_rng(seed)
    spots = [(0.0, 0.0)] + [(float(rng.uniform(2, 28)), float(rng.uniform(-14, 14))) for _ in range(targets)]
    names = ["start", *(f"T{k + 1}" for k in range(targets))]

    def observation(name: str, kind: str, seconds: float) -> dict[str, Any]:
        return {
            "id": name,
            "kind": kind,
            "utility": round(float(rng.uniform(2, 10)), 1),
            "p_success": 0.9,
            "observe": {
                "time_s": {"mean": seconds, "sd": 0.2 * seconds},
                "energy_j": {"mean": 40.0 * seconds, "sd": 8.0 * seconds},
            },
        }

    legs = []
    for a, origin in enumerate(names):
        for b, to in enumerate(names[1:], start=1):
            if a == b:
                continue
            metres = math.dist(spots[a], spots[b])
            seconds = 200.0 + 130.0 * metres
            legs.append(
                {
                    "from": origin,
                    "to": to,
                    "time_s": {"mean": seconds, "sd": 0.4 * seconds},
                    "energy_j": {"mean": 9000.0 * metres + 4000.0, "sd": 2000.0 * metres + 800.0},
                    "p_lose": {name: round(min(0.5, 0.01 * metres), 4) for name in names[1:]},
                }
            )
    return {
        "format": "problem/1",
        "name": f"large-{targets}",
        "budget": {"time_s": 14_400.0, "energy_j": 1_800_000.0},
        "hotel_w": sample["hotel_w"],
        "overrun_penalty": 20.0,
        "track_start": sample["track_start"],
        "track_overhead_s_per_leg": sample["track_overhead_s_per_leg"],
        "targets": [
            {
                "id": name,
                "observations": [
                    observation(f"{name}-image", "image", 180.0),
                    observation(f"{name}-place", "place", 504.0),
                ],
            }
            for name in names[1:]
        ],
        "legs": legs,
    }


def child(file: str, limit_s: float) -> None:
    """Plan twice, and again after a change; print seconds, value, bound and branches as JSON."""
    from planner.plan_edits import fitted
    from planner.problem import load_problem
    from planner.solve import Progress, solve
    from planner.what_if import candidates, what_if

    problem = load_problem(Path(file))
    row: dict[str, float] = {}
    result = None
    for which in ("fresh", "warm"):
        first: list[float] = []
        began = time.process_time() if which == "warm" else 0.0

        def told(progress: Progress, began: float = began, first: list[float] = first) -> None:
            if progress.plan and not first:
                first.append(time.process_time() - began)

        result = solve(problem, time_limit_s=limit_s, report=told)
        row |= {
            f"{which}_first_s": first[0],
            f"{which}_final_s": time.process_time() - began,
            "wall_s": result.wall_s,
            "value": result.expected_utility,
            "upper": result.upper,
            "branches": result.branches,
        }
    assert result is not None
    plan = result.tree.plan
    changed = replace(problem, budget=replace(problem.budget, time_s=0.93 * problem.budget.time_s))
    warm = (fitted(changed, plan),)
    row["replan_s"] = _second(partial(solve, changed, time_limit_s=limit_s, warm=warm, quick=True))
    row["kept_s"] = _second(partial(_kept, problem, changed, plan))
    known = candidates(problem, plan)
    row["anew_s"] = _second(partial(what_if, problem, plan, changed, known=known, max_branches=6, seed=1))
    print(json.dumps(row))


def _kept(problem: Problem, changed: Problem, plan: Plan) -> None:
    """Value the plan today and, as far as it fits, in the changed day, in the futures of a what-if."""
    from planner.evaluate.model import Model
    from planner.evaluate.monte_carlo import simulate
    from planner.plan_edits import fitted
    from planner.what_if import FUTURES

    simulate(Model.of(problem), plan, FUTURES, seed=1)
    simulate(Model.of(changed), fitted(changed, plan), FUTURES, seed=1)


def _second(work: Callable[[], object]) -> float:
    """Return the processor seconds of the second time, when all is compiled."""
    work()
    return spent(work)


def figures(
    targets: tuple[int, ...] = (4, 6, 8, 10, 30), seed: int = 5, time_limit: float = 300.0
) -> Iterator[Figure]:
    """Yield the seconds of each step, and value, bound and branches, for each number of targets."""
    with tempfile.TemporaryDirectory() as folder:
        for count in targets:
            file = Path(folder) / f"{count}.json"
            file.write_text(json.dumps(document(count, seed)), encoding="utf-8")
            order = [sys.executable, "-c", CHILD, str(file), str(time_limit)]
            out = subprocess.run(order, check=True, stdout=subprocess.PIPE, text=True).stdout
            row: dict[str, float] = json.loads(out.splitlines()[-1])
            for key, name in NAMES.items():
                yield Figure(f"{count} targets: {name}", row[key], "s", MOST_S.get((count, key)))
            yield Figure(f"{count} targets: final plan, wall", row["wall_s"], "s")
            for key in ("value", "upper", "branches"):
                yield Figure(f"{count} targets: {key}", row[key])


if __name__ == "__main__":
    command(figures, QUICK, BUDGET_S)
