"""Move a target: its observation requests find their observation points anew."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from sqlalchemy import Select, select
from sqlalchemy.orm import Session

from ground.gdr.repository import Repository
from ground.records.actor import Actor
from ground.records.edit import remove
from ground.records.kind import Changed, Prepared, given_columns
from ground.resources.observation_requests.change_request import forget_precedence, set_by_hand
from ground.resources.observation_requests.kind import OBSERVATION_REQUEST
from ground.resources.observation_requests.place_rover import place_rover
from ground.resources.observation_requests.row import ObservationRequestRow
from ground.resources.targets.bodies import TargetChange
from ground.resources.targets.create_target import NamesOf, target_columns
from ground.resources.targets.row import TargetRow
from ground.resources.targets.rules import free_name
from ground.resources.targets.tie_target import tied_target


def prepare_target(repo: Repository, session: Session, row: TargetRow, given: TargetChange) -> Prepared:
    """Return height, normal and covariance of the new place, and the observation points of its requests."""
    if not {"east_m", "north_m"} & given.model_fields_set:
        return Prepared(row.revision)
    east = given.east_m if "east_m" in given.model_fields_set else row.east_m
    north = given.north_m if "north_m" in given.model_fields_set else row.north_m
    columns = target_columns(repo, session, row.mission_id, east, north)
    moved = TargetRow(id=row.id, mission_id=row.mission_id, name=row.name, **columns)
    points: dict[tuple[str, str], Mapping[str, Any] | None] = {}
    for request in session.scalars(_requests_on(row)):
        if not set_by_hand(request):
            point = place_rover(repo, session, moved, request.instrument)
            points[(request.id, request.instrument)] = asdict(point)
    return Prepared(row.revision, columns, points)


def change_target(
    _repo: Repository, session: Session, row: TargetRow, given: TargetChange, prepared: Prepared
) -> Changed | None:
    """Return the columns of a target that a change sets, and those of the requests that move with it.

    None if other requests than those prepared for are there now.

    Raises
    ------
    NameTakenError
        If another target has the name.
    InvalidInputError
        If the mission has no such frame.
    """
    requests: list[ObservationRequestRow] = []
    if prepared.columns:
        locked = _requests_on(row).with_for_update().execution_options(populate_existing=True)
        found = session.scalars(locked)
        requests = [r for r in found if not set_by_hand(r)]
    if any((r.id, r.instrument) not in prepared.points for r in requests):
        return None
    if "name" in given.model_fields_set and given.name != row.name:
        free_name(NamesOf(session, row.mission_id), given.name)
    columns = given_columns(given) | dict(prepared.columns)
    return Changed(
        columns | tied_target(session, row, columns),
        [
            (OBSERVATION_REQUEST, r, {"observation_point": prepared.points[(r.id, r.instrument)]})
            for r in requests
        ],
    )


def forget_requests(session: Session, actor: Actor, row: TargetRow, reason: str) -> None:
    """Delete the requests of a target that is about to go."""
    for request in session.scalars(_requests_on(row)):
        forget_precedence(session, actor, request, reason)
        remove(session, actor, OBSERVATION_REQUEST, request, reason=reason)


def _requests_on(target: TargetRow) -> Select[ObservationRequestRow]:
    return select(ObservationRequestRow).where(ObservationRequestRow.target_id == target.id)
