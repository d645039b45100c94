"""Endpoints: data products."""

from __future__ import annotations

from starlette.requests import Request
from starlette.responses import FileResponse, Response

from ground.api.context import PRODUCT_FILE, Asked, Id, product_file
from ground.api.parts import wants_part
from ground.api.problems import responses
from ground.api.resource_routes import resource_routes
from ground.resources.products.kind import PRODUCT
from ground.resources.products.read_product import read_product

router = resource_routes(
    PRODUCT,
    "runs",
    lists="List data products by run, target or request; `orphan=true` lists those that match no request.",
    where={"orphan": bool | None},
    reads="Read what is known of a data product.",
)


@router.get(
    "/products/{product_id}/file",
    response_class=FileResponse,
    responses={**PRODUCT_FILE, **responses(404, 422)},
)
async def get_product_file(ask: Asked, product_id: Id, request: Request) -> Response:
    """Send the file of a data product; its ETag is the SHA-256 of the content."""
    asked = request.headers
    return product_file(asked, *await ask.do(read_product, product_id, in_parts=wants_part(asked)))
