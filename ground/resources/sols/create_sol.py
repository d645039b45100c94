"""Open a sol."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from datetime import datetime

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.errors import NameTakenError
from ground.gdr.geometry import Pose
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.edit import insert, next_number
from ground.resources.missions.terrain import terrain_row
from ground.resources.sols.kind import SOL, show_sols
from ground.resources.sols.row import SolRow
from ground.resources.sols.value import CommunicationPass, Sol

DEFAULT_TIME_S = 21_600.0
DEFAULT_ENERGY_J = 1_500_000.0
DEFAULT_BATTERY_J = 2_000_000.0
DEFAULT_FLOOR_J = 300_000.0
DEFAULT_PENALTY = 20.0
"""A day of six hours on the battery of the K9 rover, of which a reserve stays."""


def create_sol(
    repo: Repository,
    actor: Actor,
    mission_id: str,
    *,
    number: int | None = None,
    notes: str = "",
    start_pose: Pose | None = None,
    start_utc: datetime | None = None,
    start_lmst_h: float = 9.0,
    battery_j: float = DEFAULT_BATTERY_J,
    energy_floor_j: float = DEFAULT_FLOOR_J,
    time_budget_s: float = DEFAULT_TIME_S,
    energy_budget_j: float = DEFAULT_ENERGY_J,
    overrun_penalty: float = DEFAULT_PENALTY,
    passes: Sequence[CommunicationPass] = (),
    uplink_deadline_utc: datetime | None = None,
) -> Sol:
    """Return a new sol; it starts where the terrain was taken from unless a pose is given.

    Raises
    ------
    NameTakenError
        If the mission has a sol of that number.
    """
    actor.require(Action.EDIT_MISSION, mission_id)
    with repo.database.write() as session:
        ground = terrain_row(session, mission_id)
        pose = start_pose or Pose(**ground.description["start_pose"])
        number = next_number(session, SolRow, mission_id) if number is None else number
        require_free_number(session, mission_id, number)
        row = SolRow(
            id=new_id("sol"),
            author=actor.name,
            mission_id=mission_id,
            number=number,
            notes=notes,
            start_pose=asdict(pose),
            start_utc=start_utc,
            start_lmst_h=start_lmst_h,
            battery_j=battery_j,
            energy_floor_j=energy_floor_j,
            time_budget_s=time_budget_s,
            energy_budget_j=energy_budget_j,
            overrun_penalty=overrun_penalty,
            passes=[asdict(p) for p in passes],
            uplink_deadline_utc=uplink_deadline_utc,
        )
        insert(session, actor, SOL, row)
        return show_sols(session, [row])[0]


def require_free_number(session: Session, mission_id: str, number: int) -> None:
    """Raise unless the mission has no sol of that number."""
    query = select(SolRow.id).where(SolRow.mission_id == mission_id, SolRow.number == number)
    if session.scalars(query).first():
        raise NameTakenError(f"there is a sol {number} already", pointer="/number")
