"""Dragging and picking by pointer, what comes while a run goes on, uploads and jobs that are stopped."""

from __future__ import annotations

import io
import json
import re
import zipfile
from typing import Any
from urllib.request import Request, urlopen

import pytest
from playwright.sync_api import Page, Route, expect

from tests.web.conftest import Server
from tests.web.missions import KEEP_OUT, TARGETS, ask, make_plan, small_mission
from tests.web.page import chromium, open_page, pixel, shot

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.xdist_group("browser")]


def _open(page: Page, server: Server, mission: str, query: str = "?quality=test", rest: str = "") -> None:
    page.goto("about:blank")
    page.goto(f"{server.address}/{query}#/m/{mission}{rest}")
    page.wait_for_function("() => document.querySelector('[data-testid=map], [data-testid=scene]')")
    expect(page.get_by_test_id("target-row").first).to_be_visible()


def test_what_is_saved_late_takes_nobody_away_from_where_they_went(server: Server) -> None:
    mission = small_mission(server, "A slow link")

    def late(route: Route) -> None:
        if route.request.method == "POST":
            page.wait_for_timeout(1500)
        route.continue_()

    with chromium() as browser, open_page(browser, server) as page:
        _open(page, server, mission)
        page.wait_for_function("() => document.querySelector('[data-testid=map]')?.dataset.terrain")
        before = len(ask(server, f"/missions/{mission}/keep-outs")["items"])
        page.route(re.compile("keep-outs$"), late)
        page.keyboard.press("o")
        corners = [pixel(page, *corner) for corner in ((4.0, -4.0), (5.0, -4.0), (4.5, -3.0))]
        for corner in corners:
            page.mouse.click(*corner)
        with page.expect_response(re.compile("keep-outs$")) as answer:
            page.mouse.dblclick(*corners[0])
            page.get_by_role("tab", name="Plan", exact=True).click()
        assert answer.value.status == 201
        page.get_by_role("tab", name=re.compile("^Keep-outs")).click()
        expect(page.get_by_role("tab", name=re.compile("^Keep-outs"))).to_contain_text(str(before + 1))
        expect(page.get_by_role("tab", name="Plan", exact=True)).to_have_attribute("aria-selected", "true")


def test_a_click_means_what_it_meant_when_the_pointer_went_down(server: Server) -> None:
    """The map waits a quarter of a second for a second click; who leaves a tool meanwhile selects nothing."""
    mission = small_mission(server, "A quick hand")
    with chromium() as browser, open_page(browser, server) as page:
        _open(page, server, mission)
        page.wait_for_function("() => document.querySelector('[data-testid=map]')?.dataset.terrain")
        at_a_target = pixel(page, *TARGETS[0][1:3])
        page.keyboard.press("m")
        page.mouse.click(*at_a_target)
        page.keyboard.press("Escape")
        page.wait_for_timeout(600)
        assert "sel=" not in page.url
        page.mouse.click(*at_a_target)
        page.wait_for_url(re.compile("sel=target"))


def test_a_click_counts_while_ground_is_drawn_anew_and_a_double_click_counts_once(server: Server) -> None:
    mission = small_mission(server, "Ground that comes")

    def names() -> list[str]:
        return [target["name"] for target in ask(server, f"/missions/{mission}/targets")["items"]]

    before = names()
    with chromium() as browser, open_page(browser, server) as page:
        _open(page, server, mission)
        page.wait_for_function(
            "() => document.querySelector('[data-testid=map]')?.dataset.ground === 'sharp'"
        )
        page.keyboard.press("t")
        page.mouse.move(*pixel(page, 1.0, -2.0))
        page.mouse.down()
        page.evaluate("() => document.querySelector('[data-testid=map] .ol-layers').replaceChildren()")
        page.mouse.up()
        page.wait_for_url(re.compile("sel=target"))
        assert len(names()) == len(before) + 1
        page.keyboard.press("t")
        page.mouse.dblclick(*pixel(page, -1.0, -2.0))
        expect(page.get_by_test_id("target-row")).to_have_count(len(before) + 2)
        page.wait_for_timeout(600)
        assert len(names()) == len(before) + 2


