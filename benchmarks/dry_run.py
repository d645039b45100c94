"""What a dry run costs as the service's job does it: processor time and bytes, beside the bare loop.

A plan of ten targets, flown by the abstract rover. The bare loop is executive and rover with nothing written;
both alternate in one process. The job is `fly` with journal, live lines and products, trace and telemetry
into the store, packed. Bytes are also those of the same files unpacked, and of the same run with a pose each
5 s, as each dry run was written before, three times over.
"""

from __future__ import annotations

import math
import statistics
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from benchmarks.common.figure import Figure, command
from executive.crl import canonical_text
from executive.runtime.loading import load_plan
from executive.runtime.run import run_plan
from ground.gdr.packed import SUFFIX, unpack
from ground.resources.runs import work as run_work
from ground.resources.runs.order import RunWork
from planner.emit_crl import emit
from planner.plan_tree import PlanTree, with_ids
from planner.problem import load_problem
from rover_iface.registry import find_rover
from rover_iface.simulator.world import load_world
from rover_iface.terrain import generate_terrain, write_terrain
from tests.planner.examples import problem_document, visits

MOST_S, MOST_KB = 0.06, 200.0
TARGETS = 10
WATCHED = 1e9
"""A pace at which nothing waits, and poses are reported each 5 s."""
QUICK = {"runs": 5}
BUDGET_S = 120.0


def bytes_in(*folders: Path, packed: bool = True) -> int:
    """Return the bytes of all files in folders; without `packed` those of what the packed ones hold."""
    files = [p for folder in folders for p in folder.rglob("*") if p.is_file()]
    whole = (
        len(unpack(p.read_bytes())) if p.suffix == SUFFIX and not packed else p.stat().st_size for p in files
    )
    return sum(whole)


def order_for(folder: Path) -> RunWork:
    """Return the order of a dry run of ten targets on a spiral; its terrain is written into the folder."""
    places = [
        (6 * math.cos(0.7 * k) * (1 + 0.25 * k), 6 * math.sin(0.7 * k) * (1 + 0.25 * k))
        for k in range(TARGETS)
    ]
    document = problem_document(places=places, time_s=30_000.0, energy_j=3_000_000.0, loss=0.02)
    problem = load_problem(document)
    steps = visits(problem, *(f"O{k + 1}" for k in range(TARGETS)))
    crl = canonical_text(emit(problem, PlanTree(problem.name, with_ids(steps))))
    write_terrain(generate_terrain(1, size_m=32.0), folder / "terrain")
    return RunWork(
        "run",
        run_dir="",
        files_dir="",
        terrain_dir=str(folder / "terrain"),
        crl_text=crl,
        problem=document,
        rover="abstract",
        rover_profile="k9",
        seed=1,
    )


def fly(order: RunWork, folder: Path, seed: int, pace: float = 0.0) -> tuple[float, Path, Path]:
    """Return the processor time of a job, its folder and its store."""
    name = f"{'watched-' if pace else ''}{seed}"
    run, files = folder / "runs" / name, folder / "files" / name
    given = replace(order, run_dir=str(run), files_dir=str(files), seed=seed, pace=pace)
    began = time.process_time()
    run_work.work(given, lambda _share, _what: None, lambda: False)
    return time.process_time() - began, run, files


def bare(plan: Any, world: Any, seed: int) -> float:
    """Return the processor time of executive and rover alone."""
    began = time.process_time()
    run_plan(plan, find_rover("abstract")(world, seed=seed))
    return time.process_time() - began


def figures(runs: int = 9, seed: int = 1) -> Iterator[Figure]:
    """Yield the medians of the runs of seeds from `seed` on."""
    with tempfile.TemporaryDirectory(prefix="outcrop-benchmark-") as work:
        folder = Path(work)
        order = order_for(folder)
        plan, world = load_plan(order.crl_text), load_world({"format": "world/1", "problem": order.problem})
        fly(order, folder, seed - 1)
        loops, jobs, sizes, unpacked = [], [], [], []
        for number in range(seed, seed + runs):
            loops.append(bare(plan, world, number))
            spent, *places = fly(order, folder, number)
            jobs.append(spent)
            sizes.append(bytes_in(*places))
            unpacked.append(bytes_in(*places, packed=False))
        loop_s, job_s = statistics.median(loops), statistics.median(jobs)
        yield Figure("job: processor time", job_s, "s", MOST_S)
        yield Figure("job beside the bare loop", job_s, "s", ratio=job_s / loop_s, to="executive and rover")
        yield Figure("folder and store", statistics.median(sizes) / 1000, "kB", MOST_KB)
        yield Figure("the same unpacked", statistics.median(unpacked) / 1000, "kB")
        spent, *places = fly(order, folder, seed, WATCHED)
        yield Figure("with a pose each 5 s: processor time", spent, "s")
        yield Figure("with a pose each 5 s: folder and store", bytes_in(*places) / 1000, "kB")
        yield Figure("the same unpacked, a pose each 5 s", bytes_in(*places, packed=False) / 1000, "kB")


if __name__ == "__main__":
    command(figures, QUICK, BUDGET_S)
