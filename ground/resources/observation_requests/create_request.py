"""File an observation request on a target that is there, or on one that is made with it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.day.rovers import instrument_name
from ground.errors import GroundError
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.edit import insert, new_row
from ground.records.get_resource import row_in_mission
from ground.records.show import value_of
from ground.resources.observation_requests.bodies import ObservationRequestCreate
from ground.resources.observation_requests.constraints import written_constraints
from ground.resources.observation_requests.kind import OBSERVATION_REQUEST
from ground.resources.observation_requests.place_rover import Worksite, stand_at, worksite_of
from ground.resources.observation_requests.row import ObservationRequestRow
from ground.resources.observation_requests.rules import require_order, require_window
from ground.resources.observation_requests.value import ObservationPoint, ObservationRequest, RequestState
from ground.resources.targets.create_target import Foreseen as NewTarget
from ground.resources.targets.create_target import foresee_targets, target_row
from ground.resources.targets.kind import TARGET
from ground.resources.targets.row import TargetRow

UNNAMED = "(unnamed)"
"""Stands for the name of a new target that gets one when it is written, in the words about it."""


@dataclass(frozen=True, slots=True)
class Foreseen:
    """What a request comes to: its target, or what makes it, and where the rover stands for it."""

    target: TargetRow | NewTarget
    instrument: str
    tracked: bool
    constraints: Sequence[object]
    point: ObservationPoint


def create_request(
    repo: Repository,
    actor: Actor,
    mission_id: str,
    given: ObservationRequestCreate,
    foreseen: Foreseen | GroundError | None = None,
) -> ObservationRequest:
    """Return a new request with its observation point; a target that is given with it is made in one act.

    Where `tracked` is left open, the instrument decides. A point that cannot be reached does not stop the
    request: it says so, and plans leave it out. `foreseen` is what it comes to, or why it cannot be made, if
    that was asked before.
    """
    actor.require(Action.EDIT_SCIENCE, mission_id)
    if foreseen is None:
        (foreseen,) = foresee_requests(repo, mission_id, [given])
    if isinstance(foreseen, GroundError):
        raise foreseen
    with repo.database.write() as session:
        if given.after:
            require_order(order_of(session, mission_id), None, given.after)
        target = _target(session, actor, mission_id, foreseen.target)
        point = replace(foreseen.point, reason=foreseen.point.reason.replace(UNNAMED, target.name))
        row = new_row(
            OBSERVATION_REQUEST,
            actor,
            mission_id,
            given,
            target_id=target.id,
            instrument=foreseen.instrument,
            tracked=foreseen.tracked,
            constraints=foreseen.constraints or None,
            observation_point=asdict(point),
            state=RequestState.OPEN.value,
            state_reason="",
        )
        insert(session, actor, OBSERVATION_REQUEST, row)
        return value_of(ObservationRequest, row, target_name=target.name)


def foresee_requests(
    repo: Repository, mission_id: str, given: Sequence[ObservationRequestCreate]
) -> list[Foreseen | GroundError]:
    """Return what making many requests takes long for; the error where one cannot be made."""
    new = [one.target for one in given if "target" in one.model_fields_set]
    made = iter(foresee_targets(repo, mission_id, new) if new else ())
    with repo.database.read() as session:
        site = worksite_of(repo, session, mission_id)
        ids = {one.target_id for one in given if "target_id" in one.model_fields_set}
        rows = select(TargetRow).where(TargetRow.mission_id == mission_id, TargetRow.id.in_(ids))
        there = {row.id: row for row in session.scalars(rows)}
        found: list[Foreseen | GroundError] = []
        for one in given:
            known = next(made) if "target" in one.model_fields_set else there.get(one.target_id)
            try:
                found.append(_foresee(repo, session, site, mission_id, one, known))
            except GroundError as err:
                found.append(err)
        return found


def _foresee(
    repo: Repository,
    session: Session,
    site: Worksite,
    mission_id: str,
    given: ObservationRequestCreate,
    known: TargetRow | NewTarget | GroundError | None,
) -> Foreseen:
    require_window(given.window_s)
    constraints = written_constraints(given.constraints)
    if known is None:  # says that there is none
        known = row_in_mission(session, TARGET, given.target_id, mission_id, "/target_id")
    with of_the_target():
        if isinstance(known, GroundError):
            raise known
    if isinstance(known, TargetRow):
        target = known
    else:
        name = given.target.name or UNNAMED
        target = TargetRow(id="", mission_id=mission_id, name=name, **known[1])
    instrument = instrument_name(site.profile, given.instrument)
    if given.observation_pose is None:
        point = site.stand(target, instrument)
    else:
        point = stand_at(repo, session, target, instrument, given.observation_pose.value())
    tracked = site.profile.instrument(instrument).tracks if given.tracked is None else given.tracked
    return Foreseen(known, instrument, tracked, constraints, point)


def _target(session: Session, actor: Actor, mission_id: str, found: TargetRow | NewTarget) -> TargetRow:
    """Return the target that a request is on, made now if it is new."""
    if isinstance(found, TargetRow):
        return found
    form, columns = found
    with of_the_target():
        row = target_row(session, actor, mission_id, form, columns)
    insert(session, actor, TARGET, row)
    return row


@contextmanager
def of_the_target() -> Iterator[None]:
    """Let what is wrong with the form of a new target point into the request's form."""
    try:
        yield
    except GroundError as err:
        err.pointer = f"/target{err.pointer}" if (err.pointer or "").startswith("/") else "/target"
        raise


def order_of(session: Session, mission_id: str) -> dict[str, list[str]]:
    """Return for each request of a mission those to be done before it."""
    rows = select(ObservationRequestRow.id, ObservationRequestRow.after).where(
        ObservationRequestRow.mission_id == mission_id
    )
    return {row.id: list(row.after) for row in session.execute(rows)}
