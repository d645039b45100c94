"""A mission's sol as a day of work, made once from its rows."""

from __future__ import annotations

from collections.abc import Collection

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.day.worksite import Worksite
from ground.errors import InvalidInputError, StateError
from ground.gdr.repository import Repository
from ground.records.get_resource import row_in_mission
from ground.resources.keep_outs.row import KeepOutRow, day_keep_out
from ground.resources.missions.row import MissionRow
from ground.resources.missions.terrain import terrain_row
from ground.resources.observation_requests.change_rover import require_instruments
from ground.resources.observation_requests.row import ObservationRequestRow, day_request
from ground.resources.sols.kind import SOL
from ground.resources.sols.row import SolRow, usable_energy_j
from ground.resources.sols.sol_sky import sol_sky
from ground.resources.targets.row import TargetRow, day_target
from mission import Day, DriveRule, Limits, Pose

TO_PLAN = ("open", "planned", "carried", "attempted", "failed")
"""States of requests that a new plan takes up; what is satisfied is not asked for again."""


def choose_sol(session: Session, mission_id: str, sol_id: str | None) -> SolRow:
    """Return the sol named, else the newest of the mission.

    Raises
    ------
    InvalidInputError
        If the mission has no such sol.
    StateError
        If it has none at all.
    """
    if sol_id is not None:
        named: SolRow = row_in_mission(session, SOL, sol_id, mission_id, "/sol_id")
        return named
    newest = session.scalars(
        select(SolRow).where(SolRow.mission_id == mission_id).order_by(SolRow.number.desc()).limit(1)
    ).first()
    if newest is None:
        raise StateError("the mission has no sol; open one, so that there is a start and a budget")
    return newest


def worksite(repo: Repository, session: Session, mission: MissionRow) -> Worksite:
    """Return the ground and the rover of a mission."""
    return Worksite(
        mission.id,
        repo.address("terrains", terrain_row(session, mission.id).id),
        mission.rover_profile,
        mission.calibration,
    )


def mission_day(
    repo: Repository,
    session: Session,
    mission: MissionRow,
    sol: SolRow,
    request_ids: Collection[str] = (),
) -> Day:
    """Return a sol of a mission as a day of work, with the requests named, else with all that wait.

    Raises
    ------
    InvalidInputError
        If a request asked for is not in the mission.
    StateError
        If the mission's rover lacks an instrument that a request asks for.
    """
    rows = _requests(session, mission, request_ids)
    require_instruments(mission.rover_profile, rows)
    chosen = {row.id for row in rows}
    wanted = {row.target_id for row in rows}
    targets = session.scalars(
        select(TargetRow).where(TargetRow.mission_id == mission.id).order_by(TargetRow.id)
    )
    keep_outs = session.scalars(
        select(KeepOutRow).where(KeepOutRow.mission_id == mission.id).order_by(KeepOutRow.id)
    )
    return Day(
        name=f"{mission.name} sol {sol.number}",
        start=Pose(**sol.start_pose),
        limits=Limits(
            time_s=sol.time_budget_s,
            energy_j=usable_energy_j(sol.battery_j, sol.energy_floor_j, sol.energy_budget_j),
            overrun_penalty=sol.overrun_penalty,
            data_mbit=sum(p["data_mbit"] for p in sol.passes) or None,
        ),
        targets=tuple(day_target(row) for row in targets if row.id in wanted),
        requests=tuple(day_request(row, chosen) for row in rows),
        keep_outs=tuple(day_keep_out(row) for row in keep_outs),
        drive_rules=tuple(
            DriveRule(rule["from_target_id"], rule["to_target_id"], _corners(rule["via_m"]))
            for rule in mission.drive_rules or ()
            if {rule["from_target_id"], rule["to_target_id"]} <= {None, *wanted}
        ),
        sky=sol_sky(repo, session, sol),
        refs={"mission": mission.id, "sol": str(sol.number)},
    )


def _requests(
    session: Session, mission: MissionRow, request_ids: Collection[str]
) -> list[ObservationRequestRow]:
    rows = list(
        session.scalars(
            select(ObservationRequestRow)
            .where(ObservationRequestRow.mission_id == mission.id)
            .order_by(ObservationRequestRow.id)
        )
    )
    if not request_ids:
        return [row for row in rows if row.state in TO_PLAN]
    known = {row.id for row in rows}
    for index, wanted in enumerate(request_ids):
        if wanted not in known:
            raise InvalidInputError(
                f"there is no observation request {wanted} in mission {mission.id}",
                pointer=f"/request_ids/{index}",
            )
    return [row for row in rows if row.id in set(request_ids)]


def _corners(via_m: list[list[float]] | None) -> tuple[tuple[float, float], ...] | None:
    return None if via_m is None else tuple((e, n) for e, n in via_m)
