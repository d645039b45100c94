"""The page's other promises: 3D with a true pick, the map without WebGL, two people, keys, no barrier."""

from __future__ import annotations

import io
import json
import re

import pytest
from playwright.sync_api import Page, expect

from tests.web.conftest import ROOT
from tests.web.page import chromium, open_demo, open_page, pixel, shot

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.xdist_group("browser")]

AXE = ROOT / "web" / "node_modules" / "axe-core" / "axe.min.js"


def _colours(page: Page, test_id: str) -> int:
    """Return how many colours the pixels of an element have: one or two would be a blank picture."""
    from PIL import Image

    picture = Image.open(io.BytesIO(page.get_by_test_id(test_id).screenshot())).convert("RGB")
    return len(picture.getcolors(maxcolors=1 << 24) or [])


def _open_scene(page: Page) -> None:
    page.get_by_role("button", name="3D").click()
    page.wait_for_function("() => document.querySelector('[data-testid=scene]')?.dataset.ready === 'true'")
    page.wait_for_function("() => Number(document.querySelector('[data-testid=scene]').dataset.drawn) > 0")


def test_the_marker_of_a_target_picked_in_3d_lies_under_the_click(server: str) -> None:
    with chromium() as browser, open_page(browser, server) as page:
        open_demo(page)
        _open_scene(page)
        page.wait_for_timeout(1500)
        assert _colours(page, "scene") > 500, "WebGL has drawn nothing"
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
            "() => document.querySelector('[data-testid=scene]').dataset.landed", timeout=20_000
        ).json_value()
        px, py = (float(part) for part in str(marked).split(","))
        assert abs(px - x) <= 1.0
        assert abs(py - y) <= 1.0


def test_a_page_at_rest_draws_nothing(server: str) -> None:
    with chromium() as browser, open_page(browser, server) as page:
        open_demo(page)
        _open_scene(page)
        page.wait_for_timeout(3000)
        drawn = page.get_by_test_id("scene").get_attribute("data-drawn")
        page.wait_for_timeout(1500)
        assert page.get_by_test_id("scene").get_attribute("data-drawn") == drawn


def test_without_webgl_the_map_does_it_all(server: str) -> None:
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


def test_two_people_see_each_other_and_a_stale_edit_is_refused_with_both_versions(server: str) -> None:
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
        conflict = other.locator(".conflict")
        expect(conflict).to_contain_text("5.5")
        expect(conflict).to_contain_text("7")
        shot(other, "conflict")
        other.get_by_role("button", name="Keep mine").click()
        other.get_by_test_id("save-request").click()
        expect(other.get_by_test_id("save-request")).to_have_count(0)
        expect(one.locator("article .request").first).to_contain_text("value 7.0")


def test_what_is_deleted_comes_back_with_one_key_also_after_a_reload(server: str) -> None:
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


def test_keys_are_shown_and_an_address_brings_back_the_selection(server: str) -> None:
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


@pytest.mark.parametrize("scheme", ["dark", "light"])
def test_nobody_is_shut_out_of_the_page(server: str, scheme: str) -> None:
    with chromium() as browser, open_page(browser, server, scheme=scheme) as page:
        views = []

        def look(name: str) -> None:
            page.evaluate(AXE.read_text())
            found = page.evaluate("axe.run(document, {resultTypes: ['violations']})")
            views.extend(
                (name, item["id"], [node["target"] for node in item["nodes"]][:3])
                for item in found["violations"]
                if item["impact"] in {"serious", "critical"}
            )

        expect(page.get_by_role("heading", name="Missions")).to_be_visible()
        look("missions")
        open_demo(page)
        look("mission")
        page.get_by_test_id("target-row").filter(has_text="Bonneville").click()
        page.get_by_role("button", name="Edit request").first.click()
        look("target")
        for tab in ("Plan", "Run", "CRL", "Review"):
            page.get_by_role("tab", name=tab, exact=True).click()
            look(tab)
        page.get_by_role("tab", name=re.compile("^Keep-outs")).click()
        look("keep-outs")
        page.get_by_role("tab", name=re.compile("^Targets")).click()
        page.get_by_role("button", name="Edit in a table").click()
        look("table")
        shot(page, f"table-{scheme}")
        assert views == [], json.dumps(views, indent=1)
