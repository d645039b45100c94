"""Debian's chromium for benchmarks: pages that note what is drawn, and what their main thread used."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from playwright.sync_api import Browser, CDPSession, Page, Playwright

from tests.web.conftest import CHROMIUM, FLAGS

WIDTH, HEIGHT = 1440, 900
PATIENCE_MS = 180_000

WATCH = """
(() => {
  const seen = {};
  window.outcropSeen = seen;
  const look = () => {
    const map = document.querySelector('[data-testid=map]');
    const scene = document.querySelector('[data-testid=scene]');
    if (map?.dataset.terrain && !seen.map) seen.map = performance.now();
    if (Number(scene?.dataset.drawn) > 0 && !seen.scene) seen.scene = performance.now();
    requestAnimationFrame(look);
  };
  requestAnimationFrame(look);
})();
"""


def launch(playwright: Playwright, flags: Sequence[str] = ()) -> Browser:
    """Return a browser."""
    return playwright.chromium.launch(executable_path=CHROMIUM, args=[*FLAGS, *flags])


@contextmanager
def page_of(browser: Browser) -> Iterator[tuple[Page, CDPSession]]:
    """Give a page in a context of its own that notes when the map and the scene are first drawn."""
    context = browser.new_context(viewport={"width": WIDTH, "height": HEIGHT})
    page = context.new_page()
    page.set_default_timeout(PATIENCE_MS)
    page.add_init_script(WATCH)
    session = context.new_cdp_session(page)
    session.send("Performance.enable", {"timeDomain": "threadTicks"})
    try:
        yield page, session
    finally:
        context.close()


def busy_s(session: CDPSession) -> float:
    """Return the seconds that tasks kept the main thread, by its own clock (processor time)."""
    metrics = {m["name"]: m["value"] for m in session.send("Performance.getMetrics")["metrics"]}
    return float(metrics["TaskDuration"])


def median_pair(measure: Callable[[], tuple[float, float]], repeat: int) -> tuple[float, float]:
    """Return the medians of two things measured together."""
    found = [measure() for _ in range(repeat)]
    return statistics.median(w for w, _ in found), statistics.median(c for _, c in found)
