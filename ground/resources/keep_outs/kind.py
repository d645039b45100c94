"""How keep-outs are stored and shown."""

from __future__ import annotations

from ground.records.actor import Action
from ground.records.kind import Kind
from ground.resources.keep_outs.bodies import KeepOutChange, KeepOutCreate
from ground.resources.keep_outs.in_reference import keep_out_in_site, keep_outs_located
from ground.resources.keep_outs.row import KeepOutRow
from ground.resources.keep_outs.value import KeepOut

KEEP_OUT = Kind(
    "keep_out",
    "kpo",
    "keep-outs",
    KeepOutRow,
    KeepOut,
    Action.EDIT_MISSION,
    "keep-out",
    make=KeepOutCreate,
    change=KeepOutChange,
    undoable=True,
    computed={"at": lambda _row: None},
    settle=keep_out_in_site,
    locate=keep_outs_located,
)
