"""Endpoints: a mission's history."""

from __future__ import annotations

from typing import Annotated

from fastapi import Path, Query
from starlette.responses import Response

from ground.api.context import Asked, Id, Limit, answer, api_router
from ground.api.problems import responses
from ground.records.forms import Page
from ground.records.list_history import Event
from ground.records.list_history import list_history as list_history_use_case
from ground.resources.history.as_of import MissionAsOf, mission_as_of
from ground.resources.history.bodies import UndoBody
from ground.resources.history.undo import redo as redo_use_case
from ground.resources.history.undo import undo as undo_use_case

router = api_router("missions")


@router.get("/missions/{mission_id}/history", response_model=Page[Event], responses=responses(404, 422))
async def list_history(
    ask: Asked,
    mission_id: Id,
    limit: Limit = 100,
    after: Annotated[int, Query(ge=0, le=2**53, description="events behind this number")] = 0,
    newest_first: bool = False,
) -> Response:
    """List the changes of a mission; `next_cursor` is the number to give as `after`."""
    return answer(
        await ask.do(list_history_use_case, mission_id, after=after, limit=limit, newest_first=newest_first)
    )


@router.get("/missions/{mission_id}/as-of/{event}", response_model=MissionAsOf, responses=responses(404, 422))
async def get_mission_as_of(
    ask: Asked, mission_id: Id, event: Annotated[int, Path(ge=1, le=2**53, description="number of the event")]
) -> Response:
    """Look at a mission and its parts as an event left them."""
    return answer(await ask.do(mission_as_of, mission_id, event))


@router.post(
    "/missions/{mission_id}/undo", response_model=list[Event], responses=responses(400, 404, 409, 422)
)
async def undo(ask: Asked, mission_id: Id, body: UndoBody) -> Response:
    """Take back the last act, or one that is named; the answer holds the events that did it.

    Where a later act rests on it the answer is 409 and its member `event` names that act.
    """
    return answer(await ask.do(undo_use_case, mission_id, anyone=body.anyone, event=body.event))


@router.post(
    "/missions/{mission_id}/redo", response_model=list[Event], responses=responses(400, 404, 409, 422)
)
async def redo(ask: Asked, mission_id: Id, body: UndoBody) -> Response:
    """Do again what was last taken back."""
    return answer(await ask.do(redo_use_case, mission_id, anyone=body.anyone, event=body.event))
