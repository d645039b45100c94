"""The paper's day through the page: six targets and obstacles, a plan, why not, what if, compare, a dry run
with a lost track, a second person's approval, the execution, what came back opened from its targets."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path
from typing import Any
from urllib.request import urlopen

import pytest
from playwright.sync_api import Page, expect

from tests.web.conftest import Server
from tests.web.page import WAIT_MS, chromium, colours, field_of, open_page, open_scene, pixel, shot
from tests.web.review_steps import approve, sign_as_author

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.xdist_group("browser")]

TARGETS = [
    (4.0, 0.0, "microscopic_imager", 12),
    (-3.3, 3.0, "microscopic_imager", 9),
    (0.4, -5.0, "microscopic_imager", 14),
    (3.3, 4.4, "science_camera", 4),
    (-5.9, -1.0, "science_camera", 3),
    (10.2, -2.2, "microscopic_imager", 5),
]
"""East and north in metres, instrument, value; the last one is the paper's target at 10 m, left out there."""

BUDGET_H = "1.6"
PLAN_S = os.environ.get("OUTCROP_BROWSER_PLAN_S", "8")
"""Time limit of the plan; for pictures on a busy machine it has to be longer."""


def new_mission(page: Page, server: Server) -> str:
    """Make an empty mission on ground from a seed, as the dialog does, but on a smaller site."""
    body = {
        "name": "Paper's day",
        "notes": "Six targets within ten metres.",
        "rover_profile": "k9",
        "terrain": {"source": "generated", "seed": 7, "size_m": 48.0, "rock_cover": 0.05},
        "demo_content": False,
    }
    made = page.request.post(
        f"{server.address}/api/v1/missions",
        data=body,
        headers={"X-Outcrop-Person": "Planner"},
        timeout=WAIT_MS,
    )
    assert made.status == 201, made.text()
    return str(made.json()["id"])


def pick(page: Page, east: float, north: float, instrument: str, value: int) -> str:
    """Pick a target on the map and file a request on it; return the target's name."""
    rows = page.get_by_test_id("target-row")
    before = rows.count()
    page.keyboard.press("t")
    page.mouse.click(*pixel(page, east, north))
    if instrument == "science_camera":
        page.get_by_role("radio", name=re.compile("Science camera")).click()
    page.get_by_label("Value", exact=True).fill(str(value))
    page.get_by_test_id("save-request").click()
    expect(rows).to_have_count(before + 1)
    expect(page.get_by_test_id("save-request")).to_have_count(0)
    return page.get_by_label("Name of the target").input_value()


def _draw_keep_out(page: Page, name: str, corners: list[tuple[float, float]]) -> None:
    page.keyboard.press("o")
    for corner in corners:
        page.mouse.click(*pixel(page, *corner))
    page.mouse.dblclick(*pixel(page, *corners[0]))
    expect(page.get_by_label("Name of the keep-out")).to_have_value(name)
    page.keyboard.press("Escape")


def make_plan(page: Page) -> None:
    page.get_by_test_id("plan").click()
    expect(page.get_by_test_id("plan-state")).to_have_text("computed")
    expect(page.get_by_test_id("outline")).to_be_visible()


def run_plan(page: Page) -> str:
    """Start a dry run and return how it ended."""
    before = page.url
    page.get_by_test_id("start-run").click()
    page.wait_for_function("before => location.href !== before", arg=before)
    expect(page.get_by_test_id("start-run")).to_be_enabled()
    expect(page.get_by_test_id("run-outcome")).not_to_have_text(re.compile("queued|running"))
    return page.get_by_test_id("run-outcome").inner_text()


def _execute(server: Server, package: Path, problem: dict[str, Any], terrain: str, folder: Path) -> Path:
    """Carry the package out where the rover is, without server or database; return the run's folder."""
    world = folder / "world"
    world.mkdir()
    ground = server.data / "terrains" / terrain
    (world / "world.json").write_text(
        json.dumps({"format": "world/1", "name": "site", "terrain": str(ground), "problem": problem})
    )
    run = folder / "run"
    trust = folder / "trust.json"
    server.outcrop("keys", "make", str(folder / "root.key"))
    roots = ["--root", str(folder / "root.key")]
    server.outcrop("trust", "init", str(trust), "--rover", "site", "--person", "Root", *roots)
    for key in json.loads(urlopen(f"{server.address}/api/v1/signing-keys").read()):
        role = "approver" if key["person"] == "Flight Director" else "author"
        roles = ["--role", role, *(["--role", "verifier"] if role == "author" else [])]
        server.outcrop("trust", "add", str(trust), key["person"], key["public"], *roles, *roots)
    server.outcrop("execute", str(package), "--world", str(world), "--trust", str(trust), "--out", str(run))
    return run


