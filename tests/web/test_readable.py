"""What stands on the page is for people: no ids, no thousands of seconds; and it fits a narrow window."""

from __future__ import annotations

import re

import pytest
from playwright.sync_api import Page

from tests.web.all_views import all_views
from tests.web.conftest import Server
from tests.web.missions import make_plan, small_mission
from tests.web.page import chromium, open_page

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.xdist_group("browser")]

NARROW_PX = 320
"""WCAG 2.2, 1.4.10: the width at which nothing may need scrolling in two directions."""
MOST_S = 300.0
"""Longer times are told in minutes or on a clock."""
ID = re.compile(r"\b[a-z]{3}-[0-9abcdefghjkmnpqrstvwxyz]{13}\b")
"""`ground.gdr.ids.new_id`."""
SECONDS = re.compile(
    r"(?<![\w.:])(\d+(?:[,.'\u2009\u202f ]\d{3})*(?:\.\d+)?)[ \u2009\u202f\xa0]?(?:s|sec|seconds)\b"
)

TEXTS = """() => {
  // The text of a plan is what people sign, as it is; and a block that holds others is read by those.
  const own = (node) => node.closest('.cm-editor, [data-testid=crl]') !== null;
  const texts = [];
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const parent = walker.currentNode.parentElement;
    if (parent === null || own(parent) || ['SCRIPT', 'STYLE'].includes(parent.tagName)) continue;
    if (!parent.checkVisibility({ visibilityProperty: true })) continue;
    const whole = parent.closest('p, td, th, li, button, label, h1, h2, h3, dd, text') ?? parent;
    if (whole.querySelector('.cm-editor, [data-testid=crl]') !== null) continue;
    texts.push(whole.innerText ?? whole.textContent);
  }
  for (const field of document.querySelectorAll('input, textarea, select')) {
    if (!field.checkVisibility() || own(field)) continue;
    if (field.selectedOptions) texts.push([...field.options].map((o) => o.text).join('\\n'));
    else if (['text', 'search', 'textarea'].includes(field.type)) texts.push(field.value);
  }
  for (const named of document.querySelectorAll('[title], [aria-label]')) {
    if (!named.checkVisibility() || own(named)) continue;
    texts.push(named.title ?? '', named.getAttribute('aria-label') ?? '');
  }
  return [...new Set(texts)];
}"""

WIDE = """() => {
  const root = document.scrollingElement;
  const wide = [...document.querySelectorAll('body *')].filter((e) => {
    if (!e.checkVisibility() || e.getBoundingClientRect().right <= innerWidth + 0.5) return false;
    for (let up = e.parentElement; up !== null; up = up.parentElement) {
      if (up === document.body || up === root) break;
      if (getComputedStyle(up).overflowX !== 'visible') return false;
    }
    return true;
  });
  const says = (e) => `${e.tagName}.${e.className} ${Math.round(e.getBoundingClientRect().right)}`;
  return [root.scrollWidth, wide.slice(0, 4).map(says)];
}"""


def unreadable(text: str) -> list[str]:
    """Return the ids and the long numbers of seconds in a text."""
    long = [m[0] for m in SECONDS.finditer(text) if float(re.sub(r"[,' \u2009\u202f]", "", m[1])) > MOST_S]
    return [*ID.findall(text), *long]


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("target tgt-1qtts7k24h7b8 is out of reach", ["tgt-1qtts7k24h7b8"]),
        ("it takes 3443.99 s, not 40 s", ["3443.99 s"]),
        ("it takes 3,443 s or 3 443 seconds", ["3,443 s", "3 443 seconds"]),
        ("it takes 301 s", ["301 s"]),
        ("Rock-1 in 300 s, at 1:05:09, 12 steps", []),
    ],
)
def test_ids_and_long_times_are_seen_in_a_text(text: str, found: list[str]) -> None:
    assert unreadable(text) == found


def _at_a_narrow_window(page: Page) -> tuple[int, list[str]]:
    page.set_viewport_size({"width": NARROW_PX, "height": 800})
    page.wait_for_timeout(300)
    width, wide = page.evaluate(WIDE)
    page.set_viewport_size({"width": 1440, "height": 900})
    page.wait_for_timeout(100)
    return int(width), wide


def test_all_views_are_in_words_and_fit_a_window_of_320_pixels(server: Server) -> None:
    mission = small_mission(server, "In words")
    make_plan(server, mission)
    make_plan(server, mission)
    wrong: list[str] = []
    views: list[str] = []
    with chromium() as browser, open_page(browser, server) as page:
        for view in all_views(page, server, mission, "In words"):
            views.append(view)
            for text in page.evaluate(TEXTS):
                wrong += [f"{view}: {found} in {text[:200]!r}" for found in unreadable(text)]
            width, wide = _at_a_narrow_window(page)
            if width > NARROW_PX:
                wrong.append(f"{view}: {width} pixels wide in a window of {NARROW_PX}: {wide}")
    assert len(views) >= 20, views
    assert wrong == [], "\n".join(wrong)
