"""Two people edit the same things at once: each sees the other's side beside theirs, and nothing is lost."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from tests.web.conftest import Server
from tests.web.missions import ask, small_mission
from tests.web.page import chromium, open_page, shot
from tests.web.review_steps import become

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.xdist_group("browser")]


@contextmanager
def two_pages(server: Server, mission: str) -> Iterator[tuple[Page, Page]]:
    """Give the pages of a planner and of a flight director, who look at the same mission."""
    query = "?quality=test&webgl=off"
    with (
        chromium() as browser,
        open_page(browser, server, query) as one,
        open_page(browser, server, query) as other,
    ):
        for page in (one, other):
            page.goto(f"{server}/{query}#/m/{mission}")
            expect(page.get_by_test_id("target-row")).to_have_count(3)
        become(other, "flight director")
        yield one, other


def select(page: Page, name: str) -> None:
    page.get_by_test_id("target-row").filter(has_text=name).click()
    expect(page.get_by_label("Name of the target")).to_have_value(name)


def type_place(page: Page, text: str) -> None:
    """Begin to move the selected target, and do not save it yet."""
    page.get_by_role("button", name="Type coordinates").click()
    page.get_by_label("coordinates", exact=True).fill(text)


def edit_value(page: Page, value: str) -> None:
    """Begin to edit the request of the selected target, and do not save it yet."""
    page.get_by_role("button", name="Edit request").click()
    page.get_by_label("Value", exact=True).fill(value)


def sides(page: Page) -> list[str]:
    """Return what the page says of a change that came meanwhile: a line a member, mine before theirs."""
    box = page.get_by_test_id("meanwhile")
    expect(box).to_be_visible()
    return [" | ".join(row.locator("td").all_inner_texts()) for row in box.locator("tbody tr").all()]


def the(server: Server, mission: str, what: str, name: str) -> dict[str, Any]:
    """Return a target by its name, or the request on it."""
    key = "name" if what == "targets" else "target_name"
    return next(r for r in ask(server, f"/missions/{mission}/{what}")["items"] if r[key] == name)


def test_a_target_that_both_move_has_both_places_side_by_side(server: Server) -> None:
    mission = small_mission(server, "Both move")
    with two_pages(server, mission) as (one, other):
        for page, place in ((one, "3.5, 3.5"), (other, "2.5, 3.0")):
            select(page, "North")
            type_place(page, place)
        other.get_by_role("button", name="Save", exact=True).click()
        expect(other.get_by_test_id("coordinates-text")).to_have_text("2.500, 3.000")
        assert sides(one) == ["Coordinates | 3.5, 3.5 | 2.500, 3.000"]
        expect(one.get_by_label("coordinates", exact=True)).to_have_value("3.5, 3.5")  # what was typed stays
        one.get_by_label("coordinates", exact=True).press("Enter")
        assert the(server, mission, "targets", "North")["position"]["east_m"] == 2.5  # not before one decides
        shot(one, "both-move")

        type_place(
            other, "2.0, 2.0"
        )  # and the other way round: the first one decides, the second one sees it
        one.get_by_role("button", name="Keep mine").click()
        one.get_by_role("button", name="Save", exact=True).click()
        expect(one.get_by_test_id("coordinates-text")).to_have_text("3.500, 3.500")
        assert sides(other) == ["Coordinates | 2.0, 2.0 | 3.500, 3.500"]
        other.get_by_role("button", name="Take theirs").click()
        expect(other.get_by_test_id("coordinates-text")).to_have_text("3.500, 3.500")
    events = ask(server, f"/missions/{mission}/history?limit=500")["items"]
    moves = [e for e in events if e["kind"] == "target" and e["action"] == "change"]
    assert {e["actor"] for e in moves} == {"Planner", "Flight Director"}  # both moves stand in the history


def test_a_name_that_both_change_has_both_side_by_side(server: Server) -> None:
    mission = small_mission(server, "Both rename")
    with two_pages(server, mission) as (one, other):
        for page in (one, other):
            select(page, "West")
        one.get_by_label("Name of the target").fill("Westerly")
        other.get_by_label("Name of the target").fill("Occident")
        other.get_by_label("Name of the target").press("Enter")
        assert sides(one) == ["Name | Westerly | Occident"]
        one.get_by_label("Name of the target").press("Enter")
        assert the(server, mission, "targets", "Occident")["revision"] == 2
        one.get_by_role("button", name="Keep mine").click()
        expect(other.get_by_label("Name of the target")).to_have_value("Westerly")


def test_a_request_that_both_edit_has_every_difference_side_by_side(server: Server) -> None:
    mission = small_mission(server, "Both edit")
    with two_pages(server, mission) as (one, other):
        for page, value in ((one, "20"), (other, "30")):
            select(page, "South")
            edit_value(page, value)
        one.get_by_role("button", name="More…").click()
        one.get_by_label("Notes", exact=True).fill("grey vein")
        other.get_by_test_id("save-request").click()
        assert sides(one) == ["Value | 20 | 30", "Notes | grey vein | –"]
        one.get_by_role("button", name="Keep mine").click()
        edit_value(other, "40")
        one.get_by_test_id("save-request").click()
        assert sides(other) == ["Value | 40 | 20", "Notes | – | grey vein"]
        other.get_by_role("button", name="Take theirs").click()
        expect(other.get_by_label("Value", exact=True)).to_have_value("20")
    request = the(server, mission, "observation-requests", "South")
    assert (request["value"], request["notes"]) == (20.0, "grey vein")


def test_a_request_that_one_deletes_while_the_other_edits_it_is_not_lost(server: Server) -> None:
    mission = small_mission(server, "Deleted request")
    with two_pages(server, mission) as (one, other):
        for page in (one, other):
            select(page, "North")
        edit_value(one, "33")
        other.get_by_role("button", name="Delete request").click()
        expect(one.get_by_text("This request was deleted meanwhile.")).to_be_visible()
        assert "Value | 33 | deleted" in sides(one)
        expect(one.get_by_label("Value", exact=True)).to_have_value("33")
        shot(one, "deleted-meanwhile")
        one.get_by_role("button", name="File it anew").click()
        expect(other.get_by_role("button", name="Edit request")).to_be_visible()
    assert the(server, mission, "observation-requests", "North")["value"] == 33.0


def test_a_target_that_one_deletes_while_the_other_works_on_it_is_not_lost(server: Server) -> None:
    mission = small_mission(server, "Deleted target")
    with two_pages(server, mission) as (one, other):
        for page in (one, other):
            select(page, "South")
        edit_value(one, "44")
        other.get_by_role("button", name="Delete target").click()
        # Told of the request at once, though its own message comes after that of its target.
        expect(one.get_by_text("This request was deleted meanwhile.")).to_be_visible()
        assert "Value | 44 | deleted" in sides(one)
        one.get_by_role("button", name="File it anew").click()
        expect(other.get_by_test_id("target-row")).to_have_count(3)
        assert the(server, mission, "observation-requests", "South")["value"] == 44.0

        for page in (one, other):
            select(page, "West")
        other.get_by_role("button", name="Delete target").click()
        expect(one.get_by_text("This target was deleted meanwhile.")).to_be_visible()
        one.get_by_role("button", name="Put it back").click()
        expect(other.get_by_test_id("target-row")).to_have_count(3)
        expect(one.get_by_label("Name of the target")).to_have_value("West")


def test_what_somebody_changed_first_is_not_deleted_unseen(server: Server) -> None:
    mission = small_mission(server, "Changed first")
    request = the(server, mission, "observation-requests", "North")["id"]
    with (
        chromium() as browser,
        open_page(browser, server, refused=f"observation-requests/{request}", status=412) as slow,
        open_page(browser, server, "?quality=test&webgl=off") as other,
    ):
        silent = {"content_type": "text/event-stream", "body": "retry: 600000\n\n"}
        slow.route("**/missions/*/events", lambda route: route.fulfill(**silent))  # it hears of no change
        for page in (slow, other):
            page.goto(f"{server}/?quality=test&webgl=off#/m/{mission}")
            select(page, "North")
        edit_value(other, "50")
        other.get_by_test_id("save-request").click()
        expect(other.get_by_test_id("save-request")).to_have_count(0)
        slow.get_by_role("button", name="Delete request").click()
        expect(slow.get_by_text("somebody else changed it first")).to_be_visible()
        expect(slow.get_by_text("value 50")).to_be_visible()  # what is there now is shown
        slow.get_by_role("button", name="Delete request").click()
        expect(other.get_by_role("button", name="Edit request")).to_have_count(0)
        slow.unroute_all(behavior="ignoreErrors")
