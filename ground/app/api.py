"""The FastAPI application: routers, problem documents, middleware."""

from __future__ import annotations

from importlib.metadata import version
from typing import Any, cast

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi

from ground.api import problems as problem_answers
from ground.api.context import PREFIX
from ground.api.openapi_form import OpenApi
from ground.app import health
from ground.app.openapi_details import describe
from ground.resources.approvals.routes import router as approvals
from ground.resources.calibrations.routes import router as calibrations
from ground.resources.campaigns.routes import router as campaigns
from ground.resources.comments.routes import router as comments
from ground.resources.downlinks.routes import router as ingest
from ground.resources.drafts.routes import router as drafts
from ground.resources.executions.routes import router as executions
from ground.resources.features.routes import router as features
from ground.resources.frames.routes import router as frames
from ground.resources.geometry_files.routes import router as geometry_files
from ground.resources.history.routes import router as history
from ground.resources.jobs.routes import router as jobs
from ground.resources.keep_outs.routes import router as keep_outs
from ground.resources.lineage.routes import router as lineage
from ground.resources.mission_archives.routes import router as mission_archives
from ground.resources.mission_merges.routes import router as mission_merges
from ground.resources.mission_setup.routes import router as mission_setup
from ground.resources.missions.routes import router as missions
from ground.resources.observation_requests.routes import router as observation_requests
from ground.resources.operations.routes import router as operations
from ground.resources.packages.routes import router as packages
from ground.resources.path_networks.routes import router as path_networks
from ground.resources.people.routes import router as people
from ground.resources.plans.routes import router as plans
from ground.resources.presence.routes import router as presence
from ground.resources.problems.routes import router as problems
from ground.resources.products.routes import router as products
from ground.resources.reports.routes import router as reports
from ground.resources.rovers.routes import router as rovers
from ground.resources.runs.export_routes import router as product_files
from ground.resources.runs.routes import router as runs
from ground.resources.site_maps.routes import router as site_maps
from ground.resources.site_views.routes import router as site_views
from ground.resources.sols.routes import router as sols
from ground.resources.solutions.routes import router as solutions
from ground.resources.stac.routes import router as stac
from ground.resources.targets.routes import router as targets
from ground.resources.traverses.routes import router as traverses
from ground.resources.uploads.routes import router as uploads
from ground.resources.webhooks.routes import router as webhooks

ROUTERS = (
    targets,
    missions,
    mission_setup,
    mission_merges,
    sols,
    observation_requests,
    keep_outs,
    site_views,
    comments,
    drafts,
    path_networks,
    problems,
    plans,
    runs,
    campaigns,
    approvals,
    packages,
    geometry_files,
    stac,
    features,
    reports,
    frames,
    solutions,
    site_maps,
    traverses,
    jobs,
    rovers,
    uploads,
    people,
    products,
    calibrations,
    history,
    lineage,
    mission_archives,
    ingest,
    executions,
    product_files,
    webhooks,
    operations,
    presence,
)
"""Those asked most come first: a request is checked against one route after the other."""

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
    for router in ROUTERS:
        app.router.routes.extend(router.routes)
    app.router.routes.extend(health.router.routes)
    problem_answers.install(app)
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
        form = cast("OpenApi", document)
        problem_answers.state_once(form)
        describe(form)
        app.openapi_schema = document
    return app.openapi_schema
