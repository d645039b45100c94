"""`outcrop sim`: pictures, panorama and tracking from the command line."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import typer
from PIL import Image
from typer.testing import CliRunner

from ground.cli import sim
from ground.cli import terrain as terrain_commands
from rover_iface.cameras.panorama import load_panorama
from rover_iface.terrain import Recipe, generate_terrain, write_terrain


@pytest.fixture(scope="module")
def terrain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site") / "terrain"
    recipe = Recipe(
        seed=3, size_m=40.0, inner_m=12.0, crater=False, outcrop=False, ortho=False, rock_cover=0.08
    )
    write_terrain(generate_terrain(recipe=recipe), folder)
    return folder


def invoke(*arguments: str) -> tuple[int, str]:
    app = typer.Typer()
    sim.register(app)
    terrain_commands.register(app)
    result = CliRunner().invoke(app, list(arguments))
    return result.exit_code, result.output


def run(*arguments: str) -> tuple[int, str]:
    return invoke("sim", *arguments)


def test_render_writes_an_image_its_label_and_its_truth(terrain: Path, tmp_path: Path) -> None:
    out = tmp_path / "view.png"
    code, said = run(
        "render",
        "--out",
        str(out),
        "--terrain",
        str(terrain),
        "--camera",
        "hazcam_left",
        "--truth",
        "--lmst",
        "14",
    )
    assert code == 0, said
    with Image.open(out) as image:
        pixels = np.asarray(image)
    label = json.loads(out.with_suffix(".json").read_text())
    assert pixels.shape == (label["camera_model"]["height"], label["camera_model"]["width"])
    assert pixels.std() > 5
    assert label["camera"] == "hazcam_left"
    assert label["sun_direction"][0] < 0 < label["sun_direction"][2]  # afternoon: the sun in the west
    with np.load(out.with_suffix(".npz")) as truth:
        assert np.isfinite(truth["range_m"]).mean() > 0.5


def test_a_generated_geology_is_rendered_with_the_rover_in_view(tmp_path: Path) -> None:
    folder, out = tmp_path / "site", tmp_path / "view.png"
    code, said = invoke("terrain", "generate", "--out", str(folder), "--size", "16", "--geology", "jezero")
    assert code == 0, said
    code, said = run(
        "render", "--out", str(out), "--terrain", str(folder), "--camera", "hazcam_left", "--rover-in-view",
        "--truth",
    )  # fmt: skip
    assert code == 0, said
    with np.load(out.with_suffix(".npz")) as truth:
        seen = {str(truth["ids"][k]) for k in np.unique(truth["object_index"]) if k >= 0}
    assert "rover wheel" in seen
    assert json.loads((folder / "terrain.json").read_text())["surface"]["geology"] == "jezero"


def test_a_geology_that_is_not_known_is_named_with_those_that_are(tmp_path: Path) -> None:
    code, said = invoke("terrain", "generate", "--out", str(tmp_path / "site"), "--geology", "mare")
    assert code == 2
    assert "geology 'mare' is not known; there are gusev, meridiani, gale, jezero" in said
    assert not (tmp_path / "site").exists()


def test_a_terrain_is_not_written_over_unasked(tmp_path: Path) -> None:
    asked = ("terrain", "generate", "--out", str(tmp_path / "site"), "--size", "16", "--seed")
    code, said = invoke(*asked, "1")
    assert code == 0, said
    before = (tmp_path / "site" / "terrain.json").read_bytes()
    code, said = invoke(*asked, "2")
    assert code == 2
    assert "holds a terrain already" in said
    assert (tmp_path / "site" / "terrain.json").read_bytes() == before
    code, said = invoke(*asked, "2", "--replace")
    assert code == 0, said
    assert (tmp_path / "site" / "terrain.json").read_bytes() != before


def test_panorama_can_be_picked_from(terrain: Path, tmp_path: Path) -> None:
    folder = tmp_path / "pan"
    code, said = run("panorama", "--out", str(folder), "--terrain", str(terrain), "--span", "20")
    assert code == 0, said
    panorama = load_panorama(folder)
    match = panorama.wedges[0].pick((500.0, 600.0))
    assert np.trace(match.covariance) > 0
    assert (folder / "mosaic.png").is_file()


def test_drive_tells_how_it_ended_and_draws_the_way(terrain: Path, tmp_path: Path) -> None:
    out = tmp_path / "drive.png"
    code, said = run("drive", "--terrain", str(terrain), "--seed", "2", "--out", str(out), "--", "4", "-1")
    assert code == 0, said
    assert "arrived after" in said
    assert "from the goal, least clearance" in said
    with Image.open(out) as image:
        pixels = np.asarray(image)
    assert pixels.shape[0] == 600
    assert (np.abs(pixels.astype(int) - (90, 200, 255)).max(axis=-1) < 3).sum() > 100  # the way driven


def test_a_drive_off_the_terrain_is_refused(terrain: Path) -> None:
    code, said = run("drive", "--terrain", str(terrain), "--", "400", "0")
    assert code == 2
    assert "goal" in said
    assert "400" in said


def test_track_tells_each_stop(terrain: Path, tmp_path: Path) -> None:
    code, said = run(
        "track", "--terrain", str(terrain), "--start", "4", "--step", "0.2", "--out", str(tmp_path / "run")
    )
    assert code == 0, said
    stops = json.loads((tmp_path / "run/track.json").read_text())["stops"]
    assert len(stops) >= 3
    assert all(stop["state"] == "tracked" and stop["error_cm"] < 5 for stop in stops), said
    assert stops[-1]["sigma_cm"] < stops[0]["sigma_cm"]


def test_what_cannot_be_done_is_told_with_exit_code_2(terrain: Path, tmp_path: Path) -> None:
    place = ("--terrain", str(terrain))
    out = ("--out", str(tmp_path / "x.png"))
    for arguments, words in [
        (("render", *out, *place, "--x", "500"), "lies outside the terrain"),
        (("render", *out, *place, "--camera", "nose"), 'no camera "nose"'),
        (("render", *out, *place, "--rover", "viking"), "viking"),
        (("render", *out, *place, "--sun-azimuth", "90"), "go together"),
        (("track", *place, "--target", "R99999"), 'no rock "R99999"'),
    ]:
        code, said = run(*arguments)
        assert code == 2, (arguments, said)
        assert words in said
