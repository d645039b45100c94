"""How traverses are stored and shown."""

from __future__ import annotations

from collections.abc import Sequence

from ground.records.actor import Action
from ground.records.kind import Kind
from ground.records.show import value_of
from ground.resources.traverses.bodies import TraverseChange, TraverseCreate
from ground.resources.traverses.row import TraverseRow
from ground.resources.traverses.value import Traverse, TraverseStop


def show_traverses(_session: object, rows: Sequence[TraverseRow]) -> list[Traverse]:
    return [value_of(Traverse, r, stops=[TraverseStop(**stop) for stop in r.stops]) for r in rows]


TRAVERSE = Kind(
    "traverse",
    "traverse",
    "trv",
    "traverses",
    TraverseRow,
    show_traverses,
    Action.PLAN,
    make=TraverseCreate,
    change=TraverseChange,
)