def test_a_place_to_stand_is_dragged_in_3d_saved_and_undone(server: Server) -> None:
    mission = small_mission(server, "Drag in 3D")

    def request() -> dict[str, Any]:
        items = ask(server, f"/missions/{mission}/observation-requests")["items"]
        return next(r for r in items if r["target_name"] == "South")

    placed = request()["observation_point"]
    assert placed["manual"] is False
    with chromium() as browser, open_page(browser, server) as page:
        _open(page, server, mission)
        page.get_by_test_id("target-row").filter(has_text="South").click()
        page.keyboard.press("3")
        scene = page.get_by_test_id("scene")
        expect(scene).to_have_attribute("data-ready", "true")
        page.wait_for_timeout(1500)
        # The keys bring the crosshair to where the rover is to stand: there is what the pointer takes.
        scene.focus()
        page.keyboard.press("g")
        x, y = (float(part) for part in str(scene.get_attribute("data-cross")).split(","))
        page.keyboard.press("Escape")
        box = scene.bounding_box()
        assert box is not None
        x, y = box["x"] + x, box["y"] + y
        hint = page.get_by_test_id("stand-hint")
        sheet = page.locator("article .request").first

        page.mouse.move(x, y - 3)
        page.mouse.down()
        page.mouse.move(x + 190, y + 60, steps=6)
        expect(hint).to_contain_text("Refused")
        page.mouse.up()
        expect(page.get_by_text("stays where it was")).to_be_visible()
        assert request()["observation_point"] == placed

        page.mouse.move(x, y - 3)
        page.mouse.down()
        page.mouse.move(x + 2, y - 4, steps=3)
        expect(hint).to_contain_text("Reached")
        page.mouse.up()
        expect(sheet).to_contain_text("set by hand")
        now = request()["observation_point"]
        assert now["manual"] is True
        far = [abs(now["pose"][key] - placed["pose"][key]) for key in ("east_m", "north_m")]
        assert 0.0 < max(far) < 0.5, far
        page.keyboard.press("Control+z")
        expect(sheet).not_to_contain_text("set by hand")
        assert request()["observation_point"]["pose"] == placed["pose"]


def test_a_keep_out_dragged_in_a_what_if_is_weighed_and_not_saved_until_it_is_accepted(
    server: Server,
) -> None:
    mission = small_mission(server, "What if")
    make_plan(server, mission)

    def saved() -> list[list[float]]:
        return ask(server, f"/missions/{mission}/keep-outs")["items"][0]["polygon_m"]  # type: ignore[no-any-return]

    with chromium() as browser, open_page(browser, server, refused="/what-if") as page:
        _open(page, server, mission, "?webgl=off")
        asked: list[dict[str, Any]] = []

        def note(route: Route) -> None:
            asked.append(json.loads(route.request.post_data or "{}"))
            route.continue_()

        page.route("**/what-if", note)
        page.keyboard.press("w")
        answer = page.get_by_test_id("what-if-answer")
        expect(answer).to_have_attribute("data-ms", re.compile(r"\d+"))
        expect(page.get_by_test_id("keep-out-hint")).to_contain_text("nothing is saved")
        area = page.get_by_test_id("map")
        before = area.screenshot()

        # The whole, by its inside: over the way to the northern target. Asked while it moves, not only then.
        page.get_by_role("tab", name=re.compile("^Keep-outs")).click()
        page.locator("button.item").first.click()
        page.get_by_role("tab", name="Plan", exact=True).click()
        expect(answer).to_have_attribute("data-ms", re.compile(r"\d+"))
        asked.clear()
        page.mouse.move(*pixel(page, 7.5, 3.5))
        page.mouse.down()
        page.mouse.move(*pixel(page, 5.5, 3.5), steps=4)
        page.wait_for_function("() => true")
        for _ in range(200):
            if any("keep_outs" in body for body in asked):
                break
            page.wait_for_timeout(50)
        assert any("keep_outs" in body for body in asked), "weighed while it is dragged"
        page.mouse.move(*pixel(page, 3.0, 3.5), steps=4)
        page.mouse.up()
        expect(answer).to_have_attribute("aria-busy", "false")
        expect(answer).to_contain_text("on the same futures")
        tried = asked[-1]["keep_outs"][0]
        east = [corner[0] for corner in tried]
        assert min(east) == pytest.approx(1.5, abs=0.15)
        assert max(east) == pytest.approx(4.5, abs=0.15)
        assert float(str(answer.get_attribute("data-change"))) < -1.0, "the target under it is lost"
        assert saved() == KEEP_OUT, "nothing is saved"
        assert area.screenshot() != before

        # A corner.
        asked.clear()
        corner = tried[1]
        page.mouse.move(*pixel(page, *corner))
        page.mouse.down()
        page.mouse.move(*pixel(page, corner[0] + 1.0, corner[1] - 0.5), steps=4)
        page.mouse.up()
        expect(answer).to_have_attribute("aria-busy", "false")
        page.wait_for_timeout(300)
        assert asked[-1]["keep_outs"][0][1] == pytest.approx([corner[0] + 1.0, corner[1] - 0.5], abs=0.15)
        shot(page, "what-if-keep-out")

        # Put back; tried again by keys, and then saved for the mission.
        page.get_by_role("button", name="Put K1 back").click()
        expect(answer).to_contain_text("change something")
        area.focus()
        page.keyboard.press("g")
        expect(area).to_have_attribute("data-held", "true")
        for _ in range(3):
            page.keyboard.press("ArrowRight")
        page.keyboard.press("Enter")
        expect(page.get_by_test_id("accept-keep-outs")).to_be_visible()
        assert saved() == KEEP_OUT
        page.get_by_test_id("accept-keep-outs").click()
        expect(page.get_by_test_id("accept-keep-outs")).to_have_count(0)
        resolution = float(str(area.get_attribute("data-resolution")))
        moved = [p[0] - q[0] for p, q in zip(saved(), KEEP_OUT, strict=True)]
        assert moved == pytest.approx([24 * resolution] * 4, abs=2e-3)


