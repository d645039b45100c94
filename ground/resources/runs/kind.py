"""How runs are stored and shown."""

from __future__ import annotations

from collections.abc import Sequence

from ground.jobs.value import JobState
from ground.records.actor import Action
from ground.records.kind import Kind
from ground.records.show import value_of
from ground.resources.runs.bodies import RunChange, RunCreate
from ground.resources.runs.row import RunRow
from ground.resources.runs.value import Fault, Run, RunKind


def show_runs(_session: object, rows: Sequence[RunRow]) -> list[Run]:
    return [
        value_of(
            Run,
            r,
            kind=RunKind(r.kind),
            faults=[Fault(**f) for f in r.faults],
            state=JobState(r.state),
        )
        for r in rows
    ]


RUN = Kind("run", "run", "run", "runs", RunRow, show_runs, Action.PLAN, make=RunCreate, change=RunChange)
