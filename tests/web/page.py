"""A browser page that remembers what went wrong in it, and knows the plan map."""

from __future__ import annotations

import io
import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Error, Page, expect, sync_playwright

from tests.web.conftest import CHROMIUM, FLAGS, ROOT, Server

SHOTS = ROOT / "docs" / "img"
WAIT_MS = int(os.environ.get("OUTCROP_BROWSER_WAIT_MS", "180000"))
"""For whatever a page is to show: no test is judged by its time, and a crowded machine takes a minute."""


KEPT = ExitStack()
"""What closes the browser that is kept, and its Playwright."""


@cache
def kept_chromium() -> Browser:
    """Return a browser that stays until `close_chromium`: to start one takes a second of a core."""
    playwright = KEPT.enter_context(sync_playwright())
    return KEPT.enter_context(playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS))


def close_chromium() -> None:
    """Close the browser; the event loop of its Playwright goes with it, beside which no other may run."""
    kept_chromium.cache_clear()
    KEPT.close()


@contextmanager
def chromium() -> Iterator[Browser]:
    """Give Debian's chromium, or skip with the reason; its pages are closed afterwards.

    Tests share no more than the process: cookies, stores and caches are those of a context.
    """
    if not CHROMIUM.exists():
        pytest.skip(f"{CHROMIUM} is missing: apt-get install chromium (or set OUTCROP_CHROMIUM)")
    browser = kept_chromium()
    try:
        yield browser
    finally:
        if browser.is_connected():
            for context in browser.contexts:
                context.close()
        else:
            close_chromium()  # it crashed: the next test has a new one


@contextmanager
def open_page(
    browser: Browser,
    server: Server | str,
    query: str = "?quality=test",
    scheme: str = "dark",
    refused: str = "",
    status: int = 422,
) -> Iterator[Page]:
    """Open the list of missions; an error in the page's console fails the test.

    `refused` is the end of an address whose refusal with `status`, which browsers log, is none.
    """
    context = browser.new_context(viewport={"width": 1440, "height": 900}, color_scheme=scheme)  # type: ignore[arg-type]
    page = context.new_page()
    page.set_default_timeout(WAIT_MS)
    expect.set_options(timeout=WAIT_MS)
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(f"{error} {error.stack}"))
    page.on(
        "console",
        lambda message: (
            errors.append(f"{message.text} {message.location}") if message.type == "error" else None
        ),
    )
    page.goto(f"{server}/{query}")
    try:
        try:
            yield page
        except BaseException:
            if folder := os.environ.get("OUTCROP_FAILURE_SHOTS"):
                page.screenshot(path=Path(folder) / "failure.png")
            print("page:", page.url, "console:", errors)
            with suppress(Error):  # the page may be gone
                print(page.locator("body").inner_text(timeout=5000)[:4000])
            raise
        if refused:
            errors = [e for e in errors if not (f"status of {status}" in e and f"{refused}'" in e)]
        assert errors == [], errors
    finally:
        context.close()


def open_demo(page: Page) -> None:
    page.get_by_role("link", name="Demo").first.click()
    expect(page.get_by_test_id("target-row").first).to_be_visible()
    page.wait_for_function("() => document.querySelector('[data-testid=map]')?.dataset.terrain")


def _wait_for_rest(page: Page) -> None:
    """Wait until the map's view has not moved for a quarter of a second."""
    page.wait_for_function(
        """() => {
            const map = document.querySelector('[data-testid=map]');
            const view = `${map.dataset.center} ${map.dataset.resolution}`;
            if (window.outcropView !== view) {
                window.outcropView = view;
                window.outcropRest = performance.now();
            }
            return performance.now() - window.outcropRest > 250;
        }"""
    )


def pixel(page: Page, east_m: float, north_m: float) -> tuple[float, float]:
    """Return where a point of the site lies on the screen, from what the map says of its view."""
    element = page.get_by_test_id("map")
    _wait_for_rest(page)
    box = element.bounding_box()
    assert box is not None
    east, north = (float(part) for part in str(element.get_attribute("data-center")).split(","))
    resolution = float(str(element.get_attribute("data-resolution")))
    return (
        box["x"] + box["width"] / 2 + (east_m - east) / resolution,
        box["y"] + box["height"] / 2 - (north_m - north) / resolution,
    )


def colours(page: Page, test_id: str) -> int:
    """Return how many colours the pixels of an element have: one or two would be a blank picture."""
    from PIL import Image

    picture = Image.open(io.BytesIO(page.get_by_test_id(test_id).screenshot())).convert("RGB")
    return len(picture.getcolors(maxcolors=1 << 24) or [])


def open_scene(page: Page) -> None:
    """Go to the 3D view and wait for its first frame."""
    page.get_by_role("button", name="3D").click()
    page.wait_for_function("() => document.querySelector('[data-testid=scene]')?.dataset.ready === 'true'")
    page.wait_for_function("() => Number(document.querySelector('[data-testid=scene]').dataset.drawn) > 0")


def field_of(page: Page, server: Server, path: str) -> Any:
    """Return what the API says of a resource, asked as the person at work."""
    answer = page.request.get(f"{server.address}/api/v1{path}")
    assert answer.ok, answer.text()
    return answer.json()


def shot(page: Page, name: str) -> None:
    """Write a screenshot for the documentation when `OUTCROP_SCREENSHOTS` asks for it."""
    if os.environ.get("OUTCROP_SCREENSHOTS"):
        SHOTS.mkdir(parents=True, exist_ok=True)
        page.wait_for_timeout(400)
        page.screenshot(path=SHOTS / f"browser-{name}.jpg", type="jpeg", quality=84)
