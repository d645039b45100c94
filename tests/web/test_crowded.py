"""Hundreds of targets, long names and narrow windows: nothing leaves the window, everything is reached."""

from __future__ import annotations

import json
import random
from urllib.request import Request, urlopen

import pytest
from playwright.sync_api import Page, expect

from tests.web.conftest import Server
from tests.web.missions import ask, small_mission
from tests.web.page import chromium, open_page, shot

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.xdist_group("browser")]

MANY = 300
LONG = "Contact between the laminated and the massive unit, upper part"
TITLE = "A survey of three hundred targets on the eastern slope of the old outcrop"


def _crowd(server: Server) -> str:
    """Return a mission with 300 targets, every fifth with a long name."""
    mission = small_mission(server, TITLE)
    draw = random.Random(1)
    rows = ["kind,name,east_m,north_m"]
    for k in range(MANY - 3):
        name = f'"{LONG} {k}"' if k % 5 == 0 else f"S{k}"
        rows.append(f"target,{name},{draw.uniform(-15, 15):.2f},{draw.uniform(-14, 14):.2f}")
    upload = Request(
        f"{server}/api/v1/uploads?file_name=survey.csv",
        "\n".join(rows).encode(),
        {"X-Outcrop-Person": "Planner", "Content-Type": "application/octet-stream"},
    )
    with urlopen(upload, timeout=300) as answer:
        found = json.load(answer)
    ask(server, f"/missions/{mission}/geometry", {"upload_id": found["id"]})
    return mission


def _beyond(page: Page) -> list[str]:
    """Return the controls that reach out of the window."""
    found = page.evaluate(
        """() => [...document.querySelectorAll('header button, header select, main button, aside [role=tab]')]
            .filter((e) => e.checkVisibility())
            .filter((e) => {
                const box = e.getBoundingClientRect();
                const scrolls = e.closest('[role=tablist]');
                return box.left < -0.5 || (box.right > innerWidth + 0.5 && scrolls === null);
            })
            .map((e) => e.getAttribute('aria-label') ?? e.textContent.trim())"""
    )
    return [str(name) for name in found]


def test_three_hundred_targets_with_long_names_stay_in_order_on_wide_and_narrow_windows(
    server: Server,
) -> None:
    mission = _crowd(server)
    with chromium() as browser, open_page(browser, server) as page:
        link = page.get_by_role("link", name=TITLE)
        expect(link).to_be_visible()
        assert page.evaluate("() => document.documentElement.scrollWidth <= innerWidth")
        page.goto("about:blank")
        page.goto(f"{server}/?quality=test#/m/{mission}")
        page.wait_for_function("() => document.querySelector('[data-testid=map]')?.dataset.terrain")
        expect(page.get_by_test_id("target-row")).to_have_count(MANY)
        page.get_by_label("Find").fill(f"{LONG} 25")
        row = page.get_by_test_id("target-row").first
        row.click()
        expect(page.get_by_label("Name of the target")).to_have_value(f"{LONG} 25")
        page.get_by_label("Find").fill("")
        expect(page.get_by_test_id("target-seen")).to_contain_text(" m, ")
        shot(page, "many")
        for width, height in ((1440, 900), (1100, 720), (760, 1000)):
            page.set_viewport_size({"width": width, "height": height})
            page.wait_for_timeout(300)
            assert _beyond(page) == [], width
            middle = page.get_by_test_id("map").bounding_box()
            assert middle is not None
            assert middle["width"] > 350, width
        shot(page, "narrow")
