"""A plan that somebody else changes is read anew while one works at it: what was typed stays."""

from __future__ import annotations

import pytest
from playwright.sync_api import Page, Route, expect

from tests.web.conftest import Server
from tests.web.missions import make_plan, small_mission
from tests.web.page import chromium, open_page
from tests.web.review_steps import become

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.xdist_group("browser")]


def _rename(page: Page, server: Server, plan: str, name: str) -> None:
    """Change the plan's name as somebody else, and wait until the page shows it."""
    headers = {"X-Outcrop-Person": "Planner", "If-Match": "*"}
    answer = page.request.patch(f"{server.address}/api/v1/plans/{plan}", headers=headers, data={"name": name})
    assert answer.ok, answer.text()
    expect(page.get_by_role("heading", name=name)).to_be_visible()


def _one_rule_fails(route: Route) -> None:
    """Answer as the server does, but for the first flight rule, which does not hold."""
    answer = route.fetch()
    first, *others = answer.json()
    route.fulfill(response=answer, json=[{**first, "holds": False, "waived_by": None}, *others])


def test_a_waiver_that_is_being_written_outlives_a_change_by_somebody_else(server: Server) -> None:
    mission = small_mission(server, "Read anew")
    plan = make_plan(server, mission)
    with chromium() as browser, open_page(browser, server) as page:
        page.route("**/flight-rules", _one_rule_fails)
        page.goto(f"{server}/?quality=test#/m/{mission}?plan={plan}&tab=review")
        become(page, "flight director")
        page.get_by_role("button", name="Waive…").first.click()
        reason = page.get_by_label("Reason of the waiver")
        reason.fill("The team has looked")
        field = reason.element_handle()
        _rename(page, server, plan, "The plan by another name")
        expect(reason).to_have_value("The team has looked")
        assert field is not None
        assert field.evaluate("node => node.isConnected"), "the field was taken away and put back"
        page.unroute_all(behavior="ignoreErrors")  # a rule that is being read as the page closes
