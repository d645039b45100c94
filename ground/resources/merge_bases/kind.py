"""How merge bases are stored and shown."""

from __future__ import annotations

from ground.records.actor import Action
from ground.records.kind import Kind
from ground.resources.merge_bases.row import MergeBaseRow
from ground.resources.merge_bases.value import MergeBase

MERGE_BASE = Kind(
    "merge_base",
    "mgb",
    "merge-bases",
    MergeBaseRow,
    MergeBase,
    Action.EDIT_SCIENCE,
    undoable=True,
    unseen=frozenset({"pairs"}),
)
