"""Files in and out: targets and keep-outs, drawings of plans, products, reports of plans and runs."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path
from typing import Any, Literal

from starlette.background import BackgroundTask
from starlette.responses import FileResponse, Response

from ground.api.context import Asked, Id, answer, api_router
from ground.api.problems import responses
from ground.api.schemas import GeometryImport
from ground.gdr import values as v

router = api_router("exchange")
SEALED = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; sandbox"


def _as(*media: str) -> dict[int | str, dict[str, Any]]:
    return {
        200: {
            "content": {
                kind: {"schema": {"type": "object" if kind.endswith("json") else "string"}} for kind in media
            }
        }
    }


def _attachment(name: str) -> dict[str, str]:
    return {"Content-Disposition": f'attachment; filename="{name}"'}


@router.get(
    "/missions/{mission_id}/geometry",
    response_class=Response,
    responses={**_as("application/geo+json", "text/csv"), **responses(404, 422)},
)
async def export_geometry(
    ask: Asked, mission_id: Id, form: Literal["geojson", "csv"] = "geojson"
) -> Response:
    """Send all targets and keep-outs as GeoJSON in site metres or as CSV."""
    from ground.services.exchange_geometry import export_geometry

    content = await ask.do(export_geometry, mission_id, form=form)
    media = "text/csv; charset=utf-8" if form == "csv" else "application/geo+json"
    return Response(content, media_type=media, headers=_attachment(f"{mission_id}.{form}"))


@router.post(
    "/missions/{mission_id}/geometry",
    response_model=v.ImportedGeometry,
    status_code=201,
    responses=responses(400, 404, 413, 422),
)
async def import_geometry(ask: Asked, mission_id: Id, body: GeometryImport) -> Response:
    """Take in targets and keep-outs from an uploaded GeoJSON or CSV file: all of them, or none with the rows
    that are wrong."""
    from ground.services.exchange_geometry import import_geometry

    return answer(await ask.do(import_geometry, mission_id, body.upload_id), 201)


@router.get(
    "/plans/{plan_id}/drawing",
    response_class=Response,
    responses={**_as("image/svg+xml", "text/vnd.graphviz"), **responses(404, 409, 422)},
)
async def draw_plan(ask: Asked, plan_id: Id, form: Literal["svg", "dot"] = "svg") -> Response:
    """Draw the plan tree as SVG, or give it as DOT."""
    from ground.services.draw_plan import draw_plan

    text = await ask.do(draw_plan, plan_id, form=form)
    media = "image/svg+xml" if form == "svg" else "text/vnd.graphviz"
    return Response(text, media_type=media, headers={"Content-Security-Policy": SEALED})


@router.get(
    "/plans/{plan_id}/report",
    response_class=Response,
    responses={**_as("text/html"), **responses(404, 409, 422)},
)
async def get_plan_report(ask: Asked, plan_id: Id) -> Response:
    """Report a plan before its run on one page that loads nothing: map, tree, odds, budgets, rules."""
    from ground.services.report_plan import report_plan

    text = await ask.do(report_plan, plan_id)
    headers = {"Content-Security-Policy": SEALED}
    return Response(text, media_type="text/html; charset=utf-8", headers=headers)


@router.get(
    "/runs/{run_id}/products",
    response_class=Response,
    responses={
        200: {"content": {"application/zip": {"schema": {"type": "string", "format": "binary"}}}},
        **responses(404, 422),
    },
)
async def export_products(ask: Asked, run_id: Id) -> Response:
    """Send the data products of a run as a zip with a manifest of hashes, tasks, requests and targets."""
    from ground.services.export_products import export_products

    folder = Path(tempfile.mkdtemp(prefix="outcrop-products-"))
    target = folder / f"{run_id}-products.zip"
    try:
        await ask.do(export_products, run_id, target)
    except BaseException:
        shutil.rmtree(folder)
        raise
    tidy = BackgroundTask(shutil.rmtree, folder)
    return FileResponse(target, media_type="application/zip", filename=target.name, background=tidy)


@router.get(
    "/runs/{run_id}/report",
    response_class=Response,
    responses={**_as("text/html"), **responses(404, 409, 422)},
)
async def get_run_report(ask: Asked, run_id: Id) -> Response:
    """Report a run on one page that loads nothing: map, plan tree, odds, requests and what came back."""
    from ground.services.report_run import report_run

    text = await ask.do(report_run, run_id)
    headers = {"Content-Security-Policy": SEALED}
    return Response(text, media_type="text/html; charset=utf-8", headers=headers)
