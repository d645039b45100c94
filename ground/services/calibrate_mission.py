"""Learn the loss, duration and energy parameters of a mission's path network from recorded runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from sqlalchemy import select

from ground.driven_legs import DrivenLeg, calibrate, legs_of_run
from ground.errors import ArchiveError, InvalidInputError, NotFoundError
from ground.gdr import models as m
from ground.gdr import values as v
from ground.gdr.repository import Repository
from ground.services.actor import Action, Actor
from ground.services.edit import update
from ground.services.kinds import KINDS
from ground.services.terrains import mission_terrain
from ground.services.views import show_missions


def calibrate_mission(
    repo: Repository, actor: Actor, mission_id: str, *, run_ids: Sequence[str] = (), name: str = ""
) -> v.Mission:
    """Return the mission with the calibration that its recorded runs bear out; plans made from now on use it.

    Parameters
    ----------
    run_ids
        Runs of the mission to learn from; all that a rover on terrain drove when empty.

    Raises
    ------
    NotFoundError
        If there is no such mission.
    InvalidInputError
        If a run is not of the mission, holds no legs, or there are too few legs.
    """
    with repo.database.read() as session:
        row = m.RunRow
        known = list(session.scalars(select(row.id).where(row.mission_id == mission_id).order_by(row.id)))
    for index, wanted in enumerate(run_ids):
        if wanted not in known:
            raise InvalidInputError(
                f"there is no run {wanted} in mission {mission_id}", pointer=f"/run_ids/{index}"
            )
    folders = [repo.run_dir(run_id) for run_id in run_ids or known]
    return calibrate_from_folders(repo, actor, mission_id, folders, strict=bool(run_ids), name=name)


def calibrate_from_folders(
    repo: Repository,
    actor: Actor,
    mission_id: str,
    folders: Sequence[Path],
    *,
    strict: bool = True,
    name: str = "",
) -> v.Mission:
    """Return the mission with the calibration that run folders on its terrain bear out; see above.

    Without `strict`, folders that hold no legs are passed over.
    """
    from planner.path_network import calibration_to_json
    from rover_iface.profile import load_profile

    actor.require(Action.EDIT_MISSION, mission_id)
    with repo.database.read() as session:
        mission = session.get(m.MissionRow, mission_id)
        if mission is None:
            raise NotFoundError(f"there is no mission {mission_id}")
        profile = load_profile(mission.rover_profile)
        terrain = mission_terrain(repo, session, mission_id)
    legs: list[DrivenLeg] = []
    used = 0
    for folder in folders:
        try:
            found = legs_of_run(folder)
        except ArchiveError as err:
            if strict:
                raise InvalidInputError(err.message, pointer="/run_ids") from err
            continue
        legs += found
        used += bool(found)
    title = name or f"runs of {mission.name}"
    fitted = calibrate(
        legs,
        profile,
        terrain,
        name=title,
        source=f"{len(legs)} legs of {used} recorded runs of rover profile {profile.name} {profile.version}",
    )
    calibration_to_json(fitted)  # refuses what could not be read again
    with repo.database.write() as session:
        row = session.get(m.MissionRow, mission_id, with_for_update=True)
        if row is None:
            raise NotFoundError(f"there is no mission {mission_id}")
        document = {"format": "calibration/1", **asdict(fitted)}
        update(session, actor, KINDS["mission"], row, {"calibration": document}, action="calibrate")
        return show_missions(session, [row])[0]
