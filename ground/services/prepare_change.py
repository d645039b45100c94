"""Work out what a change of a resource needs from the terrain, before the database is locked for it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.gdr import models as m
from ground.gdr import values as v
from ground.gdr.repository import Repository
from ground.services.actor import Actor
from ground.services.checks import target_columns
from ground.services.get_resource import find_row, mission_of
from ground.services.kinds import KINDS
from ground.services.place_rover import place_rover
from ground.services.views import observation_point_of


@dataclass(frozen=True, slots=True)
class Prepared:
    """What the terrain says to a change, and the revision of the resource for which it does.

    `points` holds the observation point of each request concerned, under its id and instrument.
    """

    revision: int
    columns: Mapping[str, Any] = field(default_factory=dict)
    points: Mapping[tuple[str, str], Mapping[str, Any] | None] = field(default_factory=dict)


def prepare_change(
    repo: Repository, actor: Actor, kind_name: str, resource_id: str, changes: Mapping[str, Any]
) -> Prepared:
    """Return heights and observation points that follow from a change of a target or a request."""
    with repo.database.read() as session:
        row = find_row(session, KINDS[kind_name], resource_id)
        actor.require(KINDS[kind_name].edit, mission_of(row))
        if kind_name == "target" and {"east_m", "north_m"} & set(changes):
            return _moved_target(repo, session, row, changes)
        if kind_name == "observation_request" and {"observation_pose", "instrument"} & set(changes):
            return _placed_request(repo, session, row, changes)
        return Prepared(row.revision)


def _moved_target(
    repo: Repository, session: Session, row: m.TargetRow, changes: Mapping[str, Any]
) -> Prepared:
    east, north = changes.get("east_m", row.east_m), changes.get("north_m", row.north_m)
    columns = target_columns(repo, session, row.mission_id, east, north)
    moved = m.TargetRow(id=row.id, mission_id=row.mission_id, name=row.name, **columns)
    requests = m.ObservationRequestRow
    points: dict[tuple[str, str], Mapping[str, Any] | None] = {}
    for request in session.scalars(select(requests).where(requests.target_id == row.id)):
        if not set_by_hand(request):
            point = place_rover(repo, session, moved, v.Instrument(request.instrument))
            points[(request.id, request.instrument)] = asdict(point)
    return Prepared(row.revision, columns, points)


def _placed_request(
    repo: Repository, session: Session, row: m.ObservationRequestRow, changes: Mapping[str, Any]
) -> Prepared:
    instrument = v.Instrument(changes.get("instrument", row.instrument))
    old = observation_point_of(row.observation_point)
    manual: v.Pose | None = changes.get("observation_pose")
    if "observation_pose" not in changes and old is not None and old.manual:
        manual = old.pose
    point = place_rover(repo, session, session.get_one(m.TargetRow, row.target_id), instrument, manual)
    return Prepared(row.revision, points={(row.id, instrument.value): asdict(point)})


def set_by_hand(request: m.ObservationRequestRow) -> bool:
    """Tell whether a person said where the rover has to stand."""
    old = observation_point_of(request.observation_point)
    return old is not None and old.manual
