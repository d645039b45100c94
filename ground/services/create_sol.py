"""Open a sol."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from datetime import datetime

from sqlalchemy import select

from ground.errors import NameTakenError
from ground.gdr import values as v
from ground.gdr.ids import new_id
from ground.gdr.models import SolRow
from ground.gdr.repository import Repository
from ground.services.actor import Action, Actor
from ground.services.checks import next_number
from ground.services.edit import insert
from ground.services.kinds import KINDS
from ground.services.terrains import terrain_row
from ground.services.views import show_sols

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
    start_pose: v.Pose | None = None,
    start_utc: datetime | None = None,
    start_lmst_h: float = 9.0,
    battery_j: float = DEFAULT_BATTERY_J,
    energy_floor_j: float = DEFAULT_FLOOR_J,
    time_budget_s: float = DEFAULT_TIME_S,
    energy_budget_j: float = DEFAULT_ENERGY_J,
    overrun_penalty: float = DEFAULT_PENALTY,
    passes: Sequence[v.CommunicationPass] = (),
    uplink_deadline_utc: datetime | None = None,
) -> v.Sol:
    """Return a new sol; it starts where the terrain was taken from unless a pose is given.

    Raises
    ------
    NameTakenError
        If the mission has a sol of that number.
    """
    actor.require(Action.EDIT_MISSION, mission_id)
    with repo.database.write() as session:
        ground = terrain_row(session, mission_id)
        pose = start_pose or v.Pose(**ground.description["start_pose"])
        number = next_number(session, SolRow, mission_id) if number is None else number
        if session.scalars(
            select(SolRow.id).where(SolRow.mission_id == mission_id, SolRow.number == number)
        ).first():
            raise NameTakenError(f"there is a sol {number} already", pointer="/number")
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
        insert(session, actor, KINDS["sol"], row)
        return show_sols(session, [row])[0]
