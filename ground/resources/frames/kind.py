"""How frames of the site chain are stored and shown."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from ground.errors import StateError
from ground.records.actor import Action
from ground.records.kind import Kind
from ground.resources.frames.bodies import FrameChange, FrameCreate
from ground.resources.frames.row import FrameFileRow, FrameRow, SolutionRow
from ground.resources.frames.site_chain import load_chain
from ground.resources.frames.value import Frame, Level


def _places(session: Session, rows: Sequence[FrameRow]) -> Callable[[FrameRow], Mapping[str, object]]:
    """Read the chain of each mission once."""
    chains = {i: load_chain(session, i) for i in {row.mission_id for row in rows}}
    s = SolutionRow
    counted = select(s.frame_id, func.count()).where(s.mission_id.in_(chains)).group_by(s.frame_id)
    counts = dict(session.execute(counted).all())
    declared: dict[tuple[str, tuple[int, ...]], list[int]] = {}
    files = select(FrameFileRow.mission_id, FrameFileRow.aliases).order_by(FrameFileRow.id)
    for file in session.execute(files.where(FrameFileRow.mission_id.in_(chains))):
        for alias in file.aliases:
            declared.setdefault((file.mission_id, tuple(alias["new"])), alias["old"])

    def place(row: FrameRow) -> Mapping[str, object]:
        known = declared.get((row.mission_id, tuple(row.counter))) if row.level == Level.SITE else None
        found = {"declared_at": known, "solutions": counts.get(row.id, 0)}
        try:
            return {**found, "place": chains[row.mission_id].place(row.id), "reason": ""}
        except StateError as err:
            return {**found, "place": None, "reason": err.message}

    return place


FRAME = Kind(
    "frame",
    "frm",
    "frames",
    FrameRow,
    Frame,
    Action.EDIT_MISSION,
    make=FrameCreate,
    change=FrameChange,
    undoable=True,
    related=_places,
)
