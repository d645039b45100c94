"""Speed of the temporal network: full check, one added constraint, one executed point, dispatch bound.

Networks look like plans: a chain of tasks with durations, a third of the constraints are cross links.
Times are processor milliseconds, medians over networks.
"""

from __future__ import annotations

import random
import statistics
import time
from collections.abc import Iterator

from benchmarks.common.clock import quantile
from benchmarks.common.figure import Figure, command
from executive.stn import ORIGIN, TemporalNetwork

MOST_MS = {
    (1001, "full check"): 20.0,
    (1001, "add, 99th percentile"): 0.5,
    (1001, "execute, mean"): 0.25,
}
QUICK = {"points": (101,), "repeat": 1}
BUDGET_S = 120.0
Row = tuple[int, int, int | None, int | None]


def plan_like(points: int, seed: int) -> tuple[list[Row], list[int]]:
    """Return constraints that a hidden schedule satisfies, and that schedule, milliseconds."""
    rng = random.Random(seed)
    when = [0]
    for _ in range(points - 1):
        when.append(when[-1] + rng.randrange(1_000, 60_000))
    rows: list[Row] = []
    for point in range(1, points):
        gap = when[point] - when[point - 1]
        rows.append((point - 1, point, gap // 2, gap * 2 if rng.random() < 0.5 else None))
        rows.append((ORIGIN, point, 0, None))
    for _ in range(points):
        a = rng.randrange(1, points)
        b = min(points - 1, a + rng.randrange(1, 40))
        if a != b:
            gap = when[b] - when[a]
            rows.append((a, b, int(gap * 0.7), int(gap * 1.5)))
    return rows, when


def build(points: int, rows: list[Row]) -> TemporalNetwork:
    """Return the network of so many points and these constraints."""
    network = TemporalNetwork()
    for _ in range(points - 1):
        network.add_point()
    for row in rows:
        network.declare(*row)
    return network


def measure(points: int, seed: int) -> dict[str, float]:
    """Return milliseconds of each operation on a network like a plan's."""
    rows, when = plan_like(points, seed)
    clock = time.process_time
    begin = clock()
    network = build(points, rows)
    out = {"build": (clock() - begin) * 1e3}
    begin = clock()
    assert network.check() is None
    out["full check"] = (clock() - begin) * 1e3

    begin = clock()
    network.relax()
    out["relax"] = (clock() - begin) * 1e3

    rng = random.Random(seed + 1)
    added = []
    for _ in range(1000):
        a, b = sorted(rng.sample(range(1, points), 2))
        b = min(b, a + 60)
        gap = when[b] - when[a]
        begin = time.process_time()
        network.add(a, b, int(gap * 0.8), int(gap * 1.3))
        added.append((time.process_time() - begin) * 1e3)
    assert network.consistent
    out["add, mean"] = statistics.fmean(added)
    out["add, 99th percentile"] = quantile(added, 0.99)

    executed = []
    bounds = []
    now = 0
    for point in range(1, points):
        begin = time.process_time()
        now = max(now, network.dispatch_bound(point))
        bounds.append((time.process_time() - begin) * 1e3)
        now += rng.randrange(0, 50)
        begin = time.process_time()
        network.advance(now)
        network.execute(point, now)
        executed.append((time.process_time() - begin) * 1e3)
    out["execute, mean"] = statistics.fmean(executed)
    out["execute, 99th percentile"] = quantile(executed, 0.99)
    out["dispatch bound, mean"] = statistics.fmean(bounds)
    assert network.consistent

    broken = build(points, [*rows, (1, points - 1, None, (when[-1] - when[1]) // 4)])
    begin = clock()
    conflict = broken.check()
    out["full check that finds a conflict"] = (clock() - begin) * 1e3
    assert conflict is not None
    return out


def figures(points: tuple[int, ...] = (101, 1001), repeat: int = 5) -> Iterator[Figure]:
    """Yield the milliseconds of each operation."""
    for count in points:
        runs = [measure(count, seed) for seed in range(repeat)]
        for name in runs[0]:
            middle = statistics.median(run[name] for run in runs)
            yield Figure(f"{count:,} points: {name}", middle, "ms", MOST_MS.get((count, name)))


if __name__ == "__main__":
    command(figures, QUICK, BUDGET_S)
