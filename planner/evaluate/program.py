"""A plan tree as a flat program: one row per primitive step or test, with where to go on and where on
failure.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
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
from planner.tally import Step as Work
from planner.tally import spend


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

    @cached_property
    def rows(self) -> list[tuple[int, int, float, int, int]]:
        """Operation, argument, threshold, and the rows that follow, of each row, as numbers of Python."""
        columns = (self.op, self.arg, self.value, self.go, self.fail)
        return list(zip(*(column.tolist() for column in columns), strict=True))


def compile_plan(model: Model, plan: Plan, *, mark_ends: bool = False) -> Program:
    """Return the program of a plan; every row comes after the rows that it may go to.

    With `mark_ends` the end of each list of steps has a row of its own, whose path is one past the last step.
    """
    compiler = _Compiler(model, mark_ends)
    program = compiler.program(compiler.block(plan, 0, ()))
    spend(Work.ROW, len(program) / 2)
    return program


class _Compiler:
    """Puts rows from the last to the first; each method returns the row where its part is entered."""

    def __init__(self, model: Model, mark_ends: bool) -> None:
        self.model, self.mark_ends = model, mark_ends
        self.rows: list[tuple[int, int, float, int, int]] = [(Op.END, 0, 0.0, 0, 0)]
        self.paths: list[Path | None] = [None]
        self.option_entry: dict[Path, int] = {}
        self.option_test: dict[Path, int] = {}
        self.step_row: dict[Path, int] = {}

    def put(self, op: Op, arg: int, value: float, go: int, fail: int, path: Path) -> int:
        self.rows.append((op, arg, value, go, fail))
        self.paths.append(path)
        return len(self.rows) - 1

    def test(self, condition: Condition, yes: int, no: int, path: Path) -> int:
        match condition:
            case TimeCondition(comparison, threshold):
                a, b = (yes, no) if comparison is Comparison.GE else (no, yes)
                return self.put(Op.IF_TIME, 0, threshold, a, b, path)
            case EnergyCondition(comparison, threshold):
                a, b = (yes, no) if comparison is Comparison.GE else (no, yes)
                return self.put(Op.IF_ENERGY, 0, threshold, a, b, path)
            case TrackedCondition(target, truth):
                a, b = (yes, no) if truth else (no, yes)
                return self.put(Op.IF_TRACKED, self.model.place_of[target], 0.0, a, b, path)
            case DoneCondition(observation, truth):
                a, b = (yes, no) if truth else (no, yes)
                return self.put(Op.IF_DONE, self.model.number_of[observation], 0.0, a, b, path)
            case _:
                assert_never(condition)

    def block(self, steps: Plan, k: int, path: Path) -> int:
        here = (*path, k)
        if k == len(steps):
            if not self.mark_ends:
                return 0
            row = self.put(Op.CHECK, 0, 0.0, 0, 0, here)
        elif isinstance(step := steps[k], Stop):
            row = 0
        else:
            rest = self.block(steps, k + 1, path)
            if isinstance(step, Branch):
                row = self.branch(step, rest, here)
            else:
                row = self.step(step, rest, rest if step.on_fail is OnFail.SKIP else 0, here)
        self.step_row[here] = row
        return row

    def branch(self, branch: Branch, rest: int, here: Path) -> int:
        entry = rest
        for j in range(len(branch.options) - 1, -1, -1):
            option, path = branch.options[j], (*here, j)
            body = self.block(option.plan, 0, path)
            body = self.put(Op.CHECK, 0, 0.0, body, body, path)  # a row that only this option passes
            self.option_entry[path] = entry_of_option = body
            for condition in reversed(option.when):
                entry_of_option = self.test(condition, entry_of_option, entry, path)
            self.option_test[path] = entry = entry_of_option
        return entry

    def step(
        self, step: TrackStart | TrackStop | Navigate | Observe | Visit, rest: int, fail: int, here: Path
    ) -> int:
        model, put = self.model, self.put
        match step:
            case TrackStart(target, _):
                return put(Op.TRACK_START, model.place_of[target], 0.0, rest, fail, here)
            case TrackStop(target, _):
                return put(Op.TRACK_STOP, model.place_of[target], 0.0, rest, fail, here)
            case Navigate(to, require_tracked, _):
                row = put(Op.NAVIGATE, model.place_of[to], 0.0, rest, fail, here)
                if require_tracked:
                    row = put(Op.CHECK, model.place_of[to], 0.0, row, fail, here)
                return row
            case Observe(observation, _, _):
                return put(Op.OBSERVE, model.number_of[observation], 0.0, rest, fail, here)
            case Visit(observation, target, _):
                m, place = model.number_of[observation], model.place_of[target]
                row = put(Op.OBSERVE, m, 0.0, rest, fail, here)
                row = put(Op.NAVIGATE, place, 0.0, row, fail, here)
                if model.is_place[m]:
                    row = put(Op.CHECK, place, 0.0, row, fail, here)
                return row
            case _:
                assert_never(step)

    def program(self, entry: int) -> Program:
        op, arg, value, go, fail = zip(*self.rows, strict=True)
        return Program(
            op=np.array(op, np.int64),
            arg=np.array(arg, np.int64),
            value=np.array(value, np.float64),
            go=np.array(go, np.int64),
            fail=np.array(fail, np.int64),
            entry=entry,
            path=tuple(self.paths),
            option_entry=self.option_entry,
            option_test=self.option_test,
            step_row=self.step_row,
        )
