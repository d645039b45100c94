"""The traverse in the browser: ellipses on the map, tie points, a solution chosen by keyboard."""

from __future__ import annotations

import io
import json
import os
import re
import zipfile
from pathlib import Path
from typing import Any
from urllib.request import Request, urlopen

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from tests.web.conftest import Server
from tests.web.missions import ask, done, small_mission
from tests.web.page import chromium, colours, open_page, shot
from tests.web.tab_walk import AXE

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.xdist_group("browser")]

OFF = np.array([0.9, -0.8, 0.0])
"""How far the second stop is believed off, metres east, north, up."""
SEED = 1011


def send(server: Server, name: str, content: bytes) -> str:
    """Upload a file."""
    request = Request(
        f"{server.address}/api/v1/uploads?file_name={name}",
        content,
        {"X-Outcrop-Person": "Planner", "Content-Type": "application/octet-stream"},
    )
    with urlopen(request, timeout=90) as answer:
        return str(json.load(answer)["id"])


def stop_files(folder: Path) -> list[tuple[str, bytes, np.ndarray[Any, Any]]]:
    """Return what was seen from both ends of a leg, the second end believed off, and the believed eyes.

    With `OUTCROP_SCREENSHOTS` these are rendered panoramas, which take a minute; else modelled points.
    """
    from studies.common.localization_legs import look, make_leg, stereo_points

    leg = make_leg(SEED, 26.0, rock_cover=0.06)
    if os.environ.get("OUTCROP_SCREENSHOTS"):
        return [_panorama(leg, end, folder) for end in (0, 1)]
    files = []
    for end, error in ((0, np.zeros(3)), (1, OFF)):
        seen = stereo_points(look(leg, end), np.random.default_rng([1, end]))
        out = io.BytesIO()
        np.savez(out, points=seen.points + error, eye=seen.eye + error)
        files.append((f"stop{end}.npz", out.getvalue(), seen.eye + error))
    return files


def _panorama(leg: Any, end: int, folder: Path) -> tuple[str, bytes, np.ndarray[Any, Any]]:
    from dataclasses import replace

    from studies.common.localization_legs import rendered_panorama

    panorama = rendered_panorama(leg, end, seed=SEED)
    error = OFF if end else np.zeros(3)
    wedges = [
        replace(
            wedge,
            left_camera=wedge.left_camera.moved(np.eye(3), error),
            right_camera=wedge.right_camera.moved(np.eye(3), error),
        )
        for wedge in panorama.wedges
    ]
    believed = replace(panorama, wedges=wedges)
    believed.save(folder / f"stop{end}")
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for path in sorted((folder / f"stop{end}").iterdir()):
            archive.write(path, f"stop{end}/{path.name}")
    return f"stop{end}.zip", out.getvalue(), believed.eye


@pytest.fixture(scope="module")
def mission(server: Server, tmp_path_factory: pytest.TempPathFactory) -> str:
    """A mission with two stops adjusted, and a target and a keep-out that are tied to the second."""
    mission = small_mission(server, "Traverse", targets=0)
    base = f"/missions/{mission}"
    landing = ask(server, f"{base}/frames", {"name": "SITE_FRAME", "counter": [0]})["id"]
    spread = np.diag([0.005, 0.005, 0.03, 0.9, 0.9, 0.3]) ** 2
    stops = []
    for k, (name, content, eye) in enumerate(stop_files(tmp_path_factory.mktemp("stops"))):
        frame = ask(server, f"{base}/frames", {"name": "ROVER_FRAME", "counter": [0, 10 * k]})
        solution = ask(
            server,
            f"/frames/{frame['id']}/solutions",
            {
                "label": "telemetry",
                "reference_id": landing,
                "offset_m": [float(eye[1]), float(eye[0]), float(1.5 - eye[2])],
                "quaternion": [1.0, 0.0, 0.0, 0.0],
                "covariance": (spread if k else 1e-6 * np.eye(6)).tolist(),
            },
        )
        use(server, frame["id"], solution["id"])
        stops.append({"frame_id": frame["id"], "upload_id": send(server, name, content), "at": eye})
    east, north, _ = (float(v) for v in stops[1].pop("at"))
    del stops[0]["at"]
    tied = {"frame_id": stops[1]["frame_id"]}
    ask(server, f"{base}/targets", {"name": "Humphrey", "east_m": 0.9 * east, "north_m": 0.9 * north, **tied})
    done(server, ask(server, f"{base}/traverses", {"name": "Sol 7 to 8", "stops": stops}))
    return mission


