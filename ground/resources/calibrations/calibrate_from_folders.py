"""Learn a mission's calibration from run folders at once, without a worker."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.edit import update
from ground.records.get_resource import find_row
from ground.resources.calibrations.calibrate_mission import calibration_order, run_folders
from ground.resources.calibrations.work import learn
from ground.resources.missions.kind import MISSION
from ground.resources.missions.value import Mission


def calibrate_from_folders(
    repo: Repository, actor: Actor, mission_id: str, folders: Sequence[Path] = (), *, name: str = ""
) -> Mission:
    """Return the mission with the calibration that run folders on its terrain bear out.

    Its own runs when there are no folders; those that hold no legs are passed over then.

    Raises
    ------
    NotFoundError
        If there is no such mission.
    InvalidInputError
        If a folder holds no legs, or there are too few legs.
    """
    actor.require(Action.EDIT_MISSION, mission_id)
    with repo.database.read() as session:
        order = calibration_order(
            repo,
            session,
            mission_id,
            [str(folder) for folder in folders] or run_folders(repo, session, mission_id),
            strict=bool(folders),
            name=name,
        )
    document = learn(order, lambda _share, _what: None, lambda: False)
    with repo.database.write() as session:
        row = find_row(session, MISSION, mission_id, lock=True)
        update(session, actor, MISSION, row, {"calibration": document}, action="calibrate")
        return MISSION.show_one(session, row)
