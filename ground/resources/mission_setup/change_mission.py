"""Change what a mission rests on: rover, calibration, place, drive rules, anchor."""

from __future__ import annotations

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.gdr.repository import Repository
from ground.records.kind import Changed, Follower, Prepared, given_columns
from ground.resources.missions.bodies import MissionChange
from ground.resources.missions.row import MissionRow
from ground.resources.missions.rules import (
    require_calibration,
    require_drive_rules,
    require_place,
    require_profile,
)
from ground.resources.observation_requests.change_rover import told_requests
from ground.resources.solutions.require_anchor import require_anchor
from ground.resources.targets.row import TargetRow


def change_mission(
    _repo: Repository, session: Session, row: MissionRow, given: MissionChange, _prepared: Prepared
) -> Changed:
    """Return the columns of a mission that a change sets.

    Raises
    ------
    InvalidInputError, StateError
        If rover, calibration, place, drive rules or anchor cannot be those.
    """
    columns = given_columns(given)
    followers: list[Follower] = []
    if "rover_profile" in given.model_fields_set:
        require_profile(given.rover_profile)
        followers = told_requests(session, row.id, given.rover_profile)
    if given.calibration is not None:
        columns["calibration"] = require_calibration(given.calibration)
    if given.place is not None:
        require_place(given.place, row.place)
    if given.drive_rules:
        targets = session.scalars(select(TargetRow.id).where(TargetRow.mission_id == row.id))
        require_drive_rules(given.drive_rules, set(targets))
    if "anchor_frame_id" in given.model_fields_set and given.anchor_frame_id != row.anchor_frame_id:
        require_anchor(session, row.id, given.anchor_frame_id)
    return Changed(columns, followers)
