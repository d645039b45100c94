"""A plan tree as a flat program: one row per primitive step or test, with where to go on and where on
failure.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import assert_never

import numpy as np

from planner.evaluate.model import Floats, Ints, Model
from planner.plan_tree import (
    Branch,
    Comparison,
    Condition,
    DoneCondition,
    EnergyCondition,
    Navigate,
    Observe,
    OnFail,
    Path,
    Plan,
    Stop,
    TimeCondition,
    TrackedCondition,
    TrackStart,
    TrackStop,
    Visit,
)


class Op(IntEnum):
    """What a line of a compiled plan does."""

    END = 0
    TRACK_START = 1
    TRACK_STOP = 2
    NAVIGATE = 3
    OBSERVE = 4
    CHECK = 5
    IF_TIME = 6
    IF_ENERGY = 7
    IF_TRACKED = 8
    IF_DONE = 9


@dataclass(frozen=True, eq=False)
class Program:
    """Row k does `op[k]` on place or observation `arg[k]` (threshold `value[k]`), then goes to `go[k]` or
    `fail[k]`.

    `entry` is the first row, row 0 the end. `path[k]` is the step (or option, for its first test) a row
    came from; `option_entry` maps the path of an option to the row where its plan begins, `go_on` the path
    of a branch to the row where the rest of its plan begins.
    """

    op: Ints
    arg: Ints
    value: Floats
    go: Ints
    fail: Ints
    entry: int
    path: tuple[Path | None, ...]
    option_entry: dict[Path, int]
    option_test: dict[Path, int]
    step_row: dict[Path, int]

    def __len__(self) -> int:
        return len(self.op)


def compile_plan(model: Model, plan: Plan, *, mark_ends: bool = False) -> Program:
    """Return the program of a plan; every row comes after the rows that it may go to.

    With `mark_ends` the end of each list of steps has a row of its own, whose path is one past the last step.
    """
    rows: list[tuple[int, int, float, int, int]] = [(Op.END, 0, 0.0, 0, 0)]
    paths: list[Path | None] = [None]
    option_entry: dict[Path, int] = {}
    option_test: dict[Path, int] = {}
    step_row: dict[Path, int] = {}

    def put(op: Op, arg: int, value: float, go: int, fail: int, path: Path) -> int:
        rows.append((op, arg, value, go, fail))
        paths.append(path)
        return len(rows) - 1

    def test(condition: Condition, yes: int, no: int, path: Path) -> int:
        match condition:
            case TimeCondition(comparison, threshold):
                a, b = (yes, no) if comparison is Comparison.GE else (no, yes)
                return put(Op.IF_TIME, 0, threshold, a, b, path)
            case EnergyCondition(comparison, threshold):
                a, b = (yes, no) if comparison is Comparison.GE else (no, yes)
                return put(Op.IF_ENERGY, 0, threshold, a, b, path)
            case TrackedCondition(target, truth):
                a, b = (yes, no) if truth else (no, yes)
                return put(Op.IF_TRACKED, model.place_of[target], 0.0, a, b, path)
            case DoneCondition(observation, truth):
                a, b = (yes, no) if truth else (no, yes)
                return put(Op.IF_DONE, model.number_of[observation], 0.0, a, b, path)
            case _:
                assert_never(condition)

    def block(steps: Plan, k: int, path: Path) -> int:
        if k == len(steps):
            if not mark_ends:
                return 0
            step_row[(*path, k)] = put(Op.CHECK, 0, 0.0, 0, 0, (*path, k))
            return step_row[(*path, k)]
        step, here = steps[k], (*path, k)
        if isinstance(step, Stop):
            step_row[here] = 0
            return 0
        rest = block(steps, k + 1, path)
        if isinstance(step, Branch):
            entry = rest
            for j in range(len(step.options) - 1, -1, -1):
                option = step.options[j]
                body = block(option.plan, 0, (*here, j))
                body = put(Op.CHECK, 0, 0.0, body, body, (*here, j))  # a row that only this option passes
                option_entry[(*here, j)] = body
                first = body
                for condition in reversed(option.when):
                    first = test(condition, first, entry, (*here, j))
                option_test[(*here, j)] = first
                entry = first
            step_row[here] = entry
            return entry
        fail = rest if step.on_fail is OnFail.SKIP else 0
        match step:
            case TrackStart(target, _):
                row = put(Op.TRACK_START, model.place_of[target], 0.0, rest, fail, here)
            case TrackStop(target, _):
                row = put(Op.TRACK_STOP, model.place_of[target], 0.0, rest, fail, here)
            case Navigate(to, require_tracked, _):
                row = put(Op.NAVIGATE, model.place_of[to], 0.0, rest, fail, here)
                if require_tracked:
                    row = put(Op.CHECK, model.place_of[to], 0.0, row, fail, here)
            case Observe(observation, _, _):
                row = put(Op.OBSERVE, model.number_of[observation], 0.0, rest, fail, here)
            case Visit(observation, target, _):
                m, place = model.number_of[observation], model.place_of[target]
                row = put(Op.OBSERVE, m, 0.0, rest, fail, here)
                row = put(Op.NAVIGATE, place, 0.0, row, fail, here)
                if model.is_place[m]:
                    row = put(Op.CHECK, place, 0.0, row, fail, here)
            case _:
                assert_never(step)
        step_row[here] = row
        return row

    entry = block(plan, 0, ())
    return Program(
        op=np.array([r[0] for r in rows], np.int64),
        arg=np.array([r[1] for r in rows], np.int64),
        value=np.array([r[2] for r in rows], np.float64),
        go=np.array([r[3] for r in rows], np.int64),
        fail=np.array([r[4] for r in rows], np.int64),
        entry=entry,
        path=tuple(paths),
        option_entry=option_entry,
        option_test=option_test,
        step_row=step_row,
    )
