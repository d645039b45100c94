"""Crash points of the live executive: it dies at any instant, its disk loses what was not synchronised.

    .venv/bin/python -m studies.executive_crash_points --points 100000 --minutes 10 [--out docs]

Each run drives a day beside a rover that lives on, numbers what it says and forgets what was acknowledged. It
dies up to five times, before or in the middle of a write, a synchronisation, a command or a receipt; what the
journal keeps of unsynchronised bytes is random, and so is how long the process is away. Every run has to end,
with each command carried out once, a plan clock that never goes back, and a journal that replays.
"""

from __future__ import annotations

import argparse
import secrets
import tempfile
import time
from pathlib import Path

import pytest

from tests.executive.killed_runs import live_through


def study(wanted: int, minutes: float, first: int) -> tuple[int, int, list[tuple[int, str]]]:
    """Return the crash points, the runs, and the failures as seed and reason."""
    points, seed = 0, first
    failures: list[tuple[int, str]] = []
    begin = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        while points < wanted and time.monotonic() - begin < 60 * minutes:
            try:
                with pytest.MonkeyPatch.context() as patch:
                    points += live_through(seed, Path(folder), patch)
            except Exception as error:  # noqa: BLE001 - whatever goes wrong in a run is what the study is for
                failures.append((seed, f"{type(error).__name__}: {str(error)[:200]}"))
            seed += 1
    return points, seed - first, failures


def main() -> None:
    """Draw runs from a fresh seed, or a given one, and print what came of them."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--points", type=int, default=100_000)
    parser.add_argument("--minutes", type=float, default=10)
    parser.add_argument("--seed", type=int, help="first seed; fresh if none is given")
    parser.add_argument("--out", type=Path, help="docs folder: the result goes into results/live.md")
    options = parser.parse_args()
    first = options.seed if options.seed is not None else secrets.randbelow(2**31)
    points, runs, failures = study(options.points, options.minutes, first)
    print(
        f"seeds {first} to {first + runs - 1}: {points} crash points in {runs} runs, {len(failures)} failures"
    )
    lines = [
        f"| crash points, runs | {points}, {runs} (seeds {first} to {first + runs - 1}) |",
        f"| runs unfinished, or with a command lost or carried out twice | {len(failures)} |",
    ]
    for seed, reason in failures[:20]:
        print(f"  seed {seed}: {reason}")
    if options.out is not None:
        from studies.live_kills import put

        put(
            options.out / "results" / "live.md",
            "crash_points",
            f"python -m studies.executive_crash_points --points {options.points} --seed {first}",
            lines,
        )
    raise SystemExit(1 if failures else 0)


if __name__ == "__main__":
    main()
