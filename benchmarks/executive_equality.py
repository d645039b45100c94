"""Compare what the executive running the emitted CRL earns with what the planner's evaluator says.

Each future is a table of draws that the evaluator and the abstract rover both meet. A future is equal if both
earn the same and take the same options. `--problems` names files; default five of the public instances.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.common.draws import draw_table, earned
from benchmarks.common.figure import Figure, command
from benchmarks.common.instances import INSTANCES
from executive.crl import canonical_text
from executive.runtime import run_plan
from executive.runtime.loading import load_plan
from planner.emit_crl import emit
from planner.plan_tree import Branch, PlanTree, walk, with_ids
from planner.problem import load_problem, problem_to_dict
from planner.solve import solve
from rover_iface.simulator.abstract_rover import make_rover
from rover_iface.simulator.world import load_world

NAMES = ("dev-reserve-5", "dev-windows-6", "dev-mixed-7", "dev-tracking-5", "dev-reserve-8")
PROBLEMS = tuple(str(INSTANCES / f"{name}.json") for name in NAMES)
QUICK = {"problems": PROBLEMS[:1], "futures": 20}
BUDGET_S = 600.0


@dataclass(frozen=True, slots=True)
class Difference:
    """One future in which the two do not agree."""

    future: int
    evaluator: tuple[float, tuple[str, ...]]
    executive: tuple[float, tuple[str, ...]]


def compare(problem_document: Mapping[str, Any], tree: PlanTree, futures: int, seed: int) -> list[Difference]:
    """Return the futures in which utility or options taken differ."""
    problem = load_problem(problem_document)
    tree = PlanTree(tree.instance, with_ids(tree.plan), tree.method)
    table = draw_table(problem, futures, seed)
    expected = earned(problem, tree.plan, table)
    entries = {}
    for path, step in walk(tree.plan):
        if isinstance(step, Branch):
            for k, option in enumerate(step.options):
                entries[option.id] = expected.program.option_entry[(*path, k)]
    plan = load_plan(canonical_text(emit(problem, tree)))
    world = load_world(problem_to_dict(problem))
    found = []
    for k in range(futures):
        outcome = run_plan(plan, make_rover(world, draws=table.future(k)), run_id=f"run-{k}")
        chosen = {r.arguments[1] for r in outcome.trace if r.event == "choose"}
        taken = tuple(sorted(name for name in entries if name in chosen))
        wanted = tuple(sorted(name for name, row in entries.items() if expected.visited[k, row]))
        if abs(outcome.utility - float(expected.utility[k])) > 1e-6 or taken != wanted:
            found.append(Difference(k, (float(expected.utility[k]), wanted), (float(outcome.utility), taken)))
    return found


def figures(
    problems: tuple[str, ...] = PROBLEMS,
    futures: int = 2000,
    branches: int = 6,
    seed: int = 7,
) -> Iterator[Figure]:
    """Yield the share of equal futures of each problem, and how many days were flown a second."""
    for path in map(Path, problems):
        document = json.loads(path.read_text(encoding="utf-8"))
        result = solve(load_problem(document), max_branches=branches, iterations=2000)
        began = time.process_time()
        differences = compare(document, result.tree, futures, seed)
        rate = futures / (time.process_time() - began)
        for difference in differences[:10]:
            print(f"future {difference.future}: {difference.evaluator} against {difference.executive}")
        share = 100.0 * (1.0 - len(differences) / futures)
        what = f"{path.stem}, {result.branches} branches, {futures:,} futures"
        yield Figure(f"{what}: equal", share, "%", 100.0, least=True)
        yield Figure(f"{what}: flown", rate, "days/s")


if __name__ == "__main__":
    command(figures, QUICK, BUDGET_S)
