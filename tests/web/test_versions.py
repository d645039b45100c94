"""Versions of a plan on the page: what differs in words and on the tree, and a merge with a choice."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from tests.web.conftest import Server
from tests.web.missions import ask, make_plan, small_mission
from tests.web.page import chromium, open_page, shot

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.xdist_group("browser")]

RAW_ID = re.compile(r"\b(tgt|req|pln|msn|dft|sol|kpo)-[0-9a-z]{6,}")


def _text(page: Page, server: Server, plan: str) -> str:
    return page.request.get(f"{server.address}/api/v1/plans/{plan}/crl").text()


def _edited(text: str, **retries: int) -> str:
    """Return the text with the retries of its n-th task set: `t0=2`."""
    places = [at + len("(task") for at in range(len(text)) if text.startswith("(task", at)]
    for name, count in sorted(retries.items(), reverse=True):
        at = places[int(name[1:])]
        text = f"{text[:at]} :retries {count}{text[at:]}"
    return text


def _kept(server: Server, mission: str, base: str, text: str, name: str) -> dict[str, Any]:
    """Return the plan of an edited text; an edit against nothing is merged without a conflict."""
    sides = {"base": {"plan_id": base}, "ours": {"crl": text}, "theirs": {"plan_id": base}}
    found: dict[str, Any] = ask(server, f"/missions/{mission}/plan-merges", {**sides, "name": name})
    assert found["conflicts"] == []
    return dict(found["plan"])


def test_plans_are_compared_in_words_and_merged_with_a_choice(server: Server, tmp_path: Path) -> None:
    mission = small_mission(server, "Versions")
    base = make_plan(server, mission)
    with chromium() as browser, open_page(browser, server) as page:
        text = _text(page, server, base)
        anna = _kept(server, mission, base, _edited(text, t0=2, t2=4), "Anna's")
        file = tmp_path / "ben.crl"
        file.write_text(_edited(text, t0=3, t1=5))
        page.goto(f"{server}/?quality=test#/m/{mission}?plan={base}&tab=plan")

        # The difference in words, and marked on outline and timeline.
        page.get_by_test_id("compare").click()
        dialog = page.get_by_role("dialog", name="Compare plans")
        dialog.get_by_test_id("compare-with").select_option(anna["id"])
        changes = dialog.get_by_test_id("changes")
        expect(changes.locator("> ul > li")).to_have_count(2)
        expect(changes).to_contain_text("retries")
        expect(dialog).to_contain_text("was merged from others")
        assert not RAW_ID.search(dialog.inner_text())
        dialog.get_by_test_id("mark-changes").click()
        expect(dialog).to_have_count(0)
        expect(page.get_by_test_id("against")).to_contain_text("Anna's")
        expect(page.get_by_test_id("outline").get_by_test_id("mark")).to_have_text(["changed", "changed"])
        expect(page.get_by_test_id("dock")).to_have_attribute("data-marked", "2")
        shot(page, "difference-marked")
        page.get_by_role("button", name="Take marks off").click()
        expect(page.get_by_test_id("mark")).to_have_count(0)

        # The merge: Anna's plan and Ben's file, by keyboard from the conflict on.
        page.get_by_test_id("plan-select").select_option(anna["id"])
        expect(page.get_by_text("No planner vouches for it")).to_be_visible()
        page.get_by_test_id("merge-plans").click()
        dialog = page.get_by_role("dialog", name="Merge plans")
        expect(dialog.get_by_test_id("merge-base")).to_have_value(base)
        dialog.get_by_test_id("merge-theirs").select_option("file")
        dialog.get_by_test_id("merge-file-theirs").set_input_files(file)
        state = dialog.get_by_test_id("merge-state")
        expect(state).to_have_text("1 conflict, 1 open. All else is joined.")
        conflict = dialog.get_by_test_id("conflict")
        expect(conflict).to_contain_text(": retries")
        expect(conflict).to_contain_text("both changed it")
        save = dialog.get_by_test_id("save-merge")
        expect(save).to_be_disabled()
        assert not RAW_ID.search(dialog.inner_text())
        shot(page, "merge-plans")
        conflict.get_by_role("radio").first.focus()
        page.keyboard.press("Space")
        page.keyboard.press("ArrowDown")
        expect(conflict.get_by_role("radio").nth(1)).to_be_checked()
        expect(state).to_have_text("The conflict is decided.")
        dialog.get_by_label("Name of the merged plan").fill("Anna and Ben")
        page.keyboard.press("Enter")
        expect(dialog).to_have_count(0)
        expect(page.get_by_role("heading", name="Anna and Ben")).to_be_visible()
        expect(page.get_by_text("theirs taken at")).to_be_visible()
        assert not RAW_ID.search(page.locator("#sheet").inner_text())
        merged = ask(server, f"/missions/{mission}/plans")["items"][-1]
        assert (merged["name"], merged["parent_id"]) == ("Anna and Ben", base)
        crl = _text(page, server, merged["id"])
        assert sorted(re.findall(r":retries (\d)", crl)) == ["3", "4", "5"]
        page.get_by_role("tab", name="CRL").click()
        expect(page.locator("#sheet")).to_contain_text(":retries")


def test_what_is_no_plan_is_refused_in_the_dialog_and_nothing_is_made(server: Server, tmp_path: Path) -> None:
    mission = small_mission(server, "No plan")
    base = make_plan(server, mission)
    file = tmp_path / "broken.crl"
    file.write_text("(plan :node (block")
    with chromium() as browser, open_page(browser, server, refused="/plan-merges") as page:
        page.goto(f"{server}/?quality=test#/m/{mission}?plan={base}&tab=plan")
        page.get_by_test_id("merge-plans").click()
        dialog = page.get_by_role("dialog", name="Merge plans")
        dialog.get_by_test_id("merge-file-theirs").set_input_files(file)
        expect(dialog.get_by_role("alert")).to_contain_text("line 1")
        expect(dialog.get_by_test_id("save-merge")).to_be_disabled()
    assert len(ask(server, f"/missions/{mission}/plans")["items"]) == 1


def test_a_plan_that_is_opened_behind_the_comparison_is_compared_with_another(server: Server) -> None:
    mission = small_mission(server, "Behind the dialog")
    first, second = make_plan(server, mission), make_plan(server, mission)
    with chromium() as browser, open_page(browser, server) as page:
        page.goto(f"{server}/?quality=test#/m/{mission}?plan={first}&tab=plan")
        page.get_by_test_id("compare").click()
        dialog = page.get_by_role("dialog", name="Compare plans")
        expect(dialog.get_by_test_id("paired")).to_contain_text("Beats the other with")
        expect(dialog.get_by_test_id("compare-with")).to_have_value(second)
        page.evaluate("hash => { location.hash = hash }", f"#/m/{mission}?plan={second}&tab=plan")
        expect(dialog.locator(".heads .a b")).to_contain_text("#2")
        expect(dialog.get_by_test_id("compare-with")).to_have_value(first)
        expect(dialog.get_by_test_id("paired")).to_contain_text("Beats the other with")
