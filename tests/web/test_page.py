"""The page's other promises: 3D with a true pick, the map without WebGL, two people, keys, no barrier."""

from __future__ import annotations

import json
import re
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from tests.web.conftest import ROOT, Server
from tests.web.page import chromium, colours, open_demo, open_page, open_scene, pixel, shot

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.xdist_group("browser")]

AXE = ROOT / "web" / "node_modules" / "axe-core" / "axe.min.js"


def test_the_marker_of_a_target_picked_in_3d_lies_under_the_click(server: Server) -> None:
    with chromium() as browser, open_page(browser, server) as page:
        open_demo(page)
        open_scene(page)
        page.wait_for_timeout(1500)
        assert colours(page, "scene") > 500, "WebGL has drawn nothing"
        shot(page, "scene")
        before = page.get_by_test_id("target-row").count()
        box = page.get_by_test_id("scene").bounding_box()
        assert box is not None
        x, y = box["x"] + 0.62 * box["width"], box["y"] + 0.7 * box["height"]
        # Frames that are under way have ended: the view stands still while the point is asked for.
        page.keyboard.press("t")
        page.mouse.click(x, y)
        expect(page.get_by_test_id("target-row")).to_have_count(before + 1)
        marked = page.wait_for_function(
            "() => document.querySelector('[data-testid=scene]').dataset.landed"
        ).json_value()
        px, py = (float(part) for part in str(marked).split(","))
        assert abs(px - x) <= 1.0
        assert abs(py - y) <= 1.0


def test_a_page_at_rest_draws_nothing(server: Server) -> None:
    with chromium() as browser, open_page(browser, server) as page:
        open_demo(page)
        open_scene(page)
        page.wait_for_timeout(3000)
        drawn = page.get_by_test_id("scene").get_attribute("data-drawn")
        page.wait_for_timeout(1500)
        assert page.get_by_test_id("scene").get_attribute("data-drawn") == drawn


def test_better_plans_are_drawn_while_they_are_found(server: Server) -> None:
    with chromium() as browser, open_page(browser, server, "?webgl=off") as page:
        open_demo(page)
        page.get_by_role("tab", name="Plan", exact=True).click()
        if page.get_by_role("button", name="Settings").count():
            page.get_by_role("button", name="Settings").click()
        page.get_by_label("Time limit, s").fill("600")
        page.get_by_test_id("plan").click()
        # What is drawn stands beside the word that a search goes on, on the sheet and over time.
        expect(page.get_by_test_id("so-far")).to_contain_text("Plan so far")
        expect(page.get_by_test_id("plan-state")).to_have_text("draft")
        expect(page.get_by_test_id("outline")).to_be_visible()
        expect(
            page.get_by_role("img", name=re.compile("Value of the best plan since the first"))
        ).to_be_visible()
        shot(page, "planning")
        page.get_by_role("button", name="Cancel", exact=True).first.click()
        expect(page.get_by_test_id("plan-state")).to_have_text("computed")
        expect(page.get_by_test_id("so-far")).to_have_count(0)
        expect(page.get_by_test_id("outline")).to_be_visible()


def test_without_webgl_the_map_does_it_all(server: Server) -> None:
    with chromium() as browser, open_page(browser, server, "?webgl=off") as page:
        open_demo(page)
        page.get_by_role("button", name="3D").click()
        expect(page.get_by_text("The 3D view cannot be shown")).to_be_visible()
        page.get_by_role("button", name="To the map").click()
        page.wait_for_function("() => document.querySelector('[data-testid=map]')?.dataset.terrain")
        before = page.get_by_test_id("target-row").count()
        page.keyboard.press("t")
        page.mouse.click(*pixel(page, -6.0, 2.0))
        expect(page.get_by_test_id("target-row")).to_have_count(before + 1)


