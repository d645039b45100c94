"""`outcrop localize` and `outcrop sites` as a person runs them."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from typer.testing import CliRunner

from ground.cli.localize import _stops
from ground.cli.main import app, register_all
from rover_iface.localization.site_frames import (
    FrameFile,
    FrameSolution,
    print_frame_file,
    read_frame_file,
    site,
)
from studies.common.localization_legs import look, make_leg, stereo_points
from tests.rover_iface.localization.test_site_frames import LANDING, START, UPRIGHT

if not any(command.name == "localize" for command in app.registered_commands):
    register_all()
runner = CliRunner()


@pytest.fixture(scope="module")
def stops(tmp_path_factory):
    """Two stops of a leg as point files, the second believed 1.2 m off, and how far it truly is off."""
    folder = tmp_path_factory.mktemp("stops")
    leg = make_leg(1011, 26.0, rock_cover=0.06)
    off = np.array([0.9, -0.8, 0.0])
    for end, error in ((0, np.zeros(3)), (1, off)):
        seen = stereo_points(look(leg, end), np.random.default_rng([1, end]))
        np.savez(folder / f"stop{end + 1}.npz", points=seen.points + error, eye=seen.eye + error)
    return folder, off


def test_two_stops_are_tied_and_the_error_of_odometry_is_found(stops, tmp_path):
    folder, off = stops
    files = [str(folder / f"stop{k}.npz") for k in (1, 2)]
    result = runner.invoke(app, ["localize", *files, "--out", str(tmp_path / "found")])
    assert result.exit_code == 0, result.output
    assert "accepted" in result.output
    document = json.loads((tmp_path / "found" / "localization.json").read_text())
    assert document["format"] == "localization/1"
    believed, adjusted = (np.array(document["stops"][1][key]) for key in ("believed_m", "adjusted_m"))
    assert adjusted - believed == pytest.approx(-off, abs=0.4)
    before, after = (np.trace(document["stops"][1][f"{k}_covariance_m2"]) for k in ("believed", "adjusted"))
    assert after < 0.2 * before
    assert document["legs"][0]["accepted"]
    assert len(document["legs"][0]["pairs"]) >= 4
    assert (tmp_path / "found" / "traverse.png").stat().st_size > 1000


def test_a_refused_leg_is_said_and_ends_with_its_own_code(stops):
    folder, _ = stops
    files = [str(folder / f"stop{k}.npz") for k in (1, 2)]
    result = runner.invoke(app, ["localize", *files, "--longest", "20"])
    assert result.exit_code == 3
    assert "m long, limit 20 m" in result.output


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("empty", "holds no panorama.json"),
        ("photo.jpg", "is not a run folder"),
        ("bad.csv", "0 points were seen|cannot be read"),
    ],
)
def test_what_is_no_stop_is_refused_in_one_line(stops, tmp_path, name, message):
    path = tmp_path / name
    if name == "empty":
        path.mkdir()
    else:
        path.write_text("nothing")
    result = runner.invoke(app, ["localize", str(path), str(stops[0] / "stop1.npz")])
    assert result.exit_code == 2
    assert re.search(message, result.output)
    assert "Traceback" not in result.output


def test_one_stop_is_no_traverse(stops):
    result = runner.invoke(app, ["localize", str(stops[0] / "stop1.npz")])
    assert result.exit_code == 2
    assert "at least 2 stops" in result.output


def test_panoramas_of_a_run_folder_are_taken_in_order(tmp_path):
    for name in ("b", "a"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "panorama.json").write_text("{}")
    assert [name for name, _ in _stops([tmp_path])] == ["a", "b"]


@pytest.fixture
def frame_file(tmp_path):
    solutions = tuple(
        FrameSolution(
            "telemetry", site(k), LANDING if k == 1 else site(k - 1), (10.0, float(k), 0.0), UPRIGHT, START
        )
        for k in (1, 2)
    )
    path = tmp_path / "chain.svf"
    path.write_text(print_frame_file(FrameFile("MER2", "Master_SVF", (), ("telemetry",), solutions)))
    return path


def test_sites_chain_and_carry_a_target(frame_file):
    result = runner.invoke(app, ["sites", str(frame_file), "--history"])
    assert "north 20.000  east 3.000  nadir 0.000 m" in result.output
    assert "in use" in result.output
    result = runner.invoke(app, ["sites", str(frame_file), "--into", "1", "--of", "2", "--target", "1,2,0.5"])
    assert "north 11.000  east 4.000  nadir 0.500 m" in result.output


def test_sites_writes_what_it_read_in_one_file(frame_file, tmp_path):
    more = FrameSolution("adjusted", site(2), site(1), (11.0, 2.0, 0.0), UPRIGHT, START)
    other = tmp_path / "more.svf"
    other.write_text(print_frame_file(FrameFile("MER2", "Other", (), ("adjusted", "telemetry"), (more,))))
    out = tmp_path / "all.svf"
    result = runner.invoke(app, ["sites", str(other), str(frame_file), "--out", str(out)])
    assert "2 frames, 3 solutions" in result.output
    assert "north 21.000  east 3.000" in result.output
    again = read_frame_file(out)
    assert again.priority == ("adjusted", "telemetry")
    assert again.solutions == (more, *read_frame_file(frame_file).solutions)
    other.write_text(print_frame_file(FrameFile("MER1", "Other", (), ("adjusted",), (more,))))
    result = runner.invoke(app, ["sites", str(other), str(frame_file), "--out", str(out)])
    assert result.exit_code == 2
    assert "frames of MER1 and MER2 do not go into one file" in result.output


def test_sites_refuses_what_it_does_not_know(frame_file):
    result = runner.invoke(app, ["sites", str(frame_file), "--of", "9"])
    assert result.exit_code == 2
    assert "has no solution" in result.output
    result = runner.invoke(app, ["sites", str(frame_file), "--target", "here"])
    assert result.exit_code == 2
    assert 'target "here"' in result.output
