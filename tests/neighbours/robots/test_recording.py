"""Recordings that rosbags wrote, read in: poses and pictures as they were; cut files; what is told."""

from __future__ import annotations

import io
import math
import random
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from neighbours.robots import bag_files
from neighbours.robots.bag_files import files_of
from neighbours.robots.errors import RecordingError
from neighbours.robots.recording import Mapping, Picture, Recording, read_mapping, read_recording

STORE = get_typestore(Stores.ROS2_HUMBLE)
T0_NS = 1_780_000_000_000_000_000
SECOND = 1_000_000_000
POSES = [(0.5 * n, math.sin(n / 5), 0.1 * n) for n in range(40)]
"""East, north, heading in the recording's frame, one a second."""


def make(name: str, **members: Any) -> Any:
    return STORE.types[name](**members)


def header(t_ns: int, frame: str = "odom") -> Any:
    stamp = make("builtin_interfaces/msg/Time", sec=t_ns // SECOND, nanosec=t_ns % SECOND)
    return make("std_msgs/msg/Header", stamp=stamp, frame_id=frame)


def odometry(t_ns: int, x: float, y: float, heading: float) -> Any:
    pose = make(
        "geometry_msgs/msg/Pose",
        position=make("geometry_msgs/msg/Point", x=x, y=y, z=0.25),
        orientation=make(
            "geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=math.sin(heading / 2), w=math.cos(heading / 2)
        ),
    )
    still = make("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.0)
    return make(
        "nav_msgs/msg/Odometry",
        header=header(t_ns),
        child_frame_id="base_link",
        pose=make("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=np.zeros(36)),
        twist=make(
            "geometry_msgs/msg/TwistWithCovariance",
            twist=make("geometry_msgs/msg/Twist", linear=still, angular=still),
            covariance=np.zeros(36),
        ),
    )


def pixels(number: int) -> Any:
    return np.random.default_rng(number).integers(0, 256, (24, 32, 3), dtype=np.uint8)


def write(folder: Path, plugin: StoragePlugin, *, late: bool = False, gap: bool = False) -> Path:
    """Write a bag with odometry, raw and compressed pictures, a battery and a topic of no use here."""
    with Writer(folder, version=9, storage_plugin=plugin) as writer:

        def topic(name: str, kind: str) -> Any:
            return writer.add_connection(name, kind, typestore=STORE)

        odom = topic("/odom", "nav_msgs/msg/Odometry")
        raw, packed = topic("/raw", "sensor_msgs/msg/Image"), topic("/jpg", "sensor_msgs/msg/CompressedImage")
        battery, words = (
            topic("/battery", "sensor_msgs/msg/BatteryState"),
            topic("/words", "std_msgs/msg/String"),
        )
        order = list(range(len(POSES)))
        if late:
            order[5], order[6] = order[6], order[5]
        if gap:
            order = [n for n in order if not 10 < n < 20]
        for place, n in enumerate(order):
            t_ns = T0_NS + n * SECOND
            log_ns = T0_NS + place * SECOND + 7_000_000

            def put(connection: Any, message: Any, at_ns: int = log_ns) -> None:
                writer.write(connection, at_ns, STORE.serialize_cdr(message, connection.msgtype))

            put(odom, odometry(t_ns, *POSES[n]))
            put(words, make("std_msgs/msg/String", data="all is well"))
            if n % 10 == 0:
                image = pixels(n)
                put(
                    raw,
                    make(
                        "sensor_msgs/msg/Image",
                        header=header(t_ns, "mast"),
                        height=24,
                        width=32,
                        encoding="rgb8",
                        is_bigendian=0,
                        step=96,
                        data=image.reshape(-1),
                    ),
                )
                coded = cv2.imencode(".png", image)[1].reshape(-1)
                put(
                    packed,
                    make(
                        "sensor_msgs/msg/CompressedImage",
                        header=header(t_ns, "mast"),
                        format="png",
                        data=coded,
                    ),
                )
                put(battery, battery_state(t_ns, 0.9 - n / 100))
    return folder


def battery_state(t_ns: int, share: float) -> Any:
    none = np.zeros(0, dtype=np.float32)
    return make(
        "sensor_msgs/msg/BatteryState",
        header=header(t_ns),
        voltage=24.0,
        temperature=20.0,
        current=-1.0,
        charge=10.0,
        capacity=12.0,
        design_capacity=12.0,
        percentage=share,
        power_supply_status=2,
        power_supply_health=1,
        power_supply_technology=2,
        present=True,
        cell_voltage=none,
        cell_temperature=none,
        location="",
        serial_number="",
    )


def read(path: Path, mapping: Mapping | None = None) -> tuple[Recording, list[Picture]]:
    pictures: list[Picture] = []
    return read_recording(path, mapping or Mapping(), pictures.append), pictures


def in_small_chunks(source: Path, target: Path) -> Path:
    """Write an MCAP file anew by the package `mcap`, in chunks of some messages."""
    from mcap.reader import make_reader
    from mcap.writer import Writer as McapWriter

    with source.open("rb") as file, target.open("wb") as out:
        writer = McapWriter(out, chunk_size=4000)
        writer.start(profile="ros2", library="test")
        channels: dict[int, int] = {}
        for schema, channel, message in make_reader(file).iter_messages():
            assert schema is not None
            if channel.id not in channels:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.id] = writer.register_channel(
                    channel.topic, channel.message_encoding, number
                )
            writer.add_message(
                channels[channel.id], message.log_time, message.data, message.publish_time, message.sequence
            )
        writer.finish()
    return target


PLUGINS = pytest.mark.parametrize(
    "plugin", [StoragePlugin.SQLITE3, StoragePlugin.MCAP], ids=["sqlite3", "mcap"]
)


@PLUGINS
def test_poses_and_pictures_are_as_they_were_written(plugin: StoragePlugin, tmp_path: Path) -> None:
    recording, pictures = read(write(tmp_path / "bag", plugin), Mapping(capacity_j=1e6))
    assert recording.whole
    for n, (pose, (x, y, heading)) in enumerate(zip(recording.poses, POSES, strict=True)):
        assert pose.t_ns == T0_NS + n * SECOND
        turn = math.remainder(pose.heading_rad - heading, 2 * math.pi)
        assert (pose.east_m, pose.north_m, pose.up_m, turn) == pytest.approx((x, y, 0.25, 0.0), abs=1e-12)
    raw = [p for p in pictures if p.topic == "/raw"]
    packed = [p for p in pictures if p.topic == "/jpg"]
    for n, (one, other) in enumerate(zip(raw, packed, strict=True)):
        assert one.t_ns == other.t_ns == T0_NS + 10 * n * SECOND
        seen = cv2.imdecode(np.frombuffer(one.data, np.uint8), cv2.IMREAD_COLOR)
        assert np.array_equal(seen[..., ::-1], pixels(10 * n))
        assert other.data == bytes(cv2.imencode(".png", pixels(10 * n))[1])
    assert [level for _, level in recording.battery] == pytest.approx([9e5, 8e5, 7e5, 6e5])
    assert [f for f in recording.findings if "/words of type std_msgs/msg/String is left out" in f]


@PLUGINS
def test_a_recording_lies_in_the_site_as_the_mapping_says(plugin: StoragePlugin, tmp_path: Path) -> None:
    text = 'pose = "/odom"\neast_m = 100\nnorth_m = 50.0\nheading_rad = 1.5707963267948966\nclock = "log"\n'
    (tmp_path / "map.toml").write_text(text)
    recording, _ = read(write(tmp_path / "bag", plugin), read_mapping(tmp_path / "map.toml"))
    for n, (pose, (x, y, _)) in enumerate(zip(recording.poses, POSES, strict=True)):
        assert (pose.east_m, pose.north_m) == pytest.approx((100 - y, 50 + x))
        assert pose.t_ns == T0_NS + n * SECOND + 7_000_000


@PLUGINS
def test_gaps_and_messages_out_of_order_are_told(plugin: StoragePlugin, tmp_path: Path) -> None:
    recording, _ = read(write(tmp_path / "late", plugin, late=True))
    assert [p.t_ns for p in recording.poses] == [T0_NS + n * SECOND for n in range(len(POSES))]
    assert any("/odom: 1 messages are out of order" in f for f in recording.findings)
    recording, _ = read(write(tmp_path / "gap", plugin, gap=True))
    assert any("no pose for 10.0 s, 10.0 s after the first" in f for f in recording.findings)


@PLUGINS
def test_a_file_cut_anywhere_gives_what_is_whole_and_says_so(plugin: StoragePlugin, tmp_path: Path) -> None:
    """20 random bytes; the poses that come are those written, and nothing but an own error is raised."""
    (file,) = files_of(write(tmp_path / "bag", plugin))
    if plugin is StoragePlugin.MCAP:
        file = in_small_chunks(file, tmp_path / "small.mcap")
    data, draw = file.read_bytes(), random.Random(20261122)
    some = 0
    for at in sorted(draw.sample(range(len(data)), 20)):
        cut = tmp_path / f"cut{file.suffix}"
        cut.write_bytes(data[:at])
        try:
            recording, _ = read(cut)
        except RecordingError:
            continue
        assert not recording.whole or len(recording.poses) == len(POSES), at
        for pose in recording.poses:
            number, rest = divmod(pose.t_ns - T0_NS, SECOND)
            assert rest == 0
            assert (pose.east_m, pose.north_m) == pytest.approx(POSES[number][:2])
        some += bool(recording.poses)
    assert some >= 10


def test_what_is_no_recording_and_what_does_not_fit_is_named(tmp_path: Path) -> None:
    (tmp_path / "text.mcap").write_text("no recording at all")
    for path, words in (
        (tmp_path / "none", "not a recording"),
        (tmp_path / "text.mcap", "neither MCAP nor sqlite3"),
    ):
        with pytest.raises(RecordingError, match=words):
            read(path)
    bag = write(tmp_path / "bag", StoragePlugin.MCAP)
    for mapping, words in (
        (Mapping(pose="/amcl"), "names topic /amcl, which the recording does not have; it has /battery"),
        (Mapping(pose="/words"), "/words of type std_msgs/msg/String gives no pose"),
    ):
        with pytest.raises(RecordingError, match=words):
            read(bag, mapping)
    for text, words in (
        ("poze = 'x'", "unknown member 'poze'"),
        ("east_m = 'far'", "east_m cannot be 'far'"),
        ("clock = 'wall'", "clock must be header or log"),
        ("= 3", "not TOML"),
    ):
        (tmp_path / "map.toml").write_text(text)
        with pytest.raises(RecordingError, match=words):
            read_mapping(tmp_path / "map.toml")


def test_a_bag_whose_messages_are_a_query_is_not_read(tmp_path: Path) -> None:
    file = tmp_path / "endless.db3"
    with closing(sqlite3.connect(file)) as base:
        base.execute("CREATE TABLE topics (id INTEGER, name TEXT, type TEXT)")
        base.execute(
            "CREATE VIEW messages AS WITH RECURSIVE n(k) AS (SELECT 1 UNION ALL SELECT k + 1 FROM n) "
            "SELECT 1 AS topic_id, k AS timestamp, x'00' AS data FROM n"
        )
        base.commit()
    with pytest.raises(RecordingError, match="messages is not a table"):
        read(file)


def test_a_chunk_is_unpacked_within_limits_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from mcap.writer import CompressionType, Writer

    monkeypatch.setattr(bag_files, "MOST_BYTES", 100_000)
    for kind in (CompressionType.ZSTD, CompressionType.LZ4):
        file = tmp_path / f"{kind.name}.mcap"
        with file.open("wb") as stream:
            writer = Writer(stream, compression=kind, chunk_size=10_000_000)
            writer.start()
            schema = writer.register_schema("foxglove.PoseInFrame", "jsonschema", b"{}")
            channel = writer.register_channel("/pose", "json", schema)
            writer.add_message(channel, 1, bytes(5_000_000), 1)
            writer.finish()
        assert file.stat().st_size < 60_000
        with pytest.raises(RecordingError, match=r"a chunk of \d+ bytes; 100000 are taken"):
            read(file)


def test_a_fault_behind_the_data_of_an_mcap_file_is_told(tmp_path: Path) -> None:
    """Every message stands before DataEnd (opcode 0x0F); what comes after is the summary."""
    from mcap.data_stream import ReadDataStream
    from mcap.opcode import Opcode

    (bag,) = files_of(write(tmp_path / "bag", StoragePlugin.MCAP))
    data = in_small_chunks(bag, tmp_path / "whole.mcap").read_bytes()
    place, opcode = 8, 0
    while opcode != Opcode.DATA_END:
        stream = ReadDataStream(io.BytesIO(data[place:]))
        opcode, length = stream.read1(), stream.read8()
        place += 9 + length
    for name, bad in (
        ("cut", data[: place + 5]),
        ("gone", data[:place]),
        ("wild", data[:place] + b"\xff" * 40),
    ):
        broken = tmp_path / f"{name}.mcap"
        broken.write_bytes(bad)
        found, _ = read(broken)
        assert len(found.poses) == len(POSES)
        assert not found.whole
        assert any(
            f.startswith(f"{broken.name} is cut or damaged behind its data, all ") for f in found.findings
        )
