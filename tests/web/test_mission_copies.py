"""A copy of a mission on the page: what differs from its original, and a merge with choices."""

from __future__ import annotations

import json
from typing import Any
from urllib.request import Request, urlopen

import pytest
from playwright.sync_api import Route, expect

from tests.web.conftest import Server
from tests.web.missions import ask, small_mission
from tests.web.page import chromium, open_page, shot
from tests.web.test_versions import RAW_ID

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.xdist_group("browser")]


def _patch(server: Server, path: str, body: dict[str, Any]) -> None:
    headers = {"X-Outcrop-Person": "Planner", "Content-Type": "application/json", "If-Match": "*"}
    request = Request(f"{server.address}/api/v1{path}", json.dumps(body).encode(), headers, method="PATCH")
    with urlopen(request, timeout=60) as answer:
        assert answer.status == 200


def _targets(server: Server, mission: str) -> dict[str, dict[str, Any]]:
    return {target["name"]: target for target in ask(server, f"/missions/{mission}/targets")["items"]}


def _both_edited(server: Server, name: str) -> tuple[str, str]:
    """Return a mission and its copy: two conflicts, and an edit of each alone."""
    mission = small_mission(server, name)
    copy = str(ask(server, f"/missions/{mission}/copy", {"name": f"{name}, north", "notes": ""})["id"])
    ours, theirs = _targets(server, mission), _targets(server, copy)
    _patch(server, f"/targets/{ours['North']['id']}", {"notes": "red"})
    _patch(server, f"/targets/{theirs['North']['id']}", {"notes": "grey"})
    _patch(server, f"/targets/{ours['West']['id']}", {"east_m": -5.0})
    _patch(server, f"/targets/{theirs['West']['id']}", {"east_m": -6.0})
    _patch(server, f"/targets/{ours['South']['id']}", {"notes": "steep"})
    ask(server, f"/missions/{copy}/targets", {"name": "East", "east_m": 4.0, "north_m": 0.5})
    request = ask(server, f"/missions/{copy}/observation-requests")["items"][0]
    _patch(server, f"/observation-requests/{request['id']}", {"value": 20.0})
    return mission, copy


def test_a_copy_is_compared_with_its_original_and_merged_back_with_a_choice(server: Server) -> None:
    mission, copy = _both_edited(server, "Ridge")
    with (
        chromium() as browser,
        open_page(browser, server, refused="/mission-merges", status=409) as page,
    ):
        page.goto(f"{server}/?quality=test#/m/{copy}")
        page.get_by_test_id("original").click()
        dialog = page.get_by_role("dialog", name="A copy and its original")
        state = dialog.get_by_test_id("mission-merge-state")
        expect(state).to_have_text("2 conflicts, 2 open. All else is joined.")
        edits = dialog.get_by_test_id("mission-edits")
        expect(edits.first).to_contain_text("target East")
        expect(edits.first).to_contain_text("9 → 20")
        expect(edits.nth(1)).to_contain_text("target South")
        expect(edits.nth(1)).not_to_contain_text("target East")
        merge = dialog.get_by_test_id("merge-mission")
        expect(merge).to_be_disabled()
        assert not RAW_ID.search(dialog.inner_text())
        shot(page, "mission-merge")

        # By keyboard: the copy's notes, and where the original has put the other target.
        notes = dialog.get_by_test_id("conflict").filter(has_text="notes")
        notes.get_by_role("radio").first.focus()
        page.keyboard.press("ArrowDown")
        expect(state).to_have_text("2 conflicts, 1 open. All else is joined.")
        place = dialog.get_by_test_id("conflict").filter(has_text="place")
        expect(place).to_contain_text("E −5.000")
        place.get_by_role("radio").first.focus()
        page.keyboard.press("Space")
        expect(state).to_have_text("All 2 conflicts are decided.")

        # Somebody was faster: nothing is merged, and what differs now is shown. Choices stand.
        expect(merge).to_be_enabled()
        _patch(server, f"/targets/{_targets(server, mission)['South']['id']}", {"notes": "very steep"})
        merge.click()
        expect(page.get_by_text("One of the missions was changed meanwhile")).to_be_visible()
        assert "East" not in _targets(server, mission)
        expect(edits.nth(1)).to_contain_text("very steep")
        expect(state).to_have_text("All 2 conflicts are decided.")
        merge.click()
        expect(dialog.get_by_test_id("mission-merged")).to_contain_text("1 added, 2 changed")
        found = _targets(server, mission)
        assert (found["North"]["notes"], found["South"]["notes"]) == ("grey", "very steep")
        assert found["West"]["position"]["east_m"] == -5.0
        assert "East" in found
        dialog.get_by_role("link", name="Open Ridge").click()
        expect(page.get_by_test_id("target-row").filter(has_text="East")).to_be_visible()
        page.get_by_role("button", name="Undo").click()
        expect(page.get_by_test_id("target-row").filter(has_text="East")).to_have_count(0)
        assert _targets(server, mission)["North"]["notes"] == "red"


def test_a_slow_answer_about_the_other_way_changes_nothing(server: Server) -> None:
    _, copy = _both_edited(server, "Gorge")
    with chromium() as browser, open_page(browser, server) as page:
        held: list[Route] = []
        page.route("**/difference?*", lambda route: route.continue_() if held else held.append(route))
        page.goto(f"{server}/?quality=test#/m/{copy}")
        with page.expect_request("**/difference?*"):
            page.get_by_test_id("original").click()
        dialog = page.get_by_role("dialog", name="A copy and its original")
        dialog.get_by_label("up to date with").check()
        state = dialog.get_by_test_id("mission-merge-state")
        expect(state).to_contain_text("2 open")
        brought = dialog.get_by_test_id("mission-edits").first
        expect(brought).to_contain_text("target South")
        with page.expect_response("**/difference?*"):
            held[0].continue_()
        page.wait_for_timeout(500)
        expect(brought).to_contain_text("target South")
        expect(brought).not_to_contain_text("target East")
        dialog.get_by_role("button", name="Take all of Gorge, north").click()
        expect(state).to_have_text("All 2 conflicts are decided.")


def test_a_copy_is_brought_up_to_date_from_the_list_of_missions(server: Server) -> None:
    mission, copy = _both_edited(server, "Gully")
    with chromium() as browser, open_page(browser, server) as page:
        page.goto(server.address)
        page.get_by_role("button", name="copy of Gully").click()
        dialog = page.get_by_role("dialog", name="A copy and its original")
        # the dialog may be drawn anew while its mission comes: the click counts, not what it shows at once
        dialog.get_by_label("up to date with").click()
        expect(dialog.get_by_label("up to date with")).to_be_checked()
        expect(dialog.get_by_test_id("mission-merge-state")).to_contain_text("2 open")
        dialog.get_by_role("button", name="Take all of Gully, north").click()
        expect(dialog.get_by_test_id("mission-merge-state")).to_have_text("All 2 conflicts are decided.")
        dialog.get_by_test_id("merge-mission").click()
        expect(dialog.get_by_test_id("mission-merged")).to_contain_text("1 changed")
        found = _targets(server, copy)
        assert (found["North"]["notes"], found["South"]["notes"]) == ("grey", "steep")
        assert "East" not in _targets(server, mission)
        dialog.get_by_text("Close", exact=True).click()
        expect(dialog).to_have_count(0)
