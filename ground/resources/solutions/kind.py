"""How localization solutions are stored and shown."""

from __future__ import annotations

from collections.abc import Sequence

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.records.actor import Action
from ground.records.kind import Kind
from ground.records.show import value_of
from ground.resources.frames.row import FrameFileRow, FrameRow, SolutionRow
from ground.resources.solutions.bodies import SolutionChange, SolutionCreate
from ground.resources.solutions.value import FrameFile, Solution


def show_solutions(session: Session, rows: Sequence[SolutionRow]) -> list[Solution]:
    """Return solutions and whether each is in use."""
    frames = select(FrameRow.solution_id).where(FrameRow.id.in_({r.frame_id for r in rows}))
    used = set(session.scalars(frames))
    return [value_of(Solution, r, in_use=r.id in used) for r in rows]


def show_frame_files(_session: object, rows: Sequence[FrameFileRow]) -> list[FrameFile]:
    return [value_of(FrameFile, r) for r in rows]


SOLUTION = Kind(
    "solution",
    "localization solution",
    "sln",
    "solutions",
    SolutionRow,
    show_solutions,
    Action.EDIT_MISSION,
    make=SolutionCreate,
    change=SolutionChange,
    undoable=True,
    related=True,
)


FRAME_FILE = Kind(
    "frame_file",
    "frame file",
    "frf",
    "frame-files",
    FrameFileRow,
    show_frame_files,
    Action.EDIT_MISSION,
    undoable=True,
)
