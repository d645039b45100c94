"""Rows pasted from a spreadsheet: one request and one undo; what cannot be used is shown, nothing is made."""

from __future__ import annotations

from pathlib import Path

import pytest
from playwright.sync_api import expect

from benchmarks.page.paste import rows
from tests.web.conftest import Server
from tests.web.missions import ask, small_mission
from tests.web.page import chromium, open_page

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.xdist_group("browser")]

ROWS = 500


def test_rows_are_pasted_as_one_act_and_those_that_cannot_be_used_are_shown(
    server: Server, tmp_path: Path
) -> None:
    mission = small_mission(server, "Paste")
    with (
        chromium() as browser,
        open_page(browser, server, "?quality=test&webgl=off", refused="bulk") as page,
    ):
        page.goto(f"{server.address}/?quality=test&webgl=off#/m/{mission}")
        expect(page.get_by_test_id("target-row")).to_have_count(3)
        changes: list[str] = []
        page.on(
            "request",
            lambda r: changes.append(r.url) if r.method != "GET" and "presence" not in r.url else None,
        )
        lines = rows(ROWS, seed=20).split("\n")
        wrong = list(lines)
        wrong[17] = "P16\t900\t2.5\tscience camera\t3"  # only the server knows the ground
        wrong[203] = "P202\t1.5\t2.5\tscience camera\t-3"
        wrong[400] = "North\t1.5\t2.5\tscience camera\t3"
        page.get_by_role("button", name="Edit in a table").click()
        page.get_by_role("button", name="Paste targets").click()
        field, add = page.get_by_label("Targets to paste"), page.get_by_role("button", name="targets with a")
        shown = page.get_by_test_id("wrong-rows").locator("tbody tr")
        field.fill("\n".join(wrong))
        expect(shown).to_have_count(2)
        expect(shown.first).to_have_text("204P202value-3value is “-3”, not a number of at least 0")
        expect(shown.last).to_have_text("401NorthnameNorththere is a target “North” already")
        expect(add).to_be_disabled()

        wrong[203], wrong[400] = lines[203], lines[400]
        field.fill("\n".join(wrong))
        add.click()
        expect(shown).to_have_count(1)
        expect(shown).to_contain_text("18P16east900point (900.00, 2.50) lies outside the terrain")
        expect(page.get_by_test_id("pasted")).to_contain_text("1 cannot be used; nothing is added")
        assert ask(server, f"/missions/{mission}/targets?count=true")["total"] == 3

        file = tmp_path / "rows.tsv"
        file.write_text("\n".join(lines))
        content = page.evaluate_handle(
            """text => {
                const data = new DataTransfer();
                data.items.add(new File([text], 'rows.tsv'));
                return data;
            }""",
            file.read_text(),
        )
        field.dispatch_event("drop", {"dataTransfer": content})
        expect(shown).to_have_count(0)
        changes.clear()
        reads: list[str] = []
        page.on("request", lambda r: reads.append(r.url) if r.method == "GET" else None)
        add.click()
        expect(field).to_have_count(0)  # the word of it is gone before a busy machine looks
        assert [url.rsplit("/", 2)[1:] for url in changes] == [["observation-requests", "bulk"]]
        page.keyboard.press("Escape")
        expect(page.get_by_test_id("target-row")).to_have_count(3 + ROWS)
        page.wait_for_timeout(2000)  # what is told of the act has come
        lists = [url.rsplit("/", 1)[1] for url in reads if "cursor" not in url]
        for name in ("targets", "observation-requests"):
            assert sum(one.startswith(name) for one in lists) == 1, lists

        changes.clear()
        page.keyboard.press("Control+z")
        expect(page.get_by_test_id("target-row")).to_have_count(3)
        assert [url.rsplit("/", 1)[1] for url in changes] == ["undo"]
        assert len(ask(server, f"/missions/{mission}/observation-requests")["items"]) == 3


def test_a_change_of_many_requests_is_one_act(server: Server) -> None:
    mission = small_mission(server, "Bulk")
    with chromium() as browser, open_page(browser, server) as page:
        page.goto(f"{server.address}/?quality=test&webgl=off#/m/{mission}")
        expect(page.get_by_test_id("target-row")).to_have_count(3)
        page.get_by_role("button", name="Edit in a table").click()
        page.get_by_label("All", exact=True).check()
        page.get_by_role("spinbutton", name="Value").first.fill("7")
        page.get_by_role("button", name="Set", exact=True).click()
        expect(page.get_by_text("3 of 3 requests changed")).to_be_visible()
        items = f"/missions/{mission}/observation-requests"
        assert [one["value"] for one in ask(server, items)["items"]] == [7.0] * 3
        page.get_by_role("button", name="Delete", exact=True).click()
        expect(page.get_by_text("3 of 3 requests deleted")).to_be_visible()
        page.keyboard.press("Escape")
        page.keyboard.press("Control+z")
        page.keyboard.press("Control+z")
        expect(page.get_by_test_id("target-row").first).to_contain_text("9")
        assert [one["value"] for one in ask(server, items)["items"]] == [9.0, 12.0, 4.0]


def test_a_long_table_makes_the_rows_in_sight_and_loses_nothing_typed(server: Server) -> None:
    mission, count = small_mission(server, "Long table", targets=0), 300
    places = [{"name": f"L{k:03}", "east_m": -10 + k / 20, "north_m": 8.0} for k in range(count)]
    form = {"instrument": "science_camera", "value": 2.0}
    order = {"create": [{**form, "target": place} for place in places]}
    ask(server, f"/missions/{mission}/observation-requests/bulk", order)
    with chromium() as browser, open_page(browser, server) as page:
        page.goto(f"{server.address}/?quality=test&webgl=off#/m/{mission}")
        expect(page.get_by_test_id("target-row")).to_have_count(count)
        page.get_by_role("button", name="Edit in a table").click()
        table = page.get_by_role("table")
        assert table.get_attribute("aria-rowcount") == str(count + 1)
        assert table.locator("tbody tr").count() < 100
        value = table.get_by_role("row", name="L003").get_by_label("Value")
        value.fill("7")
        table.evaluate("t => (t.parentElement.scrollTop = t.parentElement.scrollHeight)")
        last = table.get_by_role("row", name=f"L{count - 1}")
        expect(last).to_be_visible()
        expect(value).to_have_count(0)
        items = f"/missions/{mission}/observation-requests?limit=500"
        page.wait_for_timeout(1000)
        assert [one["value"] for one in ask(server, items)["items"]] == [2.0] * 3 + [7.0] + [2.0] * (
            count - 4
        )
        last.get_by_label("Value").fill("5")
        page.keyboard.press("Tab")
        page.wait_for_timeout(1000)
        assert ask(server, items)["items"][-1]["value"] == 5.0
