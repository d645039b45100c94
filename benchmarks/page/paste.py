"""500 rows from a spreadsheet, each a target with a request: pasted in one act, and taken back in one."""

from __future__ import annotations

import random
import statistics
from collections.abc import Callable, Iterator

from playwright.sync_api import Browser, CDPSession, Page

from benchmarks.common.browser import busy_s, page_of
from benchmarks.common.figure import Figure
from studies.common.processes import cpu_of
from tests.web.conftest import Server
from tests.web.missions import small_mission

ROWS = 500
THERE = 3
"""Targets of the mission before anything is pasted."""
REST_MS = 1500
"""Until the page has followed what the server tells of a change, and both are at rest."""
PASTE_MOST_S = 2.0

SHOWN = """count => document.querySelectorAll('[data-testid=target-row]').length === count"""


def rows(count: int, seed: int) -> str:
    """Return rows as a spreadsheet gives them: half are for the arm, half for the camera."""
    draw = random.Random(seed)
    lines = ["name\teast\tnorth\tinstrument\tvalue"]
    for k in range(count):
        instrument = "microscopic imager" if k % 2 else "science camera"
        east, north = draw.uniform(-15.0, 15.0), draw.uniform(-15.0, 15.0)
        lines.append(f"P{k}\t{east:.2f}\t{north:.2f}\t{instrument}\t{draw.uniform(1.0, 12.0):.1f}")
    return "\n".join(lines)


def figures(browser: Browser, server: Server, repeat: int) -> Iterator[Figure]:
    """Yield requests and processor seconds of pasting 500 rows, and of taking them back."""
    asked: list[tuple[int, float, float]] = []
    back: list[tuple[int, float, float]] = []
    for k in range(repeat):
        mission = small_mission(server, f"Pasted {k}")
        with page_of(browser) as (page, session):
            page.goto(f"{server}/?quality=test#/m/{mission}")
            page.wait_for_function(SHOWN, arg=THERE)
            page.get_by_role("button", name="Edit in a table").click()
            page.get_by_role("button", name="Paste targets").click()
            page.get_by_label("Targets to paste").fill(rows(ROWS, seed=k))
            add = page.get_by_role("button", name=f"Add {ROWS} targets with a request each")
            page.wait_for_timeout(REST_MS)
            asked.append(_act(page, session, server, add.click, THERE + ROWS))
            page.keyboard.press("Escape")
            page.wait_for_timeout(REST_MS)
            back.append(_act(page, session, server, lambda: page.keyboard.press("Control+z"), THERE))
    for what, found in ((f"{ROWS} rows pasted", asked), (f"{ROWS} rows taken back", back)):
        posts, served, shown = (statistics.median(column) for column in zip(*found, strict=True))
        yield Figure(f"{what}: requests that change something", posts, "", 1.0)
        most = PASTE_MOST_S if found is asked else None
        yield Figure(f"{what}: processors of server and page", served + shown, "s", most)
        yield Figure(f"{what}: of it, the page's main thread", shown, "s")


def _act(
    page: Page, session: CDPSession, server: Server, act: Callable[[], None], then: int
) -> tuple[int, float, float]:
    """Return requests that were not reads, and processor seconds of server and page, until all is shown."""
    posts: list[str] = []
    page.on("request", lambda request: posts.append(request.url) if request.method != "GET" else None)
    served, shown = cpu_of(server.pid), busy_s(session)
    act()
    page.wait_for_function(SHOWN, arg=then)
    page.wait_for_timeout(REST_MS)
    changing = [url for url in posts if "presence" not in url]
    return len(changing), cpu_of(server.pid) - served, busy_s(session) - shown
