"""Send the data products of a run as one archive."""

from __future__ import annotations

from starlette.responses import Response

from ground.api.context import ZIP, Asked, Id, api_router, archive
from ground.api.problems import responses
from ground.resources.runs.export_products import export_products as export_products_use_case

router = api_router("exchange")


@router.get("/runs/{run_id}/products", response_class=Response, responses={**ZIP, **responses(404, 422)})
async def export_products(ask: Asked, run_id: Id) -> Response:
    """Send the data products of a run as a zip with a manifest of hashes, tasks, requests and targets."""
    return await archive(
        f"{run_id}-products.zip", lambda target: ask.do(export_products_use_case, run_id, target)
    )
