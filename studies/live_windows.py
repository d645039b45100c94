"""How long after its window closes a command is cancelled on the wire.

    .venv/bin/python -m studies.live_windows [--runs 3] [--tasks 100] [--seed N] [--page FILE]

Each run is `outcrop execute --connect` over the reference rover in another process. Its tasks would wait for
a thousand seconds and have a window of some tenths of one, drawn by the seed; when the rover was told to
cancel each is read from the rover's own log. A thread beside it sleeps up to instants like these.
"""

from __future__ import annotations

import argparse
import os
import random
import secrets
import statistics
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path

from executive.runtime.journal import JournalFile
from studies.live_kills import executive, log_of, put, quantile, watched_rover
from tests.ground.live_site import live_site

SHORTEST_S, LONGEST_S = 0.05, 0.25
"""Between these lie the windows: long enough for the rover to begin, short enough for many in a minute."""
LIMIT_MS = 50.0
"""Lateness at p99 that a live run may have on a quiet machine."""


def plan_of(windows_s: list[float]) -> str:
    """Return a plan of one task after the other, each of which has to be cancelled."""
    tasks = "\n".join(
        f"(task :id t{n} :action wait :parameters (duration_s = 1000) :duration (0 {window:g})"
        " :continue-on-failure t)"
        for n, window in enumerate(windows_s)
    )
    return f"(plan :id day :node (block :id all :node-list ({tasks})))"


@contextmanager
def sleeper(late_ms: list[float]) -> Iterator[None]:
    """Collect how late a thread wakes that sleeps up to an instant, again and again."""
    over = threading.Event()

    def measure() -> None:
        while not over.is_set():
            due = time.monotonic() + 0.1
            over.wait(0.1)
            late_ms.append(1000 * (time.monotonic() - due))

    thread = threading.Thread(target=measure, daemon=True)
    thread.start()
    yield
    over.set()
    thread.join()
    late_ms.pop()  # it was woken, and is early


def one_run(seed: int, tasks: int, sleeper_ms: list[float]) -> list[float]:
    """Return by how many milliseconds each cancel came after its window had closed."""
    rng = random.Random(seed)
    windows_s = [round(rng.uniform(SHORTEST_S, LONGEST_S), 3) for _ in range(tasks)]
    with tempfile.TemporaryDirectory() as folder:
        site, log = live_site(Path(folder), plan_of(windows_s)), Path(folder) / "rover.log"
        with watched_rover(site, log), sleeper(sleeper_ms):
            process = executive(site)
            process.wait(timeout=60 + 5 * tasks)
        records = JournalFile(site.run / "journal.jsonl").records
        zero_ms = 1000 * datetime.fromisoformat(records[0]["instant"]).timestamp()
        starts = {r["a"][0]: r["t"] for r in records if r["k"] == "trace" and r["e"] == "start"}
        cancelled = {e[1][1]: 1000 * float(str(e[2])) for e in log_of(log) if e[0] == "acknowledgement"}  # type: ignore[index]
        late = [
            cancelled[f"t{n}"] - zero_ms - starts[f"t{n}"] - 1000 * window
            for n, window in enumerate(windows_s)
        ]
    sys.stderr.write(f"run {seed}: {len(late)} cancels, most {max(late):.1f} ms\n")
    return late


def main() -> None:
    """Run the study; print its table, and write the page if one is named."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--tasks", type=int, default=100, help="windows in a run")
    parser.add_argument("--seed", type=int, default=None, help="drawn and printed when absent")
    parser.add_argument("--page", type=Path, default=None, help="put the result into this page")
    given = parser.parse_args()
    seed = secrets.randbelow(10**6) if given.seed is None else given.seed
    load, slept = os.getloadavg()[0], list[float]()
    late = [ms for n in range(given.runs) for ms in one_run(seed + n, given.tasks, slept)]

    def row(values: list[float]) -> str:
        return f"{statistics.median(values):.1f}, {quantile(values, 0.99):.1f}, {max(values):.1f} ms"

    lines = [
        f"| cancels, none early | {len(late)}, {sum(ms < -1.0 for ms in late)} early (seeds {seed} to "
        f"{seed + given.runs - 1}) |",
        f"| window closed to cancel at the rover: median, p99 (limit {LIMIT_MS:g}), most | {row(late)} |",
        f"| a thread that sleeps, beside it ({len(slept)}): median, p99, most | {row(slept)} |",
        f"| load of the machine (2 cores) at the start | {load:.1f} |",
    ]
    sys.stdout.write("\n".join(lines) + "\n")
    if given.page is not None:
        command = f"python -m studies.live_windows --runs {given.runs} --tasks {given.tasks} --seed {seed}"
        put(given.page, "windows", command, lines)


if __name__ == "__main__":
    main()
