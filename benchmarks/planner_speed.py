"""Processor seconds to the first plan, to the final one, and of a re-plan from an earlier solution.

Each problem is planned in a fresh process (imports counted) and once more in the same, warm one. Processor
seconds are what a quiet core would need; the wall beside them depends on what else the machine does.

    .venv/bin/python -m benchmarks.planner_speed [--targets 8 10 30] [--time-limit 60]
"""

from __future__ import annotations

import argparse
import importlib
import json
import math
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).resolve().parents[1].parent / "shared" / "contingency"
LARGE = 12
"""From so many targets on, the problem is of two observations a target, made here."""


def document(targets: int, seed: int) -> dict[str, Any]:
    """Return a problem of so many targets: of the `reserve` family, or a large one with two requests each."""
    sys.path.insert(0, str(FOLDER))
    generate = importlib.import_module("instance").generate
    found: dict[str, Any] = generate(f"reserve-{targets}", "reserve", min(targets, LARGE), seed)
    return found if targets <= LARGE else _large(found, targets, seed)


def _large(sample: dict[str, Any], targets: int, seed: int) -> dict[str, Any]:
    """Return a problem with one image and one placement a target, of the same rover as the sample."""
    numpy = importlib.import_module("numpy")
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


def child(file: Path, limit_s: float) -> None:
    """Plan twice and plan again after a change; print the figures as JSON."""
    from planner.plan_edits import fitted
    from planner.problem import load_problem
    from planner.solve import Progress, solve

    problem = load_problem(file)
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
    budget = replace(problem.budget, time_s=0.93 * problem.budget.time_s)
    for _ in range(2):
        began = time.process_time()
        changed = replace(problem, budget=budget)
        warm = (fitted(changed, result.tree.plan),)
        again = solve(changed, time_limit_s=limit_s, warm=warm, quick=True)
        row |= {"replan_s": time.process_time() - began, "replan_value": again.expected_utility}
    print(json.dumps(row))


def main() -> None:
    """Print one row per problem, in Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--targets", type=int, nargs="*", default=[4, 6, 8, 10, 30])
    parser.add_argument("--seed", type=int, default=5)
    parser.add_argument("--time-limit", type=float, default=300.0)
    parser.add_argument("--child", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.child:
        child(arguments.child, arguments.time_limit)
        return
    print(
        "| targets | first, fresh | first, warm | final, warm | re-plan | wall | value | bound | branches |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for targets in arguments.targets:
            file = Path(folder) / f"{targets}.json"
            file.write_text(json.dumps(document(targets, arguments.seed)), encoding="utf-8")
            command = [
                sys.executable,
                "-m",
                "benchmarks.planner_speed",
                "--child",
                str(file),
                "--time-limit",
                str(arguments.time_limit),
            ]
            out = subprocess.run(command, check=True, capture_output=True, text=True).stdout
            r = json.loads(out.splitlines()[-1])
            print(
                f"| {targets} | {r['fresh_first_s']:.2f} | {r['warm_first_s']:.2f} | "
                f"{r['warm_final_s']:.1f} | "
                f"{r['replan_s']:.2f} | {r['wall_s']:.1f} | {r['value']:.2f} | {r['upper']:.2f} | "
                f"{r['branches']:.0f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
