"""The sheet *Operations*: an administrator sees how the service fares, others have no way to it."""

from __future__ import annotations

import json
import re
from typing import Any

import pytest
from playwright.sync_api import Page, Route, expect

from tests.web.conftest import Server
from tests.web.page import chromium, open_page, shot
from tests.web.test_traverse import axe

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.xdist_group("browser")]

TROUBLE = (
    "OSError: the Dask scheduler tcp://10.0.0.7:8786 does not answer since 2026-11-23T09:00:00Z, tried again"
)


def work_as(page: Page, person: str) -> None:
    page.get_by_test_id("person").select_option(person)


def crowded(told: dict[str, Any]) -> dict[str, Any]:
    """Return what a service says that is busy and not well."""
    job = {
        "id": "job-1", "kind": "generate_plan", "state": "running", "mission_id": "msn-1",
        "mission_name": "A survey of three hundred targets on the eastern slope", "position": None,
        "took_s": 754.0, "attempt": 2, "progress": 0.42, "worker": "planner-7:1234",
        "message": "its engine failed (OSError: the Dask scheduler does not answer); queued again",
    }  # fmt: skip
    waits = {**job, "state": "queued", "progress": 0.0}
    well = {"name": "planner-8:99", "executor": "process", "running": 0, "heard_s": 41.0, "trouble": ""}
    lost = {**well, "name": "planner-7:1234", "executor": "distributed", "running": 1, "trouble": TROUBLE}
    line = {name: job[name] for name in ("kind", "mission_id", "mission_name")}
    return {
        **told,
        "workers": [lost, well],
        "backlog": [{**line, "waiting": 30, "running": 1}],
        "running": [job],
        "waiting": [{**waits, "id": f"job-w{k}", "position": k, "took_s": 40.0 * k} for k in (1, 2, 3)],
        "slowest": [{**job, "id": f"job-s{k}", "state": ("succeeded", "failed")[k % 2]} for k in range(10)],
        "upkeep": [
            {"act": "backup", "at_utc": "2026-01-01T00:00:00Z", "faults": 0},
            {"act": "audit", "at_utc": told["at_utc"], "faults": 2},
            {"act": "contents", "at_utc": None, "faults": None},
        ],
        "disk": {**told["disk"], "free_bytes": 2 * 2**30, "size_bytes": 2**40, "store_bytes": None},
    }  # fmt: skip


def test_an_administrator_sees_workers_queue_disk_and_upkeep(server: Server) -> None:
    with chromium() as browser, open_page(browser, server, "?webgl=off") as page:
        expect(page.get_by_test_id("operate")).to_have_count(0)
        work_as(page, "Administrator")
        page.get_by_test_id("operate").click()
        sheet = page.get_by_test_id("operations")
        expect(sheet.get_by_text("takes work")).to_be_visible()
        expect(sheet).to_contain_text("Queue: 0 waiting, 0 running")
        expect(sheet).to_contain_text(re.compile(r"Free.* of .*GiB"))
        expect(sheet).to_contain_text(re.compile(r"Backup\s*never\s*:\s*outcrop backup FILE"))
        expect(sheet.get_by_text("being counted")).to_have_count(0)  # it is read anew
        assert axe(page) == []
        shot(page, "operations")
        page.keyboard.press("Escape")
        expect(sheet).to_have_count(0)
        work_as(page, "Planner")
        expect(page.get_by_test_id("operate")).to_have_count(0)


@pytest.mark.parametrize("width", [1440, 700])
def test_a_busy_service_that_is_not_well_fits_into_the_window(server: Server, width: int) -> None:
    def busy(route: Route) -> None:
        route.fulfill(body=json.dumps(crowded(route.fetch().json())), content_type="application/json")

    with chromium() as browser, open_page(browser, server, "?webgl=off") as page:
        page.route("**/api/v1/operations", busy)
        work_as(page, "Administrator")
        page.set_viewport_size({"width": width, "height": 900})
        page.get_by_test_id("operate").click()
        sheet = page.get_by_test_id("operations")
        expect(sheet.get_by_text(TROUBLE)).to_be_visible()
        expect(sheet).to_contain_text("Queue: 30 waiting, 1 running")
        expect(sheet.get_by_role("row", name=re.compile("^3 generate plan"))).to_be_visible()
        expect(sheet).to_contain_text("2 faults")
        expect(sheet.get_by_text("being counted")).to_be_visible()
        dialog = page.get_by_role("dialog", name="Operations")
        assert dialog.evaluate("d => d.scrollWidth <= d.clientWidth"), "nothing is cut off at the right"
        assert axe(page) == []
        if width == 1440:
            shot(page, "operations-busy")
