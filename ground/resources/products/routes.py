"""Endpoints: data products."""

from __future__ import annotations

from starlette.responses import FileResponse, Response

from ground.api.context import PRODUCT_FILE, Asked, Cursor, FilterId, Id, Limit, api_router, product_file
from ground.api.problems import responses
from ground.records.forms import Page
from ground.resources.products.read_product import read_product
from ground.resources.products.value import Product

router = api_router("runs")


@router.get("/missions/{mission_id}/products", response_model=Page[Product], responses=responses(404, 422))
async def list_products(
    ask: Asked,
    mission_id: Id,
    limit: Limit = 100,
    cursor: Cursor = None,
    run_id: FilterId = None,
    target_id: FilterId = None,
    request_id: FilterId = None,
    orphan: bool | None = None,
) -> Response:
    """List data products by run, target or request; `orphan=true` lists those that match no request."""
    where = {"run_id": run_id, "target_id": target_id, "request_id": request_id, "orphan": orphan}
    return await ask.page("product", mission_id, limit, cursor, where)


@router.get("/products/{product_id}", response_model=Product, responses=responses(404, 422))
async def get_product(ask: Asked, product_id: Id) -> Response:
    """Read what is known of a data product."""
    return await ask.one("product", product_id)


@router.get(
    "/products/{product_id}/file",
    response_class=FileResponse,
    responses={**PRODUCT_FILE, **responses(404, 422)},
)
async def get_product_file(ask: Asked, product_id: Id) -> Response:
    """Send the file of a data product; its ETag is the SHA-256 of the content."""
    return product_file(*await ask.do(read_product, product_id))
