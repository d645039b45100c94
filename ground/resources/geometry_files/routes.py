"""Endpoints: files of targets and keep-outs."""

from __future__ import annotations

from typing import Annotated, Literal

from fastapi import Query
from starlette.responses import Response

from ground.api.context import Asked, Crs, Id, answer, api_router, attachment, media_answers
from ground.api.problems import responses
from ground.resources.geometry_files.bodies import GeometryImport
from ground.resources.geometry_files.exchange_geometry import export_geometry as export_geometry_use_case
from ground.resources.geometry_files.exchange_geometry import import_geometry as import_geometry_use_case
from ground.resources.geometry_files.value import ImportedGeometry

router = api_router("exchange")
MEDIA = {
    "geojson": "application/geo+json",
    "csv": "text/csv",
    "gpkg": "application/geopackage+sqlite3",
    "kml": "application/vnd.google-earth.kml+xml",
    "gpx": "application/gpx+xml",
}

Lines = Annotated[
    bool, Query(description="also traverses and ribbons of plans: in GeoPackage, KML and GPX as lines")
]


@router.get(
    "/missions/{mission_id}/geometry",
    response_class=Response,
    responses={**media_answers(*MEDIA.values()), **responses(404, 422, 503)},
)
async def export_geometry(
    ask: Asked,
    mission_id: Id,
    form: Literal["geojson", "csv", "gpkg", "kml", "gpx"] = "geojson",
    crs: Crs | None = None,
    lines: Lines = False,
) -> Response:
    """Send all targets and keep-outs as GeoJSON, CSV, GeoPackage, KML or GPX, in any reference; the last
    three with `lines` also traverses and the ribbons of plans.
    """
    content = await ask.do(export_geometry_use_case, mission_id, form=form, crs=crs, lines=lines)
    media = MEDIA[form] + ("; charset=utf-8" if form == "csv" else "")
    return Response(content, media_type=media, headers=attachment(f"{mission_id}.{form}"))


@router.post(
    "/missions/{mission_id}/geometry",
    response_model=ImportedGeometry,
    status_code=201,
    responses=responses(400, 404, 422, 503),
)
async def import_geometry(ask: Asked, mission_id: Id, body: GeometryImport) -> Response:
    """Take in targets and keep-outs from an uploaded GeoJSON, CSV, GeoPackage, KML or GPX file: all of them,
    or none with the rows that are wrong.
    """
    return answer(await ask.do(import_geometry_use_case, mission_id, body.upload_id, body.crs), 201)
