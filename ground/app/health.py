"""Whether the service lives, is ready, and how it fares."""

from __future__ import annotations

from importlib.metadata import version

from fastapi import APIRouter, Request
from prometheus_client import CONTENT_TYPE_LATEST, generate_latest
from pydantic import BaseModel
from sqlalchemy import func, select
from sqlalchemy.exc import SQLAlchemyError
from starlette.responses import Response

from ground.api.context import Repo, answer, call, operation_id
from ground.api.metrics import JOBS, MISSIONS, REGISTRY
from ground.api.problems import problem, responses
from ground.app.check_readiness import check_readiness
from ground.gdr.repository import Repository
from ground.jobs.row import JobRow
from ground.resources.missions.row import MissionRow


def exposition(repo: Repository) -> tuple[bytes, str]:
    """Return the metrics as text and their media type."""
    with repo.database.read() as session:
        JOBS.clear()
        for kind, state, count in session.execute(
            select(JobRow.kind, JobRow.state, func.count()).group_by(JobRow.kind, JobRow.state)
        ):
            JOBS.labels(kind, state).set(count)
        MISSIONS.set(session.scalar(select(func.count()).select_from(MissionRow)) or 0)
    return generate_latest(REGISTRY), CONTENT_TYPE_LATEST


router = APIRouter(tags=["operations"], generate_unique_id_function=operation_id)


class Health(BaseModel):
    status: str
    version: str
    checks: dict[str, str] = {}


@router.get("/healthz", response_model=Health)
async def healthz() -> Response:
    """Say that the process answers."""
    return answer({"status": "ok", "version": version("outcrop"), "checks": {}})


@router.get("/readyz", response_model=Health, responses=responses(503))
async def readyz(repo: Repo, request: Request) -> Response:
    """Say whether the database answers, is migrated, and the data folder takes files."""
    try:
        checks = await call(check_readiness, repo)
    except SQLAlchemyError as err:
        checks = {"database": type(err).__name__}
    ready = all(word == "ok" for word in checks.values())
    content = {"status": "ok" if ready else "not ready", "version": version("outcrop"), "checks": checks}
    if ready:
        return answer(content)

    detail = "; ".join(f"{name}: {word}" for name, word in checks.items() if word != "ok")
    return problem(503, "unavailable", "Not ready", detail, instance=request.url.path)


@router.get("/metrics", response_class=Response, responses={200: {"content": {"text/plain": {}}}})
async def metrics(repo: Repo) -> Response:
    """Give counters and gauges in the form of Prometheus."""
    content, media = await call(exposition, repo)
    return Response(content, media_type=media)