def test_two_people_see_each_other_and_a_stale_edit_is_refused_with_both_versions(server: Server) -> None:
    with chromium() as browser, open_page(browser, server) as one, open_page(browser, server) as other:
        open_demo(one)
        open_demo(other)
        other.get_by_test_id("target-row").filter(has_text="Gusev").click()
        other.get_by_role("button", name="Edit request").first.click()
        value = other.get_by_label("Value", exact=True)
        value.fill("7")

        one.get_by_test_id("target-row").filter(has_text="Gusev").click()
        one.get_by_role("button", name="Edit request").first.click()
        one.get_by_label("Value", exact=True).fill("5.5")
        one.get_by_test_id("save-request").click()
        expect(one.get_by_test_id("save-request")).to_have_count(0)

        expect(other.get_by_text("Somebody changed this request meanwhile")).to_be_visible()
        conflict = other.get_by_test_id("meanwhile")
        expect(conflict).to_contain_text("5.5")
        expect(conflict).to_contain_text("7")
        shot(other, "conflict")
        other.get_by_role("button", name="Keep mine").click()
        other.get_by_test_id("save-request").click()
        expect(other.get_by_test_id("save-request")).to_have_count(0)
        expect(one.locator("article .request").first).to_contain_text("value 7.0")


def test_what_is_deleted_comes_back_with_one_key_also_after_a_reload(server: Server) -> None:
    with chromium() as browser, open_page(browser, server) as page:
        open_demo(page)
        rows = page.get_by_test_id("target-row")
        before = rows.count()
        rows.filter(has_text="Jotun").click()
        page.keyboard.press("Delete")
        expect(rows).to_have_count(before - 1)
        page.reload()
        expect(rows).to_have_count(before - 1)
        page.keyboard.press("Control+z")
        expect(rows).to_have_count(before)
        page.keyboard.press("Control+y")
        expect(rows).to_have_count(before - 1)
        page.keyboard.press("Control+z")
        expect(rows).to_have_count(before)


def test_keys_are_shown_and_an_address_brings_back_the_selection(server: Server) -> None:
    with chromium() as browser, open_page(browser, server) as page:
        open_demo(page)
        page.keyboard.press("?")
        expect(page.get_by_role("dialog", name="Keys")).to_be_visible()
        shot(page, "help")
        page.keyboard.press("Escape")
        page.get_by_test_id("target-row").filter(has_text="Humphrey").click()
        address = page.url
        assert re.search(r"sel=target:tgt-", address)
        page.goto("about:blank")
        page.goto(address)
        expect(page.get_by_label("Name of the target")).to_have_value("Humphrey")


def _plan_and_run_twice(page: Page) -> None:
    """Have two plans and a run to look at; what an earlier test left is enough."""
    select = page.get_by_test_id("plan-select")
    for number in (1, 2):
        if select.count() and select.locator("option").count() > number:
            continue
        if page.get_by_role("button", name="Settings").count():
            page.get_by_role("button", name="Settings").click()
        page.get_by_label("Time limit, s").fill("3")
        page.get_by_test_id("plan").click()
        expect(select.locator("option")).to_have_count(number + 1)  # the new one is open, not the one before
        expect(page.get_by_test_id("plan-state")).to_have_text("computed")
    if not page.get_by_role("tab", name=re.compile(r"^Products [1-9]")).count():
        page.get_by_test_id("dry-run").click()
        expect(page.get_by_test_id("run-outcome")).to_be_visible()


def test_a_live_run_is_held_stepped_and_aborted_from_the_page(server: Server) -> None:
    with chromium() as browser, open_page(browser, server) as page:
        open_demo(page)
        page.get_by_role("tab", name="Plan", exact=True).click()
        _plan_and_run_twice(page)
        page.get_by_role("tab", name="Run", exact=True).click()
        page.get_by_test_id("pace").select_option("300")
        page.get_by_test_id("start-run").click()
        live = page.get_by_test_id("live-run")
        expect(live).to_be_visible()
        clock = page.get_by_label("Moment of the run")
        page.wait_for_function(
            "() => Number(document.querySelector('[aria-label=\"Moment of the run\"]').value) > 20"
        )
        page.keyboard.press(" ")
        expect(live).to_have_attribute("data-held", "true")
        page.wait_for_timeout(700)
        held = float(clock.input_value())
        page.wait_for_timeout(1500)
        assert float(clock.input_value()) == held, "plan time goes on while the run is held"
        records = page.locator(".trace li").count()
        page.keyboard.press("]")
        expect(page.locator(".trace li")).not_to_have_count(records)
        shot(page, "live")
        clock.fill("0")
        expect(page.get_by_role("button", name="Go live")).to_be_visible()
        page.get_by_role("button", name="Go live").click()
        page.get_by_test_id("abort-run").click()
        expect(page.get_by_test_id("run-outcome")).to_have_text("aborted")
        expect(page.locator(".trace li").first).to_be_visible()


