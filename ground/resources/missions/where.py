"""Where the site of a mission lies, for forms that count in another reference."""

from __future__ import annotations

from sqlalchemy import Connection, select
from sqlalchemy.orm import Session

from ground.geo.place import Place
from ground.resources.missions.row import MissionRow


def site_of(session: Session | Connection, mission_id: str) -> Place | None:
    """Return where the site of a mission lies; None where nobody has said it."""
    place = session.scalar(select(MissionRow.place).where(MissionRow.id == mission_id))
    return None if place is None else Place(**place)