def test_pictures_come_while_the_run_goes_on(server: Server) -> None:
    mission = small_mission(server, "Pictures")
    plan = make_plan(server, mission)
    with chromium() as browser, open_page(browser, server) as page:
        _open(page, server, mission, "?webgl=off", f"?plan={plan}&tab=run")
        page.get_by_test_id("pace").select_option("900")
        page.get_by_test_id("start-run").click()
        live = page.get_by_test_id("live-run")
        expect(live).to_be_visible()
        tiles = page.locator(".sheet").get_by_test_id("product")
        expect(tiles.first).to_be_visible()
        page.keyboard.press(" ")
        expect(live).to_have_attribute("data-held", "true")
        page.wait_for_function(
            "() => document.querySelector('.sheet [data-testid=product] img')?.naturalWidth > 0"
        )
        source = str(tiles.locator("img").first.get_attribute("src"))
        assert re.fullmatch(r"/api/v1/runs/run-\w+/products/prd-\w+/file", source)
        assert ask(server, f"/missions/{mission}/products")["items"] == [], "recorded only at the end"
        shot(page, "live-pictures")
        tiles.first.click()
        sheet = page.get_by_test_id("product-sheet")
        expect(sheet).to_be_visible()
        opened = page.url
        expect(sheet.get_by_label("Say something")).to_have_count(0)
        page.keyboard.press("r")
        page.get_by_label("Pace of the run").select_option("0")
        page.keyboard.press(" ")
        expect(page.get_by_test_id("run-outcome")).not_to_have_text(re.compile("queued|running"))
        count = len(ask(server, f"/missions/{mission}/products")["items"])
        expect(page.get_by_role("tab", name=f"Products {count}")).to_be_visible()
        page.goto(opened)
        expect(sheet).to_be_visible()
        expect(sheet.get_by_label("Say something")).to_be_visible()


