"""Map, panorama and 3D view: layers, picking by pointer and keys, places to stand, a terrain of one's own."""

from __future__ import annotations

import io
import json
import re
import time
import zipfile
from pathlib import Path
from typing import Any
from urllib.request import Request, urlopen

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from tests.web.conftest import Server
from tests.web.page import chromium, colours, open_demo, open_page, open_scene, pixel, shot

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.xdist_group("browser")]

NO_WEBGL = "?webgl=off"
"""The map and the panorama need no graphics card: what is asked of them is asked without one."""


def ask(server: Server, path: str, body: dict[str, Any] | None = None) -> Any:
    """Ask the API as the planner."""
    request = Request(
        f"{server}/api/v1{path}",
        None if body is None else json.dumps(body).encode(),
        {"X-Outcrop-Person": "Planner", "Content-Type": "application/json", "Prefer": "wait=60"},
    )
    with urlopen(request, timeout=90) as answer:
        return json.load(answer)


def demo(server: Server) -> str:
    missions = ask(server, "/missions")["items"]
    return str(next(mission["id"] for mission in missions if mission["name"] == "Demo"))


def choose(page: Page, name: str) -> None:
    page.get_by_test_id("target-row").filter(has_text=name).click()
    expect(page.get_by_label("Name of the target")).to_have_value(name)


