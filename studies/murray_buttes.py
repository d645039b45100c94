"""What the branches of the demo day on Curiosity terrain are worth, and whether the executive earns as much.

The plan is compared with the same planner's plan without branches on fresh futures (the same for both), each
option's share of them is counted, and the executive flies the emitted CRL on the abstract rover in the same
tables of draws.

    .venv/bin/python -m studies.murray_buttes TERRAIN_FOLDER [--futures 2000] [--time-limit 60]
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import numpy as np

from benchmarks.executive_equality import compare
from ground.day.prepare import prepare_day
from ground.demo.mission import demo_mission
from planner.evaluate.model import Model
from planner.evaluate.monte_carlo import simulate
from planner.problem import problem_to_dict
from planner.solve import solve
from rover_iface.profile import load_profile
from rover_iface.terrain import load_terrain

FRESH_SEED = 20_041_204
FRESH_FUTURES = 200_000


def main() -> None:
    """Print the comparison."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("terrain", type=Path)
    parser.add_argument("--futures", type=int, default=2000)
    parser.add_argument("--branches", type=int, default=6)
    parser.add_argument("--time-limit", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    terrain, profile = load_terrain(arguments.terrain), load_profile("k9")
    day = demo_mission(terrain, profile, seed=arguments.seed)
    problem = prepare_day(terrain, profile, day).problem
    document = problem_to_dict(problem)
    common = {"time_limit_s": arguments.time_limit, "seed": arguments.seed, "least_taken": 0.02}
    branched = solve(problem, max_branches=arguments.branches, **common)
    plain = solve(problem, max_branches=0, **common)

    model = Model.of(problem)
    with_branches = simulate(model, branched.tree.plan, FRESH_FUTURES, seed=FRESH_SEED).utility
    without = simulate(model, plain.tree.plan, FRESH_FUTURES, seed=FRESH_SEED).utility
    won = with_branches - without
    error = float(np.std(won)) / math.sqrt(len(won))
    print(
        f"plan with {branched.branches} branches: {np.mean(with_branches):.3f} "
        f"(upper bound {branched.upper:.3f})"
    )
    print(f"plan without branches: {np.mean(without):.3f}")
    print(f"won by branches: {np.mean(won):.3f} +- {error:.4f} = {np.mean(won) / error:.1f} standard errors")
    for path, notes in sorted(branched.tree.option_notes.items()):
        print(
            f"  option {'.'.join(map(str, path))}: taken in {100 * notes.p_taken:.1f} %, "
            f"wins {notes.gain:.3f}"
        )
    differences = compare(document, branched.tree, arguments.futures, FRESH_SEED)
    share = 100.0 * (1.0 - len(differences) / arguments.futures)
    print(f"executive against evaluator: {share:.2f} % of {arguments.futures} futures equal")
    for difference in differences[:20]:
        print(f"  future {difference.future}: {difference.evaluator} against {difference.executive}")


if __name__ == "__main__":
    main()
