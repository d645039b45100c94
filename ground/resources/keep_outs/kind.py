"""How keep-outs are stored and shown."""

from __future__ import annotations

from collections.abc import Sequence

from ground.records.actor import Action
from ground.records.kind import Kind
from ground.records.show import value_of
from ground.resources.keep_outs.bodies import KeepOutChange, KeepOutCreate
from ground.resources.keep_outs.row import KeepOutRow
from ground.resources.keep_outs.value import KeepOut


def show_keep_outs(_session: object, rows: Sequence[KeepOutRow]) -> list[KeepOut]:
    return [value_of(KeepOut, r) for r in rows]


KEEP_OUT = Kind(
    "keep_out",
    "keep-out",
    "kpo",
    "keep-outs",
    KeepOutRow,
    show_keep_outs,
    Action.EDIT_MISSION,
    make=KeepOutCreate,
    change=KeepOutChange,
    undoable=True,
)
