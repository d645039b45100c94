"""Draw a keep-out."""

from __future__ import annotations

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.edit import insert, new_row
from ground.resources.keep_outs.bodies import KeepOutCreate
from ground.resources.keep_outs.in_reference import keep_out_in_site
from ground.resources.keep_outs.kind import KEEP_OUT
from ground.resources.keep_outs.row import KeepOutRow
from ground.resources.keep_outs.rules import require_outline
from ground.resources.keep_outs.tie_keep_out import tied_keep_out
from ground.resources.keep_outs.value import KeepOut
from ground.resources.missions.terrain import terrain_bounds


def create_keep_out(repo: Repository, actor: Actor, mission_id: str, given: KeepOutCreate) -> KeepOut:
    """Return a new keep-out; with `frame_id` it is tied to that frame and moves with it.

    Raises
    ------
    InvalidInputError
        If the outline crosses itself, has no area or lies off the terrain, or there is no
        way to the site from its reference.
    """
    actor.require(Action.EDIT_MISSION, mission_id)
    with repo.database.write() as session:
        row = keep_out_row(session, actor, mission_id, keep_out_in_site(session, mission_id, given))
        insert(session, actor, KEEP_OUT, row)
        return KEEP_OUT.show_one(session, row)


def keep_out_row(session: Session, actor: Actor, mission_id: str, given: KeepOutCreate) -> KeepOutRow:
    """Return the row of a keep-out from what a person gave.

    Raises
    ------
    InvalidInputError
        If the outline is none on this terrain, or the mission has no such frame.
    """
    require_outline(given.polygon_m, terrain_bounds(session, mission_id))
    count = session.scalar(select(func.count()).where(KeepOutRow.mission_id == mission_id)) or 0
    name = given.name or f"Keep-out {count + 1}"
    row: KeepOutRow = new_row(KEEP_OUT, actor, mission_id, given, name=name, sigma_m=0.0)
    for column, value in tied_keep_out(session, row, {"polygon_m": row.polygon_m}).items():
        setattr(row, column, value)
    return row
