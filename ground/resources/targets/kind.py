"""How targets are stored and shown."""

from __future__ import annotations

from ground.gdr.geometry import Point
from ground.records.actor import Action
from ground.records.kind import Kind
from ground.resources.targets.bodies import TargetChange, TargetCreate
from ground.resources.targets.in_reference import target_in_site, targets_located
from ground.resources.targets.row import TargetRow
from ground.resources.targets.value import Target

TARGET = Kind(
    "target",
    "tgt",
    "targets",
    TargetRow,
    Target,
    Action.EDIT_SCIENCE,
    make=TargetCreate,
    change=TargetChange,
    undoable=True,
    computed={"position": lambda row: Point(row.east_m, row.north_m, row.up_m), "at": lambda _row: None},
    settle=target_in_site,
    locate=targets_located,
)
