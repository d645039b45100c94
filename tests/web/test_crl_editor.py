"""The text of a plan on the page: read, edited with help and findings, saved, dry run and sent to review."""

from __future__ import annotations

import re
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from tests.web.conftest import ROOT, Server
from tests.web.missions import ask, make_plan, small_mission
from tests.web.page import chromium, open_page, shot
from tests.web.review_steps import approve, become

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.xdist_group("browser")]

AXE = ROOT / "web" / "node_modules" / "axe-core" / "axe.min.js"


def _text(server: Server, page: Page, plan: str) -> str:
    return page.request.get(f"{server.address}/api/v1/plans/{plan}/crl").text()


def _violations(page: Page) -> list[tuple[str, Any]]:
    page.evaluate(AXE.read_text())
    found = page.evaluate("axe.run(document, {resultTypes: ['violations']})")
    return [(item["id"], [node["target"] for node in item["nodes"]][:3]) for item in found["violations"]]


def _find(page: Page, words: str) -> None:
    """Select the first place of some words in the text by the editor's search."""
    page.keyboard.press("Control+Home")
    page.keyboard.press("Control+f")
    field = page.get_by_role("textbox", name="Find")
    expect(field).to_be_focused()
    page.keyboard.type(words)
    field.press("Enter")
    field.press("Escape")
    expect(field).to_have_count(0)


def _checked(page: Page) -> None:
    expect(page.locator("[data-editing=true]")).to_have_attribute("data-checked", "true")


def _selected(page: Page) -> str:
    return str(page.evaluate("() => new URLSearchParams(location.hash.split('?')[1]).get('sel') ?? ''"))


@pytest.mark.parametrize("scheme", ["dark", "light"])
def test_a_text_is_edited_into_a_new_plan_that_goes_to_review(server: Server, scheme: str) -> None:
    mission = small_mission(server, f"By hand, {scheme}")
    plan = make_plan(server, mission)
    with chromium() as browser, open_page(browser, server, scheme=scheme) as page:
        before = _text(server, page, plan)
        page.goto(f"{server}/?quality=test#/m/{mission}?plan={plan}&tab=crl")
        text, verdict = page.get_by_test_id("crl"), page.get_by_test_id("crl-verdict")
        expect(text).to_have_attribute("aria-readonly", "true")
        expect(verdict).to_have_text("No findings")
        expect(page.get_by_test_id("send-to-review")).to_be_disabled()
        assert _violations(page) == []

        # A field with its help from the suggestions; the bounds are the wrong way round.
        page.get_by_test_id("edit-crl").click()
        expect(text).to_be_focused()
        _find(page, ":expectations ((time 180")
        page.keyboard.press("ArrowLeft")
        page.keyboard.type(" ")
        page.keyboard.press("ArrowLeft")
        page.keyboard.type(":dura")
        suggestion = page.get_by_role("option", name=re.compile("^:duration"))
        expect(suggestion).to_contain_text("short for the end condition")
        page.wait_for_timeout(200)  # a suggestion that has just come up is not taken by accident
        page.keyboard.press("Enter")
        expect(page.get_by_test_id("crl-help")).to_contain_text(":duration")
        page.keyboard.type(" (900 0)")
        _checked(page)
        finding = page.get_by_test_id("crl-finding")
        expect(finding).to_have_count(1)
        line = 1 + before[: before.index(":expectations ((time 180")].count("\n")
        expect(finding).to_contain_text(f"line {line}")
        expect(verdict).to_have_text("1 error")
        expect(page.locator(".cm-lintRange-error").first).to_be_visible()
        expect(page.locator(".cm-lint-marker-error")).to_have_count(1)
        expect(page.get_by_test_id("save-crl")).to_be_disabled()
        assert _violations(page) == []
        if scheme == "dark":
            shot(page, "crl-edit")

        # What is written waits while another sheet is open.
        page.get_by_role("tab", name="Review").click()
        page.get_by_role("tab", name="CRL", exact=True).click()
        expect(finding).to_have_count(1)

        # The finding leads to its place, where it is mended.
        finding.click()
        expect(text).to_be_focused()
        _find(page, "(900 0)")
        page.keyboard.type("(0 900)")
        _checked(page)
        expect(verdict).not_to_contain_text("error")
        page.get_by_label("Name of the new plan").fill("Typed")
        page.get_by_label("Name of the new plan").press("Enter")
        expect(page.get_by_test_id("plan-select")).to_contain_text("Typed")
        expect(page.locator("[data-editing=false]")).to_be_visible()
        new = ask(server, f"/missions/{mission}/plans")["items"][-1]
        assert (new["name"], new["parent_id"], new["strategy"]) == ("Typed", plan, "edited")
        assert _text(server, page, plan) == before
        assert ":duration (0 900)" in _text(server, page, new["id"])
        expect(page.get_by_text("was edited by hand: it has no tree")).to_be_visible()

        # It is dry run and sent to review, where a second person approves it.
        page.get_by_test_id("dry-run-crl").click()
        expect(page.get_by_test_id("run-outcome")).to_have_text("succeeded")
        page.get_by_role("tab", name="CRL", exact=True).click()
        expect(page.locator(".cm-line.succeeded").first).to_be_visible()
        page.get_by_test_id("send-to-review").click()
        expect(page.get_by_role("tab", name="Review")).to_have_attribute("aria-selected", "true")
        expect(page.get_by_test_id("signatures")).to_contain_text("author Planner, verifier Planner")
        if scheme == "dark":
            approve(page)


