"""The live console: a live run is begun, held, disturbed and stopped on the page."""

from __future__ import annotations

import re

import pytest
from playwright.sync_api import Page, expect

from tests.web.conftest import Server
from tests.web.missions import make_plan
from tests.web.page import chromium, open_demo, open_page, shot
from tests.web.review_steps import become
from tests.web.test_traverse import axe

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.xdist_group("browser")]


def open_planned(page: Page, server: Server) -> None:
    """Open a plan of the demo; how a plan is ordered on the page is not what these tests are about."""
    open_demo(page)
    mission = page.url.partition("#/m/")[2].partition("?")[0]
    plan = make_plan(server, mission)
    page.goto("about:blank")
    page.goto(f"{server.address}/?webgl=off#/m/{mission}?plan={plan}")


def test_a_live_run_is_held_disturbed_and_stopped_on_the_page(server: Server) -> None:
    with chromium() as browser, open_page(browser, server, "?webgl=off") as page:
        open_planned(page, server)
        stop = page.get_by_test_id("live-stop")
        expect(stop).to_have_count(0)
        page.get_by_role("tab", name="Run").click()
        page.get_by_test_id("live").check()
        page.get_by_test_id("rate").select_option("1")
        page.get_by_test_id("start-run").click()

        console = page.get_by_test_id("live-console")
        expect(page.get_by_test_id("link")).to_contain_text(re.compile("link up, last word"))
        expect(page.get_by_test_id("link")).to_have_attribute("data-tone", "ok")
        expect(console.get_by_role("listitem").first).to_be_visible()  # a command is under way
        expect(page.get_by_label("Pace of the run")).to_have_count(0)  # its pace is its rover's

        page.get_by_test_id("hold").click()
        live = page.get_by_test_id("live-run")
        expect(live).to_have_attribute("data-held", "true")
        page.get_by_test_id("step-run").click()
        expect(live).to_have_attribute("data-held", "true")
        page.get_by_test_id("hold").click()
        expect(live).to_have_attribute("data-held", "false")

        page.get_by_test_id("live-fault").select_option("slow-drive")
        page.get_by_test_id("inject").click()
        expect(page.get_by_test_id("injected")).to_contain_text("Faults: Slow drive at ")
        expect(page.get_by_label("Notes, newest first")).to_contain_text("injected by Planner")
        assert axe(page) == []
        shot(page, "live-console")

        page.get_by_role("tab", name="Plan", exact=True).click()  # STOP is in reach whatever is looked at
        page.keyboard.press("Control+.")
        expect(stop).to_have_count(0)
        page.get_by_role("tab", name="Run").click()
        expect(page.get_by_test_id("run-outcome")).to_have_text("aborted")
        page.reload()  # what was done to the run is kept with it
        expect(page.get_by_test_id("injected")).to_contain_text("Faults: Slow drive at ")
        notes = page.get_by_test_id("run-notes")
        expect(notes).to_have_text(re.compile(r"UTC: fault slow-drive at \d+ s, injected by Planner\n"))
        expect(notes).to_contain_text(re.compile(r"UTC: STOP by Planner$"))


def test_stop_is_one_click_for_an_operator_and_none_for_a_scientist(server: Server) -> None:
    with chromium() as browser, open_page(browser, server, "?webgl=off") as page:
        open_planned(page, server)
        page.get_by_role("tab", name="Run").click()
        page.get_by_test_id("live").check()
        page.get_by_test_id("start-run").click()
        expect(page.get_by_test_id("link")).to_contain_text(re.compile("link up"))
        become(page, "scientist")
        expect(page.get_by_test_id("live-stop")).to_be_disabled()
        become(page, "operator")
        expect(page.get_by_test_id("hold")).to_be_disabled()
        page.get_by_test_id("live-stop").click()
        expect(page.get_by_test_id("live-stop")).to_have_count(0)
        expect(page.get_by_test_id("run-outcome")).to_have_text("aborted")
        expect(page.get_by_test_id("run-notes")).to_contain_text("STOP by Operator")