def _big_upload() -> bytes:
    """Return a zip that is not a terrain and takes a while to send."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr("dem.tif", b"\x5a" * 12_000_000)
    return packed.getvalue()


def test_an_upload_shows_how_far_it_is_and_can_be_stopped(server: Server) -> None:
    with chromium() as browser, open_page(browser, server) as page:
        # As slow as a link to a field camp: 500 kB a second.
        session = page.context.new_cdp_session(page)
        session.send("Network.enable")
        slow = {"offline": False, "latency": 5, "downloadThroughput": 10_000_000, "uploadThroughput": 500_000}
        page.get_by_role("button", name="New mission").first.click()
        page.get_by_role("textbox", name="Name", exact=True).fill("Never made")
        page.get_by_label("A terrain of your own").check()
        page.get_by_test_id("terrain-file").set_input_files(
            {"name": "big.zip", "mimeType": "application/zip", "buffer": _big_upload()}
        )
        session.send("Network.emulateNetworkConditions", slow)
        page.get_by_role("button", name="Open", exact=True).click()
        progress = page.get_by_test_id("upload-progress")
        expect(progress).to_contain_text("Sending big.zip")
        expect(progress).to_contain_text(re.compile(r"[1-9]\d? %"))
        bar = progress.get_by_role("progressbar")
        first = float(bar.evaluate("bar => bar.value"))
        page.wait_for_function(
            f"() => document.querySelector('[data-testid=upload-progress] progress').value > {first + 0.02}"
        )
        page.get_by_role("button", name="Stop").click()
        expect(page.get_by_role("dialog")).to_have_count(0)
        fast = {**slow, "uploadThroughput": -1, "downloadThroughput": -1, "latency": 0}
        session.send("Network.emulateNetworkConditions", fast)
        page.reload()
        expect(page.get_by_role("heading", name="Missions")).to_be_visible()
        expect(page.get_by_role("link", name="Never made")).to_have_count(0)


def test_a_job_is_cancelled_from_the_header_and_said_to_be(server: Server) -> None:
    mission = small_mission(server, "Cancelled")
    with chromium() as browser, open_page(browser, server) as page:
        _open(page, server, mission, "?webgl=off")
        page.keyboard.press("p")
        page.get_by_label("Time limit, s").fill("300")
        page.get_by_test_id("plan").click()
        job = page.get_by_test_id("job")
        expect(job).to_contain_text("Planning")
        # A job reports often; the button may be drawn anew under the pointer.
        page.get_by_role("button", name="Cancel Planning").dispatch_event("click")
        expect(job).to_have_count(0)
        plan = ask(server, f"/missions/{mission}/plans")["items"][-1]
        state = ask(server, f"/jobs/{plan['job_id']}")["state"]
        # What was asked to stop hands in the plan it has, if it has one.
        assert state in {"cancelled", "succeeded"}
        if state == "cancelled":
            expect(page.get_by_text("Cancelled before there was a plan.").first).to_be_visible()
        else:
            expect(page.get_by_test_id("plan-state")).to_have_text("computed")


def test_a_risk_of_an_overrun_is_asked_for_in_per_cent_and_checked(server: Server) -> None:
    mission = small_mission(server, "Risk")
    with chromium() as browser, open_page(browser, server) as page:
        _open(page, server, mission, "?webgl=off")
        page.keyboard.press("p")
        risk = page.get_by_test_id("risk")
        risk.fill("120")
        expect(page.get_by_text("it has to be less than 100")).to_be_visible()
        page.get_by_test_id("plan").click()
        expect(page.get_by_text("No plan was asked for")).to_be_visible()
        assert ask(server, f"/missions/{mission}/plans")["items"] == []
        risk.fill("2.5")
        page.get_by_label("Time limit, s").fill("3")
        page.get_by_test_id("plan").click()
        expect(page.get_by_test_id("plan-state")).to_have_text("computed")
        plan = ask(server, f"/missions/{mission}/plans")["items"][-1]
        request = Request(
            f"{server.address}/api/v1/plans/{plan['id']}/summary", headers={"X-Outcrop-Person": "Planner"}
        )
        with urlopen(request, timeout=60) as summary:
            assert json.load(summary)["max_overrun_probability"] == pytest.approx(0.025)


def test_deleting_a_request_and_leaving_a_sheet_while_it_answers_is_no_error(server: Server) -> None:
    mission = small_mission(server, "Sheets")
    plan = make_plan(server, mission)

    def answer_late(route: Route) -> None:
        page.wait_for_timeout(700)
        route.continue_()

    with chromium() as browser, open_page(browser, server) as page:
        _open(page, server, mission, "?webgl=off", f"?plan={plan}")
        page.get_by_test_id("dry-run").click()
        expect(page.get_by_test_id("run-outcome")).not_to_have_text(re.compile("queued|running"))
        page.get_by_test_id("target-row").filter(has_text="West").click()
        expect(page.get_by_test_id("rehearsed")).to_contain_text("the rover has not done it")
        # The lineage of a product answers when its sheet has gone.
        page.route("**/lineage", answer_late)
        page.get_by_role("tab", name=re.compile("^Products")).click()
        page.get_by_test_id("product-row").first.click()
        expect(page.get_by_test_id("product-sheet")).to_be_visible()
        page.keyboard.press("Escape")
        page.wait_for_timeout(1500)
        # A name that was being changed when its target went; a request that is deleted from its sheet.
        page.get_by_role("tab", name=re.compile("^Targets")).click()
        page.get_by_test_id("target-row").filter(has_text="North").click()
        page.get_by_label("Name of the target").fill("North face")
        page.evaluate("() => { location.hash = location.hash.replace(/[?&]sel=[^&]*/, '?') }")
        page.wait_for_timeout(500)
        page.get_by_test_id("target-row").filter(has_text="South").click()
        page.get_by_role("button", name="Delete request").click()
        expect(page.get_by_label("Name of the target")).to_have_value("South")
        expect(page.locator("article .request")).to_have_count(0)
