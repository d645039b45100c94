"""Telemetry out of topics: values of their kind in the dictionary's units, and nothing else."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace

import pytest

from executive.ports import Update, Value
from rover_iface.ros2.field_paths import AbsentError, read_field, steps_of
from rover_iface.ros2.load import Mapped, load_mapping
from rover_iface.ros2.poses import TransformTree
from tests.ros2.fakes import TURTLE, Bench, odometry


def told(bench: Bench, **topics: list[object]) -> dict[str, Value]:
    for name, messages in topics.items():
        bench.port.ears["/" + name].waiting = list(messages)
    found: dict[str, Value] = {}
    for event in bench.turn(after_s=1.0):
        if isinstance(event, Update):
            found |= event.values
    return found


def mapped_with(tmp_path: Path, change: str, into: str) -> Mapped:
    for name in ("turtle.yaml", "turtle.dictionary.toml"):
        text = (TURTLE.parent / name).read_text()
        (tmp_path / name).write_text(text.replace(change, into) if name.endswith("yaml") else text)
    return load_mapping(tmp_path / "turtle.yaml")


def test_topics_tell_their_keys(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    status = SimpleNamespace(name="base", level=b"\x01")
    found = told(
        bench,
        odom=[odometry(1.0, 2.0, speed=0.25)],
        battery_state=[SimpleNamespace(percentage=0.5)],
        diagnostics=[SimpleNamespace(status=[SimpleNamespace(name="arm", level=b"\x02"), status])],
    )
    assert found == {
        "pose x": 1.0,
        "pose y": 2.0,
        "pose heading": 0.0,
        "speed": 0.25,
        "battery": 50.0,
        "base-state": "warning",
    }


def test_the_site_frame_lies_where_the_mapping_says(tmp_path: Path) -> None:
    placed = "{frame: map, x_m: 10, y_m: 5, yaw_rad: 1.5707963267948966}"
    mapped = mapped_with(tmp_path, "{frame: map, x_m: 0, y_m: 0, yaw_rad: 0}", placed)
    bench = Bench(tmp_path, mapped)
    found = told(bench, odom=[odometry(10.0, 8.0)])
    assert found["pose x"] == pytest.approx(3.0)
    assert found["pose y"] == pytest.approx(0.0)
    assert found["pose heading"] == pytest.approx(-math.pi / 2)
    bench.send("navigate", x=3.0, y=0.0, heading=0.0)
    pose = bench.port.sent[-1][2]["pose"]
    assert pose.position == pytest.approx((10.0, 8.0, 0.0))  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("message", "said"),
    [
        (odometry(math.nan, 0.0), "not finite"),
        (odometry(math.inf, 0.0), "not finite"),
        (odometry(1e9, 0.0), "farther than"),
        (odometry(0.0, 0.0, w=0.0), "no direction"),
        (odometry(0.0, 0.0, frame="odom"), "no transform leads to 'map'"),
        (odometry("east", 0.0), "not a pose"),  # type: ignore[arg-type]
        (SimpleNamespace(), "there is no pose"),
    ],
)
def test_a_pose_that_is_none_is_held_off_and_noted(tmp_path: Path, message: object, said: str) -> None:
    bench = Bench(tmp_path)
    for _ in range(100):
        assert not {k for k in told(bench, odom=[message]) if k.startswith("pose")}
    about = [note for note in bench.rover.notes if "pose x" in note]
    assert len(about) == 1
    assert said in about[0]


@pytest.mark.parametrize("speed", [math.nan, "fast", True, None, [1.0], b"ab"])
def test_a_value_of_the_wrong_kind_keeps_no_other_back(tmp_path: Path, speed: object) -> None:
    bench = Bench(tmp_path)
    found = told(bench, odom=[odometry(1.0, 2.0, speed=speed)])
    assert "speed" not in found
    assert found["pose x"] == 1.0
    assert any(note.startswith("/odom: speed: ") for note in bench.rover.notes)


def test_a_value_out_of_the_dictionary_is_held_off(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    assert told(bench, battery_state=[SimpleNamespace(percentage=-1.0)]) == {}
    assert any("-100 is out of range; allowed are 0 to 100" in note for note in bench.rover.notes)
    assert told(bench, diagnostics=[SimpleNamespace(status=[SimpleNamespace(name="base", level=9)])]) == {}
    assert any("'9' is none of 0, 1, 2, 3" in note for note in bench.rover.notes)


def test_ten_thousand_messages_a_second_are_a_few_updates(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    said = 0
    for n in range(10_000):
        bench.port.ears["/odom"].waiting.append(odometry(n / 1000, 0.0))
        said += len(bench.turn(after_s=0.0001))
    assert 4 <= said <= 6  # rate_hz is 5
    assert bench.rover.notes == {}


def test_notes_are_bounded(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    for n in range(3000):
        told(bench, battery_state=[SimpleNamespace(percentage=2.0 + n)])
    assert len(bench.rover.notes) <= 1000


def test_a_topic_that_is_silent_is_named(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.turn(after_s=11)
    assert "/odom (nav_msgs/msg/Odometry) has told nothing for 10 s" in bench.rover.notes


def test_what_has_not_changed_is_not_told_again(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    assert told(bench, battery_state=[SimpleNamespace(percentage=0.5)])
    assert told(bench, battery_state=[SimpleNamespace(percentage=0.5)]) == {}


# ---- transforms


def stamped(parent: str, child: str, x: float, yaw: float = 0.0) -> SimpleNamespace:
    turn = SimpleNamespace(w=math.cos(yaw / 2), x=0.0, y=0.0, z=math.sin(yaw / 2))
    place = SimpleNamespace(translation=SimpleNamespace(x=x, y=0.0, z=0.0), rotation=turn)
    header = SimpleNamespace(frame_id=parent)
    return SimpleNamespace(transforms=[SimpleNamespace(header=header, child_frame_id=child, transform=place)])


def test_transforms_lead_through_the_tree() -> None:
    tree = TransformTree()
    assert tree.take([stamped("map", "odom", 1.0, math.pi / 2), stamped("/odom", "base", 2.0)]) == []
    found = tree.find("map", "base")
    assert found is not None
    assert found.translation == pytest.approx([1.0, 2.0, 0.0])
    back = tree.find("base", "map")
    assert back is not None
    assert back.apply(found.translation) == pytest.approx([0, 0, 0], abs=1e-12)
    assert tree.find("map", "elsewhere") is None


def test_a_circle_of_frames_has_no_way_out() -> None:
    tree = TransformTree()
    tree.take([stamped("a", "b", 1.0), stamped("b", "a", 1.0)])
    assert tree.find("map", "a") is None


def test_a_transform_that_is_none_is_not_used() -> None:
    tree = TransformTree()
    assert "not finite" in tree.take([stamped("map", "odom", math.nan)])[0]
    assert tree.find("map", "odom") is None


def test_odometry_in_its_own_frame_is_told_through_tf(tmp_path: Path) -> None:
    tf = "tf: {child: base, keys: {pose x: x}}\n\ntelemetry:"
    bench = Bench(tmp_path, mapped_with(tmp_path, "telemetry:", tf))
    bench.port.ears["/tf_static"].waiting = [stamped("map", "odom", 100.0)]
    bench.port.ears["/tf"].waiting = [stamped("odom", "base", 7.0)]
    assert told(bench)["pose x"] == 107.0
    bench.port.ears["/tf"].waiting = []
    assert told(bench, odom=[odometry(3.0, 4.0, frame="odom")])["pose y"] == 4.0


# ---- ways to fields


def test_ways_lead_to_fields() -> None:
    entry = SimpleNamespace(name="base: motors", values=[SimpleNamespace(key="t", value="21.5")])
    message = SimpleNamespace(status=[SimpleNamespace(name="x"), entry], ranges=[1.0, 2.0])
    assert read_field(message, "ranges[1]") == 2.0
    assert read_field(message, "status[name=base: motors].values[key=t].value") == "21.5"
    for way in (
        "status[2].name",
        "status[name=none]",
        "status.name",
        "ranges[0].x",
        "absent",
        "ranges[0][0]",
    ):
        with pytest.raises(AbsentError):
            read_field(message, way)


@pytest.mark.parametrize(
    "way", ["", ".", "a.", "a..b", "[0]", "a[", "a[]", "a[x=]", "a b", "a[-1]", "1a", "__x"]
)
def test_a_way_that_is_none_is_refused(way: str) -> None:
    from rover_iface.errors import MappingError

    with pytest.raises(MappingError, match="is not a path to a field"):
        steps_of(way)
