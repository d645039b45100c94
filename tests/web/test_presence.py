"""Two people on one mission see each other: who is here, and what each has selected."""

from __future__ import annotations

import pytest
from playwright.sync_api import Page, Route, expect

from tests.waiting import until
from tests.web.conftest import Server
from tests.web.missions import ask, make_plan, small_mission
from tests.web.page import chromium, open_page, shot
from tests.web.review_steps import become
from tests.web.test_traverse import axe

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.xdist_group("browser")]
SOON_MS = 5_000
"""The page tells a selection after a quarter of a second; the rest is for a busy machine."""
SOON_S = SOON_MS / 1000


def lookers(server: Server, mission: str) -> list[str]:
    """Return who looks at a mission, once for each page."""
    return [one["person"] for one in ask(server, f"/missions/{mission}/presence")]


def look(page: Page, server: Server, mission: str) -> None:
    """Open a mission and wait for its targets."""
    page.goto(f"{server}/?quality=test&webgl=off#/m/{mission}")
    expect(page.get_by_test_id("target-row")).to_have_count(3)


def test_a_selection_of_somebody_else_appears_moves_and_goes_away(server: Server) -> None:
    mission = small_mission(server, "Seen together")
    with (
        chromium() as browser,
        open_page(browser, server, "?webgl=off") as planner,
        open_page(browser, server, "?webgl=off") as director,
    ):
        look(planner, server, mission)
        expect(planner.get_by_test_id("looker")).to_have_count(0)  # nobody else, and not oneself
        look(director, server, mission)
        until(
            lambda: len(lookers(server, mission)) == 2, SOON_S
        )  # both pages have said it, as the same person
        become(director, "flight director")
        until(lambda: lookers(server, mission) == ["Flight Director", "Planner"], SOON_S)
        mark = planner.get_by_role("button", name="Flight Director looks at this mission")
        expect(mark).to_have_text("FD", timeout=SOON_MS)
        expect(mark).to_have_attribute("title", "Flight Director looks at this mission")
        expect(planner.get_by_test_id("looker")).to_have_count(1)  # who was Planner there is gone
        expect(director.get_by_role("button", name="Planner looks at this mission")).to_be_visible()

        rows = director.get_by_test_id("target-row")
        seen = planner.get_by_test_id("target-row")
        where = planner.get_by_test_id("map")
        for name, other in (("North", "South"), ("South", "North")):
            rows.filter(has_text=name).click()
            expect(seen.filter(has_text=name).get_by_test_id("seen-by")).to_have_text("FD", timeout=SOON_MS)
            expect(seen.filter(has_text=other).get_by_test_id("seen-by")).to_have_count(0)
            expect(where).to_have_attribute("data-others", f"{name} FD")
            expect(planner.get_by_test_id("looker")).to_have_attribute(
                "title", f"Flight Director looks at {name}"
            )
        assert axe(planner) == []
        shot(planner, "presence")

        director.locator("button.item.sub").first.click()  # a request, which marks its target on the map
        label = planner.get_by_role("img", name="selected by Flight Director")
        expect(label).to_have_count(1)
        expect(where).to_have_attribute("data-others", "North FD")
        planner.get_by_test_id("looker").click()  # to what the other one looks at
        expect(planner.get_by_label("Name of the target")).to_have_value("North")
        expect(director.get_by_test_id("looker")).to_have_attribute(
            "title", "Planner looks at North · microscopic imager"
        )

        director.goto("about:blank")
        expect(planner.get_by_test_id("looker")).to_have_count(0, timeout=SOON_MS)
        expect(planner.get_by_test_id("seen-by")).to_have_count(0)
        expect(where).to_have_attribute("data-others", "")
        planner.goto("about:blank")
        until(lambda: lookers(server, mission) == [], SOON_S)
    history = ask(server, f"/missions/{mission}/history?limit=500")["items"]
    assert {event["actor"] for event in history} == {"Planner"}  # who only looked is no part of it


def test_who_changes_the_person_does_not_wait_for_a_word_that_hangs(server: Server) -> None:
    mission = small_mission(server, "Heard slowly")
    with chromium() as browser, open_page(browser, server, "?webgl=off") as page:
        held: list[Route] = []
        page.route("**/presence/*", lambda route: held.append(route))  # neither answered nor refused
        look(page, server, mission)
        page.wait_for_timeout(1_000)  # the page says it after a quarter of a second
        assert held != []
        with page.expect_response(
            lambda got: got.url.endswith("/session") and got.request.method == "POST"
        ) as told:
            become(page, "flight director")
        assert told.value.json()["person"]["name"] == "Flight Director"


def test_a_comment_on_a_step_of_a_plan_is_seen_by_the_other_and_leads_to_the_step(server: Server) -> None:
    mission = small_mission(server, "Said of a step")
    plan = make_plan(server, mission)
    with (
        chromium() as browser,
        open_page(browser, server, "?webgl=off") as planner,
        open_page(browser, server, "?webgl=off") as director,
    ):
        for page in (planner, director):
            page.goto(f"{server}/?quality=test&webgl=off#/m/{mission}?plan={plan}&tab=plan")
            expect(page.get_by_test_id("outline")).to_be_visible()
        become(director, "flight director")
        expect(planner.get_by_test_id("step-comments")).to_have_count(0)
        step = director.get_by_test_id("outline").locator("button.observe").first
        name = step.locator("b").inner_text()
        step.click()
        director.get_by_role("tab", name="Selection").click()
        director.get_by_label("Say something").fill("Why so early?")
        director.get_by_role("button", name="Send").click()
        mark = planner.get_by_test_id("step-comments")
        expect(mark).to_have_attribute("title", "1 comment")
        assert axe(planner) == []
        planner.get_by_role("tab", name="Review").click()
        expect(planner.get_by_text("Why so early?")).to_be_visible()
        planner.locator(".comment button").click()  # to the step that it is on
        expect(planner.get_by_role("heading", name=name)).to_be_visible()
        expect(planner.get_by_text("Why so early?")).to_be_visible()
        planner.get_by_role("tab", name="Plan", exact=True).click()
        planner.get_by_test_id("outline").locator("button.observe").last.click()
        planner.get_by_role("tab", name="Selection").click()  # another step has none
        expect(planner.get_by_text("Comments 0")).to_be_visible()
