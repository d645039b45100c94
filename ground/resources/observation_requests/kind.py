"""How observation requests are stored and shown."""

from __future__ import annotations

from collections.abc import Sequence

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.records.actor import Action
from ground.records.kind import Kind
from ground.records.show import value_of
from ground.resources.observation_requests.bodies import ObservationRequestChange, ObservationRequestCreate
from ground.resources.observation_requests.row import ObservationRequestRow, observation_point_of
from ground.resources.observation_requests.value import ObservationRequest, RequestState
from ground.resources.targets.row import TargetRow


def show_requests(session: Session, rows: Sequence[ObservationRequestRow]) -> list[ObservationRequest]:
    names = dict(
        session.execute(
            select(TargetRow.id, TargetRow.name).where(TargetRow.id.in_({r.target_id for r in rows}))
        ).all()
    )
    return [
        value_of(
            ObservationRequest,
            r,
            target_name=names.get(r.target_id, ""),
            constraints=r.constraints or [],
            observation_point=observation_point_of(r.observation_point),
            state=RequestState(r.state),
        )
        for r in rows
    ]


OBSERVATION_REQUEST = Kind(
    "observation_request",
    "observation request",
    "req",
    "observation-requests",
    ObservationRequestRow,
    show_requests,
    Action.EDIT_SCIENCE,
    make=ObservationRequestCreate,
    change=ObservationRequestChange,
    undoable=True,
    related=True,
)
