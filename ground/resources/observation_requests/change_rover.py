"""Tell requests that their mission has another rover."""

from __future__ import annotations

from collections.abc import Sequence

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.day.rovers import instrument_name, profile_of
from ground.errors import InvalidInputError, StateError
from ground.records.kind import Follower
from ground.resources.observation_requests.kind import OBSERVATION_REQUEST
from ground.resources.observation_requests.row import ObservationRequestRow

LACKS = "has no instrument"
"""Words of the reason by which it is known again when the rover is changed back."""


def told_requests(session: Session, mission_id: str, rover_profile: str) -> list[Follower]:
    """Return the requests whose state's reason changes with the rover, and the new reason.

    A request for an instrument that the rover lacks stays as it is and says so; one that it has again says
    nothing more.
    """
    told: list[Follower] = []
    rows = ObservationRequestRow
    for row in session.scalars(select(rows).where(rows.mission_id == mission_id).order_by(rows.id)):
        reason = lacking(rover_profile, row.instrument)
        if reason or LACKS in row.state_reason:
            told.append((OBSERVATION_REQUEST, row, {"state_reason": reason}))
    return told


def lacking(rover_profile: str, instrument: str) -> str:
    """Return why a rover cannot use an instrument, or an empty string."""
    try:
        instrument_name(profile_of(rover_profile), instrument)
    except InvalidInputError as err:
        return err.message
    return ""


def require_instruments(rover_profile: str, rows: Sequence[ObservationRequestRow]) -> None:
    """Raise unless the rover carries what each of the requests asks for.

    Raises
    ------
    StateError
        With each request, its instrument and what the rover carries.
    """
    wrong = [
        f"observation request {row.id}: {reason}"
        for row in rows
        if (reason := lacking(rover_profile, row.instrument))
    ]
    if wrong:
        raise StateError(
            "; ".join(wrong) + "; change the requests, plan without them, or change the mission's rover"
        )
