"""Lists of a thousand rows, scrolled; and a run of 10 h with 100,000 events, scrubbed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from playwright.sync_api import Browser, CDPSession, Page

from benchmarks.common.browser import busy_s, page_of
from benchmarks.common.figure import Figure
from tests.web.conftest import Server
from tests.web.missions import ask, done, make_plan, small_mission, uploaded

ROWS, EVENTS, HOURS = 1000, 100_000, 10
FRAMES_LEAST = 50.0
SECONDS = 4.0

SLIDER = 'input[aria-label="Moment of the run"]'

SCROLL = """async ([selector, seconds]) => {
  const list = document.querySelector(selector);
  const [began, most] = [performance.now(), list.scrollHeight - list.clientHeight];
  let frames = 0;
  while (performance.now() - began < 1000 * seconds) {
    list.scrollTop = (most / 2) * (1 - Math.cos(frames / 40));
    await new Promise(requestAnimationFrame);
    frames += 1;
  }
  return [frames, most];
}"""

SCRUB = """async ([seconds]) => {
  const slider = document.querySelector('input[aria-label="Moment of the run"]');
  const [began, most] = [performance.now(), Number(slider.max)];
  let frames = 0;
  while (performance.now() - began < 1000 * seconds) {
    slider.value = String((most / 2) * (1 - Math.cos(frames / 40)));
    slider.dispatchEvent(new Event('input', { bubbles: true }));
    await new Promise(requestAnimationFrame);
    frames += 1;
  }
  return [frames, most];
}"""


def figures(browser: Browser, server: Server, repeat: int) -> Iterator[Figure]:
    """Yield frames a second, each with the processor milliseconds of the main thread that one took."""
    del repeat
    mission = small_mission(server, "A thousand targets")
    rng = np.random.default_rng(3)
    rows = [f"target,S{k},{e:.2f},{n:.2f}" for k, (e, n) in enumerate(rng.uniform(-14, 14, (ROWS - 3, 2)))]
    text = "\n".join(["kind,name,east_m,north_m", *rows])
    ask(server, f"/missions/{mission}/geometry", {"upload_id": uploaded(server, "rows.csv", text.encode())})
    with page_of(browser) as (page, session):
        page.goto(f"{server}/?quality=test#/m/{mission}")
        page.wait_for_function(
            f"() => document.querySelectorAll('[data-testid=target-row]').length === {ROWS}"
        )
        fps, each = _frames(page, session, SCROLL, ["#list", SECONDS])
    yield Figure(f"list of {ROWS} targets, scrolled", fps, "frames/s", FRAMES_LEAST, least=True)
    yield Figure("a frame of it: main thread", each, "ms")
    fps, each = _scrubbed(browser, server)
    name = f"run of {HOURS} h with {EVENTS:,} events, scrubbed"
    yield Figure(name, fps, "frames/s", FRAMES_LEAST, least=True)
    yield Figure("a frame of that: main thread", each, "ms")


def _frames(page: Page, session: CDPSession, script: str, given: list[Any]) -> tuple[float, float]:
    page.wait_for_timeout(1500)
    before = busy_s(session)
    frames, most = page.evaluate(script, given)
    assert most > 0, "nothing to move over"
    return frames / SECONDS, 1000.0 * (busy_s(session) - before) / frames


def _scrubbed(browser: Browser, server: Server) -> tuple[float, float]:
    """Return frames a second and milliseconds a frame with a long run in the place of a recorded one."""
    mission = small_mission(server, "A long run")
    plan = make_plan(server, mission)
    order = {"plan_id": plan, "rover": "abstract", "seed": 1, "faults": [], "pace": 0, "notes": ""}
    run = done(server, ask(server, f"/missions/{mission}/runs", order))["subject_id"]
    telemetry = ask(server, f"/runs/{run}/telemetry")
    trace = ask(server, f"/runs/{run}/trace")
    end_s = 3600.0 * HOURS
    times = np.linspace(0.0, end_s, EVENTS).round(3).tolist()
    known = trace["events"]
    trace["events"] = [{**known[k % len(known)], "t_s": t} for k, t in enumerate(times)]
    long = _long(telemetry, end_s)
    with page_of(browser) as (page, session):
        page.route(f"**/runs/{run}/trace", lambda route: route.fulfill(json=trace))
        page.route(f"**/runs/{run}/telemetry", lambda route: route.fulfill(json=long))
        page.goto(f"{server}/?quality=test#/m/{mission}?plan={plan}&run={run}&tab=run")
        page.wait_for_function(f"() => Number(document.querySelector('{SLIDER}')?.max) > {end_s - 9}")
        return _frames(page, session, SCRUB, [SECONDS])


def _long(telemetry: dict[str, Any], end_s: float) -> dict[str, Any]:
    """Return telemetry of a sample a second: the same columns, drawn out, and a spiral driven."""
    count, there = int(end_s), len(telemetry["t_s"])
    turn = np.arange(count) / 900.0
    radius = 1.0 + 8.0 * np.arange(count) / count

    def drawn_out(column: list[Any]) -> list[Any]:
        return [column[k * there // count] for k in range(count)]

    return {
        **{name: drawn_out(c) for name, c in telemetry.items() if isinstance(c, list)},
        **{
            name: {k: drawn_out(c) for k, c in t.items()}
            for name, t in telemetry.items()
            if isinstance(t, dict)
        },
        "t_s": list(range(count)),
        "east_m": (radius * np.cos(turn)).round(3).tolist(),
        "north_m": (radius * np.sin(turn)).round(3).tolist(),
    }
