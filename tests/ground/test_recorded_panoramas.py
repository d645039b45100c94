"""A plan asks for stereo panoramas, the executive flies it, and `outcrop localize` ties the stops."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from executive.crl import canonical_text, parse
from ground.cli.main import app, register_all
from ground.uplink.flight import fly
from rover_iface.cameras.panorama import load_panorama
from rover_iface.frames import Pose
from rover_iface.profile import load_profile
from rover_iface.simulator.faults import Fault, FaultKind
from rover_iface.simulator.subframe_rover import make_rover
from rover_iface.terrain import generate_terrain

if not any(command.name == "localize" for command in app.registered_commands):
    register_all()

PLAN = """
(plan :id stops :node
  (block :id root :node-list
    ((task :id first :action imagepanorama :parameters (from_azimuth = 0.7 to_azimuth = -0.7))
     (task :id drive :action navigate :parameters (x = 6 y = 0.5 heading = 0 mode = blind))
     (task :id second :action imagepanorama :parameters (from_azimuth = 0.7 to_azimuth = -0.7)))))
"""


@pytest.mark.parametrize("site", [3, pytest.param(8, marks=pytest.mark.slow)])
def test_the_stops_of_a_recorded_run_are_tied_by_what_they_saw(site: int, tmp_path: Path) -> None:
    terrain = generate_terrain(
        site, 64.0, rock_cover=0.06, inner_m=8.0, inner_spacing_m=0.1, spacing_m=0.25,
        crater=False, outcrop=False, ortho=False, relief_m=1.0, smallest_rock_m=0.12,
    )  # fmt: skip
    out = tmp_path / "run"
    world = {"format": "world/1", "name": "stops", "profile": "mer", "seed": site}
    slipping = Fault(FaultKind.SLIP_BURST, at_s=0.0, amount=1.08)
    rover = make_rover(world, terrain=terrain, out=out, faults=[slipping])
    flight = fly(canonical_text(parse(PLAN)), rover, out, run_id="stops", sync=False)
    assert flight.outcome.outcome == "SUCCEEDED"

    rows = [json.loads(line) for line in (out / "products.jsonl").read_text().splitlines()]
    stops = [out / row["path"] for row in rows if row["kind"] == "stereopanorama"]
    assert len(stops) == 2
    for stop in stops:
        files = {path for path in stop.parent.iterdir() if not path.name.endswith(".png.json")}
        told = {out / row["path"] for row in rows}
        assert files - told == {stop.with_name("panorama.json.json")}, "a file that no product names"
        assert len(load_panorama(stop.parent).wedges) >= 2

    result = CliRunner().invoke(app, ["localize", str(out), "--out", str(tmp_path / "found")])
    assert result.exit_code == 0, result.output
    found = json.loads((tmp_path / "found" / "localization.json").read_text())
    assert [leg["accepted"] for leg in found["legs"]] == [True]
    true = np.diff([_eye(stop) for stop in stops], axis=0)[0, :2]
    off = {}
    for key in ("believed_m", "adjusted_m"):
        way = np.diff([stop[key] for stop in found["stops"]], axis=0)[0, :2]
        off[key] = float(np.linalg.norm(way - true))
    assert off["believed_m"] > 0.3
    assert off["adjusted_m"] < 0.15


def _eye(stop: Path) -> np.ndarray[Any, Any]:
    """Return where the mast truly stood, from the simulation's part of a label."""
    pose = json.loads(stop.with_name(f"{stop.name}.json").read_text())["simulation_truth"]["pose"]
    mast = load_profile("mer").mast
    where = Pose(
        pose["east_m"],
        pose["north_m"],
        pose["up_m"],
        pose["heading_rad"],
        pose["pitch_rad"],
        pose["roll_rad"],
    )
    return where.site_from_rover.apply(np.array([mast.base_m[0], mast.base_m[1], mast.height_m]))
