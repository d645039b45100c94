"""Endpoints: what differs between missions, and merges of them."""

from __future__ import annotations

from typing import Annotated

from fastapi import Query
from starlette.responses import Response

from ground.api.context import ID, Asked, Id, answer, api_router
from ground.api.problems import responses
from ground.resources.mission_merges.bodies import MissionMergeCreate
from ground.resources.mission_merges.differ_missions import differ_missions as differ_missions_use_case
from ground.resources.mission_merges.merge_missions import merge_missions as merge_missions_use_case
from ground.resources.mission_merges.value import MissionDifference, MissionMerge

router = api_router("missions")


@router.get(
    "/missions/{mission_id}/difference",
    response_model=MissionDifference,
    responses=responses(404, 422),
)
async def differ_missions(
    ask: Asked,
    mission_id: Id,
    from_id: Annotated[
        str, Query(pattern=ID, description="the other mission: its copy, or what it is a copy of")
    ],
) -> Response:
    """Say what a mission and its copy did since they began to differ, and where the edits collide."""
    return answer(await ask.do(differ_missions_use_case, mission_id, from_id))


@router.post(
    "/missions/{mission_id}/mission-merges",
    response_model=MissionMerge,
    responses=responses(400, 404, 409, 422),
)
async def merge_missions(ask: Asked, mission_id: Id, body: MissionMergeCreate) -> Response:
    """Merge a copy into its mission, or the other way, as one act; or name the conflicts and do nothing.

    Plans, runs, approvals and signatures never move. 409 where one of the missions moved on since it was
    looked at.
    """
    return answer(await ask.do(merge_missions_use_case, mission_id, body))
