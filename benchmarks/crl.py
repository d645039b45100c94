"""Speed of the plan language: read, validate and print plans of many tasks.

    .venv/bin/python -m benchmarks.crl [--tasks 1000 10000] [--repeat 5]

Every task has parameters, a duration, a condition, a window and an expectation. CPU seconds, median.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable

from executive.crl import canonical_text, check, from_json, parse, to_json


def flat(tasks: int) -> str:
    """Return a plan of one block."""
    return f"(plan :id flat :node (block :id root :node-list ({' '.join(task(i) for i in range(tasks))})))"


def nested(tasks: int) -> str:
    """Return a plan of blocks of ten, in blocks of ten, ..."""
    level = [task(i) for i in range(tasks)]
    depth = 0
    while len(level) > 1:
        depth += 1
        level = [
            f"(block :id b{depth}-{i} :node-list ({' '.join(level[i : i + 10])}))"
            for i in range(0, len(level), 10)
        ]
    return level[0]


def branches(tasks: int) -> str:
    """Return a plan of branches of two options, one inside the other, twelve deep."""
    parts = []
    for i in range(0, tasks, 24):
        inner = task(f"{i}-last")
        for j in range(12):
            inner = (
                f"(branch :id br{i}-{j} :options ((option :id go{i}-{j} :utility 2 :eligible-conditions"
                f" ((database (:soc >= 40))) :node {inner}) (option :id no{i}-{j} :node {task(f'{i}-{j}')})))"
            )
        parts.append(inner)
    return f"(block :id root :node-list ({' '.join(parts)}))"


def task(number: object) -> str:
    """Return a task with parameters, conditions and an expectation as CRL."""
    return (
        f'(task :id t{number} :action image :parameters (camera = "navcam" x = 1.5) :duration (10 20)'
        " :start-conditions ((database (:battery > 5))) :start-temporal-conditions ((0 :plus-infinity))"
        " :expectations ((time 60 0)))"
    )


def seconds(work: Callable[[], object], repeat: int) -> float:
    """Return the median of the processor seconds of several runs."""
    times = []
    for _ in range(repeat):
        begin = time.process_time()
        work()
        times.append(time.process_time() - begin)
    return statistics.median(times)


def main() -> None:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--tasks", type=int, nargs="*", default=[1_000, 10_000])
    parser.add_argument("--repeat", type=int, default=5)
    arguments = parser.parse_args()
    print(f"{'plan':10s} {'tasks':>7s} {'read':>8s} {'check':>8s} {'print':>8s} {'json':>8s}")
    for make in (flat, nested, branches):
        for tasks in arguments.tasks:
            text = make(tasks)
            plan = parse(text)
            assert check(text).valid
            document = to_json(plan)
            row = [
                seconds(work, arguments.repeat)
                for work in (
                    lambda text=text: parse(text),
                    lambda text=text: check(text),
                    lambda plan=plan: canonical_text(plan),
                    lambda document=document: from_json(document),
                )
            ]
            print(f"{make.__name__:10s} {tasks:7d} " + " ".join(f"{value:8.3f}" for value in row))


if __name__ == "__main__":
    main()
