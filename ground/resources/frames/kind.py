"""How frames of the site chain are stored and shown."""

from __future__ import annotations

from collections.abc import Sequence

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from ground.errors import StateError
from ground.records.actor import Action
from ground.records.kind import Kind
from ground.records.show import value_of
from ground.resources.frames.bodies import FrameChange, FrameCreate
from ground.resources.frames.row import FrameFileRow, FrameRow, SolutionRow
from ground.resources.frames.site_chain import load_chain
from ground.resources.frames.value import Frame, Level


def show_frames(session: Session, rows: Sequence[FrameRow]) -> list[Frame]:
    """Return frames with their places, by the chain of each mission once."""
    chains = {i: load_chain(session, i) for i in {r.mission_id for r in rows}}
    s = SolutionRow
    counted = select(s.frame_id, func.count()).where(s.mission_id.in_(chains)).group_by(s.frame_id)
    counts = dict(session.execute(counted).all())
    declared: dict[tuple[str, tuple[int, ...]], list[int]] = {}
    files = select(FrameFileRow.mission_id, FrameFileRow.aliases).order_by(FrameFileRow.id)
    for file in session.execute(files.where(FrameFileRow.mission_id.in_(chains))):
        for alias in file.aliases:
            declared.setdefault((file.mission_id, tuple(alias["new"])), alias["old"])
    shown = []
    for r in rows:
        place, reason = None, ""
        try:
            place = chains[r.mission_id].place(r.id)
        except StateError as err:
            reason = err.message
        known = declared.get((r.mission_id, tuple(r.counter))) if r.level == "site" else None
        shown.append(
            value_of(
                Frame,
                r,
                level=Level(r.level),
                declared_at=known,
                solutions=counts.get(r.id, 0),
                place=place,
                reason=reason,
            )
        )
    return shown


FRAME = Kind(
    "frame",
    "frame",
    "frm",
    "frames",
    FrameRow,
    show_frames,
    Action.EDIT_MISSION,
    make=FrameCreate,
    change=FrameChange,
    undoable=True,
    related=True,
)
