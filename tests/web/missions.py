"""Small missions made over REST, for tests that must not disturb each other."""

from __future__ import annotations

import json
import shutil
import tempfile
import time
from functools import cache
from pathlib import Path
from typing import Any
from urllib.request import Request, urlopen

from tests.web.conftest import Server

TARGETS = [
    ("North", 3.0, 3.5, "microscopic_imager", 9.0),
    ("South", 3.5, -3.0, "microscopic_imager", 12.0),
    ("West", -4.0, 1.0, "science_camera", 4.0),
]
KEEP_OUT = [[6.0, 2.0], [9.0, 2.0], [9.0, 5.0], [6.0, 5.0]]


def ask(server: Server, path: str, body: dict[str, Any] | None = None, *, wait_s: int = 60) -> Any:
    """Ask the API as the planner; a job is waited for, but no longer than so."""
    request = Request(
        f"{server.address}/api/v1{path}",
        None if body is None else json.dumps(body).encode(),
        {"X-Outcrop-Person": "Planner", "Content-Type": "application/json", "Prefer": f"wait={wait_s}"},
    )
    with urlopen(request, timeout=300) as answer:
        return json.load(answer)


@cache
def ground_from_a_seed() -> bytes:
    """Return a zip of the ground that the server generates from seed 7; that takes seconds each time."""
    from rover_iface.terrain import generate_terrain, write_terrain

    with tempfile.TemporaryDirectory() as folder:
        write_terrain(generate_terrain(7, 48.0, rock_cover=0.05), Path(folder) / "ground")
        packed = shutil.make_archive(str(Path(folder) / "packed"), "zip", Path(folder) / "ground")
        return Path(packed).read_bytes()


def small_mission(server: Server, name: str, targets: int = len(TARGETS)) -> str:
    """Return a new mission on ground from a seed: three targets with a request each, a keep-out."""
    terrain = {"source": "uploaded", "upload_id": uploaded(server, "ground.zip", ground_from_a_seed())}
    body = {"name": name, "notes": "", "rover_profile": "k9", "terrain": terrain, "demo_content": False}
    mission = str(ask(server, "/missions", body)["id"])
    for title, east, north, instrument, value in TARGETS[:targets]:
        target = ask(
            server, f"/missions/{mission}/targets", {"name": title, "east_m": east, "north_m": north}
        )
        contact = instrument == "microscopic_imager"
        request = {"target_id": target["id"], "instrument": instrument, "value": value, "tracked": contact}
        ask(server, f"/missions/{mission}/observation-requests", request)
    ask(server, f"/missions/{mission}/keep-outs", {"name": "K1", "notes": "", "polygon_m": KEEP_OUT})
    return mission


def done(server: Server, job: dict[str, Any]) -> dict[str, Any]:
    """Wait for a job and return it; it has to succeed."""
    while job["state"] in {"queued", "running"}:
        time.sleep(0.3)
        job = ask(server, f"/jobs/{job['id']}")
    assert job["state"] == "succeeded", job
    return job


def make_plan(server: Server, mission: str) -> str:
    """Return a plan of the mission."""
    order = {"time_limit_s": 3.0, "iterations": 2}
    return str(done(server, ask(server, f"/missions/{mission}/plans", order))["subject_id"])


def uploaded(server: Server, name: str, content: bytes) -> str:
    """Return the id of a file that is uploaded."""
    headers = {"X-Outcrop-Person": "Planner", "Content-Type": "application/octet-stream"}
    request = Request(f"{server.address}/api/v1/uploads?file_name={name}", content, headers)
    with urlopen(request, timeout=300) as answer:
        return str(json.load(answer)["id"])
