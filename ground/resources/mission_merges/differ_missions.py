"""Say what differs between two missions, and what would stand in the way of a merge."""

from __future__ import annotations

from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.get_resource import require_mission
from ground.resources.mission_merges.compared import schema_of
from ground.resources.mission_merges.read_sides import difference_of, read_sides, snapshot
from ground.resources.mission_merges.value import MissionDifference
from ground.versions.rows import merge_rows, row_changes


def differ_missions(repo: Repository, actor: Actor, mission_id: str, from_id: str) -> MissionDifference:
    """Return what a mission and another did since they began to differ.

    Raises
    ------
    InvalidInputError
        If they have no merge base.
    """
    for one in (mission_id, from_id):
        actor.require(Action.READ, one)
    with repo.database.read() as session:
        snapshot(session)
        for one in (mission_id, from_id):
            require_mission(session, one)
        sides = read_sides(session, mission_id, from_id)
    schema = schema_of(sides.ours, sides.theirs, sides.base)
    merged = merge_rows(sides.base, sides.ours, sides.theirs, schema)
    changes = row_changes(sides.base, sides.ours, sides.theirs, schema)
    return difference_of(sides, changes, merged.conflicts)
