"""Draw a keep-out."""

from __future__ import annotations

from collections.abc import Sequence

from sqlalchemy import func, select

from ground.gdr import values as v
from ground.gdr.ids import new_id
from ground.gdr.models import KeepOutRow
from ground.gdr.repository import Repository
from ground.services.actor import Action, Actor
from ground.services.checks import require_polygon
from ground.services.edit import insert
from ground.services.kinds import KINDS
from ground.services.site_chain import tied_columns
from ground.services.views import show_keep_outs


def create_keep_out(
    repo: Repository,
    actor: Actor,
    mission_id: str,
    *,
    polygon_m: Sequence[Sequence[float]],
    name: str | None = None,
    notes: str = "",
    frame_id: str | None = None,
) -> v.KeepOut:
    """Return a new keep-out; with `frame_id` it is tied to that frame and moves with it.

    Raises
    ------
    InvalidInputError
        If the outline crosses itself, has no area or lies off the terrain.
    """
    actor.require(Action.EDIT_MISSION, mission_id)
    with repo.database.write() as session:
        require_polygon(repo, session, mission_id, polygon_m)
        count = session.scalar(select(func.count()).where(KeepOutRow.mission_id == mission_id)) or 0
        row = KeepOutRow(
            id=new_id("kpo"),
            author=actor.name,
            mission_id=mission_id,
            name=name or f"Keep-out {count + 1}",
            notes=notes,
            polygon_m=[[float(e), float(n)] for e, n in polygon_m],
            sigma_m=0.0,
        )
        if frame_id is not None:
            for column, value in tied_columns(session, "keep_out", row, {"frame_id": frame_id}).items():
                setattr(row, column, value)
        insert(session, actor, KINDS["keep_out"], row)
        return show_keep_outs(session, [row])[0]
