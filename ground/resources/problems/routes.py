"""Endpoints: planning problems."""

from __future__ import annotations

from starlette.responses import Response

from ground.api.context import Asked, Cursor, Id, Limit, api_router
from ground.api.problems import responses
from ground.records.forms import Page
from ground.resources.problems.value import Problem

router = api_router("planning")


@router.get("/missions/{mission_id}/problems", response_model=Page[Problem], responses=responses(404, 422))
async def list_problems(ask: Asked, mission_id: Id, limit: Limit = 20, cursor: Cursor = None) -> Response:
    """List planning problems."""
    return await ask.page("problem", mission_id, limit, cursor)


@router.get("/problems/{problem_id}", response_model=Problem, responses=responses(404, 422))
async def get_problem(ask: Asked, problem_id: Id) -> Response:
    """Read a planning problem; `document` has the form `problem/1`."""
    return await ask.one("problem", problem_id)