def test_the_papers_day_from_six_clicks_to_products_opened_from_their_targets(
    server: Server, tmp_path: Path
) -> None:
    with chromium() as browser, open_page(browser, server) as page:
        expect(page.get_by_role("heading", name="Missions")).to_be_visible()
        expect(page.get_by_role("link", name="Demo").first).to_be_visible()
        shot(page, "missions")
        mission = new_mission(page, server)
        page.goto(f"{server.address}/?quality=test#/m/{mission}")
        page.wait_for_function("() => document.querySelector('[data-testid=map]')?.dataset.terrain")

        expect(page.get_by_text("No targets yet.")).to_be_visible()
        shot(page, "empty")

        # Six targets with a request each, three clicks and a value; a keep-out on the way.
        names = [pick(page, *target) for target in TARGETS]
        assert len(set(names)) == len(TARGETS)
        position = page.locator("dd.mono").first.inner_text().replace("\N{MINUS SIGN}", "-")
        east, north = (float(part) for part in re.findall(r"-?\d+\.\d+", position)[:2])
        assert abs(east - TARGETS[-1][0]) < 0.05
        assert abs(north - TARGETS[-1][1]) < 0.05
        shot(page, "target")
        _draw_keep_out(page, "K1", [(1.2, -2.4), (2.6, -2.4), (1.9, -1.2)])
        _draw_keep_out(page, "K2", [(-2.6, 0.6), (-1.4, 0.4), (-1.8, 1.6)])

        # A day too short for all of it; the 3D view has drawn, and what was picked stands in it.
        page.get_by_role("tab", name="Plan", exact=True).click()
        page.get_by_label("Time budget, h").fill(BUDGET_H)
        page.get_by_label("Time budget, h").press("Tab")
        page.get_by_label("Time limit, s").fill(PLAN_S)
        open_scene(page)
        page.wait_for_timeout(1000)
        assert colours(page, "scene") > 500, "WebGL has drawn nothing"
        page.get_by_role("button", name="2D").click()

        make_plan(page)
        utility = float(page.get_by_test_id("utility").inner_text())
        assert utility > 5.0
        first = page.get_by_test_id("plan-select").input_value()
        shot(page, "plan")

        # Why not the target at 10 m?
        page.get_by_test_id("target-row").filter(has_text=names[-1]).click()
        expect(page.get_by_text("Not in plan #1.")).to_be_visible()
        page.get_by_role("button", name="Why not?").click()
        expect(
            page.get_by_text(re.compile("A plan that must contain it changes in value|No plan was found"))
        ).to_be_visible()
        shot(page, "why-not")

        # What if there were more time, and the first target were out of reach?
        page.keyboard.press("w")
        answer = page.get_by_test_id("what-if-answer")
        expect(answer).to_have_attribute("data-ms", re.compile(r"\d+"))
        page.get_by_role("slider", name="Time budget").fill("1.5")
        expect(answer).to_contain_text("on the same futures")
        wish = page.get_by_role("group", name=f"Wish for {names[0]} · microscopic imager")
        wish.get_by_role("button", name="out").click()
        expect(answer.locator(".chip.bad").filter(has_text=names[0])).to_have_count(1)
        expect(answer).to_have_attribute("aria-busy", "false")
        shot(page, "what-if")
        page.get_by_test_id("keep-what-if").click()
        expect(page.get_by_text("What if: 1 request taken away")).to_be_visible()
        expect(page.get_by_test_id("plan-state")).to_have_text("computed")

        # Side by side with the plan it came from.
        page.get_by_test_id("compare").click()
        expect(page.get_by_test_id("paired")).to_contain_text("Beats the other with")
        expect(page.get_by_test_id("branch-by-branch")).to_contain_text(names[0])
        expect(page.get_by_role("img", name="Histogram of the utility of both plans")).to_be_visible()
        shot(page, "compare")
        page.keyboard.press("Escape")
        page.get_by_test_id("plan-select").select_option(first)
        expect(page.get_by_test_id("utility")).to_have_text(f"{utility:.2f}")

        # A dry run that loses the track of a target on the way: the rover moves, the loss is seen.
        page.get_by_role("tab", name="Run", exact=True).click()
        page.get_by_role("button", name="Add a fault").click()
        page.get_by_label("Minutes after the start").fill("8")
        start = page.get_by_test_id("map").get_attribute("data-rover")
        page.get_by_test_id("start-run").click()
        expect(page.get_by_test_id("run-outcome")).to_be_visible()
        page.wait_for_function(
            "start => document.querySelector('[data-testid=map]').dataset.rover !== start", arg=start
        )
        page.get_by_label("Moment of the run").fill("600")
        expect(page.locator(".tracker .chip.bad").first).to_have_text(re.compile("lost|failed"))
        expect(page.get_by_test_id("confidence")).to_be_visible()
        shot(page, "run")
        page.get_by_text("State of the executive").click()
        expect(page.get_by_test_id("snapshot")).to_be_visible()
        page.get_by_role("button", name="Remove fault").click()

        # Undisturbed runs until one ends well, as a planner would: then the plan is verified.
        assert "succeeded" in (run_plan(page) for _ in range(12))
        page.get_by_label("Moment of the run").fill("100000")
        page.get_by_role("button", name="Energy").click()
        page.get_by_role("tab", name="CRL", exact=True).click()
        page.get_by_test_id("target-row").filter(has_text=names[0]).focus()
        expect(page.get_by_test_id("crl")).to_contain_text(":action")
        shot(page, "crl")
        page.get_by_role("button", name="Tree").click()
        page.get_by_role("tab", name="Plan", exact=True).click()
        shot(page, "tree")
        page.get_by_role("button", name="Timeline").click()

        # The maker does not approve; a second person does, and gets the package.
        sign_as_author(page)
        approve(page)
        shot(page, "review")
        with page.expect_download() as download:
            page.get_by_test_id("package").click()
        assert download.value.suggested_filename.endswith(".zip")
        expect(page.locator(".states [aria-current]")).to_have_text("uplinked")
        package = tmp_path / "package.zip"
        download.value.save_as(package)

        # Execution on the rover, downlink: the page follows, and each product opens from its target.
        plan = field_of(page, server, f"/plans/{first}")
        problem = field_of(page, server, f"/problems/{plan['problem_id']}")["document"]
        terrain = field_of(page, server, f"/missions/{mission}")["terrain_id"]
        run = _execute(server, package, problem, terrain, tmp_path)
        server.outcrop("ingest", str(run))
        expect(page.locator(".states [aria-current]")).to_have_text("executed")
        page.get_by_role("tab", name=re.compile("Products")).click()
        expect(page.get_by_test_id("product-row").first).to_be_visible()
        page.get_by_role("tab", name=re.compile("^Targets")).click()
        seen = 0
        for name in names:
            page.get_by_test_id("target-row").filter(has_text=name).click()
            expect(page.get_by_label("Name of the target")).to_have_value(name)
            products = page.get_by_test_id("target-products").get_by_test_id("product")
            if products.count() == 0:
                continue
            products.first.click()
            expect(page.get_by_test_id("product-sheet")).to_be_visible()
            picture = page.get_by_test_id("product-image")
            expect(picture).to_be_visible()
            page.wait_for_function(
                "() => document.querySelector('[data-testid=product-image]').naturalWidth > 0"
            )
            seen += 1
            shot(page, "product")
        assert seen >= 2, "no target has what was asked of it"


def test_a_plan_that_cannot_be_made_says_why_and_is_not_said_to_be_made(server: Server) -> None:
    with chromium() as browser, open_page(browser, server) as page:
        mission = new_mission(page, server)
        page.goto(f"{server.address}/?quality=test#/m/{mission}")
        page.wait_for_function("() => document.querySelector('[data-testid=map]')?.dataset.terrain")
        pick(page, 3.0, -3.5, "microscopic_imager", 8)
        page.get_by_role("button", name="Edit request").first.click()
        page.get_by_role("button", name="More…").click()
        page.get_by_label("every plan must contain it").check()
        page.get_by_test_id("save-request").click()
        expect(page.get_by_test_id("save-request")).to_have_count(0)
        page.get_by_role("tab", name="Plan", exact=True).click()
        page.get_by_label("Time budget, h").fill("0.1")
        page.get_by_label("Time budget, h").press("Tab")
        page.get_by_test_id("plan").click()
        expect(page.get_by_test_id("plan-failed")).to_contain_text("must be done")
        expect(page.get_by_text("The plan is being made")).to_have_count(0)
        dock = page.get_by_label("Plan over time", exact=True)
        expect(dock).to_contain_text("must be done")
        shot(page, "failed")