def test_the_map_has_a_scale_and_its_layers_and_shows_where_the_rover_may_be(server: Server) -> None:
    mission = demo(server)
    job = ask(server, f"/missions/{mission}/plans", {"time_limit_s": 3.0, "iterations": 2})
    while job["state"] in {"queued", "running"}:
        time.sleep(0.5)
        job = ask(server, f"/jobs/{job['id']}")
    assert job["state"] == "succeeded", job  # the newest plan is shown, and this one has a tree
    with chromium() as browser, open_page(browser, server, NO_WEBGL) as page:
        open_demo(page)
        bar = page.get_by_test_id("scale-bar")
        metres = float(str(bar.get_attribute("data-metres")))
        resolution = float(str(page.get_by_test_id("map").get_attribute("data-resolution")))
        box = bar.bounding_box()
        assert box is not None
        assert abs(box["width"] - 4 - metres / resolution) < 2.0, "as long as it says"
        page.get_by_role("button", name="Layers").click()
        bare = colours(page, "map")
        page.get_by_label("Contours").check()
        page.get_by_label("Over the ground").select_option("coverage")
        expect(page.get_by_label("Coverage colours")).to_contain_text("hidden")
        page.wait_for_timeout(800)
        assert colours(page, "map") > bare
        page.get_by_label("Over the ground").select_option("slope")
        expect(page.get_by_label(re.compile("Slope colours"))).to_contain_text("≤ 25°")
        page.get_by_label("Where the rover may be").check()
        slider = page.get_by_label("Plan time of the predicted position")
        expect(page.get_by_test_id("spread")).to_contain_text("± 0.0 m along the plan")
        slider.fill(str(int(float(str(slider.get_attribute("max"))) * 0.4 // 30 * 30)))
        expect(page.get_by_test_id("spread")).not_to_contain_text("± 0.0 m along the plan")
        assert int(str(page.get_by_test_id("spread").get_attribute("data-spots"))) > 1
        page.get_by_role("button", name="Layers").click()
        shot(page, "spread")
        page.get_by_role("button", name="Layers").click()
        for label in ("Where the rover may be", "Contours"):
            page.get_by_label(label).uncheck()
        page.get_by_label("Over the ground").select_option("none")


def test_a_place_to_stand_is_dragged_and_a_bad_one_refused_with_the_reason(server: Server) -> None:
    with chromium() as browser, open_page(browser, server, NO_WEBGL) as page:
        open_demo(page)
        choose(page, "Clovis")
        request = page.locator("article .request").first
        stands = request.get_by_text("stands at")
        east, north = (
            float(n.replace("\N{MINUS SIGN}", "-"))
            for n in re.findall(r"[EN] (\S?[\d.]+)", stands.inner_text())
        )
        hint = page.get_by_test_id("stand-hint")

        def drag(to: tuple[float, float]) -> None:
            page.mouse.move(*pixel(page, east, north))
            page.mouse.down()
            page.mouse.move(*pixel(page, *to), steps=5)

        drag((east + 9.0, north - 9.0))
        expect(hint).to_contain_text("Refused")
        expect(hint).to_contain_text("is the limit")
        shot(page, "stand")
        page.mouse.up()
        expect(page.get_by_text("stays where it was")).to_be_visible()
        expect(request).not_to_contain_text("set by hand")

        drag((east + 0.3, north + 0.3))
        expect(hint).to_contain_text("Reached")
        page.mouse.up()
        expect(request).to_contain_text("set by hand")
        page.get_by_role("button", name="Return to base placement").click()
        expect(request).not_to_contain_text("set by hand")


def test_target_and_default_observation_come_from_the_panorama_in_three_clicks(server: Server) -> None:
    with chromium() as browser, open_page(browser, server, NO_WEBGL) as page:
        open_demo(page)
        before = page.get_by_test_id("target-row").count()
        page.get_by_role("button", name="Panorama").click()
        view = page.get_by_test_id("panorama")
        page.wait_for_function(
            """() => {
                const view = document.querySelector('[data-testid=panorama]');
                return view && Number(view.dataset.tiles.split('/')[0]) >= 1;
            }"""
        )
        box = view.bounding_box()
        assert box is not None
        assert colours(page, "panorama") > 100, "nothing was rendered"
        page.get_by_role("button", name="Add target (T)").click()
        page.mouse.click(box["x"] + 0.55 * box["width"], box["y"] + 0.6 * box["height"])
        page.get_by_test_id("save-request").click()
        expect(page.get_by_test_id("target-row")).to_have_count(before + 1)
        expect(page.locator("article .request")).to_have_count(1)
        off = [float(part) for part in str(view.get_attribute("data-landed")).split(",")]
        assert max(abs(value) for value in off) <= 1.0, "the marker lies under the click"
        shot(page, "panorama")
        page.get_by_role("button", name="2D").click()
        name = page.get_by_label("Name of the target").input_value()
    found = ask(server, f"/missions/{demo(server)}/targets")["items"]
    source = next(target["source_image"] for target in found if target["name"] == name)
    assert source.startswith("panorama navcam_left az ")


def test_targets_and_keep_outs_are_made_with_the_keyboard_alone(server: Server) -> None:
    with chromium() as browser, open_page(browser, server, NO_WEBGL) as page:
        open_demo(page)
        rows = page.get_by_test_id("target-row")
        before = rows.count()
        area = page.get_by_test_id("map")
        area.focus()
        page.keyboard.press("t")
        for key in ("ArrowRight", "ArrowRight", "Shift+ArrowDown", "Alt+ArrowLeft"):
            page.keyboard.press(key)
        cross = [float(part) for part in str(area.get_attribute("data-cross")).split(",")]
        page.keyboard.press("Enter")
        expect(rows).to_have_count(before + 1)
        where = page.locator("dd.mono").first.inner_text().replace("\N{MINUS SIGN}", "-")
        picked = [float(part) for part in re.findall(r"-?\d+\.\d+", where)[:2]]
        assert picked == pytest.approx(cross, abs=2e-3)

        area.focus()
        page.keyboard.press("o")
        page.keyboard.press("Enter")
        for key in ("Shift+ArrowRight", "Shift+ArrowUp"):
            page.keyboard.press(key)
            page.keyboard.press("Enter")
        page.keyboard.press("Shift+Enter")
        expect(page.get_by_label("Name of the keep-out")).to_be_visible()
        page.keyboard.press("Control+z")


def test_a_terrain_is_uploaded_in_the_page_and_a_broken_one_named(server: Server, tmp_path: Path) -> None:
    from rover_iface.terrain import HeightLayer, Ortho, Terrain, write_terrain

    count, spacing = 120, 0.2
    axis = (np.arange(count) + 0.5) * spacing - count * spacing / 2
    east, north = np.meshgrid(axis, axis)
    heights = (0.1 * np.sin(0.5 * east) * np.cos(0.4 * north)).astype(np.float32)
    layer = HeightLayer(heights, float(axis[0]), float(axis[0]), spacing, None, None, "dem")
    half = count * spacing / 2
    tone = np.clip(128 + 900 * heights, 0, 255).astype(np.uint8)
    ortho = Ortho((-half, -half, half, half), pixels=np.stack([tone, tone, tone], axis=-1)[::-1])
    folder = tmp_path / "yard"
    write_terrain(Terrain("yard", (layer,), (ortho,), credits="made for a test"), folder)
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for path in sorted(folder.rglob("*")):
            archive.write(path, path.relative_to(tmp_path))

    with chromium() as browser:
        refused = browser.new_context()
        page = refused.new_page()
        page.goto(server.address)
        page.get_by_role("button", name="New mission").first.click()
        page.get_by_role("textbox", name="Name", exact=True).fill("Broken")
        page.get_by_label("A terrain of your own").check()
        field = page.get_by_test_id("terrain-file")
        field.set_input_files({"name": "notes.txt", "mimeType": "text/plain", "buffer": b"no terrain"})
        expect(page.get_by_text("notes.txt is not a terrain")).to_be_visible()
        expect(page.get_by_role("button", name="Open", exact=True)).to_be_disabled()
        field.set_input_files({"name": "dem.tif", "mimeType": "image/tiff", "buffer": b"not a GeoTIFF"})
        page.get_by_role("button", name="Open", exact=True).click()
        expect(page.get_by_test_id("mission-refused")).to_contain_text("dem.tif")
        refused.close()

        with open_page(browser, server, NO_WEBGL) as good:
            good.get_by_role("button", name="New mission").first.click()
            good.get_by_role("textbox", name="Name", exact=True).fill("Own yard")
            good.get_by_label("A terrain of your own").check()
            good.get_by_test_id("terrain-file").set_input_files(
                {"name": "yard.zip", "mimeType": "application/zip", "buffer": packed.getvalue()}
            )
            shot(good, "upload")
            good.get_by_role("button", name="Open", exact=True).click()
            good.wait_for_function("() => document.querySelector('[data-testid=map]')?.dataset.terrain")
            expect(good.get_by_text("made for a test")).to_be_visible()
            good.keyboard.press("t")
            good.mouse.click(*pixel(good, 2.0, 1.0))
            expect(good.get_by_test_id("target-row")).to_have_count(1)


def test_the_scene_shows_overlays_measures_and_looks_through_the_rovers_cameras(server: Server) -> None:
    with chromium() as browser, open_page(browser, server) as page:
        open_demo(page)
        choose(page, "Adirondack")
        open_scene(page)
        scene = page.get_by_test_id("scene")
        box = scene.bounding_box()
        assert box is not None
        page.get_by_role("button", name="Layers").click()
        page.get_by_label("Over the ground").select_option("slope")
        page.get_by_label("Camera frusta").check()
        page.wait_for_timeout(1500)
        page.get_by_label("Over the ground").select_option("none")
        page.get_by_label("Camera frusta").uncheck()
        page.get_by_role("button", name="Layers").click()

        page.keyboard.press("m")
        page.mouse.click(box["x"] + 0.45 * box["width"], box["y"] + 0.72 * box["height"])
        expect(page.get_by_test_id("measured")).to_contain_text("second point")
        page.mouse.click(box["x"] + 0.6 * box["width"], box["y"] + 0.8 * box["height"])
        expect(page.get_by_test_id("measured")).to_contain_text(re.compile(r"straight · .+° · bearing \d+°"))
        page.keyboard.press("Escape")

        # Through the navigation camera: the target the mast looks at stands in the middle of the picture.
        page.get_by_role("button", name="As the rover's mast camera sees it").click()
        expect(scene).to_have_attribute("data-camera", "navcam_left")
        page.wait_for_timeout(1500)
        assert colours(page, "scene") > 300, "WebGL has drawn nothing"
        shot(page, "camera")
        before = page.get_by_test_id("target-row").count()
        x, y = box["x"] + 0.6 * box["width"], box["y"] + 0.62 * box["height"]
        page.keyboard.press("t")
        page.mouse.click(x, y)
        expect(page.get_by_test_id("target-row")).to_have_count(before + 1)
        marked = page.wait_for_function(
            "() => document.querySelector('[data-testid=scene]').dataset.landed"
        ).json_value()
        px, py = (float(part) for part in str(marked).split(","))
        assert abs(px - x) <= 1.0
        assert abs(py - y) <= 1.0
        page.get_by_label("Camera", exact=True).select_option("hazcam_left")
        expect(scene).to_have_attribute("data-camera", "hazcam_left")
        page.wait_for_timeout(1500)
        assert colours(page, "scene") > 300, "the lens shows nothing"
        page.get_by_role("button", name="Back to the free view").click()
        expect(scene).to_have_attribute("data-camera", "")
