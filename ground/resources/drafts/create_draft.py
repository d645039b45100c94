"""Propose something: a draft changes nothing until a person takes it over."""

from __future__ import annotations

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from ground.errors import StateError
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.edit import insert, new_row
from ground.records.get_resource import require_mission, row_in_mission
from ground.resources.drafts.bodies import DraftCreate, RequestDraft, WindowDraft
from ground.resources.drafts.kind import DRAFT
from ground.resources.drafts.row import DraftRow
from ground.resources.drafts.value import Draft, DraftState
from ground.resources.observation_requests.kind import OBSERVATION_REQUEST
from ground.resources.targets.kind import TARGET

MOST_OPEN = 200
"""Open drafts of one drafter in a mission: more than a person decides on in a day, and no flood."""


def create_draft(repo: Repository, actor: Actor, mission_id: str, given: DraftCreate) -> Draft:
    """Return a new draft in the name of the key that asks, for the person whose key it is.

    Raises
    ------
    InvalidInputError
        If it names a target or request that the mission does not have.
    StateError
        If the drafter has too many open ones.
    """
    actor.require(Action.DRAFT, mission_id)
    ((kind, form),) = given.forms().items()
    drafter = actor.name if actor.scope is None else actor.scope.name or actor.name
    with repo.database.write() as session:
        require_mission(session, mission_id)
        if isinstance(form, RequestDraft) and form.target_id is not None:
            row_in_mission(session, TARGET, form.target_id, mission_id, "/request/target_id")
        if isinstance(form, WindowDraft):
            row_in_mission(session, OBSERVATION_REQUEST, form.request_id, mission_id, "/window/request_id")
        row = new_row(
            DRAFT,
            actor,
            mission_id,
            given,
            kind=kind,
            form=form.model_dump(mode="json", exclude_unset=True),
            drafted_by=drafter,
            drafted_for=actor.name,
            state=DraftState.OPEN.value,
            reason="",
            decided_by="",
            decided_utc=None,
            made_kind="",
            made_id="",
        )
        insert(session, actor, DRAFT, row, reason=f"drafted by {drafter} for {actor.name}")
        _require_few(session, mission_id, drafter, actor.name)
        return DRAFT.show_one(session, row)


def _require_few(session: Session, mission_id: str, drafter: str, person: str) -> None:
    """Raise if there are too many; asked behind the lock of the mission's history, so that none slips by."""
    query = select(func.count()).where(
        DraftRow.mission_id == mission_id,
        DraftRow.drafted_by == drafter,
        DraftRow.drafted_for == person,
        DraftRow.state == DraftState.OPEN.value,
    )
    if (session.scalar(query) or 0) > MOST_OPEN:
        raise StateError(
            f"{drafter} has {MOST_OPEN} open drafts in mission {mission_id}; a person decides first"
        )
