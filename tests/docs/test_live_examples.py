"""The built pages in a real browser: their examples run and are changed there."""

from __future__ import annotations

import functools
import http.server
import json
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page

from tests.executive.test_expand import EXAMPLES
from tests.shared import ROOT
from tests.web.page import chromium

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.xdist_group("browser")]

AXE = ROOT / "web" / "node_modules" / "axe-core" / "axe.min.js"


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_: object) -> None:
        """Say nothing."""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Build the pages as `scripts/docs` does, and serve them."""
    place = tmp_path_factory.mktemp("site")
    shutil.copytree(ROOT / "docs", place / "docs")
    shutil.copy(ROOT / "mkdocs.yml", place)
    tools = Path(sys.executable).parent
    for command in (
        [str(tools / "zensical"), "build"],
        [sys.executable, str(ROOT / "scripts" / "docs_live.py"), "site"],
    ):
        done = subprocess.run(command, cwd=place, capture_output=True, text=True, timeout=300, check=False)
        assert done.returncode == 0, done.stderr[-2000:]
    server = http.server.ThreadingHTTPServer(
        ("127.0.0.1", 0), functools.partial(Quiet, directory=str(place / "site"))
    )
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_address[1]}"
    server.shutdown()
    server.server_close()


def came_of(page: Page, number: int = 0) -> dict[str, Any]:
    """Return what the editor of that number shows, when it has come to rest."""
    panel = page.locator("section.live").nth(number)
    panel.and_(page.locator("[data-state=done]")).wait_for(timeout=120_000)
    found: dict[str, Any] = panel.evaluate("panel => panel.result")
    return found


def test_every_pattern_runs_in_the_page_as_the_page_says(site: str) -> None:
    with chromium() as browser, browser.new_page() as page:
        asked: list[str] = []
        errors: list[str] = []
        page.on("request", lambda request: asked.append(request.url))
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.goto(f"{site}/how-to/crl-patterns/")
        buttons = page.get_by_role("button", name="Run and change it here")
        assert buttons.count() == len(EXAMPLES)
        for number, (title, _, world) in enumerate(EXAMPLES):
            buttons.first.click()
            came = came_of(page, number)
            assert "run" in came, (title, came)
            run = came["run"]
            assert run["events"] == json.loads(world)["trace"], title
        assert errors == []
        assert {url for url in asked if not url.startswith((site, "blob:", "data:"))} == set()


def test_a_plan_that_is_changed_is_checked_and_run_again(site: str) -> None:
    with chromium() as browser, browser.new_page() as page:
        page.goto(f"{site}/how-to/crl-patterns/")
        page.get_by_role("button", name="Run and change it here").first.click()
        assert came_of(page)["run"]["end_time"] == 61
        plan, world = page.locator("section.live textarea").all()
        world.fill('{"actions": {"drive": {"duration": 20}}}')
        page.get_by_text("The plan succeeded after 21 s.").wait_for(timeout=20_000)
        plan.fill(plan.input_value().replace(":duration (0 60)", ":duration (0 -1)"))
        finding = page.locator(".live-findings li.error button").first
        finding.wait_for(timeout=20_000)
        finding.click()
        assert plan.evaluate("area => area === document.activeElement")
        assert came_of(page).get("run") is None
        world.fill('{"actions": ')
        plan.fill(plan.input_value().replace(":duration (0 -1)", ":duration (0 60)"))
        page.get_by_text("the world is not JSON").wait_for(timeout=20_000)
        world.fill("")
        slider = page.get_by_label("Plan time")
        slider.wait_for(timeout=20_000)
        slider.fill("0")
        assert page.locator(".live-events .coming").count() > 0
        page.add_script_tag(path=AXE)
        broken = page.evaluate("async () => (await axe.run('section.live')).violations.map(v => v.id)")
        assert broken == []
