"""Drafts: proposals of assistants and sentences, decided on by people."""

from __future__ import annotations

from starlette.responses import Response

from ground.api.context import Asked, Id, answer, created
from ground.api.problems import responses
from ground.api.resource_routes import resource_routes
from ground.resources.drafts.bodies import DraftReject, Sentence
from ground.resources.drafts.create_draft import create_draft
from ground.resources.drafts.decide_draft import Deciding
from ground.resources.drafts.decide_draft import accept_draft as accept
from ground.resources.drafts.decide_draft import reject_draft as reject
from ground.resources.drafts.kind import DRAFT
from ground.resources.drafts.read_sentence import draft_sentence as draft
from ground.resources.drafts.read_sentence import read_sentence as understand
from ground.resources.drafts.value import Draft, SentenceAnswer

router = resource_routes(
    DRAFT,
    "drafts",
    lists="List the drafts of a mission, open or decided on.",
    makes=(
        create_draft,
        "Propose a target, request, window, keep-out or plan; a person takes it over or not.",
    ),
    reads="Read a draft.",
)


@router.post("/drafts/{draft_id}/accept", response_model=Draft, responses=responses(400, 403, 404, 409, 422))
async def accept_draft(ask: Asked, draft_id: Id) -> Response:
    """Take a draft over: what it proposes is done in one's own name, with the checks of doing it by hand."""
    return answer(await ask.do(accept, Deciding(ask.kinds["observation_request"]), draft_id))


@router.post("/drafts/{draft_id}/reject", response_model=Draft, responses=responses(400, 403, 404, 409, 422))
async def reject_draft(ask: Asked, draft_id: Id, body: DraftReject) -> Response:
    """Reject a draft."""
    return answer(await ask.do(reject, draft_id, body))


@router.post(
    "/missions/{mission_id}/sentences", response_model=SentenceAnswer, responses=responses(400, 404, 409, 422)
)
async def read_sentence(ask: Asked, mission_id: Id, body: Sentence) -> Response:
    """Say what a plain sentence would draft, or ask about the words that are not understood."""
    return answer(await ask.do(understand, mission_id, body))


@router.post(
    "/missions/{mission_id}/sentences/draft",
    response_model=Draft,
    status_code=201,
    responses=responses(400, 404, 409, 422),
)
async def draft_sentence(ask: Asked, mission_id: Id, body: Sentence) -> Response:
    """Draft what a plain sentence asks for; 422 with the question if it is not understood."""
    value = await ask.do(draft, mission_id, body)
    return created(value, f"/api/v1/drafts/{value.id}")
