"""Endpoint: how the service fares."""

from __future__ import annotations

from fastapi import Request
from starlette.responses import Response

from ground.api.context import Asked, answer, api_router
from ground.resources.operations.read_operations import read_operations
from ground.resources.operations.value import ServiceStatus

router = api_router("operations")


@router.get("/operations", response_model=ServiceStatus)
async def get_operations(ask: Asked, request: Request) -> Response:
    """Read how the service fares: workers, queue, slowest jobs, disk, backups and checks (administrators)."""
    state = request.app.state
    return answer(await ask.do(read_operations, state.job_kinds, state.store_size))
