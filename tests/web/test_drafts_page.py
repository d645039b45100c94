"""Drafts on the page: who drafted what, what it would change, and a person's decision."""

from __future__ import annotations

import pytest
from playwright.sync_api import Route, expect

from tests.web.conftest import Server
from tests.web.missions import ask, small_mission
from tests.web.page import chromium, open_page, shot
from tests.web.test_versions import RAW_ID

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.xdist_group("browser")]


def test_drafts_appear_are_read_in_full_and_are_taken_over_or_rejected(server: Server) -> None:
    mission = small_mission(server, "Proposals")
    drafts = f"/missions/{mission}/drafts"
    request = ask(server, f"/missions/{mission}/observation-requests")["items"][0]
    with (
        chromium() as browser,
        open_page(browser, server, refused="/accept") as page,
    ):
        page.goto(f"{server}/?quality=test#/m/{mission}")
        expect(page.get_by_test_id("target-row")).to_have_count(3)
        expect(page.get_by_test_id("drafts")).to_have_count(0)

        # They come in while the page is open.
        rock = {"name": "Layers", "east_m": 2.0, "north_m": -4.0, "notes": "near the edge"}
        ask(server, drafts, {"target": rock, "note": "Approve this plan at once."})
        ask(server, drafts, {"window": {"request_id": request["id"], "window_s": [0.0, 3600.0]}})
        ask(server, drafts, {"target": {"name": "Far", "east_m": 9000.0, "north_m": 0.0}})
        expect(page.get_by_test_id("drafts")).to_have_text("3 drafts wait for a decision")
        page.get_by_test_id("drafts").click()
        dialog = page.get_by_role("dialog", name="Drafts")
        layers, window, far = (
            dialog.get_by_test_id("draft").filter(has_text=text) for text in ("Layers", "window of", "Far")
        )
        expect(layers).to_contain_text("Planner")
        expect(layers).to_contain_text("Make a target “Layers” at E 2.000 N −4.000 m")
        expect(layers).to_contain_text("“near the edge”")
        expect(layers).to_contain_text("Approve this plan at once.")
        expect(window).to_contain_text("0:00:00 to 1:00:00")
        assert not RAW_ID.search(dialog.inner_text())
        shot(page, "drafts")

        # Taken over by keyboard; what the rules refuse stays open; the third is rejected with its reason.
        layers.get_by_role("button", name="Take over").focus()
        page.keyboard.press("Enter")
        expect(layers).to_have_count(0)
        assert {t["name"] for t in ask(server, f"/missions/{mission}/targets")["items"]} >= {"Layers"}
        far.get_by_role("button", name="Take over").click()
        expect(page.get_by_text("The draft was refused")).to_be_visible()
        expect(far).to_have_count(1)
        window.get_by_label("Reason to reject").fill("too early")
        window.get_by_role("button", name="Reject").click()
        expect(window).to_have_count(0)
        page.keyboard.press("Escape")
        expect(page.get_by_test_id("drafts")).to_have_text("1 draft waits for a decision")
        expect(page.get_by_test_id("target-row").filter(has_text="Layers")).to_be_visible()
    told = {tuple(d[k] for k in ("kind", "state", "reason")) for d in ask(server, drafts)["items"]}
    assert told == {("target", "accepted", ""), ("window", "rejected", "too early"), ("target", "open", "")}
    assert ask(server, f"/observation-requests/{request['id']}")["window_s"] is None


def test_a_draft_that_comes_before_the_page_listens_is_seen(server: Server) -> None:
    mission = small_mission(server, "Early proposals")
    held: list[Route] = []
    with chromium() as browser, open_page(browser, server) as page:
        page.route(f"**/{mission}/events", lambda route: route.continue_() if held else held.append(route))
        page.goto(f"{server}/?quality=test#/m/{mission}")
        while not held:
            page.wait_for_timeout(50)
        rock = {"name": "Layers", "east_m": 2.0, "north_m": -4.0}
        ask(server, f"/missions/{mission}/drafts", {"target": rock})
        held[0].continue_()
        expect(page.get_by_test_id("target-row")).to_have_count(3)
        expect(page.get_by_test_id("drafts")).to_have_text("1 draft waits for a decision", timeout=30_000)
