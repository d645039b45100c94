"""Drives of the path network that are forbidden or drawn on the map, by pointer and by keys."""

from __future__ import annotations

import pytest
from playwright.sync_api import Page, expect

from tests.web.conftest import Server
from tests.web.missions import ask, make_plan, small_mission
from tests.web.page import chromium, open_page, pixel, shot

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.xdist_group("browser")]

CORNERS = [(1.5, 2.0), (2.5, 0.5)]


def _rules(page: Page) -> str:
    return str(page.get_by_test_id("map").get_attribute("data-rules"))


def _open(page: Page, server: Server, mission: str, plan: str) -> None:
    page.goto("about:blank")
    page.goto(f"{server}/?quality=test#/m/{mission}?plan={plan}")
    page.get_by_test_id("target-row").filter(has_text="North").first.click()
    page.wait_for_function("() => document.querySelector('[data-testid=map]')?.dataset.terrain")
    page.get_by_test_id("drives").locator("summary").click()


def test_a_drive_is_forbidden_another_is_drawn_and_the_next_plan_obeys(server: Server) -> None:
    mission = small_mission(server, "Drives")
    plan = make_plan(server, mission)
    with chromium() as browser, open_page(browser, server) as page:
        _open(page, server, mission, plan)
        page.get_by_label("Drive between North and South").select_option("forbidden")
        expect(page.get_by_test_id("map")).to_have_attribute("data-rules", "forbidden")
        expect(page.get_by_test_id("plan-select").locator("option:checked")).to_contain_text("stale")

        page.get_by_label("Drive between North and start").select_option("drawn")
        expect(page.get_by_text("Click the path from the start to North")).to_be_visible()
        for east, north in CORNERS[:-1]:
            page.mouse.click(*pixel(page, east, north))
            page.wait_for_timeout(400)  # two clicks at once would be a double click
        page.mouse.dblclick(*pixel(page, *CORNERS[-1]))
        expect(page.get_by_test_id("map")).to_have_attribute("data-rules", "forbidden,4")
        expect(page.get_by_label("Drive between North and start")).to_have_value("drawn")
        page.get_by_label("Drive between North and start").scroll_into_view_if_needed()
        shot(page, "drives")

        rules = ask(server, f"/missions/{mission}")["drive_rules"]
        assert [rule["via_m"] is None for rule in rules] == [True, False]
        for found, wanted in zip(rules[1]["via_m"], CORNERS, strict=True):
            assert found == pytest.approx(wanted, abs=0.1)

        newer = make_plan(server, mission)
        network = ask(server, f"/path-networks/{ask(server, f'/plans/{newer}')['network_id']}")
        of = {node["id"]: node["target_id"] for node in network["nodes"]}
        names = {t["id"]: t["name"] for t in ask(server, f"/missions/{mission}/targets")["items"]}
        drives = {
            (names.get(of[s["start"]]), names.get(of[s["end"]])): s["points_m"] for s in network["segments"]
        }
        assert ("North", "South") not in drives
        assert drives[None, "North"][1:-1] == rules[1]["via_m"]


def test_a_way_is_drawn_with_the_keys_and_given_back(server: Server) -> None:
    mission = small_mission(server, "Drives by keys")
    plan = make_plan(server, mission)
    with chromium() as browser, open_page(browser, server) as page:
        _open(page, server, mission, plan)
        page.get_by_label("Drive between North and start").select_option("drawn")
        page.get_by_test_id("map").focus()
        page.keyboard.press("ArrowUp")
        page.keyboard.press("Enter")
        for _ in range(6):
            page.keyboard.press("ArrowRight")
        page.keyboard.press("Enter")
        page.keyboard.press("Shift+Enter")
        expect(page.get_by_label("Drive between North and start")).to_have_value("drawn")
        assert _rules(page) != ""
        page.get_by_label("Drive between North and start").select_option("free")
        expect(page.get_by_test_id("map")).to_have_attribute("data-rules", "")
