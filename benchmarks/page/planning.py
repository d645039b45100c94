"""From the click on *Plan* to the first plan drawn, each better one, and what-if while one drags."""

from __future__ import annotations

import math
import random
import re
import statistics
from collections.abc import Callable, Iterator

from playwright.sync_api import Browser, Page

from benchmarks.common.browser import page_of
from benchmarks.common.figure import Figure
from studies.common.processes import cpu_of, cpu_of_all
from tests.web.conftest import Server
from tests.web.missions import ask, done
from tests.web.page import pixel

FIRST_MOST_S, BETTER_MOST_S = 1.5, 0.3
FEW, MANY = 10, 30
"""Targets of the demo mission, and requests of its larger copy."""
DRAGGED_MOST_S = {FEW: 0.25, MANY: 0.6}
REST_MS = 3000
APART_M = 1.2
BUDGETS = (0.8, 0.9, 1.1, 0.7, 1.2, 0.85, 1.05)
"""Shares of the time budget that are tried; as often a keep-out is moved by 0.2 m."""

NOTE_DRAFTS = """() => {
  const seen = { clicked: 0, drawn: [] };
  window.outcropDrafts = seen;
  const click = () => (seen.clicked = Date.now());
  document.querySelector('[data-testid=plan]').addEventListener('click', click, true);
  let last = '';
  const look = () => {
    const found = document.querySelector('[data-testid=so-far]')?.dataset;
    const key = found === undefined ? '' : `${found.number} ${found.found}`;
    if (key !== '' && key !== last) {
      const at = Date.parse(found.found);
      requestAnimationFrame(() => requestAnimationFrame(() => seen.drawn.push([at, Date.now()])));
    }
    last = key;
    requestAnimationFrame(look);
  };
  requestAnimationFrame(look);
}"""
"""What stands in the page at one frame, and is asked of the map there, is on the screen two frames later."""

SETTLED = """async () => {
  const box = document.querySelector('[data-testid=what-if-answer]');
  while (box.getAttribute('aria-busy') !== 'true' && performance.now() - window.outcropMoved < 1000) {
    await new Promise((done) => setTimeout(done, 2));
  }
  do await new Promise(requestAnimationFrame); while (box.getAttribute('aria-busy') === 'true');
  return (performance.now() - window.outcropMoved) / 1000;
}"""
"""From the last movement of the pointer to the answer on the page, seconds."""

DRAG_SLIDER = """async ([share]) => {
  const box = document.querySelector('[data-testid=what-if-answer]');
  const slider = document.querySelector('[data-testid=what-if] input[type=range]');
  slider.value = String(share);
  const began = performance.now();
  slider.dispatchEvent(new Event('input', { bubbles: true }));
  do await new Promise(requestAnimationFrame); while (box.getAttribute('aria-busy') === 'true');
  return (performance.now() - began) / 1000;
}"""


def figures(browser: Browser, server: Server, repeat: int) -> Iterator[Figure]:
    """Yield what a person waits for while planning, each with what it took of processors beside it."""
    mission = str(ask(server, "/missions")["items"][0]["id"])
    first, spent, better = _first_plans(browser, server, mission, repeat)
    yield Figure(f"{FEW} targets: from the click to the first plan drawn", first, "s", FIRST_MOST_S)
    yield Figure(f"{FEW} targets: processors of the server until then", spent, "s")
    yield Figure("the slowest better plan: from found to drawn", better, "s", BETTER_MOST_S)
    for size, name in ((FEW, f"{FEW} targets"), (MANY, f"{MANY} requests")):
        if size == MANY:
            _grow(server, mission)
            done(server, ask(server, f"/missions/{mission}/plans", {"time_limit_s": 20.0, "iterations": 4}))
        for what, (wall, work) in _dragged(browser, server, mission).items():
            yield Figure(f"what-if, {name}, {what} dragged: on the page", wall, "s", DRAGGED_MOST_S[size])
            yield Figure(f"what-if, {name}, {what} dragged: server", work, "s")


def _open(page: Page, server: Server, mission: str) -> None:
    page.goto("about:blank")
    page.goto(f"{server}/?quality=test#/m/{mission}")
    page.wait_for_function("() => document.querySelector('[data-testid=map]')?.dataset.terrain")
    page.wait_for_timeout(REST_MS)


