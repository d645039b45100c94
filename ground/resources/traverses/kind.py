"""How traverses are stored and shown."""

from __future__ import annotations

from ground.records.actor import Action
from ground.records.kind import Kind
from ground.resources.traverses.bodies import TraverseChange, TraverseCreate
from ground.resources.traverses.row import TraverseRow
from ground.resources.traverses.value import Traverse

TRAVERSE = Kind(
    "traverse",
    "trv",
    "traverses",
    TraverseRow,
    Traverse,
    Action.PLAN,
    make=TraverseCreate,
    change=TraverseChange,
)
