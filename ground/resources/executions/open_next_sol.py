"""Open the sol after an execution."""

from __future__ import annotations

from datetime import timedelta

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.errors import StateError
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.edit import update
from ground.records.forms import PoseBody
from ground.records.get_resource import find_row
from ground.resources.observation_requests.kind import OBSERVATION_REQUEST
from ground.resources.observation_requests.row import ObservationRequestRow
from ground.resources.observation_requests.value import RequestState
from ground.resources.plans.row import PlanRow
from ground.resources.runs.kind import RUN
from ground.resources.runs.read_run import read_telemetry
from ground.resources.runs.row import RunRow
from ground.resources.runs.value import RunKind
from ground.resources.sols.bodies import SolCreate
from ground.resources.sols.create_sol import add_sol
from ground.resources.sols.row import SolRow
from ground.resources.sols.value import Sol

SOL_S = 88_775.244
"""Mean solar day of Mars in seconds (Allison and McEwen 2000)."""

LEFT = [
    state.value
    for state in (RequestState.OPEN, RequestState.PLANNED, RequestState.ATTEMPTED, RequestState.FAILED)
]
MAX_REASON = 1000
"""Characters kept of why a request was left; it grows by half a line a sol."""


def open_next_sol(repo: Repository, actor: Actor, run_id: str) -> Sol:
    """Return a new sol that begins where an execution ended, with the budgets of the sol before.

    What is not satisfied is carried over, each request with the sol that it comes from.

    Raises
    ------
    StateError
        If the run is not an execution, was made elsewhere, told no pose, or is not of the mission's last sol.
    """
    telemetry = read_telemetry(repo, actor, run_id)
    with repo.database.write() as session:
        run: RunRow = find_row(session, RUN, run_id)
        actor.require(Action.EDIT_MISSION, run.mission_id)
        if run.kind not in {RunKind.EXECUTION.value, RunKind.TRAINING.value}:
            raise StateError(f"the run is a {run.kind.replace('_', ' ')}; a sol ends with an execution")
        if run.elsewhere:
            raise StateError(
                f"run {run_id} on {run.rover!r} was made elsewhere, and nothing here vouches for it; a sol "
                "ends with an execution that was taken in here; the next can be made by hand"
            )
        poses = zip(telemetry.east_m, telemetry.north_m, telemetry.heading_rad, strict=True)
        east_m, north_m, heading_rad = next((p for p in reversed(list(poses)) if None not in p), (None,) * 3)
        if east_m is None or north_m is None or heading_rad is None:
            raise StateError("the run told no pose: where the next sol begins is not known")
        before = _sol_of(session, run)
        last = session.scalars(
            select(SolRow.number).where(SolRow.mission_id == run.mission_id).order_by(SolRow.number.desc())
        ).first()
        if last != before.number:
            raise StateError(f"sol {last} was opened after sol {before.number} already")
        columns = SolCreate.model_fields.keys() - {"number", "start_pose", "start_utc", "notes"}
        given = SolCreate(
            number=before.number + 1,
            notes=f"after sol {before.number}",
            start_pose=PoseBody(east_m=east_m, north_m=north_m, heading_rad=heading_rad),
            start_utc=None if before.start_utc is None else before.start_utc + timedelta(seconds=SOL_S),
            **{name: getattr(before, name) for name in columns},
        )
        _carry_over(session, actor, before)
        return add_sol(session, actor, run.mission_id, given)


def _sol_of(session: Session, run: RunRow) -> SolRow:
    """Return the sol that a run's plan is for."""
    return session.get_one(SolRow, session.get_one(PlanRow, run.plan_id).sol_id)


def _carry_over(session: Session, actor: Actor, before: SolRow) -> None:
    """Mark what waits still; what came down with the execution says for each request why."""
    rows = ObservationRequestRow
    waiting = select(rows).where(rows.mission_id == before.mission_id, rows.state.in_(LEFT)).order_by(rows.id)
    for request in session.scalars(waiting):
        why = f": {request.state_reason}" if request.state_reason else ""
        changes = {
            "state": RequestState.CARRIED.value,
            "state_reason": f"carried over from sol {before.number}{why}"[:MAX_REASON],
        }
        update(session, actor, OBSERVATION_REQUEST, request, changes, action="carry")
