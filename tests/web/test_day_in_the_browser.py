"""The paper's day through the page: target, request, keep-out, plan, dry run, product from its target."""

from __future__ import annotations

import re

import pytest
from playwright.sync_api import Page, expect

from tests.web.page import chromium, open_demo, open_page, pixel, shot

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.xdist_group("browser")]


def _draw_keep_out(page: Page, corners: list[tuple[float, float]]) -> None:
    page.keyboard.press("o")
    for corner in corners:
        page.mouse.click(*pixel(page, *corner))
    page.mouse.dblclick(*pixel(page, *corners[0]))


def test_a_day_goes_from_a_click_on_the_ground_to_a_product_opened_from_its_target(server: str) -> None:
    with chromium() as browser, open_page(browser, server) as page:
        expect(page.get_by_role("heading", name="Missions")).to_be_visible()
        shot(page, "missions")
        open_demo(page)

        # A target and its request: three clicks.
        before = page.get_by_test_id("target-row").count()
        page.keyboard.press("t")
        page.mouse.click(*pixel(page, 3.0, -3.5))
        page.get_by_test_id("save-request").click()
        expect(page.get_by_test_id("target-row")).to_have_count(before + 1)
        expect(page.get_by_test_id("save-request")).to_have_count(0)
        name = page.get_by_label("Name of the target").input_value()
        assert re.fullmatch(r"T\d+", name)
        position = page.locator("dd.mono").first.inner_text().replace("\N{MINUS SIGN}", "-")
        east, north = (float(part) for part in re.findall(r"-?\d+\.\d+", position)[:2])
        assert abs(east - 3.0) < 0.05
        assert abs(north + 3.5) < 0.05
        shot(page, "target")

        _draw_keep_out(page, [(8.0, 6.0), (10.0, 6.0), (10.0, 8.0)])
        expect(page.get_by_label("Name of the keep-out")).to_be_visible()

        # A plan with its tree.
        page.get_by_role("tab", name="Plan", exact=True).click()
        page.get_by_label("Time limit, s").fill("6")
        page.get_by_test_id("plan").click()
        expect(page.get_by_test_id("outline")).to_be_visible()
        expect(page.get_by_test_id("plan-state")).to_have_text("computed")
        utility = float(page.get_by_test_id("utility").inner_text())
        assert utility > 5.0
        shot(page, "plan")

        # A dry run: the rover moves and the products appear on their targets.
        start = page.get_by_test_id("map").get_attribute("data-rover")
        page.get_by_test_id("dry-run").click()
        expect(page.get_by_test_id("run-outcome")).to_be_visible()
        page.wait_for_function(
            "start => document.querySelector('[data-testid=map]').dataset.rover !== start", arg=start
        )
        expect(page.get_by_test_id("product").first).to_be_visible()
        page.get_by_label("Moment of the run").fill("100000")
        shot(page, "run")
        page.get_by_role("button", name="Energy").click()
        page.get_by_role("tab", name="CRL", exact=True).click()
        page.get_by_test_id("target-row").filter(has_text="Humphrey").focus()
        expect(page.get_by_test_id("crl")).to_contain_text("ipplaceinstrument")
        shot(page, "crl")
        page.get_by_role("button", name="Tree").click()
        page.get_by_role("tab", name="Plan", exact=True).click()
        shot(page, "tree")
        page.get_by_role("button", name="Timeline").click()

        # From a target to what came back.
        page.get_by_role("tab", name=re.compile("Products")).click()
        page.get_by_test_id("product-row").first.click()
        expect(page.get_by_test_id("product-sheet")).to_be_visible()
        page.get_by_test_id("product-sheet").locator(".lineage button").first.click()
        expect(page.get_by_label("Name of the target")).to_be_visible()
        page.get_by_test_id("target-products").get_by_test_id("product").first.click()
        picture = page.get_by_test_id("product-image")
        expect(picture).to_be_visible()
        page.wait_for_function("() => document.querySelector('[data-testid=product-image]').naturalWidth > 0")
        shot(page, "product")

        # The maker does not approve; a second person does, and gets the package.
        page.get_by_role("tab", name="Review").click()
        expect(page.get_by_test_id("approve")).to_be_disabled()
        people = page.get_by_test_id("person")
        director = people.locator("option", has_text="flight director").first.get_attribute("value")
        people.select_option(director)
        page.get_by_label("Note of the approval").fill("Read and found good.")
        page.get_by_test_id("approve").click()
        expect(page.get_by_text("Approved by")).to_be_visible()
        shot(page, "review")
        with page.expect_download() as download:
            page.get_by_test_id("package").click()
        assert download.value.suggested_filename.endswith(".zip")
        expect(page.locator(".states [aria-current]")).to_have_text("uplinked")
