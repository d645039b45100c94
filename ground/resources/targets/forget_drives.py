"""Take a target out of the mission's drive rules."""

from __future__ import annotations

from sqlalchemy.orm import Session

from ground.records.actor import Actor
from ground.records.edit import update
from ground.resources.missions.kind import MISSION
from ground.resources.missions.row import MissionRow
from ground.resources.targets.row import TargetRow


def forget_drives(session: Session, actor: Actor, row: TargetRow, _reason: str) -> None:
    """Take the rules for drives to and from a target that is about to go out of its mission."""
    mission = session.get_one(MissionRow, row.mission_id)
    rules = mission.drive_rules or []
    kept = [r for r in rules if row.id not in {r["from_target_id"], r["to_target_id"]}]
    if len(kept) < len(rules):
        update(session, actor, MISSION, mission, {"drive_rules": kept})