def test_a_text_is_read_folded_searched_and_tied_to_the_page_by_keyboard_too(server: Server) -> None:
    mission = small_mission(server, "Reading")
    plan = make_plan(server, mission)
    with chromium() as browser, open_page(browser, server) as page:
        page.goto(f"{server}/?quality=test#/m/{mission}?plan={plan}&tab=crl")
        text = page.get_by_test_id("crl")
        page.get_by_text(":continue-on-failure").first.hover()
        expect(page.locator(".cm-crl-help")).to_contain_text("if it fails, what follows goes on")
        expect(page.locator(".cm-crl-name[data-name=South]").first).to_be_visible()

        # A click on a line selects its task, a target lights its tasks and brings them into sight.
        page.locator(".cm-line", has_text=":action trackstart").first.click()
        first = _selected(page)
        assert first.startswith("task:trackstart")
        expect(page.locator(".cm-line.lit", has_text=":id trackstart")).to_have_count(1)
        page.get_by_test_id("target-row").filter(has_text="West").focus()
        page.keyboard.press("Enter")
        page.keyboard.press("c")
        expect(page.locator(".cm-line.lit", has_text=":action navigate")).to_be_visible()
        assert page.locator(".cm-line.lit", has_text="target-name = North").count() == 0

        # Arrow keys walk through the tasks; the chosen one is folded and unfolded.
        text.focus()
        page.keyboard.press("Home")
        assert _selected(page) == first
        page.keyboard.press("F9")
        expect(page.locator(".cm-foldPlaceholder")).to_have_count(1)
        expect(page.locator(".cm-line", has_text="(task :id trackstart").first).to_contain_text("…")
        page.keyboard.press("Shift+F9")
        expect(page.locator(".cm-foldPlaceholder")).to_have_count(0)
        page.keyboard.press("Control+f")
        expect(page.get_by_role("textbox", name="Find")).to_be_focused()
        page.keyboard.type("ipplaceinstrument")
        page.keyboard.press("Enter")
        expect(page.locator(".cm-searchMatch-selected")).to_be_visible()
        page.keyboard.press("Escape")
        expect(text).to_be_focused()
        page.keyboard.press("p")
        expect(page.get_by_role("tab", name="Plan", exact=True)).to_have_attribute("aria-selected", "true")

        # While it is edited all keys write; Tab and Escape leave, and Escape first closes what is open.
        page.keyboard.press("c")
        page.get_by_test_id("edit-crl").focus()
        page.keyboard.press("Enter")
        expect(text).to_be_focused()
        page.keyboard.type("(")
        expect(page.get_by_role("option", name=re.compile("^concurrent-block"))).to_be_visible()
        page.keyboard.press("Escape")
        expect(page.locator(".cm-tooltip-autocomplete")).to_have_count(0)
        expect(text).to_be_focused()
        page.keyboard.press("Control+z")
        page.keyboard.press("Escape")
        expect(text).not_to_be_focused()
        text.focus()
        page.keyboard.press("Tab")
        expect(text).not_to_be_focused()
        page.get_by_test_id("discard-crl").click()
        expect(text).to_have_attribute("aria-readonly", "true")
        assert len(ask(server, f"/missions/{mission}/plans")["items"]) == 1


def test_who_may_not_plan_reads_and_edits_nothing(server: Server) -> None:
    mission = small_mission(server, "Looking on")
    plan = make_plan(server, mission)
    with chromium() as browser, open_page(browser, server) as page:
        page.goto(f"{server}/?quality=test#/m/{mission}?plan={plan}&tab=crl")
        become(page, "scientist")
        expect(page.get_by_test_id("crl")).to_contain_text("trackstart")
        expect(page.get_by_test_id("edit-crl")).to_be_disabled()
        expect(page.get_by_test_id("dry-run-crl")).to_be_disabled()


def test_a_text_that_is_not_saved_is_offered_again_to_who_wrote_it(server: Server) -> None:
    mission = small_mission(server, "Unsaved")
    plan = make_plan(server, mission)
    with chromium() as browser, open_page(browser, server, "?webgl=off") as page:
        address = f"{server}/?quality=test&webgl=off#/m/{mission}?plan={plan}&tab=crl"
        page.goto(address)
        text, offer = page.get_by_test_id("crl"), page.get_by_test_id("kept-crl")
        page.get_by_test_id("edit-crl").click()
        expect(text).to_be_focused()
        expect(offer).to_have_count(0)
        page.keyboard.press("Control+Home")
        page.keyboard.type("; not saved yet\n")
        page.reload()
        expect(offer).to_contain_text("and did not save it")
        expect(text).not_to_contain_text("not saved yet")
        expect(page.get_by_test_id("edit-crl")).to_be_disabled()
        become(page, "Flight Director")
        expect(offer).to_have_count(0)
        become(page, "Planner")
        page.get_by_test_id("resume-crl").click()
        expect(text).to_contain_text("; not saved yet")
        expect(page.locator("[data-editing=true]")).to_be_visible()
        expect(offer).to_have_count(0)
        page.reload()
        page.get_by_test_id("discard-kept-crl").click()
        expect(offer).to_have_count(0)
        page.reload()
        expect(page.get_by_test_id("edit-crl")).to_be_enabled()
        expect(offer).to_have_count(0)
        page.get_by_test_id("edit-crl").click()
        expect(text).to_be_focused()
        page.keyboard.press("Control+Home")
        page.keyboard.type("; saved\n")
        _checked(page)
        page.get_by_test_id("save-crl").click()
        expect(page.get_by_text("Plan #2 is saved")).to_be_visible()
        page.goto("about:blank")
        page.goto(address)
        expect(page.get_by_test_id("edit-crl")).to_be_enabled()
        expect(offer).to_have_count(0)
