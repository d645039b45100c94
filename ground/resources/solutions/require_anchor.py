"""Choose a mission's anchor: the site whose frame is that of the terrain."""

from __future__ import annotations

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.errors import InvalidInputError, StateError
from ground.resources.frames.site_chain import require_frame
from ground.resources.keep_outs.row import KeepOutRow
from ground.resources.site_maps.row import SiteMapRow
from ground.resources.targets.row import TargetRow


def require_anchor(session: Session, mission_id: str, frame_id: str | None) -> None:
    """Raise unless the mission's anchor may become this frame: a site, while nothing is tied to a frame.

    Raises
    ------
    InvalidInputError, StateError
        If it may not.
    """
    if (
        frame_id is not None
        and require_frame(session, mission_id, frame_id, "/anchor_frame_id").level != "site"
    ):
        raise InvalidInputError("the anchor has to be a site frame", pointer="/anchor_frame_id")
    for row, what in ((TargetRow, "targets"), (KeepOutRow, "keep-outs"), (SiteMapRow, "maps")):
        tied = len(
            session.scalars(
                select(row.id).where(row.mission_id == mission_id, row.frame_id.is_not(None))
            ).all()
        )
        if tied:
            raise StateError(f"{tied} {what} are tied to frames; untie them before the anchor changes")
