"""Speed of the temporal network: full check, one added constraint, one executed point, dispatch bound.

    .venv/bin/python -m benchmarks.stn [--points 1001] [--repeat 5]

Networks look like plans: a chain of tasks with durations, a third of the constraints are cross links.
Times are CPU milliseconds; beside them stands a fixed loop of pure Python, so that machines can be compared.
"""

from __future__ import annotations

import argparse
import random
import statistics
import time

from executive.stn import ORIGIN, TemporalNetwork

Row = tuple[int, int, int | None, int | None]


def yardstick_ms() -> float:
    """Return the CPU time of a fixed loop."""
    begin = time.process_time()
    total = 0
    for i in range(300_000):
        total += i * i % 7
    return (time.process_time() - begin) * 1e3


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


def quantile(values: list[float], q: float) -> float:
    """Return the value below which a share `q` of the values lies."""
    return sorted(values)[min(len(values) - 1, int(q * len(values)))]


def measure(points: int, seed: int) -> dict[str, float]:
    """Return milliseconds of each operation on a network like a plan's."""
    rows, when = plan_like(points, seed)
    clock = time.process_time
    begin = clock()
    network = build(points, rows)
    out = {"build ms": (clock() - begin) * 1e3}
    begin = clock()
    assert network.check() is None
    out["full check ms"] = (clock() - begin) * 1e3

    begin = clock()
    network.relax()
    out["relax ms"] = (clock() - begin) * 1e3

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
    out["add mean ms"] = statistics.fmean(added)
    out["add p99 ms"] = quantile(added, 0.99)

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
    out["execute mean ms"] = statistics.fmean(executed)
    out["execute p99 ms"] = quantile(executed, 0.99)
    out["bound mean ms"] = statistics.fmean(bounds)
    out["consistent at the end"] = float(network.consistent)

    broken = build(points, [*rows, (1, points - 1, None, (when[-1] - when[1]) // 4)])
    begin = clock()
    conflict = broken.check()
    out["conflict ms"] = (clock() - begin) * 1e3
    assert conflict is not None
    out["links of the conflict"] = float(len(conflict.links))
    return out


def main() -> None:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--points", type=int, nargs="*", default=[101, 1001])
    parser.add_argument("--repeat", type=int, default=5)
    arguments = parser.parse_args()
    print(f"yardstick {statistics.median(yardstick_ms() for _ in range(5)):.1f} ms")
    for points in arguments.points:
        runs = [measure(points, seed) for seed in range(arguments.repeat)]
        print(
            f"\n{points} points, {len(plan_like(points, 0)[0])} constraints, median of {len(runs)} networks"
        )
        for name in runs[0]:
            print(f"  {name:24s} {statistics.median(run[name] for run in runs):10.4f}")


if __name__ == "__main__":
    main()
