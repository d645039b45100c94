"""File an observation request on a target."""

from __future__ import annotations

from dataclasses import asdict

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.day.rovers import instrument_name, profile_of
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.edit import insert, new_row
from ground.records.get_resource import row_in_mission
from ground.resources.missions.row import MissionRow
from ground.resources.observation_requests.bodies import ObservationRequestCreate
from ground.resources.observation_requests.constraints import written_constraints
from ground.resources.observation_requests.kind import OBSERVATION_REQUEST
from ground.resources.observation_requests.place_rover import place_rover
from ground.resources.observation_requests.row import ObservationRequestRow
from ground.resources.observation_requests.rules import require_order, require_window
from ground.resources.observation_requests.value import ObservationRequest, RequestState
from ground.resources.targets.kind import TARGET


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
        target = row_in_mission(session, TARGET, given.target_id, mission_id, "/target_id")
        profile = profile_of(session.get_one(MissionRow, mission_id).rover_profile)
        instrument = instrument_name(profile, given.instrument)
        manual = None if given.observation_pose is None else given.observation_pose.value()
        point = place_rover(repo, session, target, instrument, manual)
    with repo.database.write() as session:
        if given.after:
            require_order(order_of(session, mission_id), None, given.after)
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
        return OBSERVATION_REQUEST.show_one(session, row)


def order_of(session: Session, mission_id: str) -> dict[str, list[str]]:
    """Return for each request of a mission those to be done before it."""
    rows = select(ObservationRequestRow.id, ObservationRequestRow.after).where(
        ObservationRequestRow.mission_id == mission_id
    )
    return {row.id: list(row.after) for row in session.execute(rows)}
