"""Recordings of robots, rosbag2 (sqlite3) and MCAP, read as far as they are whole.

What a file holds is told apart by the type of each topic: poses, pictures, battery. Messages are of ROS 2
in CDR, or Foxglove's in JSON, as our own runs export them. Nothing that cannot be used is passed over in
silence: a file that is cut, a topic of an unknown type, a message that cannot be decoded, gaps and messages
out of order are findings.
"""

from __future__ import annotations

import base64
import json
import math
import sqlite3
import struct
import tomllib
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from neighbours.robots.errors import MissingExtraError, RecordingError

if TYPE_CHECKING:
    from mcap.records import Chunk, McapRecord

GAP_S = 5.0
"""Poses further apart are told as a gap; odometry comes many times a second."""
MOST_BYTES = 256 << 20
"""Bytes of a message or an unpacked chunk. Writers make chunks of about 1 MiB; a large picture has 100."""
NANO = 1_000_000_000
POSE_TYPES = (
    "nav_msgs/msg/Odometry",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    "geometry_msgs/msg/PoseStamped",
    "foxglove.PoseInFrame",
    "tf2_msgs/msg/TFMessage",
)
"""Types that give the pose, the best first: the topic of the first that is there is taken."""
PICTURE_TYPES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage", "foxglove.CompressedImage")
BATTERY_TYPES = ("sensor_msgs/msg/BatteryState", "outcrop.Telemetry")
PARENTS, CHILDREN = ("site", "map", "odom", "world"), ("base_link", "base_footprint", "rover")


@dataclass(frozen=True, slots=True)
class Mapping:
    """Which topics mean what, and where the recording's frame lies in the site frame.

    Attributes
    ----------
    pose, battery
        A topic; empty takes the best there is, by type.
    pictures
        Topics; none takes all of a type for pictures.
    clock
        `header` takes the stamp of a message where it has one, `log` the time of writing.
    parent, child
        Frames of the transform that is the pose, where the topic holds transforms; empty takes usual names.
    east_m, north_m, heading_rad
        Where the recording's frame lies in the site frame, and how it is turned.
    capacity_j
        Energy of the full battery, for messages that tell a share.
    """

    pose: str = ""
    battery: str = ""
    pictures: tuple[str, ...] = ()
    clock: str = "header"
    parent: str = ""
    child: str = ""
    east_m: float = 0.0
    north_m: float = 0.0
    heading_rad: float = 0.0
    capacity_j: float = 0.0


def read_mapping(path: Path) -> Mapping:
    """Return the mapping of a TOML file with the members of `Mapping`.

    Raises
    ------
    RecordingError
        If the file is no TOML, or a member is unknown or of the wrong type.
    """
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise RecordingError(f"mapping {path} cannot be read: {error}") from error
    return mapping_of(document, f"mapping {path}")


def mapping_of(document: dict[str, object], name: str) -> Mapping:
    """Return a mapping of its members; `name` names it in refusals."""
    known = {f.name: f.default for f in fields(Mapping)}
    given: dict[str, Any] = {}
    for member, value in document.items():
        if member not in known:
            raise RecordingError(f"{name}: unknown member {member!r}; known are {', '.join(known)}")
        default = known[member]
        if isinstance(default, float):
            good = type(value) in (int, float) and math.isfinite(float(str(value)))
        elif isinstance(default, tuple):
            good = isinstance(value, list) and all(isinstance(one, str) for one in value)
            value = tuple(value) if isinstance(value, list) else value
        else:
            good = isinstance(value, str)
        if not good:
            raise RecordingError(f"{name}: {member} cannot be {value!r}")
        given[member] = value
    if given.get("clock", "header") not in ("header", "log"):
        raise RecordingError(f"{name}: clock must be header or log, found {given['clock']!r}")
    return Mapping(**given)


@dataclass(frozen=True, slots=True)
class Raw:
    """A message as it lies in the file: time of writing in nanoseconds, encoding `cdr` or `json`."""

    topic: str
    type: str
    encoding: str
    log_ns: int
    data: bytes


