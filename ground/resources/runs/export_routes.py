"""Send the data products of a run as one archive."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

from starlette.background import BackgroundTask
from starlette.responses import FileResponse, Response

from ground.api.context import Asked, Id, api_router
from ground.api.problems import responses
from ground.resources.runs.export_products import export_products as export_products_use_case

router = api_router("exchange")


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
    folder = Path(tempfile.mkdtemp(prefix="outcrop-products-"))
    target = folder / f"{run_id}-products.zip"
    try:
        await ask.do(export_products_use_case, run_id, target)
    except BaseException:
        shutil.rmtree(folder)
        raise
    tidy = BackgroundTask(shutil.rmtree, folder)
    return FileResponse(target, media_type="application/zip", filename=target.name, background=tidy)
