"""What a dry run costs as the service's job does it: processor time and bytes, beside the bare loop.

    .venv/bin/python -m benchmarks.dry_run [--runs 9] [--seed 1]

A plan of ten targets, flown by the abstract rover. The bare loop is executive and rover with nothing written;
both alternate in one process, with a yardstick loop beside them. The job is `fly` with journal, live lines
and products, trace and telemetry into the store, packed. Limits: 0.06 s of processor time, 200 kB a run.
Bytes are also those of the same files unpacked, and of the same run with a pose each 5 s, as each dry run
was written before, three times over. Exit status 1 over a limit.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import brotli

from benchmarks.executive_speed import yardstick
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

LIMIT_S, LIMIT_BYTES = 0.06, 200_000
TARGETS = 10
WATCHED = 1e9
"""A pace at which nothing waits, and poses are reported each 5 s."""


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


def main() -> None:
    """Measure, print, and hold the limits."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=9)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="outcrop-benchmark-") as work:
        folder = Path(work)
        order = order_for(folder)
        plan, world = load_plan(order.crl_text), load_world({"format": "world/1", "problem": order.problem})
        fly(order, folder, arguments.seed - 1)
        loops, jobs, marks, sizes, unpacked, poses = [], [], [], [], [], []
        for seed in range(arguments.seed, arguments.seed + arguments.runs):
            marks.append(yardstick())
            loops.append(bare(plan, world, seed))
            spent, run, files = fly(order, folder, seed)
            jobs.append(spent)
            sizes.append(bytes_in(run, files))
            unpacked.append(bytes_in(run, files, packed=False))
        watched_s, run, files = fly(order, folder, arguments.seed, WATCHED)
        poses = [bytes_in(run, files), bytes_in(run, files, packed=False)]
        found = {
            "runs": arguments.runs,
            "seed": arguments.seed,
            "brotli": brotli.__version__,
            "yardstick_s": round(statistics.median(marks), 4),
            "bare_cpu_s": round(statistics.median(loops), 4),
            "job_cpu_s": round(statistics.median(jobs), 4),
            "job_cpu_best_s": round(min(jobs), 4),
            "ratio": round(statistics.median(jobs) / statistics.median(loops), 1),
            "bytes": round(statistics.median(sizes)),
            "bytes_unpacked": round(statistics.median(unpacked)),
            "watched": {"cpu_s": round(watched_s, 3), "bytes": poses[0], "bytes_unpacked": poses[1]},
        }
    print(json.dumps(found, indent=1))
    if found["job_cpu_s"] > LIMIT_S or found["bytes"] > LIMIT_BYTES:
        raise SystemExit(f"over a limit: {LIMIT_S} s of processor time, {LIMIT_BYTES:,} bytes")


if __name__ == "__main__":
    main()
