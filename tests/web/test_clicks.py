"""How many clicks of the pointer things take that are done a hundred times a day."""

from __future__ import annotations

import pytest
from playwright.sync_api import Page, expect

from tests.web.conftest import Server
from tests.web.missions import ask, small_mission
from tests.web.page import chromium, open_page, pixel

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.xdist_group("browser")]

MOST = 3
COUNT = """() => {
  window.outcropClicks = 0;
  window.outcropKeys = 0;
  addEventListener('pointerdown', () => (window.outcropClicks += 1), true);
  addEventListener('keydown', () => (window.outcropKeys += 1), true);
}"""


def _counted(page: Page) -> tuple[int, int]:
    clicks, keys = page.evaluate("() => [window.outcropClicks, window.outcropKeys]")
    return int(clicks), int(keys)


@pytest.mark.parametrize(
    ("title", "instrument"),
    [("Microscopic imager", "microscopic_imager"), ("Science camera", "science_camera")],
)
def test_a_target_with_its_request_takes_three_clicks(server: Server, title: str, instrument: str) -> None:
    """The first instrument by the pointer alone; for another one the tool is taken up by its key."""
    mission = small_mission(server, f"Clicks, {title}")
    with chromium() as browser, open_page(browser, server) as page:
        page.goto(f"{server.address}/?quality=test&webgl=off#/m/{mission}")
        expect(page.get_by_test_id("target-row")).to_have_count(3)
        place = pixel(page, 1.5, -1.0)
        page.evaluate(COUNT)
        first = instrument == "microscopic_imager"
        if first:
            page.get_by_role("button", name="Add target (T)").click()
        else:
            page.keyboard.press("t")
        page.mouse.click(*place)
        if not first:
            page.get_by_role("radio", name=title).click()
        page.get_by_test_id("save-request").click()
        expect(page.get_by_test_id("target-row")).to_have_count(4)
        expect(page.get_by_test_id("save-request")).to_have_count(0)
        clicks, keys = _counted(page)
    assert (clicks <= MOST, keys) == (True, 0 if first else 1), (clicks, keys)
    target = ask(server, f"/missions/{mission}/targets")["items"][-1]
    request = ask(server, f"/missions/{mission}/observation-requests")["items"][-1]
    assert (request["target_id"], request["instrument"]) == (target["id"], instrument)
    assert target["position"]["east_m"] == pytest.approx(1.5, abs=0.1)