SHIFTS = """
window.outcropShift = 0;
window.outcropShifted = [];
new PerformanceObserver((list) => {
    for (const entry of list.getEntries()) {
        if (entry.hadRecentInput) continue;
        window.outcropShift += entry.value;
        for (const source of entry.sources) {
            window.outcropShifted.push(source.node?.className || source.node?.nodeName);
        }
    }
}).observe({ type: 'layout-shift', buffered: true });
"""


def test_nothing_moves_while_the_page_loads(server: Server) -> None:
    with chromium() as browser, open_page(browser, server) as page:
        open_demo(page)
        address = page.url if "?" in page.url.split("#")[1] else f"{page.url}?sel="
        page.add_init_script(SHIFTS)
        for there in (f"{server}/?quality=test", f"{address}&tab=run", f"{address}&view=scene"):
            page.goto("about:blank")
            page.goto(there)
            page.wait_for_load_state("networkidle")
            page.wait_for_timeout(1000)
            moved = page.evaluate("() => [window.outcropShift, window.outcropShifted]")
            assert moved[0] < 0.01, f"{there}: {moved}"


@pytest.mark.parametrize("scheme", ["dark", "light"])
def test_nobody_is_shut_out_of_the_page(server: Server, scheme: str) -> None:
    with chromium() as browser, open_page(browser, server, scheme=scheme) as page:
        views: list[tuple[str, str, list[Any]]] = []

        def look(name: str) -> None:
            page.evaluate(AXE.read_text())
            found = page.evaluate("axe.run(document, {resultTypes: ['violations']})")
            views.extend(
                (name, item["id"], [node["target"] for node in item["nodes"]][:3])
                for item in found["violations"]
            )

        expect(page.get_by_role("heading", name="Missions")).to_be_visible()
        look("missions")
        open_demo(page)
        look("mission")
        page.get_by_test_id("target-row").filter(has_text="Bonneville").click()
        page.get_by_role("button", name="Edit request").first.click()
        look("target")
        page.get_by_role("tab", name="Plan", exact=True).click()
        _plan_and_run_twice(page)
        for tab in ("Plan", "Run", "CRL", "Review"):
            page.get_by_role("tab", name=tab, exact=True).click()
            expect(page.get_by_role("tab", name=tab, exact=True)).to_have_attribute("aria-selected", "true")
            look(tab)
            if tab == "CRL":
                page.get_by_test_id("target-row").filter(has_text="Bonneville").focus()
                look("CRL of a target")
        page.keyboard.press("w")
        expect(page.get_by_test_id("what-if-answer")).to_have_attribute("data-ms", re.compile(r"\d+"))
        look("what-if")
        page.keyboard.press("d")
        expect(page.get_by_test_id("paired")).to_contain_text("Beats the other with")
        look("compare")
        page.keyboard.press("Escape")
        page.get_by_role("button", name="3D").click()
        expect(page.get_by_test_id("scene")).to_be_visible()
        look("3D")
        page.get_by_role("button", name="2D").click()
        page.get_by_role("tab", name=re.compile("^Products")).click()
        page.get_by_test_id("product-row").first.click()
        expect(page.get_by_test_id("product-sheet")).to_be_visible()
        look("product")
        page.get_by_role("tab", name=re.compile("^Keep-outs")).click()
        look("keep-outs")
        page.get_by_role("tab", name=re.compile("^Targets")).click()
        page.get_by_role("button", name="Edit in a table").click()
        look("table")
        if scheme == "light":
            shot(page, "table-light")
        assert views == [], json.dumps(views, indent=1)
