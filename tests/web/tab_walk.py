"""What can be reached with the keyboard: a walk with the Tab key, and what of the page it did not come to."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from playwright.sync_api import Page

from tests.web.conftest import ROOT

AXE = ROOT / "web" / "node_modules" / "axe-core" / "axe.min.js"
MOST = 400

LISTENERS = """
const POINTER = new Set(['click', 'dblclick', 'mousedown', 'pointerdown', 'wheel']);
const add = EventTarget.prototype.addEventListener;
EventTarget.prototype.addEventListener = function (type, ...rest) {
    if (this instanceof Element && this.id !== 'app' && POINTER.has(type)) this.outcropPointer = true;
    return add.call(this, type, ...rest);
};
"""
"""Notes who listens to the pointer; what Svelte hears for its elements, in the root, stands on them."""

HELPERS = Path(__file__).with_name("tab_walk.js")


@dataclass
class Walk:
    """What a walk came to, in its order, and what is wrong on the way."""

    stops: list[dict[str, Any]] = field(default_factory=list)
    wrong: list[str] = field(default_factory=list)


def prepare(page: Page) -> None:
    """Make ready for walks in the page that is open: to be called after each load."""
    page.evaluate(AXE.read_text())
    page.evaluate(HELPERS.read_text())


def walk(page: Page, view: str, walked: set[str], elsewhere: frozenset[str] = frozenset()) -> Walk:
    """Press Tab until it comes round; inside a group of one stop, and among radio buttons, the arrow keys.

    A group is walked through in the first view that has it: the arrow keys select what they come to, which
    would leave the view. `walked` keeps the names of those groups; `elsewhere` are the test ids of what hears
    the pointer and has its equivalent in another control.
    """
    found = Walk()
    prepare(page)
    page.evaluate("outcropTab.begin()")
    page.keyboard.press("Tab")
    seen: set[int] = set()
    inside: set[str] = set()
    for _ in range(MOST):
        stop = page.evaluate("outcropTab.at()")
        if stop is None:  # the browser's own controls are part of the round
            page.keyboard.press("Tab")
            continue
        if found.stops and stop["id"] == found.stops[0]["id"]:
            break
        if stop["id"] not in seen:
            _look(found, stop, view, seen)
        group = stop["group"] or stop["radio"]
        if stop["roving"] and not stop["group"]:
            found.wrong.append(f"{view}: the group of {stop['says']} has no name")
        elif group and group not in walked:
            inside.add(group)
            _through_group(page, found, stop, view, seen)
        page.keyboard.press("Tab")
    else:
        found.wrong.append(f"{view}: Tab does not come round in {MOST} stops")
    for element in page.evaluate("outcropTab.all()"):
        group = element["group"] or element["radio"]
        if element["id"] not in seen and (not group or group in inside):
            found.wrong.append(f"{view}: {element['says']} is not reached")
        if not element["name"]:
            found.wrong.append(f"{view}: {element['says']} has no name")
        if element["positive"]:
            found.wrong.append(f"{view}: {element['says']} has a place of its own in the order")
    for says in page.evaluate("outcropTab.pointerOnly()"):
        if not any(f"#{name} " in f"{says} " for name in elsewhere):
            found.wrong.append(f"{view}: {says} hears the pointer and no key")
    walked |= inside
    parts = [stop["part"] for stop in found.stops]
    inner = [part for part in parts if part >= 0]
    back = sum(a > b for a, b in zip(inner, inner[1:] + inner[:1], strict=True))
    if back > 1 and not page.locator("dialog[open]").count():
        found.wrong.append(f"{view}: the order jumps between the parts: {parts}")
    return found


def _look(found: Walk, stop: dict[str, Any], view: str, seen: set[int]) -> None:
    seen.add(stop["id"])
    found.stops.append(stop)
    if not stop["seen"]:
        found.wrong.append(f"{view}: the focus on {stop['says']} is not seen")
    if stop["hidden"]:
        found.wrong.append(f"{view}: {stop['says']} has the focus and is {stop['hidden']}")


def _through_group(page: Page, found: Walk, stop: dict[str, Any], view: str, seen: set[int]) -> None:
    """Go through a group with the arrow keys, from its first item to its last, and back to where it began."""
    forth, back = ("ArrowRight", "ArrowLeft") if stop["roving"] == "row" else ("ArrowDown", "ArrowUp")
    if stop["roving"]:
        page.keyboard.press("Home")
    here: list[int] = []
    for _ in range(MOST):
        now = page.evaluate("outcropTab.at()")
        if now is None:
            found.wrong.append(f"{view}: the arrow keys lost the focus in the group of {stop['says']}")
            return
        if now["id"] in here:
            break
        here.append(now["id"])
        if now["id"] not in seen:
            _look(found, now, view, seen)
        page.keyboard.press(forth)
    for _ in here:
        now = page.evaluate("outcropTab.at()")
        if now is None or now["id"] == stop["id"]:
            return
        page.keyboard.press(back)
