"""Speed of the plan language: read, validate and print plans of many tasks, in processor seconds.

Every task has parameters, a duration, a condition, a window and an expectation.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from benchmarks.common.clock import median_spent
from benchmarks.common.figure import Figure, command
from executive.crl import canonical_text, check, from_json, parse, to_json

MOST_S = {10_000: 4.0}
"""To read and validate a plan, its temporal network included."""
QUICK = {"tasks": (1_000,), "repeat": 1}
BUDGET_S = 300.0


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


def figures(tasks: tuple[int, ...] = (1_000, 10_000), repeat: int = 5) -> Iterator[Figure]:
    """Yield the seconds to read, to read and validate, to print, and to take from JSON."""
    for make in (flat, nested, branches):
        small_s = 0.0
        for count in tasks:
            text = make(count)
            plan = parse(text)
            assert check(text).valid
            label = f"{count:,} tasks, {make.__name__}"
            yield Figure(f"{label}: read", median_spent(partial(parse, text), repeat), "s")
            checked_s = median_spent(partial(check, text), repeat)
            yield Figure(f"{label}: read and validate", checked_s, "s", MOST_S.get(count))
            if small_s:
                yield Figure(f"{label}: to validate, times {tasks[0]:,} tasks", checked_s / small_s)
            small_s = small_s or checked_s
            yield Figure(f"{label}: print", median_spent(partial(canonical_text, plan), repeat), "s")
            document = to_json(plan)
            yield Figure(f"{label}: from JSON", median_spent(partial(from_json, document), repeat), "s")


if __name__ == "__main__":
    command(figures, QUICK, BUDGET_S)
