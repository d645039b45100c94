"""The odds of drives: learned from runs in the page, shown, and given back."""

from __future__ import annotations

from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from tests.ground.test_calibrate_mission import record_drives
from tests.web.conftest import Server
from tests.web.missions import ask, done, make_plan, small_mission
from tests.web.page import chromium, open_page, shot

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.xdist_group("browser")]

LEGS = 12


def _run(server: Server, mission: str, plan: str) -> Path:
    """Carry out a plan; return the run's folder."""
    order = {"plan_id": plan, "rover": "abstract", "seed": 1}
    run = done(server, ask(server, f"/missions/{mission}/runs", order))["subject_id"]
    return server.data / "runs" / str(run)


def _open(page: Page, server: Server, mission: str, plan: str) -> None:
    page.goto("about:blank")
    page.goto(f"{server}/?quality=test#/m/{mission}?plan={plan}&tab=plan")
    page.get_by_role("button", name="Settings").click()


def test_the_odds_are_learned_from_runs_and_given_back(server: Server) -> None:
    mission = small_mission(server, "Odds")
    plan = make_plan(server, mission)
    with chromium() as browser, open_page(browser, server) as page:
        _open(page, server, mission, plan)
        panel, learn = page.get_by_test_id("calibration"), page.get_by_test_id("learn")
        expect(panel).to_contain_text("From the rover's profile")
        expect(learn).to_be_disabled()

        folder = _run(server, mission, plan)
        expect(learn).to_be_enabled()
        learn.click()  # the planner's own model drives over no terrain
        expect(page.get_by_text("Learning from runs failed")).to_be_visible()
        expect(page.get_by_text("10 are needed")).to_be_visible()

        record_drives(folder, [(2.0 + k % 3, k % 4 == 0) for k in range(LEGS)])
        learn.click()
        expect(panel).to_contain_text(f"{LEGS} legs of 1 recorded run of rover profile k9")
        expect(panel).to_contain_text("3 of 12")
        expect(page.get_by_test_id("plan-select").locator("option:checked")).to_contain_text("stale")
        panel.scroll_into_view_if_needed()
        shot(page, "calibration-panel")
        found = ask(server, f"/missions/{mission}")["calibration"]
        assert (found["tracks"], found["losses"]) == (LEGS, 3)

        page.get_by_test_id("forget").click()
        expect(panel).to_contain_text("From the rover's profile")
        assert ask(server, f"/missions/{mission}")["calibration"] is None
