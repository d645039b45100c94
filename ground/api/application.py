"""The FastAPI application: routers, problem documents, middleware."""

from __future__ import annotations

from importlib.metadata import version
from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi

from ground.api import problems
from ground.api.context import PREFIX
from ground.api.routers import (
    comments,
    exchange,
    frames,
    health,
    jobs,
    keep_outs,
    missions,
    observation_requests,
    people,
    planning,
    runs,
    site_views,
    sols,
    targets,
    traverses,
    uploads,
)
from ground.api.routers import uplink as uplink_router

DESCRIPTION = """Plan a rover's day on the ground and carry it out.

Units stand in the names (`_m`, `_s`, `_j`, `_rad`); positions are in the site frame (east, north, up,
metres).
Lists come in pages (`limit`, `cursor`). A change needs the ETag that was read as `If-Match`. Long work
answers 202
with a job, or 200 when `Prefer: wait=N` was enough. Errors are problem documents (RFC 9457)."""


def build_api(**options: Any) -> FastAPI:
    """Return the application without repository and worker: enough for its OpenAPI document."""
    app = FastAPI(
        title="Outcrop",
        version=version("outcrop"),
        description=DESCRIPTION,
        openapi_url=f"{PREFIX}/openapi.json",
        docs_url=None,
        redoc_url=None,
        **options,
    )
    for module in (  # those asked most come first: a request is held against one route after the other
        targets,
        missions,
        sols,
        observation_requests,
        keep_outs,
        site_views,
        comments,
        planning,
        runs,
        uplink_router,
        exchange,
        frames,
        traverses,
        jobs,
        uploads,
        people,
    ):
        app.router.routes.extend(module.router.routes)
    app.router.routes.extend(health.router.routes)
    problems.install(app)
    app.openapi = lambda: _document(app)  # type: ignore[method-assign]
    return app


def _document(app: FastAPI) -> dict[str, Any]:
    if app.openapi_schema is None:
        document = get_openapi(
            title=app.title,
            version=app.version,
            description=app.description,
            routes=app.routes,
            openapi_version="3.1.0",
        )
        problems.state_once(document)
        app.openapi_schema = document
    return app.openapi_schema
