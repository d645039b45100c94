"""Endpoints: reports of plans and runs."""

from __future__ import annotations

from typing import Literal

from starlette.responses import Response

from ground.api.context import SEALED, Asked, Id, api_router, media_answers
from ground.api.problems import responses
from ground.resources.reports.draw_plan import draw_plan as draw_plan_use_case
from ground.resources.reports.report_plan import report_plan
from ground.resources.reports.report_run import report_run

router = api_router("exchange")


@router.get(
    "/plans/{plan_id}/drawing",
    response_class=Response,
    responses={**media_answers("image/svg+xml", "text/vnd.graphviz"), **responses(404, 409, 422)},
)
async def draw_plan(ask: Asked, plan_id: Id, form: Literal["svg", "dot"] = "svg") -> Response:
    """Draw the plan tree as SVG, or give it as DOT."""
    text = await ask.do(draw_plan_use_case, plan_id, form=form)
    media = "image/svg+xml" if form == "svg" else "text/vnd.graphviz"
    return Response(text, media_type=media, headers={"Content-Security-Policy": SEALED})


@router.get(
    "/plans/{plan_id}/report",
    response_class=Response,
    responses={**media_answers("text/html"), **responses(404, 409, 422)},
)
async def get_plan_report(ask: Asked, plan_id: Id) -> Response:
    """Report a plan before its run on one page that loads nothing: map, tree, odds, budgets, rules."""
    text = await ask.do(report_plan, plan_id)
    headers = {"Content-Security-Policy": SEALED}
    return Response(text, media_type="text/html; charset=utf-8", headers=headers)


@router.get(
    "/runs/{run_id}/report",
    response_class=Response,
    responses={**media_answers("text/html"), **responses(404, 409, 422)},
)
async def get_run_report(ask: Asked, run_id: Id) -> Response:
    """Report a run on one page that loads nothing: map, plan tree, odds, requests and what came back."""
    text = await ask.do(report_run, run_id)
    headers = {"Content-Security-Policy": SEALED}
    return Response(text, media_type="text/html; charset=utf-8", headers=headers)
