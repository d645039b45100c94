"""How localization solutions are stored and shown."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.records.actor import Action
from ground.records.kind import Kind
from ground.resources.frames.row import FrameFileRow, FrameRow, SolutionRow
from ground.resources.solutions.bodies import SolutionChange, SolutionCreate
from ground.resources.solutions.value import FrameFile, Solution


def _use(session: Session, rows: Sequence[SolutionRow]) -> Callable[[SolutionRow], Mapping[str, object]]:
    frames = select(FrameRow.solution_id).where(FrameRow.id.in_({row.frame_id for row in rows}))
    used = set(session.scalars(frames))
    return lambda row: {"in_use": row.id in used}


SOLUTION = Kind(
    "solution",
    "sln",
    "solutions",
    SolutionRow,
    Solution,
    Action.EDIT_MISSION,
    "localization solution",
    make=SolutionCreate,
    change=SolutionChange,
    undoable=True,
    related=_use,
)

FRAME_FILE = Kind(
    "frame_file", "frf", "frame-files", FrameFileRow, FrameFile, Action.EDIT_MISSION, undoable=True
)
