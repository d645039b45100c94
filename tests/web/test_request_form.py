"""The form of a request: whatever the mission's rover carries, and conditions of any kind, in plain words."""

from __future__ import annotations

import math

import pytest
from playwright.sync_api import Page, Route, expect

from tests.web.conftest import Server
from tests.web.missions import ask, small_mission
from tests.web.page import chromium, open_page

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.xdist_group("browser")]


def _with_a_drill(route: Route) -> None:
    """Answer as the server does, of a rover that carries a drill beside its instruments."""
    answer = route.fetch()
    rover = answer.json()
    contact = next(one for one in rover["instruments"] if one["use"] == "contact")
    rover["instruments"].append(contact | {"name": "core_drill", "time_s": {"mean": 2400.0, "sd": 60.0}})
    route.fulfill(response=answer, json=rover)


def _new_request(page: Page, server: Server, mission: str, target: str) -> None:
    page.goto("about:blank")
    page.goto(f"{server.address}/?quality=test&webgl=off#/m/{mission}")
    page.get_by_test_id("target-row").filter(has_text=target).click()
    page.get_by_test_id("add-request").click()


def test_instruments_are_those_of_the_rover_and_a_condition_is_filed_in_degrees(server: Server) -> None:
    mission = small_mission(server, "Forms")
    with chromium() as browser, open_page(browser, server) as page:
        page.route("**/api/v1/rovers/*", _with_a_drill)
        _new_request(page, server, mission, "West")
        drill = page.get_by_role("radio", name="Core drill by the arm, on contact, 0:40:00")
        drill.click()
        expect(drill).to_have_attribute("aria-checked", "true")
        tracked = page.get_by_role("checkbox", name="this instrument needs it")
        expect(tracked).to_be_checked()
        expect(tracked).to_be_disabled()
        page.get_by_role("radio", name="Science camera from afar").click()
        free = page.get_by_role("checkbox", name="kept in view on the way")
        expect(free).not_to_be_checked()
        expect(free).to_be_enabled()

        page.get_by_test_id("add-condition").select_option("Sun elevation")
        expect(page.get_by_text("nothing is asked yet")).to_be_visible()
        page.get_by_role("spinbutton", name="at least °").fill("20")
        page.get_by_label("Value", exact=True).fill("6")
        page.get_by_test_id("save-request").click()
        expect(page.get_by_text("sun elevation at least 20°")).to_be_visible()
        filed = ask(server, f"/missions/{mission}/observation-requests")["items"][-1]
        assert (filed["instrument"], filed["value"], filed["tracked"]) == ("science_camera", 6.0, False)
        (condition,) = filed["constraints"]
        assert condition["kind"] == "sun_elevation"
        assert condition["at_least_rad"] == pytest.approx(math.radians(20.0))

        page.get_by_role("button", name="Edit request").last.click()
        expect(page.get_by_role("spinbutton", name="at least °")).to_have_value("20")
        page.get_by_role("button", name="Remove sun elevation").click()
        page.get_by_test_id("save-request").click()
        expect(page.get_by_test_id("save-request")).to_have_count(0)
        expect(page.get_by_text("sun elevation at least 20°")).to_have_count(0)
        filed = ask(server, f"/missions/{mission}/observation-requests")["items"][-1]
        assert filed["constraints"] == []
