"""Pick a target."""

from __future__ import annotations

from ground.gdr import values as v
from ground.gdr.ids import new_id
from ground.gdr.models import TargetRow
from ground.gdr.repository import Repository
from ground.services.actor import Action, Actor
from ground.services.checks import free_name, target_columns
from ground.services.edit import insert
from ground.services.kinds import KINDS
from ground.services.site_chain import tied_columns
from ground.services.views import show_targets


def create_target(
    repo: Repository,
    actor: Actor,
    mission_id: str,
    *,
    east_m: float,
    north_m: float,
    name: str | None = None,
    notes: str = "",
    source_image: str = "",
    frame_id: str | None = None,
) -> v.Target:
    """Return a new target; height, normal and covariance come from the full-resolution terrain.

    With `frame_id` it is tied to the frame it was seen from, and moves with it.

    Raises
    ------
    OutsideTerrainError
        If the point is off the terrain.
    NameTakenError
        If another target has the name.
    """
    actor.require(Action.EDIT_SCIENCE, mission_id)
    with repo.database.read() as session:
        columns = target_columns(repo, session, mission_id, east_m, north_m)
    with repo.database.write() as session:
        row = TargetRow(
            id=new_id("tgt"),
            author=actor.name,
            mission_id=mission_id,
            name=free_name(session, mission_id, name),
            notes=notes,
            source_image=source_image,
            **columns,
        )
        if frame_id is not None:
            tied = tied_columns(session, "target", row, {**columns, "frame_id": frame_id})
            for column, value in tied.items():
                setattr(row, column, value)
        insert(session, actor, KINDS["target"], row)
        return show_targets(session, [row])[0]