@dataclass(frozen=True, slots=True)
class RecordedPose:
    """Pose in the site frame (east, north, up; heading counter-clockwise from east)."""

    t_ns: int
    east_m: float
    north_m: float
    up_m: float
    heading_rad: float


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture, encoded as `format` (png, jpeg, ...)."""

    t_ns: int
    topic: str
    frame: str
    format: str
    data: bytes


@dataclass(slots=True)
class Recording:
    """What was read: poses and battery (nanoseconds, joules) in order of time, counts, and what to know."""

    poses: list[RecordedPose] = field(default_factory=list)
    battery: list[tuple[int, float]] = field(default_factory=list)
    pictures: int = 0
    messages: Counter[str] = field(default_factory=Counter)
    findings: list[str] = field(default_factory=list)
    whole: bool = True


# --- files --------------------------------------------------------------------------


def files_of(path: Path) -> list[Path]:
    """Return the files of a recording: itself, or those of a rosbag2 folder in the order of their names."""
    if path.is_file():
        return [path]
    found = sorted(p for p in path.glob("*") if p.suffix in (".db3", ".mcap")) if path.is_dir() else []
    if not found:
        raise RecordingError(f"{path} is no recording: neither a file nor a folder with .db3 or .mcap files")
    return found


def raw_messages(path: Path, broken: Callable[[str], None]) -> Iterator[Raw]:
    """Yield the messages of one file as far as it is whole; `broken` is told where it is not."""
    with path.open("rb") as file:
        magic = file.read(16)
    if magic.startswith(b"SQLite format 3"):
        yield from _sqlite(path, broken)
    elif magic.startswith(b"\x89MCAP0\r\n"):
        yield from _mcap(path, broken)
    else:
        broken(f"{path.name} is neither MCAP nor sqlite3")


def _sqlite(path: Path, broken: Callable[[str], None]) -> Iterator[Raw]:
    count = 0
    try:
        with closing(sqlite3.connect(f"file:{path}?mode=ro&immutable=1", uri=True)) as base:
            base.execute(
                "PRAGMA writable_schema=ON"
            )  # else a file that is shorter than it says is refused whole
            base.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MOST_BYTES)
            _require_tables(base)
            topics = {row[0]: row[1:] for row in base.execute("SELECT id, name, type FROM topics")}
            for topic, at_ns, data in base.execute("SELECT topic_id, timestamp, data FROM messages"):
                if topic in topics and isinstance(data, bytes) and isinstance(at_ns, int):
                    name, type_ = topics[topic]
                    count += 1
                    yield Raw(str(name), str(type_), "cdr", at_ns, data)
    except (sqlite3.Error, UnicodeDecodeError, OverflowError) as error:
        broken(f"{path.name} is damaged after {count} messages: {error}")


def _require_tables(base: sqlite3.Connection) -> None:
    """Raise unless topics and messages are plain tables: a view may be a query that never ends."""
    made = dict(base.execute("SELECT name, sql FROM sqlite_master WHERE type = 'table'"))
    for name in ("topics", "messages"):
        if not str(made.get(name)).upper().startswith("CREATE TABLE"):
            raise sqlite3.DatabaseError(f"{name} is no table")


def _unpacked(chunk: Chunk) -> Chunk:
    """Return a chunk without compression.

    Raises
    ------
    ValueError
        If it would be larger than it says, or than what is taken.
    """
    size = chunk.uncompressed_size
    if size > MOST_BYTES:
        raise ValueError(f"a chunk of {size} bytes; {MOST_BYTES} are taken")
    if chunk.compression == "zstd":
        import zstandard

        try:
            with zstandard.ZstdDecompressor().stream_reader(chunk.data) as stream:
                data = stream.read(size + 1)
        except zstandard.ZstdError as error:
            raise ValueError(f"a chunk that cannot be unpacked: {error}") from error
    elif chunk.compression == "lz4":
        import lz4.frame

        data = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=size + 1)
    else:
        return chunk
    if len(data) != size:
        raise ValueError(f"a chunk that is not of the {size} bytes that it says")
    return replace(chunk, compression="", data=data)


def _records(stream: BinaryIO) -> Iterator[McapRecord]:
    """Yield the records of a file, those of chunks too; a chunk is unpacked only within limits."""
    from mcap import records
    from mcap.stream_reader import StreamReader, breakup_chunk

    reader = StreamReader(stream, emit_chunks=True, validate_crcs=True, record_size_limit=MOST_BYTES)
    for record in reader.records:
        if isinstance(record, records.Chunk):
            yield from breakup_chunk(_unpacked(record), validate_crc=True)
        else:
            yield record


def _mcap(path: Path, broken: Callable[[str], None]) -> Iterator[Raw]:
    try:
        from mcap.exceptions import McapError
        from mcap.records import Channel, DataEnd, Message, Schema
    except ImportError:
        raise MissingExtraError("MCAP needs the package mcap: pip install 'outcrop[mcap]'") from None
    schemas: dict[int, str] = {}
    channels: dict[int, tuple[str, str, str]] = {}
    count, over = 0, False
    with path.open("rb") as file:
        try:
            for record in _records(file):
                if isinstance(record, Schema):
                    schemas[record.id] = record.name
                elif isinstance(record, Channel):
                    type_ = schemas.get(record.schema_id, "")
                    channels[record.id] = (record.topic, type_, record.message_encoding)
                elif isinstance(record, Message) and record.channel_id in channels:
                    topic, type_, encoding = channels[record.channel_id]
                    count += 1
                    yield Raw(topic, type_, encoding, record.log_time, bytes(record.data))
                elif isinstance(record, DataEnd):
                    over = True
        except (
            McapError,
            struct.error,
            ValueError,
            EOFError,
            RuntimeError,
            KeyError,
            AssertionError,
        ) as error:
            if not over:
                why = str(error) or type(error).__name__
                broken(f"{path.name} is cut or damaged after {count} messages: {why}")
                return
    if not over:
        broken(f"{path.name} is cut after {count} messages")


# --- reading --------------------------------------------------------------------------


def read_recording(path: Path, mapping: Mapping, keep: Callable[[Picture], None]) -> Recording:
    """Return what a recording holds; `keep` is given each picture as it comes.

    Raises
    ------
    RecordingError
        If there is no such recording, it holds nothing that can be used, or the mapping names a topic that it
        has not.
    MissingExtraError
        If a package that is needed is not installed.
    """
    files, reader = files_of(path), _Reader(mapping, keep)

    def broken(what: str) -> None:
        reader.recording.whole = False
        reader.recording.findings.append(what)

    known: dict[str, str] = {}
    faults: list[str] = []
    for file in files:
        for raw in raw_messages(file, faults.append):
            known.setdefault(raw.topic, raw.type)
    if not known:
        raise RecordingError(f"the recording holds no message: {'; '.join(faults) or 'it is empty'}")
    reader.choose(known)
    for file in files:
        for raw in raw_messages(file, broken):
            reader.take(raw)
    return reader.finish()


class _Reader:
    def __init__(self, mapping: Mapping, keep: Callable[[Picture], None]) -> None:
        self.mapping, self._keep = mapping, keep
        self.recording = Recording()
        self._roles: dict[str, str] = {}
        self._bad: Counter[str] = Counter()
        self._late: Counter[str] = Counter()
        self._last: dict[str, int] = {}
        self._unstamped: set[str] = set()
        self._store: Any = None

    def choose(self, known: dict[str, str]) -> None:
        """Say what each topic is taken for."""
        mapping = self.mapping
        for topic in (mapping.pose, mapping.battery, *mapping.pictures):
            if topic and topic not in known:
                has = ", ".join(sorted(known)) or "none"
                raise RecordingError(
                    f"the mapping names topic {topic}, which the recording has not; it has {has}"
                )
        pose = mapping.pose or _best(known, POSE_TYPES)
        battery = mapping.battery or _best(known, BATTERY_TYPES)
        pictures = mapping.pictures or tuple(t for t, kind in known.items() if kind in PICTURE_TYPES)
        usable = {"pose": POSE_TYPES, "battery": BATTERY_TYPES, "picture": PICTURE_TYPES}
        for role, topics in (("pose", (pose,)), ("battery", (battery,)), ("picture", pictures)):
            for topic in filter(None, topics):
                if known[topic] not in usable[role]:
                    raise RecordingError(f"topic {topic} of type {known[topic]} gives no {role}")
                self._roles[topic] = role
        every = {*POSE_TYPES, *BATTERY_TYPES, *PICTURE_TYPES}
        for topic, kind in sorted(known.items()):
            if topic not in self._roles:
                why = "another topic is taken for this" if kind in every else "nothing here reads this type"
                self.recording.findings.append(
                    f"topic {topic} of type {kind or 'unknown'} is left out: {why}"
                )

    def take(self, raw: Raw) -> None:
        role = self._roles.get(raw.topic)
        self.recording.messages[raw.topic] += 1
        if role is None:
            return
        try:
            self._use(role, raw, self._decode(raw))
        except (MissingExtraError, RecordingError):
            raise
        except Exception as error:  # noqa: BLE001 - foreign bytes: any decoder's error is the message's
            self._bad[f"{raw.topic}: {type(error).__name__}"] += 1

    def _decode(self, raw: Raw) -> Any:
        if raw.encoding == "json":
            return _Members(json.loads(raw.data))
        if self._store is None:
            try:
                from rosbags.typesys import Stores, get_typestore
            except ImportError:
                raise MissingExtraError("messages in CDR need rosbags: pip install 'outcrop[mcap]'") from None
            self._store = get_typestore(Stores.ROS2_HUMBLE)
        return self._store.deserialize_cdr(raw.data, raw.type)

    def _time(self, raw: Raw, stamp: Any) -> int:
        """Return the time of a message on the chosen clock, and note where it goes back."""
        t_ns = raw.log_ns
        if self.mapping.clock == "header":
            told = 0 if stamp is None else _stamp_ns(stamp)
            if told > 0:
                t_ns = told
            else:
                self._unstamped.add(raw.topic)
        if t_ns < self._last.get(raw.topic, t_ns):
            self._late[raw.topic] += 1
        self._last[raw.topic] = max(t_ns, self._last.get(raw.topic, t_ns))
        return t_ns

    def _use(self, role: str, raw: Raw, message: Any) -> None:
        if role == "pose":
            found = _pose_of(raw.type, message, self.mapping)
            if found is not None:
                stamp, position, turn = found
                self.recording.poses.append(self._in_site(self._time(raw, stamp), position, turn))
        elif role == "battery":
            level = _level_of(raw.type, message, self.mapping)
            if math.isfinite(level):
                stamp = message.header.stamp if raw.encoding == "cdr" else None
                self.recording.battery.append((self._time(raw, stamp), level))
        else:
            stamp, frame, kind, data = _picture_of(raw.type, message)
            self._keep(Picture(self._time(raw, stamp), raw.topic, frame, kind, data))
            self.recording.pictures += 1

    def _in_site(self, t_ns: int, position: Any, turn: Any) -> RecordedPose:
        """Return a pose in the site frame; raise ValueError of one that is no number."""
        mapping = self.mapping
        x, y, z = float(position.x), float(position.y), float(position.z)
        qx, qy, qz, qw = (float(v) for v in (turn.x, turn.y, turn.z, turn.w))
        if (
            not all(map(math.isfinite, (x, y, z, qx, qy, qz, qw)))
            or qx * qx + qy * qy + qz * qz + qw * qw < 0.25
        ):
            raise ValueError("no pose")
        c, s = math.cos(mapping.heading_rad), math.sin(mapping.heading_rad)
        yaw = math.atan2(2 * (qw * qz + qx * qy), 1 - 2 * (qy * qy + qz * qz)) + mapping.heading_rad
        heading = math.atan2(math.sin(yaw), math.cos(yaw))
        return RecordedPose(t_ns, mapping.east_m + c * x - s * y, mapping.north_m + s * x + c * y, z, heading)

    def finish(self) -> Recording:
        recording, tell = self.recording, self.recording.findings.append
        for what, count in sorted(self._bad.items()):
            tell(f"{count} messages could not be decoded: {what}")
        for topic, count in sorted(self._late.items()):
            tell(f"topic {topic}: {count} messages are out of order; they are put in order by their time")
        for topic in sorted(self._unstamped):
            tell(f"topic {topic}: messages without a header stamp have the time of writing")
        recording.poses.sort(key=lambda pose: pose.t_ns)
        recording.battery.sort()
        for before, after in zip(recording.poses, recording.poses[1:], strict=False):
            if after.t_ns - before.t_ns > GAP_S * NANO:
                since = (before.t_ns - recording.poses[0].t_ns) / NANO
                tell(f"no pose for {(after.t_ns - before.t_ns) / NANO:.1f} s, {since:.1f} s after the first")
        if not recording.poses and not recording.pictures and not recording.battery:
            why = "; ".join(recording.findings) or "it is empty"
            raise RecordingError(f"the recording holds no pose, picture or battery level: {why}")
        return recording


def _best(known: dict[str, str], types: Sequence[str]) -> str:
    for kind in types:
        for topic, type_ in sorted(known.items()):
            if type_ == kind:
                return topic
    return ""


class _Members:
    """Members of a JSON object by attribute."""

    def __init__(self, members: dict[str, Any]) -> None:
        self.__dict__.update(
            {name: _Members(value) if isinstance(value, dict) else value for name, value in members.items()}
        )


def _stamp_ns(stamp: Any) -> int:
    """Return a stamp in nanoseconds; `nanosec` is ROS 2's word, `nsec` Foxglove's."""
    nanoseconds = stamp.nanosec if hasattr(stamp, "nanosec") else stamp.nsec
    return int(stamp.sec) * NANO + int(nanoseconds)


def _pose_of(kind: str, message: Any, mapping: Mapping) -> tuple[Any, Any, Any] | None:
    """Return stamp, position and orientation; None of transforms between other frames."""
    if kind == "foxglove.PoseInFrame":
        return message.timestamp, message.pose.position, message.pose.orientation
    if kind == "tf2_msgs/msg/TFMessage":
        for one in message.transforms:
            parent, child = one.header.frame_id.strip("/"), one.child_frame_id.strip("/")
            if parent in ((mapping.parent,) if mapping.parent else PARENTS) and child in (
                (mapping.child,) if mapping.child else CHILDREN
            ):
                return one.header.stamp, one.transform.translation, one.transform.rotation
        return None
    pose = message.pose if kind == "geometry_msgs/msg/PoseStamped" else message.pose.pose
    return message.header.stamp, pose.position, pose.orientation


def _level_of(kind: str, message: Any, mapping: Mapping) -> float:
    """Return the energy in the battery, joules; NaN if the message does not tell it."""
    if kind == "outcrop.Telemetry":
        return float(message.battery_j)
    if mapping.capacity_j > 0 and 0 <= message.percentage <= 1:
        return float(message.percentage) * mapping.capacity_j
    return float(message.charge) * 3600.0 * float(message.voltage)  # Ah at the present voltage


def _picture_of(kind: str, message: Any) -> tuple[Any, str, str, bytes]:
    """Return stamp, frame, format and bytes of a picture; a raw one becomes PNG.

    Raises
    ------
    ValueError
        If the pixels are of an encoding that is not known.
    """
    if kind == "foxglove.CompressedImage":
        data = base64.b64decode(message.data, validate=True)
        return message.timestamp, message.frame_id, _format(data), data
    if kind == "sensor_msgs/msg/CompressedImage":
        data = bytes(message.data)
        return message.header.stamp, message.header.frame_id, _format(data), data
    return message.header.stamp, message.header.frame_id, "png", _png(message)


def _format(data: bytes) -> str:
    for magic, name in ((b"\x89PNG", "png"), (b"\xff\xd8\xff", "jpeg"), (b"RIFF", "webp")):
        if data.startswith(magic):
            return name
    raise ValueError("no PNG, JPEG or WebP")


def _png(message: Any) -> bytes:
    """Return a raw image as PNG, its pixels unchanged (blue and red are put in PNG's order by the writer)."""
    import cv2
    import numpy as np

    layouts = {
        "mono8": (1, "u1"),
        "rgb8": (3, "u1"),
        "bgr8": (3, "u1"),
        "rgba8": (4, "u1"),
        "bgra8": (4, "u1"),
    }
    layouts |= {"8UC1": (1, "u1"), "8UC3": (3, "u1"), "mono16": (1, "u2"), "16UC1": (1, "u2")}
    if message.encoding not in layouts:
        raise ValueError(f"pixels of encoding {message.encoding}")
    channels, depth = layouts[message.encoding]
    kind = np.dtype(depth).newbyteorder(">" if message.is_bigendian else "<")
    wide = message.width * channels
    rows = np.frombuffer(bytes(message.data), dtype=np.uint8).reshape(message.height, message.step)
    pixels = rows[:, : wide * kind.itemsize].copy().view(kind).astype(kind.newbyteorder("="))
    pixels = pixels.reshape(message.height, message.width, channels)
    if message.encoding.startswith("rgb"):
        pixels = pixels[..., [2, 1, 0, *range(3, channels)]]
    good, data = cv2.imencode(".png", pixels)
    if not good:
        raise ValueError("the picture cannot be written as PNG")
    return bytes(data)
