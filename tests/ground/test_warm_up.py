"""The planner gets ready beside the server, which does not wait for it."""

from __future__ import annotations

import logging
import threading

import anyio
import httpx
import pytest

import ground.app.service
from ground.app import warm_up as module
from ground.app.service import build_app
from ground.gdr.repository import Repository


def test_the_small_day_is_planned_and_asked_about() -> None:
    from planner.problem import problem_from_dict
    from planner.solve import PlanStatus, solve

    assert module.warm_up() > 0.0
    result = solve(problem_from_dict(module.small_day()), max_branches=2, iterations=1, seed=1)
    assert result.status is PlanStatus.PLANNED, "a day without a plan would leave kernels cold"


def test_the_server_answers_while_the_planner_gets_ready(
    sqlite_repo: Repository, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun, go_on = threading.Event(), threading.Event()

    def slow() -> None:
        begun.set()
        go_on.wait(30.0)

    monkeypatch.setattr(ground.app.service, "warm_up_quietly", slow)
    app = build_app(sqlite_repo, with_worker=False, warm=True)

    async def asked() -> int:
        transport = httpx.ASGITransport(app=app)
        async with (
            app.router.lifespan_context(app),
            httpx.AsyncClient(transport=transport, base_url="http://testserver") as client,
        ):
            assert await anyio.to_thread.run_sync(begun.wait, 10.0)
            return (await client.get("/healthz")).status_code

    try:
        assert anyio.run(asked) == 200
    finally:
        go_on.set()


def test_what_goes_wrong_is_logged_and_keeps_nobody_from_working(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def broken() -> float:
        raise RuntimeError("no such kernel")

    monkeypatch.setattr(module, "warm_up", broken)
    with caplog.at_level(logging.ERROR):
        module.warm_up_quietly()
    assert "could not be warmed up" in caplog.text
