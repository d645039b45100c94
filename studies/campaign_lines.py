"""Campaigns of a demo's ten-target plan: cost, memory, disk, and the same bytes however they are flown.

    .venv/bin/python -m studies.campaign_lines [--runs 10000] [--many 100000] [--seed S]

A demo day is made with a seed drawn here, and its plan flown by `outcrop campaign run`: by one worker, by a
pool of two, on a Dask scheduler with two workers on loopback, and killed with SIGKILL half-way and resumed.
Every hundredth row is compared with the run by itself, of a pilot that has flown nothing else. Then many more
runs by one worker: processor time of a run, and memory when the first 10,000 are done and at the last unit.
"""

from __future__ import annotations

import argparse
import os
import resource
import secrets
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from ground.campaigns.folder import CampaignFolder
from ground.campaigns.inputs import read_case
from ground.campaigns.pilot import Pilot
from studies.common.bare_loop import BareLoop, beside, made_day
from studies.common.processes import free_port, resident_mib, size_of, until

ROOT = Path(__file__).parents[1]
OUTCROP = [sys.executable, "-m", "ground.cli"]
DRAFT = ".draft"
"""Of a file that is being written: it takes its place whole."""
EARLY_RUNS = 10_000
"""After so many runs memory is noted; the last is compared with it."""


class Day:
    """A demo's plan and world, and where campaigns of it are put."""

    def __init__(self, folder: Path, seed: int) -> None:
        self.folder, self.seed = folder, seed
        self.environment = {**os.environ, "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"}
        self.day = made_day(folder, seed)

    def start(self, name: str, runs: int, *more: str, **environment: str) -> subprocess.Popen[bytes]:
        given = ["--runs", str(runs), "--seed", str(self.seed), "--out", name, *more]
        order = [*OUTCROP, "campaign", "run", "day/plan.crl", "--world", "day/problem.json", *given]
        env = {**self.environment, **environment}
        return subprocess.Popen(order, cwd=self.folder, env=env, stdout=subprocess.DEVNULL)

    def fly(self, name: str, runs: int, *more: str, **environment: str) -> float:
        """Fly a campaign and return its processor seconds, those of its processes too."""
        before = _children_s()
        if self.start(name, runs, *more, **environment).wait():
            raise SystemExit(f"the campaign {name} failed")
        return _children_s() - before

    def told(self, name: str) -> list[bytes]:
        """Return what a campaign says, of all its series."""
        at = self.folder / name
        return [p.read_bytes() for p in sorted(at.rglob("*")) if p.name in ("campaign.json", "runs.csv")]

    def units(self, name: str) -> Mapping[str, int]:
        """Return the units of the main series that are there, with the time of their last change."""
        found = (self.folder / name / "units").glob("*")
        return {p.name: p.stat().st_mtime_ns for p in found if p.suffix != DRAFT}


def _children_s() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


@contextmanager
def dask(folder: Path) -> Iterator[str]:
    """Run a scheduler and two workers on loopback; yield the address."""
    port = free_port()
    address = f"tcp://127.0.0.1:{port}"
    hand = ["worker", address, "--nthreads", "1", "--no-nanny", "--local-directory", str(folder)]
    orders = [["scheduler", "--host", "127.0.0.1", "--port", str(port)], hand, hand]
    env = {**os.environ, "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"}
    with (folder / "dask.log").open("ab") as log:
        made = [
            subprocess.Popen(
                [sys.executable, "-m", "dask", *order, "--no-dashboard"], stdout=log, stderr=log, env=env
            )
            for order in orders
        ]
    try:
        yield address
    finally:
        for process in reversed(made):
            process.terminate()
            process.wait(30)


def rows_alone(day: Day, name: str, runs: int) -> None:
    """Compare every hundredth row with the run by itself."""
    case = read_case(day.day / "plan.crl", day.day / "problem.json", "abstract")
    rows = list(CampaignFolder(day.folder / name).rows(runs=runs))
    every = rows[::100]
    same = sum(Pilot(case).row(row.seed).line() == row.line() for row in every)
    print(f"rows equal to the run by itself: {same} of {len(every)}", flush=True)


def killed(day: Day, runs: int, whole: list[bytes]) -> None:
    """Kill a campaign of two workers half-way, resume it, and see what was flown again."""
    process = day.start("killed", runs, "--workers", "2")
    half = runs // 200
    until(lambda: len(day.units("killed")) >= half, "half of the units")
    process.send_signal(signal.SIGKILL)
    process.wait()
    time.sleep(1.0)
    there = day.units("killed")
    day.fly("killed", runs, "--workers", "2", "--resume")
    after = day.units("killed")
    again = sum(after[unit] != at for unit, at in there.items())
    print(
        f"killed with {len(there)} units done, resumed: same bytes {day.told('killed') == whole}, "
        f"{again} units flown twice of those done",
        flush=True,
    )


def many(day: Day, runs: int) -> None:
    """Fly many runs by one worker; note memory early and at the last unit."""
    before = _children_s()
    process = day.start("many", runs, "--help-runs", "0")
    early_mib = last_mib = 0.0
    units = 0
    while process.poll() is None:
        now = len(day.units("many"))
        if now != units and now * 100 < runs:  # at the end the rows are summed up
            units, last_mib = now, resident_mib(process.pid) or last_mib
            if now * 100 >= EARLY_RUNS and not early_mib:
                early_mib = last_mib
        time.sleep(0.2)
    used_ms = 1000 * (_children_s() - before) / runs
    print(
        f"{runs} runs by one worker: {used_ms:.2f} ms of processor time each (3 asked), "
        f"{beside(used_ms, 3.0, BareLoop(day.day).ms())}; memory "
        f"{early_mib:.1f} MiB after {EARLY_RUNS} runs, {last_mib:.1f} after {100 * units} "
        f"({100 * (last_mib / early_mib - 1):+.1f} %, 5 asked); "
        f"{size_of(day.folder / 'many') / runs:.0f} bytes a run on disk",
        flush=True,
    )


def main() -> None:
    """Fly, compare, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=10_000)
    parser.add_argument("--many", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=secrets.randbelow(100_000))
    given = parser.parse_args()
    print(f"seed {given.seed}, load {os.getloadavg()[0]:.1f}", flush=True)
    with tempfile.TemporaryDirectory() as place:
        day = Day(Path(place), given.seed)
        used_s = day.fly("one", given.runs)
        whole = day.told("one")
        size = size_of(day.folder / "one") / given.runs
        print(
            f"{given.runs} runs by one worker, with what would help most: {used_s:.1f} s of processor time "
            f"in all (60 asked), {size:.0f} bytes a run on disk (2,000 asked)",
            flush=True,
        )
        rows_alone(day, "one", given.runs)
        day.fly("two", given.runs, "--workers", "2")
        print(f"a pool of two: same bytes {day.told('two') == whole}", flush=True)
        with dask(day.folder) as address:
            day.fly("dask", given.runs, "--engine", "dask", OUTCROP_DASK_SCHEDULER=address)
        print(f"Dask with two workers: same bytes {day.told('dask') == whole}", flush=True)
        killed(day, given.runs, whole)
        many(day, given.many)


if __name__ == "__main__":
    main()
