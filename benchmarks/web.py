"""How fast the browser's page is: planning, ground, long lists and runs (`benchmarks.page`), sizes,
first map and 3D frame, what-if, panning of a large timeline.

Needs Debian's chromium. Wall times depend on what else the machine does, so the time that the page's main
thread was on a processor stands beside them, for what-if that of the server, and a fixed loop as yardstick.
"""

from __future__ import annotations

import gzip
import re
import statistics
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from playwright.sync_api import Browser, Page, sync_playwright

from benchmarks.common.browser import busy_s, launch, median_pair, page_of
from benchmarks.common.figure import Figure, command
from benchmarks.page import ground, many, paste, planning
from studies.common.processes import cpu_of
from tests.web.conftest import Server, build_ui, run_server

ROOT = Path(__file__).resolve().parents[1]
FIRST_LOAD_MOST_KB = 300.0
MAP_MOST_S, SCENE_MOST_S, WHAT_IF_MOST_S = 1.0, 2.0, 1.0
FRAMES_LEAST = 20.0
"""A second, while the timeline of `ACTIVITIES` and `BRANCHES` is dragged."""
QUICK = {"repeat": 1}
BUDGET_S = 1800.0
ACTIVITIES, BRANCHES = 300, 50
PAN_S = 4.0
EXTRA_TARGETS = ((2.5, -6.0), (-2.0, 5.5))

LOOP = """() => {
  const began = performance.now();
  let x = 1;
  for (let k = 0; k < 3e7; k += 1) x = (x * 1103515245 + 12345) % 2147483648;
  return performance.now() - began + 0 * x;
}"""


def _first(browser: Browser, address: str, what: str) -> tuple[float, float]:
    with page_of(browser) as (page, session):
        page.goto(address)
        page.wait_for_function(f"() => window.outcropSeen.{what}")
        return float(page.evaluate(f"() => window.outcropSeen.{what}")) / 1000, busy_s(session)


def large_tree(requests: list[dict[str, Any]]) -> dict[str, Any]:
    """Return a plan tree with 300 activities on the mainline and 50 branches of plausible times."""
    counter = iter(range(10**6))

    def observe(t: float, p: float) -> dict[str, Any]:
        request = requests[next(counter) % len(requests)]
        times = [t * f for f in (0.85, 0.95, 1.0, 1.06, 1.2)]
        return {
            "op": "visit",
            "target": request["target_id"],
            "observation": request["id"],
            "on_fail": "skip",
            "p_reached": p,
            "quantiles": {
                "p": [0.05, 0.25, 0.5, 0.75, 0.95],
                "time_s": times,
                "energy_j": [60.0 * x for x in times],
            },
        }

    per_branch = (ACTIVITIES - 100) // BRANCHES
    plan: list[dict[str, Any]] = []
    for k in range(100):
        t = 120.0 * (k + 1)
        plan.append(observe(t, 1.0))
        if k % 2 == 1:
            option = {
                "id": f"option-{k // 2 + 1}",
                "when": [{"var": "time_s", "ge": t}],
                "p_taken": 0.3,
                "gain": 0.5,
                "utility_table": [],
                "plan": [observe(t + 90.0 * (j + 1), 0.3) for j in range(per_branch)],
            }
            plan.append({"op": "branch", "options": [option]})
    return {"format": "plan-tree/2", "plan": plan}


