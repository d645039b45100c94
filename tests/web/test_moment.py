"""A run of ten hours and 100,000 events: one gesture tells every value of a moment."""

from __future__ import annotations

import re
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from tests.web.conftest import Server
from tests.web.missions import ask, done, make_plan, small_mission
from tests.web.page import chromium, open_page

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.xdist_group("browser")]

END_S, EVENTS = 36_000, 100_000
LABEL_PX = 132
"""Left of the axis, where the names of the lines stand."""


def _confidence(t: float) -> float:
    return 0.5 + 0.4 * t / END_S


def _telemetry(targets: list[str]) -> dict[str, Any]:
    """Return telemetry of a sample a second whose values follow from the time."""
    times = range(END_S + 1)
    return {
        "t_s": list(times),
        "east_m": [t / 1000 for t in times],
        "north_m": [-t / 2000 for t in times],
        "heading_rad": [0.5] * len(times),
        "battery_j": [7_200_000 - 36 * t for t in times],
        "energy_used_j": [36 * t for t in times],
        "task": ["root"] * len(times),
        "tracker_state": {target: ["tracked"] * len(times) for target in targets},
        "tracker_confidence": {target: [_confidence(t) for t in times] for target in targets},
    }


def _told(page: Page) -> list[str]:
    return [line for line in page.locator(".tip").inner_text().split("\n") if line]


def test_every_value_of_a_moment_is_told_by_one_gesture(server: Server) -> None:
    mission = small_mission(server, "Ten hours")
    plan = make_plan(server, mission)
    order = {"plan_id": plan, "rover": "abstract", "seed": 1, "faults": [], "pace": 0, "notes": ""}
    run = done(server, ask(server, f"/missions/{mission}/runs", order))["subject_id"]
    targets = {t["name"]: t["id"] for t in ask(server, f"/missions/{mission}/targets")["items"]}
    long = ask(server, f"/runs/{run}/telemetry") | _telemetry(list(targets.values()))
    trace = ask(server, f"/runs/{run}/trace")
    known = trace["events"]
    trace["events"] = [{**known[k % len(known)], "t_s": END_S * k / EVENTS} for k in range(EVENTS)]
    with chromium() as browser, open_page(browser, server) as page:
        page.route(f"**/runs/{run}/trace", lambda route: route.fulfill(json=trace))
        page.route(f"**/runs/{run}/telemetry", lambda route: route.fulfill(json=long))
        page.goto(f"{server.address}/?quality=test&webgl=off#/m/{mission}?plan={plan}&run={run}&tab=run")
        slider = page.get_by_label("Moment of the run")
        expect(slider).to_have_attribute("max", str(END_S))
        dock = page.get_by_test_id("dock")
        box = dock.bounding_box()
        assert box is not None
        for chart, down_px in (("Timeline", 8.0), ("Energy", 0.6 * box["height"])):
            page.get_by_role("button", name=chart, exact=True).click()
            for share in (0.15, 0.55):
                page.mouse.move(
                    box["x"] + LABEL_PX + share * (box["width"] - LABEL_PX), box["y"] + down_px, steps=1
                )
                first, _, place, power, *tracked = _told(page)
                clock = re.match(r"(\d+):(\d\d):(\d\d) \(\d\d:\d\d LMST\)$", first)
                assert clock is not None, first
                t = 3600 * int(clock[1]) + 60 * int(clock[2]) + int(clock[3])
                east, north = (float(v.replace("\u2212", "-")) for v in re.findall(r"[EN] (\S+) m", place))
                assert (east, north) == pytest.approx((t / 1000, -t / 2000), abs=0.006)
                used, left = (float(v) for v in re.findall(r"([\d.]+) Wh", power))
                assert (used, left) == pytest.approx((t / 100, 2000 - t / 100), abs=0.6)
                found = dict(line.split(": tracked, ") for line in tracked)
                assert list(found) == list(targets)
                for part in found.values():
                    assert float(part.removesuffix(" %")) == pytest.approx(100 * _confidence(t), abs=0.51)