def use(server: Server, frame: str, solution: str) -> None:
    """Put a solution in use."""
    request = Request(
        f"{server.address}/api/v1/frames/{frame}/solution",
        f'{{"solution_id": "{solution}"}}'.encode(),
        {"X-Outcrop-Person": "Planner", "Content-Type": "application/json", "If-Match": "*"},
        method="PUT",
    )
    urlopen(request, timeout=90).close()


def axe(page: Page) -> list[str]:
    """Return the rules of accessibility that the page breaks badly."""
    page.evaluate(AXE.read_text())
    found = page.evaluate("axe.run(document, {resultTypes: ['violations']})")
    return [
        f"{v['id']}: {[n['target'] for n in v['nodes']][:3]}"
        for v in found["violations"]
        if v["impact"] in {"serious", "critical"}
    ]


def test_a_traverse_is_looked_at_and_its_solution_chosen_by_keyboard(server: Server, mission: str) -> None:
    with chromium() as browser, open_page(browser, server, "?webgl=off") as page:
        page.goto(f"{server}/?webgl=off#/m/{mission}?tab=traverse")
        sheet = page.get_by_test_id("traverse-sheet")
        expect(sheet.get_by_text("accepted", exact=True)).to_be_visible()
        expect(page.get_by_test_id("traverse-key")).to_contain_text("adjusted")
        page.wait_for_timeout(1000)
        shown = colours(page, "map")
        shot(page, "traverse")
        page.get_by_role("button", name="Layers").click()
        page.get_by_label(re.compile("Traverse with 95 % ellipses")).uncheck()
        page.wait_for_timeout(600)
        assert colours(page, "map") != shown
        page.get_by_label(re.compile("Traverse with 95 % ellipses")).check()
        page.get_by_role("button", name="Layers").click()
        assert axe(page) == []

        use_it = sheet.get_by_role("button", name=re.compile("Use adjusted of .* for ROVER_FRAME 0.10"))
        use_it.focus()
        page.keyboard.press("Enter")
        weighed = sheet.get_by_role("group", name="What the choice moves")
        expect(weighed).to_contain_text(re.compile(r"Humphrey 1\.\d\d m, ± \d\.\d\d → \d\.\d\d m"))
        shot(page, "traverse-choice")
        page.keyboard.press("Tab")
        expect(weighed.get_by_role("button", name="Put in use")).to_be_focused()
        before = ask(server, f"/missions/{mission}/targets")["items"][0]["position"]
        page.keyboard.press("Enter")
        expect(sheet.get_by_role("group", name="ROVER_FRAME 0.10").locator(".used")).to_contain_text(
            "adjusted"
        )
        after = ask(server, f"/missions/{mission}/targets")["items"][0]["position"]
        moved = np.array([after[k] - before[k] for k in ("east_m", "north_m")])
        assert moved == pytest.approx(-OFF[:2], abs=0.5)


def test_tie_points_are_drawn_between_both_panoramas(server: Server, mission: str) -> None:
    (traverse,) = ask(server, f"/missions/{mission}/traverses")["items"]
    leg = traverse["document"]["legs"][0]
    with chromium() as browser, open_page(browser, server, "?webgl=off") as page:
        page.goto(f"{server}/?webgl=off#/m/{mission}?tab=traverse")
        page.get_by_role("button", name="Tie points").click()
        ties = page.get_by_test_id("ties")
        expect(ties.locator("svg g.yes")).to_have_count(len(leg["pairs"]))
        expect(ties.locator("svg g.no")).to_have_count(len(leg["rejected"]))
        page.wait_for_function(
            "() => [...document.querySelectorAll('[data-testid=ties] image')].length === 2"
        )
        page.wait_for_timeout(1500)
        assert colours(page, "ties") > 60
        for circle in ties.locator("svg g.yes circle").all():
            box = circle.bounding_box()
            around = ties.locator(".scroll").bounding_box()
            assert box is not None
            assert around is not None
            assert around["x"] - 8 <= box["x"] + box["width"] / 2 <= around["x"] + around["width"] + 8
        assert axe(page) == []
        shot(page, "ties")
        page.get_by_role("checkbox", name=re.compile("accepted")).focus()
        page.keyboard.press("Space")
        expect(ties.locator("svg g.yes")).to_have_count(0)
        page.keyboard.press("Space")
        first = ties.get_by_role("button", name="Show pair 1", exact=True)
        first.focus()
        page.keyboard.press("Enter")
        expect(ties.locator("svg g.chosen")).to_have_count(1)
