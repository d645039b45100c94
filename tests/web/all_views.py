"""The views that the page has, one after the other, as a person comes to them."""

from __future__ import annotations

import re
from collections.abc import Iterator

from playwright.sync_api import Page, expect

from tests.web.conftest import Server
from tests.web.page import open_scene


def open_mission(page: Page, server: Server, mission: str, query: str = "?quality=test") -> None:
    page.goto("about:blank")
    page.goto(f"{server.address}/{query}#/m/{mission}")
    page.wait_for_function("() => document.querySelector('[data-testid=map]')?.dataset.terrain")
    expect(page.get_by_test_id("target-row").first).to_be_visible()


def all_views(page: Page, server: Server, mission: str, title: str) -> Iterator[str]:
    """Go from view to view and yield the name of each; the mission, called so, has two plans."""
    page.goto("about:blank")
    page.goto(server.address)
    expect(page.get_by_role("heading", name="Missions")).to_be_visible()
    expect(page.get_by_role("link", name=title)).to_be_visible()
    yield "missions"
    page.get_by_role("button", name="New mission").first.click()
    for ground in ("Ground made from a seed", "A terrain of your own", "The demo site"):
        page.get_by_label(ground).check()
        yield f"new mission, {ground}"
    page.keyboard.press("Escape")

    open_mission(page, server, mission)
    page.get_by_role("button", name="Layers").click()
    page.get_by_label("Where the rover may be").check()
    page.get_by_label("Over the ground").select_option("slope")
    yield "map with layers"
    page.get_by_label("Where the rover may be").uncheck()
    page.get_by_label("Over the ground").select_option("none")
    page.get_by_role("button", name="Layers").click()

    page.get_by_test_id("target-row").first.click()
    page.get_by_role("button", name="Edit request").first.click()
    page.get_by_role("button", name="More…").click()
    yield "target with its form"
    page.get_by_role("tab", name=re.compile("^Keep-outs")).click()
    page.locator("button.item").first.click()
    yield "keep-out"
    page.get_by_role("tab", name=re.compile("^Targets")).click()
    page.get_by_role("button", name="Edit in a table").click()
    page.get_by_label("All", exact=True).check()
    page.get_by_role("button", name="Paste targets").click()
    yield "table of requests"
    page.keyboard.press("Escape")

    page.get_by_role("tab", name="Plan", exact=True).click()
    page.get_by_role("button", name="Settings").click()
    page.keyboard.press("w")
    expect(page.get_by_test_id("what-if-answer")).to_have_attribute("data-ms", re.compile(r"\d+"))
    yield "plan, settings, what-if"
    page.get_by_test_id("compare").click()
    expect(page.get_by_test_id("paired")).to_contain_text("Beats the other with")
    yield "compare"
    page.keyboard.press("Escape")
    page.get_by_test_id("merge-plans").click()
    expect(page.get_by_test_id("merge-state")).to_be_visible()
    yield "merge"
    page.keyboard.press("Escape")
    page.get_by_test_id("outline").get_by_role("button").first.click()
    page.get_by_role("tab", name="Selection").click()
    yield "line of the plan"

    page.get_by_test_id("dry-run").click()
    expect(page.get_by_test_id("run-outcome")).not_to_have_text(re.compile("queued|running"))
    page.get_by_label("Moment of the run").fill("100000")
    page.get_by_role("button", name="Add a fault").click()
    page.get_by_text("State of the executive").click()
    expect(page.get_by_test_id("snapshot")).to_be_visible()
    page.get_by_label("what is over").check()
    expect(page.get_by_test_id("snapshot").get_by_role("button").first).to_be_visible()
    yield "run"
    page.get_by_role("tab", name="CRL", exact=True).click()
    yield "CRL"
    page.get_by_test_id("edit-crl").click()
    page.get_by_role("button", name="Find", exact=True).click()
    expect(page.get_by_role("textbox", name="Replace")).to_be_visible()
    yield "CRL, edited and searched"
    page.get_by_test_id("discard-crl").click()
    expect(page.get_by_test_id("crl")).to_have_attribute("aria-readonly", "true")
    page.get_by_role("tab", name="Review").click()
    expect(page.locator(".rule").first).to_be_visible()
    yield "review"

    page.get_by_role("tab", name=re.compile("^Products")).click()
    page.get_by_test_id("product-row").first.click()
    expect(page.get_by_test_id("product-image")).to_be_visible()
    yield "product"
    page.get_by_role("button", name="Open in the image viewer").click()
    yield "image viewer"
    page.keyboard.press("Escape")
    page.get_by_role("tab", name=re.compile("^Targets")).click()

    open_scene(page)
    page.get_by_role("button", name="As the rover's mast camera sees it").click()
    page.get_by_role("button", name="Layers").click()
    expect(page.get_by_role("button", name="Turn the mast left")).to_be_visible()
    yield "3D"
    page.get_by_role("button", name="Panorama").click()
    expect(page.get_by_test_id("panorama")).to_be_visible()
    yield "panorama"
    page.get_by_role("button", name="2D").click()
    page.keyboard.press("?")
    yield "keys"
    page.keyboard.press("Escape")
