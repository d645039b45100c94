"""Whether the service lives, is ready, and how it fares."""

from __future__ import annotations

import shutil
from importlib.metadata import version

from fastapi import APIRouter, Request
from prometheus_client import CONTENT_TYPE_LATEST, generate_latest
from pydantic import BaseModel
from sqlalchemy import func, select
from sqlalchemy.exc import SQLAlchemyError
from starlette.responses import Response

from ground.api.context import Repo, answer, call, operation_id
from ground.api.metrics import (
    DATABASE_SIZE,
    DISK_FREE,
    ENGINE_FAILURES,
    ENGINE_UP,
    EVENTS,
    FAULTS,
    JOB_WAIT,
    JOBS,
    MISSIONS,
    PRODUCTS_SIZE,
    REGISTRY,
    SINCE,
    WORKER_UP,
    WORKERS,
)
from ground.api.problems import problem, responses
from ground.app.check_readiness import DEGRADED, OK, check_readiness
from ground.gdr.base import utc_now
from ground.gdr.history import ChainRow
from ground.gdr.repository import Repository
from ground.jobs.presence import present
from ground.jobs.row import JobRow
from ground.jobs.worker import Worker
from ground.resources.missions.row import MissionRow
from ground.resources.products.row import ProductRow
from ground.resources.upkeep.noted import ACTS, noted


def exposition(repo: Repository, worker: Worker | None = None) -> tuple[bytes, str]:
    """Return the metrics as text and their media type."""
    if worker is not None:
        ENGINE_UP.set(0.0 if worker.engine.trouble else 1.0)
        ENGINE_FAILURES.set(worker.engine.failures)
        WORKER_UP.set(1.0 if worker.alive else 0.0)
    there = present(repo.job_dir())
    WORKERS.labels("down").set(sum(bool(p.trouble) for p in there))
    WORKERS.labels("up").set(sum(not p.trouble for p in there))
    with repo.database.read() as session:
        JOBS.clear()
        for kind, state, count in session.execute(
            select(JobRow.kind, JobRow.state, func.count()).group_by(JobRow.kind, JobRow.state)
        ):
            JOBS.labels(kind, state).set(count)
        MISSIONS.set(session.scalar(select(func.count()).select_from(MissionRow)) or 0)
        oldest = session.scalar(select(func.min(JobRow.created_utc)).where(JobRow.state == "queued"))
        JOB_WAIT.set(0.0 if oldest is None else (utc_now() - oldest).total_seconds())
        PRODUCTS_SIZE.set(session.scalar(select(func.sum(ProductRow.size_bytes))) or 0)
        EVENTS.set(session.scalar(select(func.sum(ChainRow.seq))) or 0)
    DATABASE_SIZE.set(repo.database.size_bytes())
    DISK_FREE.set(shutil.disk_usage(repo.data_dir).free)
    for act in ACTS:
        last = noted(repo, act)
        if last is not None:
            SINCE.labels(act).set((utc_now() - last[0]).total_seconds())
            FAULTS.labels(act).set(last[1])
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
    """Say whether the database answers, is migrated, and the data folder takes files.

    `degraded` answers requests, but its worker's engine is away: jobs wait.
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
    content, media = await call(exposition, repo, request.app.state.worker)
    return Response(content, media_type=media)
