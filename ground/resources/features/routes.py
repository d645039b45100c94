"""Endpoints: OGC API Features of a mission."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated
from urllib.parse import urlencode

import orjson
from fastapi import Path, Query, Request
from starlette.responses import Response

from ground.api.context import Asked, Id, api_router, media_answers
from ground.api.problems import responses
from ground.api.strict_queries import StrictRoute
from ground.resources.features.collections import collection_of
from ground.resources.features.describe_collections import describe_site
from ground.resources.features.documents import (
    GEOJSON,
    JSON,
    SCHEMA,
    collection_page,
    collections_page,
    conformance,
    item_page,
    items_page,
    landing_page,
    queryables,
)
from ground.resources.features.select_features import MOST, Question, select_features
from ground.resources.features.select_features import get_feature as get_feature_use_case
from neighbours.geodata.cql2.words import MAX_TEXT

router = api_router("features", route_class=StrictRoute)
ROOT = "/missions/{mission_id}/features"
HERE = f"{ROOT}/collections/{{collection_id}}"
CollectionId = Annotated[str, Path(pattern=r"^[a-z-]{1,40}$", examples=["targets"])]
FeatureId = Annotated[str, Path(pattern=r"^[A-Za-z0-9_.-]{1,60}$", examples=["tgt-1qep8e5zsqmg5"])]
Uri = Annotated[str | None, Query(max_length=200, description="URI of one of the collection's `crs`")]
ANSWERS = responses(400, 404, 409, 503)


def sent(document: Mapping[str, object], media: str = JSON, reference: str | None = None) -> Response:
    """Answer with a document; `reference` is the URI of that of its coordinates."""
    headers = None if reference is None else {"Content-Crs": f"<{reference}>"}
    return Response(orjson.dumps(document), media_type=media, headers=headers)


def root_of(request: Request, mission_id: str) -> str:
    """Return the address of a mission's landing page."""
    base = f"{request.url.scheme}://{request.url.netloc}{request.url.path.partition('/missions/')[0]}"
    return f"{base}{ROOT.format(mission_id=mission_id)}"


@router.get(ROOT, response_class=Response, responses={**media_answers(JSON), **ANSWERS})
async def get_features_landing_page(ask: Asked, request: Request, mission_id: Id) -> Response:
    """Where a GIS begins (OGC API Features): links to conformance, collections and this interface."""
    name, body, _, _ = await ask.do(describe_site, mission_id)
    root = root_of(request, mission_id)
    api = f"{root.partition('/missions/')[0]}/openapi.json"
    return sent(landing_page(root, api, name, body))


@router.get(f"{ROOT}/conformance", response_class=Response, responses={**media_answers(JSON), **ANSWERS})
async def get_features_conformance(ask: Asked, mission_id: Id) -> Response:
    """Tell which classes of OGC API Features and CQL2 are kept."""
    await ask.do(describe_site, mission_id)
    return sent(conformance())


@router.get(f"{ROOT}/collections", response_class=Response, responses={**media_answers(JSON), **ANSWERS})
async def get_feature_collections(ask: Asked, request: Request, mission_id: Id) -> Response:
    """Tell the collections: targets, keep-outs, traverses, footprints, ribbons of plans, runs."""
    _, _, place, bounds = await ask.do(describe_site, mission_id)
    return sent(collections_page(root_of(request, mission_id), place, bounds))


@router.get(HERE, response_class=Response, responses={**media_answers(JSON), **ANSWERS})
async def get_feature_collection(
    ask: Asked, request: Request, mission_id: Id, collection_id: CollectionId
) -> Response:
    """Tell of one collection: extent, references, links."""
    _, _, place, bounds = await ask.do(describe_site, mission_id)
    collection, _ = collection_of(collection_id)
    return sent(collection_page(root_of(request, mission_id), collection, place, bounds))


@router.get(f"{HERE}/queryables", response_class=Response, responses={**media_answers(SCHEMA), **ANSWERS})
async def get_feature_queryables(
    ask: Asked, request: Request, mission_id: Id, collection_id: CollectionId
) -> Response:
    """Tell what a filter on a collection may name, as a JSON Schema."""
    await ask.do(describe_site, mission_id)
    collection, _ = collection_of(collection_id)
    url = f"{root_of(request, mission_id)}/collections/{collection.id}/queryables"
    return sent(queryables(url, collection), SCHEMA)


@router.get(f"{HERE}/items", response_class=Response, responses={**media_answers(GEOJSON), **ANSWERS})
async def get_features(
    ask: Asked,
    request: Request,
    mission_id: Id,
    collection_id: CollectionId,
    limit: Annotated[
        int,
        Query(
            ge=1,
            description="how many at most; more than the maximum is the maximum",
            json_schema_extra={"maximum": MOST},
        ),
    ] = 10,
    cursor: Annotated[
        str | None, Query(pattern=r"^[A-Za-z0-9_.-]{1,60}$", description="that of the link `next`")
    ] = None,
    bbox: Annotated[
        str | None, Query(max_length=400, description="west,south,east,north in the order of bbox-crs")
    ] = None,
    bbox_crs: Annotated[Uri, Query(alias="bbox-crs")] = None,
    datetime: Annotated[
        str | None,
        Query(max_length=100, description="2026-11-22T10:00:00Z, or two of them with / between; .. is open"),
    ] = None,
    crs: Uri = None,
    filter_text: Annotated[
        str | None, Query(alias="filter", max_length=MAX_TEXT, description="CQL2 text")
    ] = None,
    filter_lang: Annotated[
        str | None, Query(alias="filter-lang", max_length=40, description="`cql2-text`")
    ] = None,
    filter_crs: Annotated[Uri, Query(alias="filter-crs")] = None,
) -> Response:
    """Send features as GeoJSON, by box, time and CQL2 filter, in any of the collection's references."""
    asked = Question(limit, cursor, bbox, bbox_crs, datetime, crs, filter_text, filter_lang, filter_crs)
    found = await ask.do(select_features, mission_id, collection_id, asked)
    here = f"{root_of(request, mission_id)}/collections/{collection_id}"
    behind = None
    if found.after is not None:
        others = [(k, v) for k, v in request.query_params.multi_items() if k != "cursor"]
        behind = f"{here}/items?{urlencode([*others, ('cursor', found.after)])}"
    page = items_page(found, here, str(request.url), behind)
    return sent(page, GEOJSON, found.reference)


@router.get(
    f"{HERE}/items/{{feature_id}}",
    response_class=Response,
    responses={**media_answers(GEOJSON), **ANSWERS},
)
async def get_feature(
    ask: Asked,
    request: Request,
    mission_id: Id,
    collection_id: CollectionId,
    feature_id: FeatureId,
    crs: Uri = None,
) -> Response:
    """Send one feature as GeoJSON."""
    found = await ask.do(get_feature_use_case, mission_id, collection_id, feature_id, crs)
    here = f"{root_of(request, mission_id)}/collections/{collection_id}"
    return sent(item_page(found, here, str(request.url)), GEOJSON, found.reference)
