"""How runs are stored and shown."""

from __future__ import annotations

from ground.records.actor import Action
from ground.records.kind import Kind
from ground.resources.runs.bodies import RunChange, RunCreate
from ground.resources.runs.row import RunRow
from ground.resources.runs.value import Run

RUN = Kind(
    "run",
    "run",
    "runs",
    RunRow,
    Run,
    Action.PLAN,
    make=RunCreate,
    change=RunChange,
)
