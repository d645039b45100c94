"""File an observation request on a target."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.day.rovers import instrument_name, profile_of
from ground.errors import InvalidInputError
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.edit import insert, new_row
from ground.resources.missions.row import MissionRow
from ground.resources.observation_requests.bodies import ObservationRequestCreate
from ground.resources.observation_requests.constraints import written_constraints
from ground.resources.observation_requests.kind import OBSERVATION_REQUEST, show_requests
from ground.resources.observation_requests.place_rover import place_rover
from ground.resources.observation_requests.row import ObservationRequestRow
from ground.resources.observation_requests.value import ObservationRequest, RequestState
from ground.resources.targets.row import TargetRow


def create_request(
    repo: Repository, actor: Actor, mission_id: str, given: ObservationRequestCreate
) -> ObservationRequest:
    """Return a new request with its observation point.

    Where `tracked` is left open, the instrument decides. A point that cannot be reached does not stop the
    request: it says so, and plans leave it out.
    """
    actor.require(Action.EDIT_SCIENCE, mission_id)
    require_window(given.window_s)
    carried = written_constraints(given.constraints)
    with repo.database.read() as session:
        target = session.get(TargetRow, given.target_id)
        if target is None or target.mission_id != mission_id:
            raise InvalidInputError(
                f"there is no target {given.target_id} in mission {mission_id}", pointer="/target_id"
            )
        profile = profile_of(session.get_one(MissionRow, mission_id).rover_profile)
        instrument = instrument_name(profile, given.instrument)
        manual = None if given.observation_pose is None else given.observation_pose.value()
        point = place_rover(repo, session, target, instrument, manual)
    with repo.database.write() as session:
        require_after(session, mission_id, None, given.after)
        row = new_row(
            OBSERVATION_REQUEST,
            actor,
            mission_id,
            given,
            instrument=instrument,
            tracked=profile.instrument(instrument).tracks if given.tracked is None else given.tracked,
            constraints=carried or None,
            observation_point=None if point is None else asdict(point),
            state=RequestState.OPEN.value,
            state_reason="",
        )
        insert(session, actor, OBSERVATION_REQUEST, row)
        return show_requests(session, [row])[0]


def require_window(window_s: Sequence[float] | None) -> None:
    """Raise unless a time window ends after it begins."""
    if window_s is not None and not window_s[0] < window_s[1]:
        raise InvalidInputError(
            f"the window ends at {window_s[1]:g} s and begins at {window_s[0]:g} s", pointer="/window_s"
        )


def require_after(session: Session, mission_id: str, request_id: str | None, after: Sequence[str]) -> None:
    """Raise unless the requests to be done before exist in the mission and make no circle."""
    rows = session.execute(
        select(ObservationRequestRow.id, ObservationRequestRow.after).where(
            ObservationRequestRow.mission_id == mission_id
        )
    ).all()
    before: dict[str, list[str]] = {row.id: list(row.after) for row in rows}
    for index, other in enumerate(after):
        if other not in before or other == request_id:
            raise InvalidInputError(
                f"there is no other observation request {other} in the mission", pointer=f"/after/{index}"
            )
    if request_id is None:
        return
    before[request_id] = list(after)
    seen: set[str] = set()
    stack = list(after)
    while stack:
        current = stack.pop()
        if current == request_id:
            raise InvalidInputError(f"{request_id} would have to come before itself", pointer="/after")
        if current not in seen:
            seen.add(current)
            stack.extend(before.get(current, ()))
