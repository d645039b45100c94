"""Endpoints: who looks at a mission."""

from __future__ import annotations

from starlette.responses import Response

from ground.api.context import Asked, Id, answer, api_router, no_content
from ground.api.problems import responses
from ground.records.lookers import Looker
from ground.resources.presence.bodies import PresenceBody
from ground.resources.presence.say_presence import leave_presence as leave
from ground.resources.presence.say_presence import list_presence as list_lookers
from ground.resources.presence.say_presence import say_presence as say

router = api_router("presence")


@router.get("/missions/{mission_id}/presence", response_model=list[Looker], responses=responses(404, 422))
async def list_presence(ask: Asked, mission_id: Id) -> Response:
    """List who looks at a mission now, and what they have selected."""
    return answer(await ask.do(list_lookers, ask.hub.lookers, mission_id))


@router.put(
    "/missions/{mission_id}/presence/{page}",
    response_model=list[Looker],
    responses=responses(400, 404, 422),
)
async def say_presence(ask: Asked, mission_id: Id, page: Id, body: PresenceBody) -> Response:
    """Say that one looks at a mission on a page, whose id the page makes up, every 15 s; hear who else does.

    It is forgotten after 40 s, and never part of the history. Others hear it as the event `presence` of the
    mission's stream.
    """
    return answer(await ask.do(say, ask.hub.lookers, mission_id, page, body.value()))


@router.delete("/missions/{mission_id}/presence/{page}", status_code=204, responses=responses(404, 422))
async def leave_presence(ask: Asked, mission_id: Id, page: Id) -> Response:
    """Say that one looks at a mission no longer on a page."""
    await ask.do(leave, ask.hub.lookers, mission_id, page)
    return no_content()
