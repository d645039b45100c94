"""The sun over a sol: by the kernels of the service where they tell it, else by the formulas."""

from __future__ import annotations

from datetime import UTC

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.errors import GroundError, StateError
from ground.gdr.repository import Repository
from ground.geo.place import Place
from ground.geo.spice_site import spice_site
from ground.resources.missions.row import MissionRow
from ground.resources.sols.row import SolRow
from mission import Sky

BEYOND_S = 7_200.0
"""The course goes on for so long behind the sol's time budget; runs end late."""


def sol_sky(repo: Repository, session: Session, sol: SolRow) -> Sky:
    """Return the sky of a sol: with a course by SPICE if there are kernels, a place and a start in UTC.

    Raises
    ------
    StateError
        If there are kernels and they do not tell where the sun stands.
    """
    plain = Sky(start_lmst_h=sol.start_lmst_h)
    kernels = repo.settings.kernels
    place = (
        session.scalar(select(MissionRow.place).where(MissionRow.id == sol.mission_id)) if kernels else None
    )
    if sol.start_utc is None or place is None:
        return plain
    from neighbours.geodata.errors import GeodataError
    from neighbours.geodata.spice_sky import sun_course

    start = sol.start_utc if sol.start_utc.tzinfo else sol.start_utc.replace(tzinfo=UTC)
    try:
        course = sun_course(kernels, spice_site(Place(**place)), start, sol.time_budget_s + BEYOND_S)
    except (GeodataError, GroundError) as err:
        raise StateError(
            f"OUTCROP_SPICE_KERNELS does not say where the sun stands on sol {sol.number}: {err}"
        ) from err
    return Sky(start_lmst_h=sol.start_lmst_h, course=course)
