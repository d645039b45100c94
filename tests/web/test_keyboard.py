"""By keyboard: each control is reached, seen and named, each gesture of the pointer has its keys."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from tests.web.all_views import all_views, open_mission
from tests.web.conftest import Server
from tests.web.missions import ask, make_plan, small_mission
from tests.web.page import chromium, open_page, pixel, shot
from tests.web.tab_walk import LISTENERS, Walk, walk

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.xdist_group("browser")]

ELSEWHERE = frozenset({"confidence"})
"""A click on the chart of confidence goes to a moment: so does the slider `Moment of the run`."""


def test_every_control_is_reached_with_the_keyboard_and_has_a_name_and_a_focus_that_is_seen(
    server: Server,
) -> None:
    mission = small_mission(server, "All controls")
    make_plan(server, mission)
    make_plan(server, mission)
    walks: dict[str, Walk] = {}
    walked: set[str] = set()
    with chromium() as browser, open_page(browser, server) as page:
        page.add_init_script(LISTENERS)

        for view in all_views(page, server, mission, "All controls"):
            walks[view] = walk(page, view, walked, ELSEWHERE)
        wrong = [line for found in walks.values() for line in found.wrong]
        stops = {view: len(found.stops) for view, found in walks.items()}
        print(f"{sum(stops.values())} stops in {len(stops)} views: {stops}")
        assert wrong == [], "\n".join(wrong)
        assert min(stops.values()) >= 2, stops


def test_the_help_shows_what_is_bound_and_f6_goes_through_the_parts(server: Server) -> None:
    mission = small_mission(server, "Parts")
    with chromium() as browser, open_page(browser, server) as page:
        open_mission(page, server, mission)
        parts = []
        page.evaluate("() => document.activeElement?.blur()")
        for _ in range(6):
            page.keyboard.press("F6")
            parts.append(
                page.evaluate("() => document.activeElement.closest('[data-part]')?.ariaLabel ?? 'header'")
            )
        lists, terrain, dock, details = (
            "Targets, keep-outs and products",
            "Terrain",
            "Plan over time",
            "Details",
        )
        assert parts == ["header", lists, terrain, dock, details, "header"]
        page.keyboard.press("Shift+F6")
        assert page.evaluate("() => document.activeElement.closest('[data-part]').ariaLabel") == details
        for key, seen in (
            ("t", "Add target (T)"),
            ("o", "Draw keep-out (O)"),
            ("m", "Measure (M)"),
        ):
            page.keyboard.press(key)
            expect(page.get_by_role("button", name=seen)).to_have_attribute("aria-pressed", "true")
            page.keyboard.press("Escape")
        for key, tab in (("p", "Plan"), ("r", "Run"), ("c", "CRL"), ("a", "Review"), ("s", "Selection")):
            page.keyboard.press(key)
            expect(page.get_by_role("tab", name=tab, exact=True)).to_have_attribute("aria-selected", "true")
        page.keyboard.press("4")
        expect(page.get_by_test_id("panorama")).to_be_visible()
        page.keyboard.press("3")
        expect(page.get_by_test_id("scene")).to_be_visible()
        page.keyboard.press("2")
        expect(page.get_by_test_id("map")).to_be_visible()
        page.keyboard.press("?")
        help_ = page.get_by_role("dialog", name="Keys")
        expect(help_).to_be_visible()
        for key in ("T", "Space", "Ctrl Z", "G", "Shift Enter", "F6", "Q"):
            expect(help_.locator("kbd").get_by_text(key, exact=True).first).to_be_visible()
        shot(page, "help")


def steer(
    page: Page, test_id: str, where: Callable[[], tuple[float, float]], to: tuple[float, float]
) -> None:
    """Move the crosshair with the arrow keys until it stands on a place of the screen."""
    for _ in range(6):
        x, y = where()
        right, down = round(to[0] - x), round(to[1] - y)
        if right == 0 and down == 0:
            return
        for pixels, plus, minus in ((right, "ArrowRight", "ArrowLeft"), (down, "ArrowDown", "ArrowUp")):
            left = abs(pixels)
            for size, held in ((40, "Shift+"), (8, ""), (1, "Alt+")):
                for _ in range(left // size):
                    page.keyboard.press(held + (plus if pixels > 0 else minus))
                left %= size
    raise AssertionError(f"the crosshair of {test_id} stands at {where()} and not at {to}")


def cross_of(page: Page) -> tuple[float, float]:
    east, north = (float(p) for p in str(page.get_by_test_id("map").get_attribute("data-aim")).split(","))
    return east, north


def steer_map(page: Page, east: float, north: float) -> None:
    """Move the crosshair of the map to within a pixel of a place of the site."""
    area = page.get_by_test_id("map")
    if area.get_attribute("data-aim") in {"", None}:
        page.keyboard.press("Enter")
    resolution = float(str(area.get_attribute("data-resolution")))

    def where() -> tuple[float, float]:
        e, n = cross_of(page)
        return e / resolution, -n / resolution

    steer(page, "map", where, (east / resolution, -north / resolution))


def polygon(server: Server, mission: str, name: str) -> list[list[float]]:
    items = ask(server, f"/missions/{mission}/keep-outs")["items"]
    return next(item["polygon_m"] for item in items if item["name"] == name)


def near(one: Any, other: Any, far: float) -> bool:
    return len(one) == len(other) and all(
        abs(a - b) <= far for p, q in zip(one, other, strict=True) for a, b in zip(p, q, strict=True)
    )


def test_keep_outs_are_drawn_snapped_edited_and_moved_by_pointer_and_by_keys_alike(server: Server) -> None:
    mission = small_mission(server, "Keep-outs")
    with chromium() as browser, open_page(browser, server) as page:
        open_mission(page, server, mission, "?webgl=off")
        area = page.get_by_test_id("map")
        first = polygon(server, mission, "K1")
        far = 1.6 * float(str(area.get_attribute("data-resolution")))

        # With the pointer: a corner that is set 6 pixels off snaps to the corner of the other one.
        page.keyboard.press("o")
        x, y = pixel(page, *first[0])
        for at in ((x + 6, y - 2), (x + 60, y), (x + 60, y + 60)):
            page.mouse.click(*at)
            page.wait_for_timeout(350)  # two clicks in quick succession are a double click
        page.mouse.dblclick(x, y + 60)
        expect(page.get_by_label("Name of the keep-out")).to_have_value("K2")
        assert near([polygon(server, mission, "K2")[0]], [first[0]], 1e-3), "snapped to the corner"

        # With the keys: the same outline, snapped to the same corner.
        area.focus()
        page.keyboard.press("o")
        corners = [first[0], *polygon(server, mission, "K2")[1:4]]
        resolution = float(str(area.get_attribute("data-resolution")))
        steer_at = (first[0][0] + 6 * resolution, first[0][1] + 2 * resolution)
        steer_map(page, *steer_at)
        page.keyboard.press("Enter")
        for corner in corners[1:]:
            steer_map(page, corner[0], corner[1])
            page.keyboard.press("Enter")
        page.keyboard.press("Shift+Enter")
        expect(page.get_by_label("Name of the keep-out")).to_have_value("K3")
        drawn = polygon(server, mission, "K3")
        assert near([drawn[0]], [first[0]], 1e-3), "the crosshair snaps as the pointer does"
        assert near(drawn[:4], corners, 2 * far)
        page.keyboard.press("Control+z")
        expect(page.get_by_role("tab", name="Keep-outs 2")).to_be_visible()
        page.get_by_role("tab", name=re.compile("^Keep-outs")).click()

        # Edit a corner: pointer, undo, keys; both end in the same place.
        def edited(act: Callable[[], None]) -> list[list[float]]:
            before = polygon(server, mission, "K1")
            act()
            for _ in range(100):
                if (now := polygon(server, mission, "K1")) != before:
                    break
                page.wait_for_timeout(100)
            else:
                raise AssertionError("nothing was saved")
            page.keyboard.press("Control+z")
            for _ in range(100):
                if polygon(server, mission, "K1") == before:
                    page.wait_for_timeout(400)
                    return now
                page.wait_for_timeout(100)
            raise AssertionError("undo did not bring it back")

        def drag(start: list[float], end: tuple[float, float]) -> None:
            page.mouse.move(*pixel(page, start[0], start[1]))
            page.mouse.down()
            page.mouse.move(*pixel(page, *end), steps=6)
            page.mouse.up()

        def carry(start: list[float], end: tuple[float, float]) -> None:
            area.focus()
            steer_map(page, start[0], start[1])
            page.keyboard.press("g")
            expect(area).to_have_attribute("data-held", "true")
            expect(page.get_by_test_id("keep-out-hint")).to_contain_text("moves it")
            steer_map(page, *end)
            page.keyboard.press("Enter")
            expect(area).to_have_attribute("data-held", "false")

        page.locator("button.item").filter(has_text="K1").click()
        corner, aim = first[2], (first[2][0] + 1.0, first[2][1] + 0.6)
        by_pointer, by_keys = edited(lambda: drag(corner, aim)), edited(lambda: carry(corner, aim))
        assert near(by_pointer, by_keys, far)
        assert near([by_keys[2]], [aim], far)
        assert near(by_keys[:2], first[:2], 1e-3), "the other corners stay"

        # An edge gives a corner more.
        middle = [(a + b) / 2 for a, b in zip(first[1], first[2], strict=True)]
        aim = (middle[0] + 0.8, middle[1])
        by_pointer, by_keys = edited(lambda: drag(middle, aim)), edited(lambda: carry(middle, aim))
        assert len(by_keys) == len(first) + 1
        assert near(by_pointer, by_keys, far)

        # The whole of the selected one.
        inside = [sum(p[k] for p in first) / len(first) for k in (0, 1)]
        aim = (inside[0] - 1.5, inside[1] + 1.0)
        by_pointer, by_keys = edited(lambda: drag(inside, aim)), edited(lambda: carry(inside, aim))
        assert near(by_pointer, by_keys, far)
        assert near(by_keys, [[p[0] - 1.5, p[1] + 1.0] for p in first], far)

        # A held corner is put back with Escape, and removed with Backspace.
        area.focus()
        steer_map(page, first[2][0], first[2][1])
        page.keyboard.press("g")
        page.keyboard.press("Shift+ArrowRight")
        page.keyboard.press("Escape")
        expect(area).to_have_attribute("data-held", "false")
        assert polygon(server, mission, "K1") == first

        def remove() -> None:
            area.focus()
            steer_map(page, first[2][0], first[2][1])
            page.keyboard.press("g")
            page.keyboard.press("Backspace")

        assert near(edited(remove), first[:2] + first[3:], 1e-3)


def _selected(page: Page) -> str:
    found = re.search(r"sel=([^&]+)", page.url)
    return "" if found is None else found.group(1)


def test_map_and_plan_are_worked_with_the_keys_as_with_the_pointer(server: Server) -> None:
    mission = small_mission(server, "Map by keys")
    make_plan(server, mission)
    with chromium() as browser, open_page(browser, server) as page:
        open_mission(page, server, mission, "?webgl=off")
        area = page.get_by_test_id("map")

        # Select: a click at the crosshair is a click of the pointer.
        page.mouse.click(*pixel(page, 3.5, -3.0))
        expect(page.get_by_label("Name of the target")).to_have_value("South")
        page.wait_for_timeout(400)
        by_pointer = _selected(page)
        page.keyboard.press("Escape")
        page.wait_for_function("() => !location.href.includes('sel=')")
        area.focus()
        steer_map(page, 3.5, -3.0)
        page.keyboard.press("Enter")
        expect(page.get_by_label("Name of the target")).to_have_value("South")
        assert _selected(page) == by_pointer

        # Measure: the same two ends give the same text.
        def measured(act: Callable[[], None]) -> str:
            page.keyboard.press("m")
            act()
            expect(page.get_by_test_id("measured")).to_contain_text("straight")
            text = page.get_by_test_id("measured").inner_text()
            page.keyboard.press("Escape")
            return text

        def point() -> None:
            for at in ((1.0, 1.0), (2.0, 3.0)):
                page.mouse.click(*pixel(page, *at))
                page.wait_for_timeout(350)

        def type_() -> None:
            area.focus()
            for at in ((1.0, 1.0), (2.0, 3.0)):
                steer_map(page, *at)
                page.keyboard.press("Enter")

        two = [re.findall(r"[\d.]+", measured(act))[:1] for act in (point, type_)]
        assert abs(float(two[0][0]) - float(two[1][0])) < 0.1, two

        # Where the rover is to stand: taken hold of, refused, put back, turned, reached, kept, undone.
        page.get_by_test_id("target-row").filter(has_text="South").click()
        request = page.locator("article .request").first
        before = request.get_by_text("stands at").inner_text()
        area.focus()
        hint = page.get_by_test_id("stand-hint")
        page.keyboard.press("g")
        expect(hint).to_be_visible()
        for _ in range(4):
            page.keyboard.press("Shift+ArrowLeft")
        expect(hint).to_contain_text("Refused")
        page.keyboard.press("Escape")
        expect(hint).to_have_count(0)
        expect(request.get_by_text("stands at")).to_have_text(before)
        page.keyboard.press("g")
        page.keyboard.press(",")
        page.keyboard.press(".")
        page.keyboard.press("Alt+ArrowUp")
        page.keyboard.press("Alt+ArrowUp")
        expect(hint).to_contain_text("Reached")
        page.keyboard.press("Enter")
        expect(request).to_contain_text("set by hand")
        page.keyboard.press("Control+z")
        expect(request).not_to_contain_text("set by hand")

        # Timeline: the keys choose, move and zoom; outline and CRL text walk through the same steps.
        dock = page.get_by_test_id("dock")
        dock.focus()
        page.keyboard.press("ArrowRight")
        first = _selected(page)
        assert first.startswith("step:")
        page.keyboard.press("ArrowRight")
        second = _selected(page)
        assert second.startswith("step:")
        assert second != first
        page.keyboard.press("ArrowLeft")
        assert _selected(page) == first
        page.keyboard.press("+")
        page.keyboard.press("+")
        assert float(str(dock.get_attribute("data-zoom"))) > 1.5
        page.keyboard.press("Shift+ArrowRight")
        assert float(str(dock.get_attribute("data-shift"))) > 0
        page.keyboard.press("0")
        assert (dock.get_attribute("data-zoom"), dock.get_attribute("data-shift")) == ("1.000", "0.0")
        page.keyboard.press("p")
        page.get_by_test_id("outline").get_by_role("button").first.focus()
        page.keyboard.press("ArrowDown")
        walked = _selected(page)
        page.keyboard.press("ArrowDown")
        assert _selected(page) != walked
        page.keyboard.press("c")
        page.get_by_test_id("crl").focus()
        page.keyboard.press("ArrowDown")
        task = _selected(page)
        assert task.startswith("task:")
        page.keyboard.press("End")
        assert _selected(page).startswith("task:")
        assert _selected(page) != task

        # A split moves, and no farther than the pointer could drag it.
        split = page.get_by_role("separator", name="Width of the lists")
        split.focus()
        wide = int(str(split.get_attribute("aria-valuenow")))
        page.keyboard.press("ArrowRight")
        expect(split).to_have_attribute("aria-valuenow", str(wide + 16))
        for _ in range(40):
            page.keyboard.press("ArrowLeft")
        expect(split).to_have_attribute("aria-valuenow", str(split.get_attribute("aria-valuemin")))

        # A run is scrubbed with the arrow keys of its slider; a picture is moved and zoomed.
        page.get_by_test_id("dry-run").click()
        expect(page.get_by_test_id("run-outcome")).not_to_have_text(re.compile("queued|running"))
        slider = page.get_by_label("Moment of the run")
        expect(slider).to_have_attribute("max", re.compile(r"\d{3,}"))  # the telemetry is here
        slider.focus()
        page.keyboard.press("End")
        page.keyboard.press("Home")  # whoever went back stays there, also when the run ends only now
        assert slider.input_value() == "0"
        page.wait_for_timeout(500)
        assert slider.input_value() == "0"
        page.keyboard.press("End")
        assert float(slider.input_value()) > 60
        page.get_by_role("tab", name=re.compile("^Products")).click()
        page.get_by_test_id("product-row").first.click()
        page.get_by_role("button", name="Open in the image viewer").press("Enter")
        stage = page.get_by_test_id("stage")
        stage.focus()
        for key in ("+", "+", "ArrowLeft"):
            page.keyboard.press(key)
        expect(stage).to_have_attribute("data-view", "1.96 40 0")
        page.keyboard.press("0")
        expect(stage).to_have_attribute("data-view", "1.00 0 0")


def test_the_3d_view_and_the_panorama_are_worked_with_the_keys(server: Server) -> None:
    mission = small_mission(server, "Views by keys")
    with chromium() as browser, open_page(browser, server) as page:
        open_mission(page, server, mission)
        page.get_by_test_id("target-row").filter(has_text="South").click()
        page.keyboard.press("3")
        scene = page.get_by_test_id("scene")
        page.wait_for_function(
            "() => document.querySelector('[data-testid=scene]')?.dataset.ready === 'true'"
        )
        page.wait_for_timeout(1200)
        box = scene.bounding_box()
        assert box is not None

        def where() -> tuple[float, float]:
            x, y = (float(p) for p in str(scene.get_attribute("data-cross")).split(","))
            return box["x"] + x, box["y"] + y

        # A target: the marker of what was picked at the crosshair lies under it.
        scene.focus()
        rows = page.get_by_test_id("target-row")
        before = rows.count()
        page.keyboard.press("t")
        page.keyboard.press("Enter")
        aim = (box["x"] + 0.4 * box["width"], box["y"] + 0.7 * box["height"])
        steer(page, "scene", where, (round(aim[0]), round(aim[1])))
        x, y = where()
        page.keyboard.press("Enter")
        expect(rows).to_have_count(before + 1)
        landed = page.wait_for_function(
            "() => document.querySelector('[data-testid=scene]').dataset.landed"
        ).json_value()
        px, py = (float(part) for part in str(landed).split(","))
        assert max(abs(px - x), abs(py - y)) <= 1.0

        # Turning, coming closer and going to the edge each draw another view; measuring takes two presses.
        scene.focus()
        for keys in (("q",), ("PageUp",), ("+",), ("f",), ("Shift+ArrowLeft",) * 14):
            drawn = int(str(scene.get_attribute("data-drawn")))
            for key in keys:
                page.keyboard.press(key)
            page.wait_for_function(
                f"() => Number(document.querySelector('[data-testid=scene]').dataset.drawn) > {drawn}"
            )
        page.keyboard.press("Escape")
        page.keyboard.press("m")
        scene.focus()
        page.keyboard.press("Enter")
        for _ in range(4):
            page.keyboard.press("ArrowDown")
        page.keyboard.press("Enter")
        expect(page.get_by_test_id("measured")).to_contain_text("second point")
        page.keyboard.press("Shift+ArrowRight")
        page.keyboard.press("Enter")
        expect(page.get_by_test_id("measured")).to_contain_text("straight")
        page.keyboard.press("Escape")

        # The place to stand.
        page.get_by_test_id("target-row").filter(has_text="South").click()
        request = page.locator("article .request").first
        expect(request).to_contain_text("stands at")
        page.wait_for_timeout(600)
        scene.focus()
        page.keyboard.press("g")
        hint = page.get_by_test_id("stand-hint")
        expect(hint).to_be_visible()
        for _ in range(4):
            page.keyboard.press("Shift+ArrowUp")
        expect(hint).to_contain_text("Refused")
        page.keyboard.press("Escape")
        expect(hint).to_have_count(0)
        page.keyboard.press("g")
        page.keyboard.press(",")
        expect(hint).to_contain_text(re.compile("Reached|Refused"))
        page.keyboard.press("Escape")
        expect(request).not_to_contain_text("set by hand")

        # The mast is turned with the same keys as the view.
        page.get_by_role("button", name="As the rover's mast camera sees it").press("Enter")
        pan = page.locator(".camera .mono")
        expect(pan).to_contain_text("pan")
        seen = pan.inner_text()
        scene.focus()
        page.keyboard.press("q")
        expect(pan).not_to_have_text(seen)

        # Panorama: picked at the crosshair, and the marker lies there.
        page.keyboard.press("4")
        view = page.get_by_test_id("panorama")
        page.wait_for_function(
            "() => Number(document.querySelector('[data-testid=panorama]')?.dataset.tiles.split('/')[0]) >= 1"
        )
        before = rows.count()
        page.keyboard.press("t")
        view.focus()
        page.keyboard.press("Enter")
        for _ in range(3):
            page.keyboard.press("Shift+ArrowDown")
        page.keyboard.press("Enter")
        expect(rows).to_have_count(before + 1)
        off = [float(part) for part in str(view.get_attribute("data-landed")).split(",")]
        assert max(abs(value) for value in off) <= 1.0