def _pan(browser: Browser, address: str, tree: dict[str, Any]) -> tuple[float, float]:
    """Return frames a second while the timeline is dragged, and processor milliseconds a frame."""
    with page_of(browser) as (page, session):
        page.route("**/api/v1/plans/*/tree", lambda route: route.fulfill(json=tree))
        page.goto(address)
        page.wait_for_function("() => window.outcropSeen.map")
        page.get_by_test_id("dock").wait_for()
        page.wait_for_timeout(1500)
        before = busy_s(session)
        frames = page.evaluate(
            """async ([seconds]) => {
                const canvas = document.querySelector('[data-testid=dock]');
                const box = canvas.getBoundingClientRect();
                const send = (type, x, y) => canvas.dispatchEvent(new PointerEvent(type, {
                    pointerId: 1, button: 0, bubbles: true, clientX: box.left + x, clientY: box.top + y }));
                canvas.setPointerCapture = () => {};
                canvas.dispatchEvent(new WheelEvent('wheel', { deltaY: -700, ctrlKey: true, bubbles: true,
                    clientX: box.left + 500, clientY: box.top + 80, cancelable: true }));
                send('pointerdown', 600, 100);
                const began = performance.now();
                let frames = 0;
                while (performance.now() - began < 1000 * seconds) {
                    const phase = frames / 20;
                    send('pointermove', 600 + 300 * Math.sin(phase), 100 - 60 * (1 - Math.cos(phase / 3)));
                    await new Promise(requestAnimationFrame);
                    frames += 1;
                }
                send('pointerup', 600, 100);
                return frames;
            }""",
            [PAN_S],
        )
        return frames / PAN_S, 1000.0 * (busy_s(session) - before) / frames


@dataclass(frozen=True)
class WhatIf:
    """Seconds of a round trip as the page asks, and processor seconds of the server for it."""

    first: tuple[float, float]
    budget: tuple[float, float]
    keep_out: tuple[float, float]


def _what_if(page: Page, pid: int, plan: str, budget_s: float, keep_outs: list[list[list[float]]]) -> WhatIf:
    """Return the first answer after the start, and medians with a budget changed and a keep-out dragged."""
    budgets = [{"time_budget_s": f * budget_s} for f in (0.8, 0.9, 1.1, 0.7, 1.2, 0.85, 1.05)]
    dragged = [
        {"keep_outs": [[[e + 0.2 * k, n] for e, n in keep_outs[0]], *keep_outs[1:]]} for k in range(1, 8)
    ]
    first = _ask(page, pid, plan, [{"time_budget_s": 1.01 * budget_s}])[0]

    def median(found: list[tuple[float, float]]) -> tuple[float, float]:
        return statistics.median(w for w, _ in found), statistics.median(e for _, e in found)

    return WhatIf(first, median(_ask(page, pid, plan, budgets)), median(_ask(page, pid, plan, dragged)))


def _ask(page: Page, pid: int, plan: str, changes: list[dict[str, Any]]) -> list[tuple[float, float]]:
    """Return of each answer the round trip and the processor time of the server, seconds."""
    found: list[tuple[float, float]] = []
    for body in changes:
        before = cpu_of(pid)
        status, wall_ms = page.evaluate(
            """async ([url, body]) => {
                const began = performance.now();
                const headers = { 'content-type': 'application/json', 'x-outcrop-person': 'Planner' };
                const answer = await fetch(url, { method: 'POST', headers, body: JSON.stringify(body) });
                await answer.json();
                return [answer.status, performance.now() - began];
            }""",
            [f"/api/v1/plans/{plan}/what-if", body],
        )
        assert status == 200, (status, body)
        found.append((wall_ms / 1000, cpu_of(pid) - before))
    return found


def _twelve_targets(page: Page, server: Server) -> tuple[str, str, float, list[dict[str, Any]]]:
    """Return mission and plan of the demo with two more targets, its time budget, its requests."""
    api = f"{server.address}/api/v1"
    headers = {"X-Outcrop-Person": "Planner"}

    def get(path: str) -> Any:
        return page.request.get(f"{api}{path}", headers=headers, timeout=120_000).json()

    def post(path: str, body: dict[str, Any]) -> Any:
        answer = page.request.post(f"{api}{path}", data=body, headers=headers, timeout=180_000)
        assert answer.ok, answer.text()
        return answer.json()

    mission = get("/missions")["items"][0]["id"]
    for k, (east, north) in enumerate(EXTRA_TARGETS):
        target = post(f"/missions/{mission}/targets", {"name": f"X{k}", "east_m": east, "north_m": north})
        post(
            f"/missions/{mission}/observation-requests",
            {"target_id": target["id"], "instrument": "microscopic_imager", "value": 9.0},
        )
    assert len(get(f"/missions/{mission}/targets")["items"]) == 12
    job = post(f"/missions/{mission}/plans", {"time_limit_s": 20.0, "iterations": 4})
    while job["state"] in {"queued", "running"}:
        page.wait_for_timeout(300)
        job = get(f"/jobs/{job['id']}")
    assert job["state"] == "succeeded", job
    plan = job["subject_id"]
    problem = get(f"/problems/{get(f'/plans/{plan}')['problem_id']}")
    requests = get(f"/missions/{mission}/observation-requests")["items"]
    return mission, plan, float(problem["document"]["budget"]["time_s"]), requests


