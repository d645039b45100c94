"""How sols are stored and shown."""

from __future__ import annotations

from collections.abc import Sequence

from ground.gdr.geometry import pose_of
from ground.records.actor import Action
from ground.records.kind import Kind
from ground.records.show import value_of
from ground.resources.sols.bodies import SolChange, SolCreate
from ground.resources.sols.row import SolRow
from ground.resources.sols.value import CommunicationPass, Sol


def show_sols(_session: object, rows: Sequence[SolRow]) -> list[Sol]:
    return [
        value_of(Sol, r, start_pose=pose_of(r.start_pose), passes=[CommunicationPass(**p) for p in r.passes])
        for r in rows
    ]


SOL = Kind(
    "sol",
    "sol",
    "sol",
    "sols",
    SolRow,
    show_sols,
    Action.EDIT_MISSION,
    make=SolCreate,
    change=SolChange,
    undoable=True,
)
