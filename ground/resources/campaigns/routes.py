"""Endpoints: campaigns."""

from __future__ import annotations

from typing import Annotated

from fastapi import Query
from starlette.responses import FileResponse, Response

from ground.api.context import SEALED, Asked, Id, answer, media_answers
from ground.api.problems import responses
from ground.api.resource_routes import resource_routes
from ground.resources.campaigns.bodies import CampaignDocument
from ground.resources.campaigns.fly_campaign import fly_campaign
from ground.resources.campaigns.kind import CAMPAIGN
from ground.resources.campaigns.read_campaign import read_csv, read_result, read_runs, report_campaign
from ground.resources.campaigns.value import FlownRuns

router = resource_routes(
    CAMPAIGN,
    "runs",
    lists="List campaigns, oldest first.",
    starts=(fly_campaign, "Fly a plan many times: a job, whose subject is the campaign; cancel it to stop."),
    reads="Read a campaign: plan, seeds, and when it has ended its mean utility and overruns.",
)

Bound = Annotated[float | None, Query(ge=-1e12, le=1e12, allow_inf_nan=False)]
Word = Annotated[str | None, Query(min_length=1, max_length=200)]


@router.get(
    "/campaigns/{campaign_id}/result", response_model=CampaignDocument, responses=responses(404, 409, 422)
)
async def get_campaign_result(ask: Asked, campaign_id: Id) -> Response:
    """Read what the runs say (`campaign/1`); while the campaign goes on, the runs so far."""
    return answer(await ask.do(read_result, campaign_id))


@router.get("/campaigns/{campaign_id}/runs", response_model=FlownRuns, responses=responses(404, 409, 422))
async def list_campaign_runs(
    ask: Asked,
    campaign_id: Id,
    low: Bound = None,
    high: Bound = None,
    option: Word = None,
    task: Word = None,
    limit: Annotated[int, Query(ge=1, le=500)] = 100,
) -> Response:
    """List runs by seed: of a range of utilities, that took an option, in which a task failed."""
    found = await ask.do(read_runs, campaign_id, low=low, high=high, option=option, task=task, limit=limit)
    return answer(found)


@router.get(
    "/campaigns/{campaign_id}/runs.csv",
    response_class=FileResponse,
    responses={**media_answers("text/csv"), **responses(404, 409, 422)},
)
async def get_campaign_table(ask: Asked, campaign_id: Id) -> Response:
    """Send `runs.csv` of a campaign that has ended."""
    return FileResponse(await ask.do(read_csv, campaign_id), media_type="text/csv", filename="runs.csv")


@router.get(
    "/campaigns/{campaign_id}/report",
    response_class=Response,
    responses={**media_answers("text/html"), **responses(404, 409, 422)},
)
async def get_campaign_report(ask: Asked, campaign_id: Id) -> Response:
    """Report a campaign on one page that loads nothing: distribution, tree, failures, convergence."""
    text = await ask.do(report_campaign, campaign_id)
    headers = {"Content-Security-Policy": SEALED}
    return Response(text, media_type="text/html; charset=utf-8", headers=headers)
