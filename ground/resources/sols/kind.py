"""How sols are stored and shown."""

from __future__ import annotations

from ground.records.actor import Action
from ground.records.kind import Kind
from ground.resources.sols.bodies import SolChange, SolCreate
from ground.resources.sols.row import SolRow
from ground.resources.sols.value import Sol

SOL = Kind(
    "sol",
    "sol",
    "sols",
    SolRow,
    Sol,
    Action.EDIT_MISSION,
    make=SolCreate,
    change=SolChange,
    undoable=True,
)
