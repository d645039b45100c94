"""Three sols on the page alone: two people plan, approve, uplink and execute, and the next sol begins where
the rover stands, with what is left."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from playwright.sync_api import Page, Route, expect

from tests.web.conftest import Server
from tests.web.page import chromium, field_of, open_page, shot
from tests.web.review_steps import approve, become, sign_as_author
from tests.web.test_day_in_the_browser import make_plan, new_mission, pick, run_plan

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.xdist_group("browser")]

PLANS = re.compile(r"/plans(\?|$)")
TARGETS = re.compile(r"/targets(\?|$)")


def one_sol(page: Page, number: int) -> None:
    """Plan the newest sol, approve its plan, and let the training rover execute it."""
    page.get_by_role("tab", name="Plan", exact=True).click()
    make_plan(page)
    page.get_by_role("tab", name="Run", exact=True).click()
    assert "succeeded" in (run_plan(page) for _ in range(12))
    sign_as_author(page)
    approve(page)
    with page.expect_download():
        page.get_by_test_id("package").click()
    expect(page.get_by_test_id(f"sol-{number}")).to_contain_text("uplinked")
    page.get_by_test_id("execute").click()
    expect(page.get_by_test_id(f"sol-{number}")).to_contain_text(re.compile(r"\d of \d done"))


@contextmanager
def lists_come_late(page: Page) -> Iterator[None]:
    """Let what the page reads of plans be answered only while it makes a target."""
    held: list[Route] = []
    late = True

    def hold(route: Route) -> None:
        if late:
            held.append(route)
        else:
            route.continue_()

    def let_go(route: Route) -> None:
        nonlocal late
        if late and route.request.method == "POST":
            late = False
            for one in held:
                one.continue_()
            page.wait_for_timeout(500.0)  # what waited for the lists goes on first
        route.continue_()

    page.route(PLANS, hold)
    page.route(TARGETS, let_go)
    yield
    page.unroute(PLANS, hold)
    page.unroute(TARGETS, let_go)


def test_three_sols_close_and_each_begins_where_the_last_ended(server: Server) -> None:
    with chromium() as browser, open_page(browser, server) as page:
        mission = new_mission(page, server)
        page.goto(f"{server.address}/?quality=test#/m/{mission}")
        page.wait_for_function("() => document.querySelector('[data-testid=map]')?.dataset.terrain")
        expect(page.get_by_test_id("sol-1")).to_contain_text("no plan yet")
        pick(page, 4.0, 0.0, "microscopic_imager", 12)
        pick(page, 10.2, -2.2, "microscopic_imager", 5)
        page.get_by_role("tab", name="Plan", exact=True).click()
        page.get_by_label("Time budget, h").fill("0.9")
        page.get_by_label("Time budget, h").press("Tab")
        page.get_by_label("Time limit, s").fill("3")
        for number in (1, 2, 3):
            one_sol(page, number)
            if number == 2:
                shot(page, "sols")
            if number == 3:
                break
            with lists_come_late(page):  # who works on meanwhile still gets what they made
                page.get_by_test_id("next-sol").click()
                expect(page.get_by_test_id(f"sol-{number + 1}")).to_contain_text("no plan yet")
                become(page, "planner")
                pick(page, -3.0, 3.0 - 6.0 * number, "science_camera", 4)  # something new is asked each sol
        runs = [
            r for r in field_of(page, server, f"/missions/{mission}/runs")["items"] if r["kind"] == "training"
        ]
        sols = field_of(page, server, f"/missions/{mission}/sols")["items"]
        assert len(runs) == len(sols) == 3
        for run, sol in zip(runs, sols[1:], strict=False):
            ended = field_of(page, server, f"/runs/{run['id']}/telemetry")
            assert sol["start_pose"]["east_m"] == ended["east_m"][-1]
        page.get_by_test_id("sol-1").click()
        expect(page.get_by_test_id("run-outcome")).to_be_visible()
