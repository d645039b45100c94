"""Coordinates on the page in degrees and in the projection of the mission's place."""

from __future__ import annotations

import json
import re
from math import cos, radians
from urllib.request import Request, urlopen

import pytest
from playwright.sync_api import expect

from tests.web.conftest import Server
from tests.web.missions import ask, small_mission
from tests.web.page import chromium, open_page, pixel

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.xdist_group("browser")]

PLACE = {"crs": "EPSG:32612", "x": 518334, "y": 4251500}
METRES_OF_A_DEGREE = 111_000.0


def _placed(server: Server, name: str) -> str:
    """Return a small mission that lies in Utah."""
    mission = small_mission(server, name)
    request = Request(
        f"{server.address}/api/v1/missions/{mission}",
        json.dumps({"place": PLACE}).encode(),
        {
            "X-Outcrop-Person": "Planner",
            "Content-Type": "application/json",
            "If-Match": f'"{ask(server, f"/missions/{mission}")["revision"]}"',
        },
        method="PATCH",
    )
    with urlopen(request, timeout=60) as answer:
        assert answer.status == 200
    return mission


def test_a_target_is_read_copied_and_moved_in_degrees_and_in_the_projection(server: Server) -> None:
    mission = _placed(server, "Coordinates")
    with chromium() as browser, open_page(browser, server) as page:
        page.context.grant_permissions(["clipboard-read", "clipboard-write"])
        page.goto(f"{server}/?quality=test#/m/{mission}")
        row = page.get_by_test_id("target-row").filter(has_text="North")
        row.click()
        page.get_by_test_id("coordinates").select_option("projected")
        expect(page.get_by_test_id("coordinates-text")).to_have_text("518337.000, 4251503.500")

        page.get_by_test_id("coordinates").select_option("lonlat")
        first = ask(server, f"/missions/{mission}/targets?crs=lonlat")["items"][0]
        text = f"{first['at']['x']:.8f}, {first['at']['y']:.8f}"
        expect(page.get_by_test_id("coordinates-text")).to_have_text(text)
        expect(page.get_by_test_id("target-at").first).to_have_text(text)
        page.get_by_role("button", name="Copy coordinates").click()
        expect(page.get_by_text("Copied")).to_be_visible()
        assert page.evaluate("navigator.clipboard.readText()") == text

        # A metre to the east, typed in degrees, is a metre in the site.
        east = first["at"]["x"] + 1 / METRES_OF_A_DEGREE / cos(radians(first["at"]["y"]))
        page.get_by_role("button", name="Type coordinates").click()
        page.get_by_role("textbox", name="coordinates").fill("somewhere")
        page.get_by_role("button", name="Save", exact=True).click()
        expect(page.get_by_role("alert").filter(has_text="Not a pair of numbers")).to_be_visible()
        page.get_by_role("textbox", name="coordinates").fill(f"{east:.8f}, {first['at']['y']:.8f}")
        page.get_by_role("button", name="Save", exact=True).click()
        expect(page.get_by_test_id("coordinates-text")).to_be_visible()
        expect(page.get_by_test_id("coordinates-text")).not_to_have_text(text)
        moved = ask(server, f"/targets/{first['id']}")["position"]
        assert moved["east_m"] - 3.0 == pytest.approx(1.0, abs=0.02)
        assert moved["north_m"] - 3.5 == pytest.approx(0.0, abs=0.03)

        # The choice is remembered, and holds for outlines too.
        page.reload()
        expect(page.get_by_test_id("coordinates")).to_have_value("lonlat")
        page.get_by_role("tab", name="Keep-outs").click()
        page.get_by_role("button", name="K1").click()
        corner = ask(server, f"/missions/{mission}/keep-outs?crs=lonlat")["items"][0]["at"]["polygon"][0]
        expect(page.get_by_test_id("coordinates-text")).to_contain_text(f"{corner[0]:.8f}, {corner[1]:.8f}")
        page.get_by_test_id("coordinates").select_option("site")
        page.get_by_role("button", name="Type corners").click()
        page.get_by_role("textbox", name="corners").fill("6, 2\n9, 2\n9, 6")
        page.get_by_role("button", name="Save", exact=True).click()
        expect(page.get_by_test_id("coordinates-text")).to_contain_text("9.000, 6.000")
        assert ask(server, f"/missions/{mission}/keep-outs")["items"][0]["polygon_m"][-1] == [9.0, 6.0]


def test_the_read_out_and_the_form_of_a_new_target_speak_the_chosen_reference(server: Server) -> None:
    mission = _placed(server, "Read-out")
    with (
        chromium() as browser,
        open_page(browser, server, refused="/targets") as page,
    ):
        page.goto(f"{server}/?quality=test#/m/{mission}")
        page.wait_for_function("() => document.querySelector('[data-testid=map]')?.dataset.terrain")
        read_out = page.get_by_test_id("read-out")

        def read(east_m: float, north_m: float) -> list[float]:
            page.mouse.move(*pixel(page, east_m + 1, north_m))
            page.mouse.move(*pixel(page, east_m, north_m))
            expect(read_out).to_contain_text(re.compile(r"\d"))
            return [float(n) for n in re.findall(r"-?[\d.]+\d", read_out.inner_text().replace("−", "-"))]

        site = read(2.0, -1.0)
        assert site == pytest.approx([2.0, -1.0], abs=0.06)
        assert read_out.inner_text().startswith("E")
        page.get_by_test_id("coordinates").select_option("projected")
        assert read(2.0, -1.0) == pytest.approx([PLACE["x"] + site[0], PLACE["y"] + site[1]], abs=0.011)
        page.get_by_test_id("coordinates").select_option("lonlat")
        where = f"/missions/{mission}/coordinates?east_m={site[0]}&north_m={site[1]}&crs=lonlat"
        exact = ask(server, where)
        assert read(2.0, -1.0) == pytest.approx([exact["x"], exact["y"]], abs=2e-7)
        assert read_out.inner_text().startswith("lon")

        # A target at typed coordinates: the server's point, by keyboard; what is no place is refused.
        page.get_by_role("button", name="Add target", exact=True).click()
        field = page.get_by_role("textbox", name="Coordinates of the new target")
        expect(field).to_have_attribute("placeholder", "longitude, latitude")
        field.fill("here")
        page.keyboard.press("Enter")
        expect(page.get_by_role("alert").filter(has_text="No pair of numbers: here")).to_be_visible()
        field.fill(f"{exact['x']:.8f}, {exact['y']:.8f}")
        page.keyboard.press("Enter")
        expect(page.get_by_label("Name of the target")).to_have_value("T4")
        expect(field).to_have_count(0)
        made = ask(server, f"/missions/{mission}/targets")["items"][-1]["position"]
        assert (made["east_m"], made["north_m"]) == pytest.approx(site, abs=0.002)
        page.keyboard.press("t")
        field.fill("10, 10")
        page.keyboard.press("Enter")
        expect(page.get_by_text("The new target was refused")).to_be_visible()
        assert len(ask(server, f"/missions/{mission}/targets")["items"]) == 4


def test_a_mission_without_a_place_offers_no_other_coordinates(server: Server) -> None:
    mission = small_mission(server, "No place")
    with chromium() as browser, open_page(browser, server) as page:
        page.goto(f"{server}/?quality=test#/m/{mission}")
        page.get_by_test_id("target-row").first.click()
        expect(page.get_by_label("Name of the target")).to_be_visible()
        expect(page.get_by_test_id("coordinates")).to_have_count(0)
        expect(page.get_by_test_id("coordinates-text")).to_have_text("3.000, 3.500")  # site metres
