"""Processor time of `outcrop --help`, all imports counted, beside a Python that does nothing."""

from __future__ import annotations

import resource
import statistics
import subprocess
import sys
from collections.abc import Iterator

from benchmarks.common.figure import Figure, command
from benchmarks.common.served import OUTCROP, ROOT

HELP_MOST_S = 0.25
QUICK = {"repeat": 3}
BUDGET_S = 60.0


def child_s(order: list[str]) -> float:
    """Return the processor seconds, user and system, of a command that ends by itself."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(order, check=True, cwd=ROOT, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def figures(repeat: int = 11) -> Iterator[Figure]:
    """Yield the medians of commands that alternate; the first of each, which may compile, is left out."""
    orders = ([sys.executable, "-c", "pass"], [*OUTCROP, "--help"])
    rounds = [[child_s(order) for order in orders] for _ in range(repeat + 1)][1:]
    bare_s, help_s = (statistics.median(column) for column in zip(*rounds, strict=True))
    yield Figure("outcrop --help", help_s, "s", HELP_MOST_S)
    yield Figure("outcrop --help beside Python", help_s, "s", ratio=help_s / bare_s, to="python -c pass")


if __name__ == "__main__":
    command(figures, QUICK, BUDGET_S)
