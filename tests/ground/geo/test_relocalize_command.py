"""`outcrop relocalize`: a stop's points on a terrain, the fix it writes, and what it refuses."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from ground.cli.main import app, register_all
from ground.geo.fixes import read_fixes
from rover_iface.terrain.generate import generate_terrain
from rover_iface.terrain.load import write_terrain
from rover_iface.terrain.terrain import Terrain

EYE, WRONG = (2.0, -3.0), (2.5, -1.5, math.radians(3.0))


@pytest.fixture(scope="module")
def outcrop() -> CliRunner:
    register_all()
    return CliRunner()


@pytest.fixture(scope="module")
def terrain() -> Terrain:
    return generate_terrain(
        8, 80.0, inner_m=8.0, inner_spacing_m=0.2, spacing_m=0.2, rock_cover=0.12, ortho=False, rough=3.0
    )


@pytest.fixture(scope="module")
def folder(terrain: Terrain, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_terrain(terrain, tmp_path_factory.mktemp("relocalize") / "map")


def stop(terrain: Terrain, path: Path, wrong: tuple[float, float, float]) -> Path:
    """Write the points of a stop at `EYE` as it believed to see them, and return the file."""
    rng = np.random.default_rng(1)
    away, azimuth = 25.0 * np.sqrt(rng.uniform(0.01, 1.0, 60_000)), rng.uniform(0, math.tau, 60_000)
    x, y = away * np.cos(azimuth), away * np.sin(azimuth)
    z = terrain.height(EYE[0] + x, EYE[1] + y) - terrain.height_at(*EYE) - 1.5
    c, s = math.cos(wrong[2]), math.sin(wrong[2])
    eye = np.array([EYE[0] - wrong[0], EYE[1] - wrong[1], 0.4])
    np.savez(path, points=np.column_stack([c * x + s * y, -s * x + c * y, z]) + eye, eye=eye)
    return path


def test_stop_is_found_and_its_fix_can_be_read(
    outcrop: CliRunner, terrain: Terrain, folder: Path, tmp_path: Path
) -> None:
    seen = stop(terrain, tmp_path / "sol9.npz", WRONG)
    result = outcrop.invoke(
        app,
        [
            "relocalize",
            str(seen),
            "--map",
            str(folder),
            "--sigma",
            "2",
            "--heading",
            "2",
            "--out",
            str(tmp_path),
        ],
    )
    assert result.exit_code == 0, result.output
    document = json.loads((tmp_path / "relocalisation.json").read_text())
    assert document["format"] == "relocalisation/1"
    assert document["accepted"] is True
    assert math.dist(document["eye_m"][:2], EYE) < 0.1
    assert document["turn_rad"] == pytest.approx(WRONG[2], abs=0.01)
    fixes, _ = read_fixes((tmp_path / "fixes.csv").read_text(), None)
    assert fixes.names == ("sol9",)
    assert fixes.places_m[0] == pytest.approx(document["eye_m"], abs=1e-3)
    spread = np.array(document["covariance"])[:3, :3]
    assert fixes.covariance_m2[0] == pytest.approx(spread, rel=1e-4, abs=1e-9)


def test_refused_stop_leaves_no_fix(
    outcrop: CliRunner, terrain: Terrain, folder: Path, tmp_path: Path
) -> None:
    seen = stop(terrain, tmp_path / "lost.npz", (14.0, 9.0, 0.0))
    (tmp_path / "fixes.csv").write_text("of an earlier answer")
    result = outcrop.invoke(
        app, ["relocalize", str(seen), "--map", str(folder), "--sigma", "2", "--out", str(tmp_path)]
    )
    assert result.exit_code == 3, result.output
    assert "lost: refused: " in result.output
    assert not (tmp_path / "fixes.csv").exists()
    document = json.loads((tmp_path / "relocalisation.json").read_text())
    assert document["accepted"] is False
    assert document["faults"]
    assert "eye_m" not in document


def test_earlier_stops_are_a_map(outcrop: CliRunner, terrain: Terrain, tmp_path: Path) -> None:
    earlier = stop(terrain, tmp_path / "earlier.npz", (0.0, 0.0, 0.0))
    later = stop(terrain, tmp_path / "later.npz", WRONG)
    result = outcrop.invoke(
        app, ["relocalize", str(later), "--map", str(earlier), "--sigma", "2", "--heading", "2"]
    )
    assert result.exit_code == 0, result.output


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--sigma", "50"], "sigma of the believed place is 50"),
        (["--heading", "-1"], "sigma of the believed heading is -1 degrees"),
        (["--map", "nowhere"], "nowhere"),
    ],
)
def test_bad_input_is_named(
    outcrop: CliRunner, terrain: Terrain, folder: Path, tmp_path: Path, arguments: list[str], told: str
) -> None:
    seen = stop(terrain, tmp_path / "stop.npz", WRONG)
    maps = [] if "--map" in arguments else ["--map", str(folder)]
    result = outcrop.invoke(app, ["relocalize", str(seen), *maps, *arguments])
    assert result.exit_code == 2, result.output
    assert told in result.output
