"""Data products are announced and can be fetched as the rover makes them, and stay the same afterwards."""

from __future__ import annotations

import hashlib
import json
import threading
from typing import Any

from ground.resources.runs.kind import RUN
from tests.ground.conftest import Api
from tests.ground.planning import PlannedDay
from tests.ground.test_control_run import _over, _until
from tests.ground.test_missions_api import problem
from tests.ground.test_packed_runs import lines_of


def _announced(api: Api, run_id: str) -> list[dict[str, Any]]:
    """Return the products in the run's event stream; it ends with the run."""
    text = api("GET", f"/runs/{run_id}/events").text
    events = [
        dict(line.split(": ", 1) for line in block.splitlines()) for block in text.split("\n\n") if block
    ]
    return [json.loads(e["data"]) for e in events if e.get("event") == "product"]


def test_products_can_be_fetched_while_the_run_goes_on_and_keep_their_ids(
    sqlite_planned_day: PlannedDay,
) -> None:
    from ground.records.actor import SYSTEM_ACTOR
    from ground.records.get_resource import get_resource

    api, mission, plan = sqlite_planned_day.api, sqlite_planned_day.mission, sqlite_planned_day.plan
    run_id = api.post(f"/missions/{mission.id}/runs", {"plan_id": plan["id"], "pace": 3000.0}, status=202)[
        "subject_id"
    ]
    run = get_resource(api.repo, SYSTEM_ACTOR, RUN, run_id)

    def made() -> list[Any]:
        return [data for kind, data in lines_of(api.repo, run) if kind == "product"]

    worker = threading.Thread(target=api.jobs)
    worker.start()
    try:
        first = _until(made)[0]
        api.post(f"/runs/{run_id}/control", {"paused": True}, status=200)
        assert api.get(f"/runs/{run_id}")["state"] == "running"
        assert api.get(f"/missions/{mission.id}/products?run_id={run_id}")["items"] == []
        assert first.file_url == f"/api/v1/runs/{run_id}/products/{first.id}/file"
        path = first.file_url.removeprefix("/api/v1")
        sent = api("GET", path)
        assert sent.status_code == 200
        assert hashlib.sha256(sent.content).hexdigest() == first.sha256
        assert sent.headers["etag"] == f'"{first.sha256}"'
        assert len(sent.content) == first.size_bytes
        unknown = api("GET", path.replace(first.id, "prd-000000000000"))
        assert "has made no product" in problem(unknown, 404, "not-found")["detail"]
        api.post(f"/runs/{run_id}/control", {"paused": False, "pace": 0.0}, status=200)
        _until(lambda: _over(api, run_id))
    finally:
        worker.join(60.0)
    kept = {p["id"]: p for p in api.get(f"/missions/{mission.id}/products?run_id={run_id}")["items"]}
    announced = _announced(api, run_id)
    assert {p["id"] for p in announced} == set(kept)
    assert len(kept) > 1
    for product in announced:
        for name in (
            "request_id",
            "target_id",
            "task_id",
            "sha256",
            "kind",
            "media",
            "label",
            "orphan",
            "t_s",
        ):
            assert product[name] == kept[product["id"]][name], name
    assert any(p["request_id"] for p in announced)
    assert api("GET", path).content == sent.content, "the address stays good"
