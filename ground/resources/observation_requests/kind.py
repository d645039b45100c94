"""How observation requests are stored and shown."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.records.actor import Action
from ground.records.kind import Kind
from ground.resources.observation_requests.bodies import ObservationRequestChange, ObservationRequestCreate
from ground.resources.observation_requests.row import ObservationRequestRow
from ground.resources.observation_requests.value import ObservationRequest
from ground.resources.targets.row import TargetRow


def _targets(
    session: Session, rows: Sequence[ObservationRequestRow]
) -> Callable[[ObservationRequestRow], Mapping[str, object]]:
    wanted = {row.target_id for row in rows}
    query = select(TargetRow.id, TargetRow.name).where(TargetRow.id.in_(wanted))
    names = {target.id: target.name for target in session.execute(query)}
    return lambda row: {"target_name": names.get(row.target_id, "")}


OBSERVATION_REQUEST = Kind(
    "observation_request",
    "req",
    "observation-requests",
    ObservationRequestRow,
    ObservationRequest,
    Action.EDIT_SCIENCE,
    make=ObservationRequestCreate,
    change=ObservationRequestChange,
    undoable=True,
    related=_targets,
)
