"""Mapping files: what is wrong is refused by its name, its value and what is allowed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import jsonschema
import pytest
import yaml

from rover_iface.errors import MappingError
from rover_iface.ros2.load import load_mapping
from rover_iface.ros2.mapping import MAPPINGS
from rover_iface.ros2.units import factor
from tests.ros2.fakes import TURTLE


def broken(tmp_path: Path, old: str, new: str) -> Path:
    text = TURTLE.read_text()
    assert old in text
    (tmp_path / "turtle.dictionary.toml").write_text((TURTLE.parent / "turtle.dictionary.toml").read_text())
    path = tmp_path / "turtle.yaml"
    path.write_text(text.replace(old, new, 1))
    return path


def test_the_example_keeps_to_the_published_schema() -> None:
    jsonschema.validate(yaml.safe_load(TURTLE.read_text()), MAPPINGS.schema())


WRONG = [
    ("ros2-mapping/1", "ros2-mapping/2", "newer than this program"),
    ("name: turtle", "name: my turtle", "name is 'my turtle'; a ROS node takes letters"),
    ("name: turtle", "nom: turtle", "name is missing"),
    ("turtle.dictionary.toml", "none.toml", "dictionary is 'none.toml'"),
    ("frame: map", "frame: map, tilt: 1", "site.tilt is not a known member"),
    ("x_m: 0", "x_m: .nan", "site.x_m"),
    ("x_m: 0", "x_m: east", 'site.x_m must be a number, found "east"'),
    ("  navigate:", "  fly:", "actions.fly: the dictionary turtle has no such action; it has navigate"),
    ("via: action", "via: pigeon", "pigeon"),
    ("    via: action\n", "", "via"),
    ("/navigate_to_pose", "/navigate to pose", "'/navigate to pose' is not a name of ROS"),
    ("nav2_msgs/action/Nav", "nav2_msgs/srv/Nav", "it must have the form package/action/Name"),
    (
        "{x: x, y: y, heading: heading}",
        "{x: east, y: y}",
        "navigate has no parameter 'east'; it has x, y, heading",
    ),
    (
        "{pose: {x: x, y: y, heading: heading}}",
        "{}",
        "a field has nothing; it takes exactly one of parameter",
    ),
    ("{parameter: lit}", "{parameter: lit, value: true}", "has parameter and value; it takes exactly one"),
    ("{route: route}", "{route: path}", "patrol has no parameter 'path'"),
    (
        "{field: distance_remaining, unit: m}",
        "{field: distance_remaining, unit: deg}",
        "deg is a unit of angle",
    ),
    ("distance-left:", "distance:", "has no such key with so many arguments; it has pose, speed"),
    ("pose x:", "pose:", "telemetry.odometry.pose: the dictionary turtle has no such key"),
    ("{field: pose, of: x}", "{field: 'pose..x'}", "'pose..x' is not a path to a field"),
    ("{field: pose, of: x}", "{field: pose, of: w}", "of"),
    ("rate_hz: 5", "rate_hz: 10000", "rate_hz is 10000; it must be 0.01 to 50"),
    ("depth: 20", "depth: 0", "depth is 0; it must be 1 to 1000"),
    ('"0": ok', '"0": fine', "telemetry.diagnostics.base-state.words: 'fine' is none of ok, warning"),
    ("limit_s: 600", "limit_s: 0", "limit_s is 0; it must be more than 0"),
    ("limit_s: 600", "limit_s: soon", 'limit_s must be a number, found "soon"'),
    ("  wait:\n    via: timer", "  wait:\n    via: timer\n    duration: x", "wait has no parameter 'x'"),
    ("  wait:", "  lamp:", "lamp stands twice"),
    ("actions:", "actions: [", "is not YAML"),
    ("actions:", "start: {battery: full}\nactions:", "start.battery: 'full' is not a number"),
    ("actions:", "start: {fuel: 1}\nactions:", "start.fuel: the dictionary turtle has no such key"),
]


@pytest.mark.parametrize(("old", "new", "said"), WRONG)
def test_a_mapping_that_is_wrong_is_refused_by_name(tmp_path: Path, old: str, new: str, said: str) -> None:
    path = broken(tmp_path, old, new)
    with pytest.raises(MappingError) as caught:
        load_mapping(path)
    assert said in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "data",
    [b"", b"\xff\xfe\x00", b"[]", b"42", b"&a [*a]", b"a: &a [1]\nb: *a", b"a: !!python/object:os.x {}"],
)
def test_a_file_that_is_no_mapping_is_refused(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "x.yaml"
    path.write_bytes(data)
    with pytest.raises(MappingError, match=r"x\.yaml"):
        load_mapping(path)
    with pytest.raises(MappingError, match="No such file"):
        load_mapping(tmp_path / "none.yaml")


def test_units_of_one_quantity_are_turned_into_each_other() -> None:
    assert factor("deg", "rad") == pytest.approx(0.0174533)
    assert factor("Wh", "J") == 3600
    assert factor("%", "1") == 0.01
    assert factor("", "m") == factor("m", "") == 1
    with pytest.raises(MappingError, match="kg"):
        factor("kg", "m")


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "ground.cli", "rover", "ros2", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_a_mapping_is_checked_without_ros() -> None:
    done = run(str(TURTLE), "--check")
    assert done.returncode == 0, done.stderr
    assert "turtle, 5 actions, 3 topics" in done.stdout


def test_without_ros_the_bridge_says_what_is_missing(tmp_path: Path) -> None:
    done = run(str(TURTLE), "--listen", f"unix:{tmp_path}/x.sock")
    assert done.returncode == 2
    assert done.stderr.startswith("outcrop: ")
    assert len(done.stderr.splitlines()) == 1
    assert "source its setup file first" in done.stderr


def test_a_bridge_without_an_address_is_refused() -> None:
    done = run(str(TURTLE))
    assert done.returncode == 2
    assert "--listen" in done.stderr
