"""Whether the service lives, is ready, and how it fares."""

from __future__ import annotations

from importlib.metadata import version

from fastapi import APIRouter, Request
from pydantic import BaseModel
from sqlalchemy.exc import SQLAlchemyError
from starlette.responses import Response

from ground.api.context import Repo, answer, call, operation_id
from ground.api.problems import problem, responses
from ground.app.check_readiness import DEGRADED, OK, check_readiness
from ground.app.exposition import exposition

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
    """Say whether the database answers, is migrated, and the data folder takes files.

    `degraded` answers requests, but its worker's engine is away, and jobs wait, or the object store is, and
    files cannot be sent or taken in.
    """
    try:
        checks = await call(check_readiness, repo, request.app.state.worker)
    except SQLAlchemyError as err:
        checks = {"database": type(err).__name__}
    degraded = any(word.startswith(DEGRADED) for word in checks.values())
    ready = all(word == OK or word.startswith(DEGRADED) for word in checks.values())
    status = "not ready" if not ready else "degraded" if degraded else OK
    content = {"status": status, "version": version("outcrop"), "checks": checks}
    if ready:
        return answer(content)

    detail = "; ".join(f"{name}: {word}" for name, word in checks.items() if word != "ok")
    return problem(503, "unavailable", "Not ready", detail, instance=request.url.path)


@router.get("/metrics", response_class=Response, responses={200: {"content": {"text/plain": {}}}})
async def metrics(repo: Repo, request: Request) -> Response:
    """Give counters and gauges in the form of Prometheus."""
    state = request.app.state
    content, media = await call(exposition, repo, state.store_size, state.worker)
    return Response(content, media_type=media)
