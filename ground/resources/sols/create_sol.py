"""Open a sol."""

from __future__ import annotations

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.errors import NameTakenError
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.edit import insert, new_row, next_number
from ground.resources.missions.terrain import terrain_row
from ground.resources.sols.bodies import SolCreate
from ground.resources.sols.kind import SOL
from ground.resources.sols.row import SolRow
from ground.resources.sols.value import Sol


def create_sol(repo: Repository, actor: Actor, mission_id: str, given: SolCreate | None = None) -> Sol:
    """Return a new sol; it starts where the terrain was taken from unless a pose is given.

    Raises
    ------
    NameTakenError
        If the mission has a sol of that number.
    """
    actor.require(Action.EDIT_MISSION, mission_id)
    with repo.database.write() as session:
        return add_sol(session, actor, mission_id, given or SolCreate())


def add_sol(session: Session, actor: Actor, mission_id: str, given: SolCreate) -> Sol:
    """Return a new sol of a mission, written in a transaction that is open; see `create_sol`."""
    start = terrain_row(session, mission_id).description["start_pose"]
    number = next_number(session, SolRow, mission_id) if given.number is None else given.number
    require_free_number(session, mission_id, number)
    start = start if given.start_pose is None else given.start_pose.model_dump()
    row = new_row(SOL, actor, mission_id, given, number=number, start_pose=start)
    insert(session, actor, SOL, row)
    return SOL.show_one(session, row)


def require_free_number(session: Session, mission_id: str, number: int) -> None:
    """Raise unless the mission has no sol of that number."""
    query = select(SolRow.id).where(SolRow.mission_id == mission_id, SolRow.number == number)
    if session.scalars(query).first():
        raise NameTakenError(f"there is a sol {number} already", pointer="/number")
