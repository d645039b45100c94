"""A plan flown many times on the page: partial results, bars that open their runs, a run that is replayed."""

from __future__ import annotations

import pytest
from playwright.sync_api import expect

from tests.web.conftest import Server
from tests.web.missions import ask, make_plan, small_mission
from tests.web.page import chromium, open_page, shot

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.xdist_group("browser")]

RUNS = 400


def test_a_plan_is_flown_many_times_and_one_run_is_replayed(server: Server) -> None:
    mission = small_mission(server, "Campaign")
    plan = make_plan(server, mission)
    with chromium() as browser, open_page(browser, server) as page:
        page.goto("about:blank")
        page.goto(f"{server}/?quality=test#/m/{mission}?plan={plan}&tab=plan")
        page.get_by_test_id("campaign").click()
        dialog = page.get_by_role("dialog")
        expect(dialog).to_contain_text("how many go wrong")
        page.get_by_test_id("campaign-runs").fill(str(RUNS))
        page.get_by_test_id("fly").click()

        expect(dialog.get_by_role("link", name="Report")).to_be_visible()
        told = ask(server, f"/missions/{mission}/campaigns")["items"][-1]
        result = ask(server, f"/campaigns/{told['id']}/result")
        assert result["runs"] == RUNS
        expect(page.get_by_test_id("campaign-mean")).to_have_text(f"{result['utility']['mean']:.2f}")
        expect(page.get_by_test_id("campaign-verdict")).to_contain_text(
            f"{result['utility']['predicted']:.2f}"
        )
        shot(page, "campaign")

        fullest = max(result["histogram"], key=lambda bin: bin["runs"])
        bars = dialog.get_by_role("group", name="Runs by utility").get_by_role("button")
        assert bars.count() == len(result["histogram"])
        bars.nth(result["histogram"].index(fullest)).click()
        listed = page.get_by_test_id("flown-runs")
        expect(listed).to_contain_text(f"{fullest['runs']} runs")

        row = listed.get_by_role("row").nth(1)
        seed = int(row.get_by_role("cell").first.inner_text())
        flown = ask(server, f"/campaigns/{told['id']}/runs?limit={RUNS}")["items"][seed - 1]
        row.get_by_role("button", name="Replay").click()
        expect(dialog).to_have_count(0)
        expect(page.get_by_test_id("run-select").locator("option:checked")).to_contain_text(
            f"seed {seed} · {flown['outcome'].lower()}"
        )
        run = ask(server, f"/missions/{mission}/runs")["items"][-1]
        assert (run["seed"], run["outcome"], run["utility"]) == (seed, flown["outcome"], flown["utility"])
        assert run["energy_used_j"] == pytest.approx(flown["energy_used_j"], abs=0.1)
