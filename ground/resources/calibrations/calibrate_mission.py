"""Learn loss, duration and energy parameters of a mission's path network from its recorded runs: a job."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.errors import InvalidInputError
from ground.gdr.history import hold_chain
from ground.gdr.repository import Repository
from ground.jobs.row import JobRow
from ground.jobs.value import Job
from ground.records.actor import SYSTEM_ACTOR, Action, Actor
from ground.records.edit import update
from ground.records.get_resource import find_row
from ground.resources.ask_job import ask_job
from ground.resources.calibrations.bodies import MissionCalibrate
from ground.resources.calibrations.order import ORDERS, CalibrationOrder
from ground.resources.missions.kind import MISSION
from ground.resources.missions.row import MissionRow
from ground.resources.missions.terrain import terrain_row
from ground.resources.runs.row import RunRow

KIND = "calibrate_mission"
ACTION = Action.EDIT_MISSION


def calibrate_mission(repo: Repository, actor: Actor, mission_id: str, given: MissionCalibrate) -> Job:
    """Return the job that gives the mission the calibration that its recorded runs bear out.

    Plans made from then on use it. Without runs to learn from it is all that a rover on terrain drove.

    Raises
    ------
    NotFoundError
        If there is no such mission.
    InvalidInputError
        If a run is not of the mission.
    """
    actor.require(ACTION, mission_id)
    with repo.database.write() as session:
        folders = run_folders(repo, session, mission_id, given.run_ids)
        order = calibration_order(
            repo, session, mission_id, folders, strict=bool(given.run_ids), name=given.name
        )
        return ask_job(session, repo, actor, KIND, mission_id, (MISSION, mission_id), ORDERS.document(order))


def run_folders(
    repo: Repository, session: Session, mission_id: str, run_ids: Sequence[str] = ()
) -> list[str]:
    """Return the addresses of the folders of these runs of a mission; without any, of all made here.

    Raises
    ------
    InvalidInputError
        If a run is not of the mission, or was made elsewhere: nothing here vouches for what it drove.
    """
    row = RunRow
    here = select(row.id, row.elsewhere).where(row.mission_id == mission_id).order_by(row.id)
    known = {run.id: run.elsewhere for run in session.execute(here)}
    for index, wanted in enumerate(run_ids):
        if wanted not in known:
            raise InvalidInputError(
                f"there is no run {wanted} in mission {mission_id}", pointer=f"/run_ids/{index}"
            )
        if known[wanted]:
            raise InvalidInputError(
                f"run {wanted} was made elsewhere and calibrates nothing", pointer=f"/run_ids/{index}"
            )
    own = [run_id for run_id, elsewhere in known.items() if not elsewhere]
    return [repo.address("runs", run_id) for run_id in run_ids or own]


def calibration_order(
    repo: Repository,
    session: Session,
    mission_id: str,
    folders: Sequence[str],
    *,
    strict: bool,
    name: str,
) -> CalibrationOrder:
    """Return what the work needs; without `strict`, folders that hold no legs are passed over.

    Raises
    ------
    NotFoundError
        If there is no such mission.
    """
    mission = find_row(session, MISSION, mission_id)
    return CalibrationOrder(
        folders=tuple(folders),
        strict=strict,
        name=name or f"runs of {mission.name}",
        rover_profile=mission.rover_profile,
        terrain_dir=repo.address("terrains", terrain_row(session, mission_id).id),
    )


def settle(_repo: Repository, session: Session, job: JobRow, result: Mapping[str, object]) -> str | None:
    """Give the mission its calibration, unless it is gone."""
    hold_chain(session, job.subject_id)
    row = session.get(MissionRow, job.subject_id, with_for_update=True, populate_existing=True)
    if row is None:
        return None
    update(
        session,
        SYSTEM_ACTOR,
        MISSION,
        row,
        {"calibration": result["calibration"]},
        action="calibrate",
    )
    return f"/api/v1/missions/{row.id}"
