"""How targets are stored and shown."""

from __future__ import annotations

from collections.abc import Sequence

from ground.gdr.geometry import Point
from ground.records.actor import Action
from ground.records.kind import Kind
from ground.records.show import value_of
from ground.resources.targets.bodies import TargetChange, TargetCreate
from ground.resources.targets.row import TargetRow
from ground.resources.targets.value import Target


def show_targets(_session: object, rows: Sequence[TargetRow]) -> list[Target]:
    return [value_of(Target, r, position=Point(r.east_m, r.north_m, r.up_m)) for r in rows]


TARGET = Kind(
    "target",
    "target",
    "tgt",
    "targets",
    TargetRow,
    show_targets,
    Action.EDIT_SCIENCE,
    make=TargetCreate,
    change=TargetChange,
    undoable=True,
)
