"""Take a draft over, or reject it: the act of a person."""

from __future__ import annotations

from dataclasses import dataclass

from sqlalchemy.orm import Session

from ground.errors import ForbiddenError, StateError
from ground.gdr.base import utc_now
from ground.gdr.history import hold_chain
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.change_resource import change_resource
from ground.records.edit import update
from ground.records.get_resource import find_row
from ground.records.kind import Kind
from ground.resources.drafts.bodies import DraftReject, RequestDraft, WindowDraft
from ground.resources.drafts.kind import DRAFT
from ground.resources.drafts.row import DraftRow
from ground.resources.drafts.value import Draft, DraftState
from ground.resources.keep_outs.bodies import KeepOutCreate
from ground.resources.keep_outs.create_keep_out import create_keep_out
from ground.resources.observation_requests.bodies import ObservationRequestChange
from ground.resources.observation_requests.create_request import create_request
from ground.resources.observation_requests.value import ObservationRequest
from ground.resources.plans.bodies import PlanCreate
from ground.resources.plans.generate_plan import generate_plan
from ground.resources.targets.bodies import TargetCreate
from ground.resources.targets.create_target import create_target

NEEDED = {
    "target": Action.EDIT_SCIENCE,
    "request": Action.EDIT_SCIENCE,
    "window": Action.EDIT_SCIENCE,
    "keep_out": Action.EDIT_MISSION,
    "plan": Action.PLAN,
}
"""The right of whoever takes a draft of a kind over: the one they would need to do it by hand."""


@dataclass(frozen=True, slots=True)
class Deciding:
    """What taking over needs: the kind of requests with its rules, which joins nouns and is given."""

    requests: Kind[ObservationRequest]


def accept_draft(repo: Repository, actor: Actor, deciding: Deciding, draft_id: str) -> Draft:
    """Return the draft, done in the name of the person who takes it over, in one transaction.

    What is made passes the same checks as what the person had filled in; a draft that does not pass stays
    open.

    Raises
    ------
    ForbiddenError
        If a narrowed key asks, or the person may not do it by hand.
    StateError
        If it was decided on already.
    """
    with repo.database.together(), repo.database.write() as session:
        row = _open_row(session, actor, draft_id)
        made_kind, made_id = _made(repo, actor, deciding, row)
        columns = {"made_kind": made_kind, "made_id": made_id}
        return _decided(session, actor, row, DraftState.ACCEPTED, columns)


def reject_draft(repo: Repository, actor: Actor, draft_id: str, given: DraftReject) -> Draft:
    """Return the draft, rejected; raises as `accept_draft` does."""
    with repo.database.write() as session:
        row = _open_row(session, actor, draft_id)
        return _decided(session, actor, row, DraftState.REJECTED, {"reason": given.reason})


def _open_row(session: Session, actor: Actor, draft_id: str) -> DraftRow:
    """Return the row, behind the lock of its mission: of two who decide at once one is told so."""
    row: DraftRow = find_row(session, DRAFT, draft_id)
    actor.require(Action.READ, row.mission_id)
    if row.kind not in NEEDED:  # of an archive that another version wrote
        raise StateError(f"draft {draft_id} is of the unknown kind {row.kind!r}")
    actor.require(NEEDED[row.kind], row.mission_id)
    if actor.scope is not None:
        raise ForbiddenError(
            f"a draft is taken over or rejected by a person, not by a narrowed key of {actor.name}"
        )
    hold_chain(session, row.mission_id)
    row = find_row(session, DRAFT, draft_id, lock=True)
    if row.state != DraftState.OPEN.value:
        raise StateError(f"draft {draft_id} was {row.state} by {row.decided_by} already")
    return row


def _decided(
    session: Session, actor: Actor, row: DraftRow, state: DraftState, columns: dict[str, str]
) -> Draft:
    changes = {"state": state.value, "decided_by": actor.name, "decided_utc": utc_now(), **columns}
    update(session, actor, DRAFT, row, changes, action=state.value)
    return DRAFT.show_one(session, row)


def _made(repo: Repository, actor: Actor, deciding: Deciding, row: DraftRow) -> tuple[str, str]:
    """Make what a draft proposes; return its kind and id."""
    mission_id, reason = row.mission_id, f"drafted by {row.drafted_by} for {row.drafted_for}"
    match row.kind:
        case "target":
            return "target", create_target(repo, actor, mission_id, TargetCreate(**row.form)).id
        case "request":
            made = create_request(repo, actor, mission_id, RequestDraft(**row.form).request())
            return "observation_request", made.id
        case "window":
            asked = WindowDraft(**row.form)
            _require_unchanged(repo, deciding, row, asked.request_id)
            change = ObservationRequestChange.model_validate({"window_s": asked.window_s})
            change_resource(repo, actor, deciding.requests, asked.request_id, change, None, reason=reason)
            return "observation_request", asked.request_id
        case "keep_out":
            return "keep_out", create_keep_out(repo, actor, mission_id, KeepOutCreate(**row.form)).id
        case "plan":
            return "plan", generate_plan(repo, actor, mission_id, PlanCreate(**row.form)).subject_id
    raise StateError(f"draft {row.id} is of the unknown kind {row.kind!r}")


def _require_unchanged(repo: Repository, deciding: Deciding, row: DraftRow, request_id: str) -> None:
    """Refuse a draft about a request that somebody has changed since: their change would be lost."""
    with repo.database.read() as session:
        request = find_row(session, deciding.requests, request_id)
        if request.modified_utc > row.created_utc:
            raise StateError(
                f"observation request {request_id} was changed at {request.modified_utc.isoformat()}, after "
                f"the draft was made at {row.created_utc.isoformat()}; draft it again, or change it by hand"
            )