def _first_plans(browser: Browser, server: Server, mission: str, repeat: int) -> tuple[float, float, float]:
    """Return the medians of the seconds to the first plan and of the processors', and the slowest better one.

    The very first one is the first that a server which has got ready makes.
    """
    waits: list[float] = []
    spent: list[float] = []
    better: list[float] = []
    with page_of(browser) as (page, _):
        _open(page, server, mission)
        page.evaluate(NOTE_DRAFTS)
        for _ in range(repeat):
            page.evaluate("() => (window.outcropDrafts.drawn.length = 0)")
            before = cpu_of_all(server.pid)
            page.get_by_test_id("plan").click()
            page.wait_for_function("() => window.outcropDrafts.drawn.length > 0")
            spent.append(cpu_of_all(server.pid) - before)
            page.wait_for_function("() => !document.querySelector('[data-testid=so-far]')")
            seen = page.evaluate("() => window.outcropDrafts")
            waits.append((seen["drawn"][0][1] - seen["clicked"]) / 1000)
            better += [(drawn - found) / 1000 for found, drawn in seen["drawn"][1:]]
            page.wait_for_timeout(REST_MS)
    return statistics.median(waits), statistics.median(spent), max(better)


def _grow(server: Server, mission: str) -> None:
    """File requests on further targets until there are 30."""
    draw = random.Random(7)
    start = ask(server, f"/missions/{mission}/sols")["items"][0]["start_pose"]
    places = [t["position"] for t in ask(server, f"/missions/{mission}/targets")["items"]]
    there = [(p["east_m"], p["north_m"]) for p in places]
    count = len(ask(server, f"/missions/{mission}/observation-requests")["items"])
    while count < MANY:
        radius, angle = draw.uniform(3.0, 9.0), draw.uniform(0.0, 2.0 * math.pi)
        east, north = start["east_m"] + radius * math.cos(angle), start["north_m"] + radius * math.sin(angle)
        if any(math.hypot(east - e, north - n) < APART_M for e, n in there):
            continue
        there.append((east, north))
        target = {"name": f"M{count}", "east_m": east, "north_m": north}
        made = ask(server, f"/missions/{mission}/targets", target)
        request = {"target_id": made["id"], "instrument": "science_camera", "value": draw.uniform(2.0, 9.0)}
        ask(server, f"/missions/{mission}/observation-requests", request)
        count += 1


def _dragged(browser: Browser, server: Server, mission: str) -> dict[str, tuple[float, float]]:
    """Return the medians of a round trip and of the server's processor time, by what is dragged."""
    keep_out = ask(server, f"/missions/{mission}/keep-outs")["items"][0]
    corners = keep_out["polygon_m"]
    middle = [sum(corner[k] for corner in corners) / len(corners) for k in (0, 1)]
    with page_of(browser) as (page, _):
        _open(page, server, mission)
        page.get_by_test_id("try-what-if").click()
        page.wait_for_selector("[data-testid=what-if-answer][data-ms]")
        return {
            "a budget": _median(page, server, lambda k: page.evaluate(DRAG_SLIDER, [BUDGETS[k]])),
            "a keep-out": _median(page, server, _keep_out_drag(page, middle)),
        }


def _keep_out_drag(page: Page, middle: list[float]) -> Callable[[int], float]:
    """Take hold of the keep-out in whose middle a point lies; return what drags it on and waits."""
    page.get_by_role("tab", name=re.compile("^Keep-outs")).click()
    page.locator("button.item").first.click()
    page.get_by_role("tab", name="Plan", exact=True).click()
    page.wait_for_selector("[data-testid=what-if-answer][data-ms]")
    page.evaluate("() => addEventListener('pointermove', () => (outcropMoved = performance.now()), true)")
    page.mouse.move(*pixel(page, *middle))
    page.mouse.down()

    def drag(k: int) -> float:
        page.mouse.move(*pixel(page, middle[0] + 0.2 * (k + 1), middle[1]))
        return float(page.evaluate(SETTLED))

    return drag


def _median(page: Page, server: Server, drag: Callable[[int], float]) -> tuple[float, float]:
    walls, works = [], []
    for k in range(len(BUDGETS)):
        before = cpu_of(server.pid)
        walls.append(drag(k))
        works.append(cpu_of(server.pid) - before)
        page.wait_for_timeout(100)
    return statistics.median(walls), statistics.median(works)
