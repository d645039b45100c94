"""Change an observation request, and take one that goes out of the order of the others."""

from __future__ import annotations

from dataclasses import asdict

from sqlalchemy import String, cast, select
from sqlalchemy.orm import Session

from ground.day.rovers import instrument_name, profile_of
from ground.gdr.repository import Repository
from ground.records.actor import Actor
from ground.records.edit import update
from ground.records.kind import Changed, Prepared, given_columns
from ground.resources.missions.row import MissionRow
from ground.resources.observation_requests.bodies import ObservationRequestChange
from ground.resources.observation_requests.constraints import written_constraints
from ground.resources.observation_requests.create_request import order_of
from ground.resources.observation_requests.kind import OBSERVATION_REQUEST
from ground.resources.observation_requests.place_rover import place_rover
from ground.resources.observation_requests.row import ObservationRequestRow, observation_point_of
from ground.resources.observation_requests.rules import require_order, require_window
from ground.resources.targets.row import TargetRow


def prepare_request(
    repo: Repository, session: Session, row: ObservationRequestRow, given: ObservationRequestChange
) -> Prepared:
    """Return the observation point that follows from another instrument or pose."""
    if not {"observation_pose", "instrument"} & given.model_fields_set:
        return Prepared(row.revision)
    instrument = given.instrument if "instrument" in given.model_fields_set else row.instrument
    if "instrument" in given.model_fields_set:
        profile = profile_of(session.get_one(MissionRow, row.mission_id).rover_profile)
        instrument = instrument_name(profile, instrument)
    old = observation_point_of(row.observation_point)
    manual = None if given.observation_pose is None else given.observation_pose.value()
    if "observation_pose" not in given.model_fields_set and old is not None and old.manual:
        manual = old.pose
    point = place_rover(repo, session, session.get_one(TargetRow, row.target_id), instrument, manual)
    named = {"instrument": instrument} if "instrument" in given.model_fields_set else {}
    return Prepared(row.revision, named, {(row.id, instrument): asdict(point)})


def change_request(
    _repo: Repository,
    session: Session,
    row: ObservationRequestRow,
    given: ObservationRequestChange,
    prepared: Prepared,
) -> Changed:
    """Return the columns of a request that a change sets.

    Raises
    ------
    InvalidInputError
        If window, order or constraints cannot be those.
    """
    if "window_s" in given.model_fields_set:
        require_window(given.window_s)
    if "after" in given.model_fields_set:
        require_order(order_of(session, row.mission_id), row.id, given.after)
    columns = given_columns(given)
    columns.pop("observation_pose", None)
    if "constraints" in given.model_fields_set:
        columns["constraints"] = written_constraints(given.constraints) or None
    columns |= dict(prepared.columns)
    if prepared.points:
        instrument = str(columns.get("instrument", row.instrument))
        columns["observation_point"] = prepared.points[(row.id, instrument)]
    return Changed(columns)


def forget_precedence(session: Session, actor: Actor, row: ObservationRequestRow, _reason: str) -> None:
    """Take a request that is about to go out of the order of the others."""
    rows = ObservationRequestRow
    ordered = cast(rows.after, String) != "[]"  # most have none: a mission may have ten thousand
    for other in session.scalars(select(rows).where(rows.mission_id == row.mission_id, ordered)):
        if row.id in other.after:
            after = [i for i in other.after if i != row.id]
            update(session, actor, OBSERVATION_REQUEST, other, {"after": after})


def hold_order(session: Session, row: ObservationRequestRow) -> None:
    """Raise unless the requests to be done before one are there and make no circle."""
    require_order(order_of(session, row.mission_id), row.id, row.after)


def set_by_hand(request: ObservationRequestRow) -> bool:
    """Tell whether a person said where the rover has to stand."""
    old = observation_point_of(request.observation_point)
    return old is not None and old.manual