def _sizes() -> tuple[int, int]:
    """Return gzip bytes of the first load, and of what the 3D view loads later."""
    dist = ROOT / "web" / "dist"
    index = (dist / "index.html").read_text()
    first = re.findall(r'(?:src|href)="/([^"]+\.(?:js|css))"', index)

    def size(path: Path) -> int:
        return len(gzip.compress(path.read_bytes()))

    scene = [p for p in (dist / "assets").glob("*.js") if p.name.startswith(("SceneView", "three", "scene"))]
    return sum(size(dist / name) for name in first) + len(gzip.compress(index.encode())), sum(
        map(size, scene)
    )


def _on_its_own_server(
    part: Callable[[Browser, Server, int], Iterator[Figure]], repeat: int
) -> Iterator[Figure]:
    with (
        tempfile.TemporaryDirectory(prefix="outcrop-web-") as folder,
        run_server(Path(folder)) as server,
        sync_playwright() as playwright,
    ):
        browser = launch(playwright)
        yield from part(browser, server, repeat)
        browser.close()


def figures(repeat: int = 3) -> Iterator[Figure]:
    """Yield sizes, and medians of time on the clock, each followed by its processor time."""
    build_ui()
    for part in (planning, ground, many, paste):
        yield from _on_its_own_server(part.figures, repeat)
    first, scene = _sizes()
    yield Figure("first load, gzip", first / 1000, "kB", FIRST_LOAD_MOST_KB)
    yield Figure("3D view, loaded when it is opened, gzip", scene / 1000, "kB")
    with (
        tempfile.TemporaryDirectory(prefix="outcrop-web-") as folder,
        run_server(Path(folder)) as server,
        sync_playwright() as playwright,
    ):
        browser = launch(playwright)
        with page_of(browser) as (page, _):
            page.goto(f"{server.address}/?quality=test")
            steps = statistics.median(float(page.evaluate(LOOP)) for _ in range(repeat))
            yield Figure("yardstick: 30 million steps of a loop", steps, "ms")
            mission, plan, budget_s, requests = _twelve_targets(page, server)
            listed = page.request.get(
                f"{server.address}/api/v1/missions/{mission}/keep-outs",
                headers={"X-Outcrop-Person": "Planner"},
            ).json()
            what_if = _what_if(page, server.pid, plan, budget_s, [k["polygon_m"] for k in listed["items"]])
        for what, (wall, spent) in (
            ("a budget changed", what_if.budget),
            ("a keep-out dragged", what_if.keep_out),
            ("the first one of a server that has got ready", what_if.first),
        ):
            yield Figure(f"what-if, 12 targets, {what}: round trip", wall, "s", WHAT_IF_MOST_S)
            yield Figure(f"what-if, 12 targets, {what}: server", spent, "s")
        there = f"{server.address}/?quality=test#/m/{mission}?plan={plan}"
        for what, address, limit in (
            ("map", there, MAP_MOST_S),
            ("scene", f"{there}&view=scene", SCENE_MOST_S),
        ):
            wall, spent = median_pair(partial(_first, browser, address, what), repeat)
            yield Figure(f"first {what}, from the address on, software GL", wall, "s", limit)
            yield Figure(f"first {what}: main thread", spent, "s")
        fps, per_frame = median_pair(lambda: _pan(browser, there, large_tree(requests)), repeat)
        dragged = f"timeline of {ACTIVITIES} activities and {BRANCHES} branches, dragged"
        yield Figure(dragged, fps, "frames/s", FRAMES_LEAST, least=True)
        yield Figure("a frame of it: main thread", per_frame, "ms")
        browser.close()


if __name__ == "__main__":
    command(figures, QUICK, BUDGET_S)
