"""Tables of observation requests."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any, TypedDict

from sqlalchemy import ForeignKey
from sqlalchemy.orm import Mapped, mapped_column, relationship

from ground.gdr import geometry
from ground.gdr.base import JsonObject, Long, Notes, Row, Text20, Text40, mission_column
from ground.resources.observation_requests.constraints import read_constraints
from ground.resources.observation_requests.value import ObservationPoint
from ground.resources.targets.row import TargetRow
from mission import After, Constraint, MustDo, Pose, Request, Tracked, Window

PLANNED = "planned"
"""Marks a column that came later and that plans are computed from; null is what it was before."""


class StoredPoint(TypedDict):
    """An observation point in its JSON form."""

    pose: Mapping[str, float] | None
    reachable: bool
    manual: bool
    reason: str


class ObservationRequestRow(Row):
    __tablename__ = "observation_requests"

    mission_id: Mapped[str] = mission_column()
    target_id: Mapped[str] = mapped_column(ForeignKey("targets.id", ondelete="CASCADE"), index=True)
    instrument: Mapped[Text40]
    value: Mapped[float]
    tracked: Mapped[bool]
    window_s: Mapped[list[Any] | None]
    after: Mapped[list[Any]]
    must_do: Mapped[bool] = mapped_column(default=False)
    dwell_s: Mapped[float | None]
    constraints: Mapped[list[Any] | None] = mapped_column(info={PLANNED: True})
    notes: Mapped[Notes]
    rationale: Mapped[Long] = mapped_column(default="", server_default="")
    """Why it is worth the rover's time, for the uplink meeting."""
    observation_point: Mapped[StoredPoint | None] = mapped_column(JsonObject(none_as_null=True))
    state: Mapped[Text20] = mapped_column(index=True)
    state_reason: Mapped[Notes]
    _on: Mapped[TargetRow] = relationship(lazy="raise")
    """Only for the order of what is written together: a target goes into the database before its requests."""


def observation_point_of(document: StoredPoint | None) -> ObservationPoint | None:
    """Return an observation point from its JSON form."""
    if document is None:
        return None
    pose = document["pose"]
    return ObservationPoint(
        pose=None
        if pose is None
        else geometry.Pose(float(pose["east_m"]), float(pose["north_m"]), float(pose["heading_rad"])),
        reachable=document["reachable"],
        manual=document["manual"],
        reason=document["reason"],
    )


def day_request(row: ObservationRequestRow, among: Collection[str]) -> Request:
    """Return a stored observation request as a value of the day; it comes after those `among` only."""
    constraints: list[Constraint] = [After(i) for i in row.after if i in among]
    if row.tracked:
        constraints.append(Tracked())
    if row.must_do:
        constraints.append(MustDo())
    if row.window_s is not None:
        constraints.append(Window(*row.window_s))
    constraints.extend(read_constraints(row.constraints or ()))
    point = row.observation_point
    pose = point["pose"] if point is not None and point["manual"] else None
    return Request(
        id=row.id,
        target_id=row.target_id,
        instrument=row.instrument,
        value=row.value,
        constraints=tuple(constraints),
        dwell_s=row.dwell_s,
        observation_point=None if pose is None else Pose(**pose),
    )
