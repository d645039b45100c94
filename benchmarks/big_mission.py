"""What a page of a large mission costs: 300 targets, 2,000 requests, 10,000 data products.

A server process of its own answers over loopback; for each page the processor time of that process and the
time on the clock, mean and median of the rounds. With `--browser` also the time until Chromium, from the
address on, shows the map and all targets in the list. `--database` is a PostgreSQL server, on which a
database is made and dropped; default a fresh SQLite file.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Iterator

import httpx
from sqlalchemy import insert

from benchmarks.common.figure import Figure, command
from benchmarks.common.served import place, repository, service
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.records.actor import Actor, Role
from ground.resources.mission_setup.create_mission import GeneratedTerrain, create_mission
from ground.resources.observation_requests.row import ObservationRequestRow
from ground.resources.people.accounts import ensure_profiles
from ground.resources.plans.row import PlanRow
from ground.resources.products.row import ProductRow
from ground.resources.runs.row import RunRow
from ground.resources.sols.create_sol import create_sol
from ground.resources.targets.row import TargetRow

TARGETS, REQUESTS, PRODUCTS = 300, 2000, 10_000
PAGES = (
    ("targets", 100),
    ("targets", 300),
    ("observation-requests", 100),
    ("observation-requests", 1000),
    ("products", 100),
    ("products", 1000),
)
QUICK = {"rounds": 3}
BUDGET_S = 300.0


def fill(repo: Repository) -> str:
    """Write the rows of the mission and return its id."""
    who = Actor("Planner", Role.PLANNER)
    mission = create_mission(repo, who, name="Large", source=GeneratedTerrain(1, 48.0, 0.05))
    sol = create_sol(repo, who, mission.id)
    common = {"author": "Planner", "mission_id": mission.id, "revision": 1}
    targets = [
        {
            **common,
            "id": new_id("tgt"),
            "name": f"T{i}",
            "east_m": 0.01 * i,
            "north_m": -0.01 * i,
            "up_m": 0.1,
            "normal": [0.071, 0.030, 0.997],
            "slope_rad": 0.1,
            "covariance_m2": [[1.5e-4, 0.0, 0.0], [0.0, 1.5e-4, 0.0], [0.0, 0.0, 1.2e-4]],
        }
        for i in range(TARGETS)
    ]
    requests = [
        {
            **common,
            "id": new_id("req"),
            "target_id": targets[i % TARGETS]["id"],
            "instrument": "microscopic_imager",
            "value": 1.0 + i % 7,
            "tracked": True,
            "window_s": [3600.0, 7200.0],
            "after": [],
            "state": "open",
            "observation_point": {
                "pose": {"east_m": 0.01 * i, "north_m": 1.0, "heading_rad": 0.5},
                "reachable": True,
                "manual": False,
                "reason": "",
            },
        }
        for i in range(REQUESTS)
    ]
    plan = PlanRow(
        id=new_id("pln"),
        sol_id=sol.id,
        number=1,
        name="P",
        state="executed",
        strategy="optimal",
        max_branches=1,
        time_limit_s=1.0,
        seed=1,
        job_id="",
        inputs_sha256="",
        terrain_sha256="",
        dictionary="",
        rover_profile="k9",
        findings=[],
        request_ids=[],
        planned_request_ids=[],
        left_out={},
        author="Planner",
        mission_id=mission.id,
    )
    run = RunRow(
        id=new_id("run"),
        plan_id=plan.id,
        kind="execution",
        rover="abstract",
        seed=1,
        faults=[],
        state="succeeded",
        options_taken=[],
        achieved_request_ids=[],
        crl_sha256="",
        author="Planner",
        mission_id=mission.id,
    )
    products = [
        {
            **common,
            "id": new_id("prd"),
            "run_id": run.id,
            "plan_id": plan.id,
            "task_id": f"image-{i}",
            "request_id": requests[i % REQUESTS]["id"],
            "target_id": targets[i % TARGETS]["id"],
            "kind": "image",
            "instrument": "microscopic_imager",
            "media": "image/png",
            "file_name": f"{i:05d}.png",
            "size_bytes": 12345,
            "sha256": f"{i:064x}",
            "t_s": float(i),
            "label": {"kind": "image", "task": f"image-{i}", "pose": [1.0, 2.0, 0.3], "t_s": float(i)},
        }
        for i in range(PRODUCTS)
    ]
    with repo.database.write() as session:
        session.execute(insert(TargetRow), targets)
        session.execute(insert(ObservationRequestRow), requests)
        session.add_all([plan])
        session.flush()
        session.add(run)
        session.flush()
        session.execute(insert(ProductRow), products)
    return mission.id


def open_in_browser(address: str, rounds: int) -> list[float]:
    """Return the seconds from the address to the drawn map and the whole list, a new context each time."""
    from playwright.sync_api import sync_playwright

    from benchmarks.common.browser import page_of
    from tests.web.conftest import CHROMIUM, FLAGS

    found = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        for _ in range(rounds):
            with page_of(browser) as (page, _session):
                began = time.perf_counter()
                page.goto(address)
                page.wait_for_function(
                    "(n) => window.outcropSeen.map && "
                    "document.querySelectorAll('[data-testid=target-row]').length >= n",
                    arg=TARGETS,
                )
                found.append(time.perf_counter() - began)
        browser.close()
    return found


def figures(database: str = "", rounds: int = 20, browser: bool = False) -> Iterator[Figure]:
    """Yield processor time, time on the clock and size of each page."""
    with place(database) as environment:
        with repository(environment) as repo:
            ensure_profiles(repo)
            mission = fill(repo)
        with service(environment) as server:
            with httpx.Client(base_url=server.api, timeout=60.0) as client:
                for collection, limit in PAGES:
                    url = f"/missions/{mission}/{collection}?limit={limit}"
                    client.get(url)
                    before, wall = server.cpu_s(), []
                    for _ in range(rounds):
                        began = time.perf_counter()
                        answer = client.get(url)
                        wall.append(1000 * (time.perf_counter() - began))
                        if len(answer.json()["items"]) != limit:
                            raise SystemExit(f"{url}: {answer.text[:200]}")
                    page, cpu_ms = f"{limit:,} {collection}", 1000 * (server.cpu_s() - before) / rounds
                    yield Figure(f"{page}: processor time", cpu_ms, "ms")
                    yield Figure(f"{page}: on the clock", statistics.median(wall), "ms")
                    yield Figure(f"{page}: size", len(answer.content) / 1024, "KiB")
            if browser:
                seconds = open_in_browser(f"{server.address}/?quality=test#/m/{mission}", rounds)
                yield Figure("map and all targets in the browser", statistics.median(seconds), "s")


if __name__ == "__main__":
    command(figures, QUICK, BUDGET_S)
