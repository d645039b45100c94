"""Name a frame by its motion counter."""

from __future__ import annotations

from collections.abc import Sequence

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.errors import InvalidInputError, NameTakenError
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.edit import insert, update
from ground.records.get_resource import find_row
from ground.resources.frames.bodies import FrameCreate
from ground.resources.frames.kind import FRAME
from ground.resources.frames.row import FrameFileRow, FrameRow, SolutionRow
from ground.resources.frames.site_chain import key_of
from ground.resources.frames.value import Frame, Level
from ground.resources.missions.kind import MISSION

SITE, ROVER = "SITE_FRAME", "ROVER_FRAME"


def create_frame(repo: Repository, actor: Actor, mission_id: str, given: FrameCreate) -> Frame:
    """Return a new frame without a solution; the first site frame of a mission becomes its anchor.

    Raises
    ------
    InvalidInputError
        If the counter does not fit the name.
    NameTakenError
        If the mission has the frame already.
    """
    actor.require(Action.EDIT_MISSION, mission_id)
    with repo.database.write() as session:
        mission = find_row(session, MISSION, mission_id)
        key = key_of(given.name, given.counter)
        taken = select(FrameRow.id).where(FrameRow.mission_id == mission_id, FrameRow.key == key)
        if session.scalars(taken).first() is not None:
            raise NameTakenError(f"there is a frame {key} already", pointer="/counter")
        row = frame_row(actor, mission_id, given.name, given.counter)
        row.notes = given.notes
        insert(session, actor, FRAME, row)
        if row.level == Level.SITE and mission.anchor_frame_id is None:
            update(session, actor, MISSION, mission, {"anchor_frame_id": row.id})
        return FRAME.show_one(session, row)


def frame_row(actor: Actor, mission_id: str, name: str, counter: Sequence[int]) -> FrameRow:
    """Return the row of a frame.

    Raises
    ------
    InvalidInputError
        If a site has not one index, or a rover frame fewer than two or more than five.
    """
    most = 1 if name == SITE else 5
    least = 1 if name == SITE else 2 if name == ROVER else 1
    if not least <= len(counter) <= most:
        raise InvalidInputError(
            f"{name} has a motion counter of {len(counter)} indices; it takes {least} to {most}",
            pointer="/counter",
        )
    if name == SITE:
        level = Level.SITE
    elif name == ROVER and not any(counter[2:]):
        level = Level.DRIVE
    else:
        level = Level.POSE
    return FrameRow(
        id=new_id("frm"),
        author=actor.name,
        mission_id=mission_id,
        key=key_of(name, counter),
        name=name,
        counter=list(counter),
        level=level.value,
        site=counter[0],
        drive=counter[1] if len(counter) > 1 else None,
        solution_id=None,
        chosen_utc=None,
    )


def next_position(session: Session, mission_id: str) -> int:
    """Return the place behind all solutions and aliases that arrived."""
    s = SolutionRow
    last = session.scalars(
        select(s.position).where(s.mission_id == mission_id).order_by(s.position.desc()).limit(1)
    ).first()
    aliases = session.scalars(select(FrameFileRow.aliases).where(FrameFileRow.mission_id == mission_id))
    taken = [int(alias["position"]) for listed in aliases for alias in listed]
    return 1 + max([-1 if last is None else last, *taken])
