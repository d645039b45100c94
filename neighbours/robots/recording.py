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
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from mission.codec import read_toml
from neighbours.robots.bag_files import Raw, files_of, raw_messages
from neighbours.robots.errors import MissingExtraError, RecordingError
from neighbours.robots.transforms import Motion, Transforms

GAP_S = 5.0
"""Poses further apart are told as a gap; odometry comes many times a second."""
NANO = 1_000_000_000
TRANSFORMS = "tf2_msgs/msg/TFMessage"
POSE_TYPES = (
    "nav_msgs/msg/Odometry",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    "geometry_msgs/msg/PoseStamped",
    "foxglove.PoseInFrame",
    TRANSFORMS,
)
"""Types that give the pose, the best first: the topic of the first that is there is taken."""
PICTURE_TYPES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage", "foxglove.CompressedImage")
BATTERY_TYPES = ("sensor_msgs/msg/BatteryState", "outcrop.Telemetry")
ENERGY_TOPIC, ENERGY_TYPE = "/energy/battery_j", "std_msgs/msg/Float64"
"""Joules in the battery, as our own runs export them for ROS 2; taken before all others."""
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
        Frames between which transforms give the pose, directly or by way of others, where the topic holds
        transforms; empty takes usual names.
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
        If the file is not TOML, or a member is unknown or of the wrong type.
    """
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise RecordingError(f"mapping {path}: {error.strerror or error}") from error
    return mapping_of(read_toml(raw, f"mapping {path}", RecordingError), f"mapping {path}")


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


# --- reading --------------------------------------------------------------------------


def read_recording(
    path: Path,
    mapping: Mapping,
    keep: Callable[[Picture], None],
    tell: Callable[[float], None] = lambda _share: None,
) -> Recording:
    """Return what a recording holds; `keep` is given each picture as it comes.

    The file is gone through twice: for the topics, then for their messages. `tell` hears with each message
    what share of the second is done; what it raises ends the reading.

    Raises
    ------
    RecordingError
        If there is no such recording, it holds nothing that can be used, or the mapping names a topic that it
        does not have.
    MissingExtraError
        If a package that is needed is not installed.
    """
    files, reader = files_of(path), _Reader(mapping, keep)

    def broken(what: str) -> None:
        reader.recording.whole = False
        reader.recording.findings.append(what)

    known: dict[str, str] = {}
    faults: list[str] = []
    count = done = 0
    for file in files:
        for raw in raw_messages(file, faults.append):
            known.setdefault(raw.topic, raw.type)
            count += 1
            tell(0.0)
    if not known:
        raise RecordingError(f"the recording holds no message: {'; '.join(faults) or 'it is empty'}")
    reader.choose(known)
    for file in files:
        for raw in raw_messages(file, broken):
            reader.take(raw)
            done += 1
            tell(done / count)
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
        self._transforms = Transforms()

    def choose(self, known: dict[str, str]) -> None:
        """Say what each topic is taken for."""
        mapping = self.mapping
        for topic in (mapping.pose, mapping.battery, *mapping.pictures):
            if topic and topic not in known:
                has = ", ".join(sorted(known)) or "none"
                raise RecordingError(
                    f"the mapping names topic {topic}, which the recording does not have; it has {has}"
                )
        pose = mapping.pose or _best(known, POSE_TYPES)
        own = ENERGY_TOPIC if known.get(ENERGY_TOPIC) == ENERGY_TYPE else ""
        battery = mapping.battery or own or _best(known, BATTERY_TYPES)
        pictures = mapping.pictures or tuple(t for t, kind in known.items() if kind in PICTURE_TYPES)
        usable = {"pose": POSE_TYPES, "battery": (*BATTERY_TYPES, ENERGY_TYPE), "picture": PICTURE_TYPES}
        for role, topics in (("pose", (pose,)), ("battery", (battery,)), ("picture", pictures)):
            for topic in filter(None, topics):
                if known[topic] not in usable[role]:
                    raise RecordingError(f"topic {topic} of type {known[topic]} gives no {role}")
                self._roles[topic] = role
        if pose and known[pose] == TRANSFORMS:
            fixed = f"{pose.rpartition('/')[0]}/tf_static"
            if known.get(fixed) == TRANSFORMS:
                self._roles[fixed] = "pose"
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
        t_ns = self._told(raw, stamp)
        if t_ns < self._last.get(raw.topic, t_ns):
            self._late[raw.topic] += 1
        self._last[raw.topic] = max(t_ns, self._last.get(raw.topic, t_ns))
        return t_ns

    def _told(self, raw: Raw, stamp: Any) -> int:
        """Return the time of a message on the chosen clock."""
        if self.mapping.clock != "header":
            return raw.log_ns
        told = 0 if stamp is None else _stamp_ns(stamp)
        if told > 0 or (stamp is not None and told == raw.log_ns):
            return told
        self._unstamped.add(raw.topic)
        return raw.log_ns

    def _use(self, role: str, raw: Raw, message: Any) -> None:
        if raw.type == TRANSFORMS:
            self._take_transforms(raw, message)
        elif role == "pose":
            stamp, position, turn = _pose_of(raw.type, message)
            motion = _motion_of(position, turn)
            self.recording.poses.append(self._in_site(self._time(raw, stamp), motion))
        elif role == "battery":
            level = _level_of(raw.type, message, self.mapping)
            if math.isfinite(level):
                stamp = message.header.stamp if raw.type == "sensor_msgs/msg/BatteryState" else None
                self.recording.battery.append((self._time(raw, stamp), level))
        else:
            stamp, frame, kind, data = _picture_of(raw.type, message)
            self._keep(Picture(self._time(raw, stamp), raw.topic, frame, kind, data))
            self.recording.pictures += 1

    def _take_transforms(self, raw: Raw, message: Any) -> None:
        wrong = 0
        for one in message.transforms:
            link = (one.header.frame_id.strip("/"), one.child_frame_id.strip("/"))
            t_ns, move = self._told(raw, one.header.stamp), one.transform
            try:
                fixed = raw.topic.endswith("/tf_static")
                self._transforms.take(t_ns, link, _motion_of(move.translation, move.rotation), fixed=fixed)
            except ValueError:
                wrong += 1
        if wrong:
            raise ValueError(f"{wrong} transforms with a number that is none")

    def _in_site(self, t_ns: int, motion: Motion) -> RecordedPose:
        """Return a pose in the site frame; raise ValueError of one that is not a number."""
        mapping = self.mapping
        (x, y, z), (qx, qy, qz, qw) = motion
        if (
            not all(map(math.isfinite, (x, y, z, qx, qy, qz, qw)))
            or qx * qx + qy * qy + qz * qz + qw * qw < 0.25
        ):
            raise ValueError("no pose")
        c, s = math.cos(mapping.heading_rad), math.sin(mapping.heading_rad)
        yaw = math.atan2(2 * (qw * qz + qx * qy), 1 - 2 * (qy * qy + qz * qz)) + mapping.heading_rad
        heading = math.atan2(math.sin(yaw), math.cos(yaw))
        return RecordedPose(t_ns, mapping.east_m + c * x - s * y, mapping.north_m + s * x + c * y, z, heading)

    def _follow_transforms(self) -> None:
        """Make poses of the chain of transforms, and tell what is to be known of it."""
        mapping, transforms, tell = self.mapping, self._transforms, self.recording.findings.append
        frames = transforms.frames()
        if not frames:
            return
        parents = (mapping.parent.strip("/"),) if mapping.parent else PARENTS
        children = (mapping.child.strip("/"),) if mapping.child else CHILDREN
        chain = transforms.chain(parents, children)
        if not chain:
            some = ", ".join(frames[:10]) + (", ..." if len(frames) > 10 else "")
            tell(
                f"no transforms lead from {' or '.join(parents)} to {' or '.join(children)}; there are {some}"
            )
            return
        if len(chain) > 1:
            tell(f"poses are put together of {' -> '.join([chain[0][0], *(child for _, child in chain)])}")
        if transforms.left_out:
            tell(f"{transforms.left_out} transforms of further frames are left out")
        for (parent, child), count in sorted(transforms.late(chain).items()):
            tell(f"transforms {parent} -> {child}: {count} are out of order; they are put in order")
        early = wrong = 0
        for t_ns, motion in transforms.poses(chain):
            if motion is None:
                early += 1
                continue
            try:
                self.recording.poses.append(self._in_site(t_ns, motion))
            except ValueError:
                wrong += 1
        if early:
            tell(f"{early} poses are left out: another transform of the chain had not come yet")
        if wrong:
            tell(f"{wrong} poses are left out: put together they are not numbers")

    def finish(self) -> Recording:
        recording, tell = self.recording, self.recording.findings.append
        self._follow_transforms()
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


def _pose_of(kind: str, message: Any) -> tuple[Any, Any, Any]:
    """Return stamp, position and orientation."""
    if kind == "foxglove.PoseInFrame":
        return message.timestamp, message.pose.position, message.pose.orientation
    pose = message.pose if kind == "geometry_msgs/msg/PoseStamped" else message.pose.pose
    return message.header.stamp, pose.position, pose.orientation


def _motion_of(position: Any, turn: Any) -> Motion:
    """Return the numbers of a position and an orientation."""
    x, y, z, qx, qy, qz, qw = (
        float(v) for v in (position.x, position.y, position.z, turn.x, turn.y, turn.z, turn.w)
    )
    return (x, y, z), (qx, qy, qz, qw)


def _level_of(kind: str, message: Any, mapping: Mapping) -> float:
    """Return the energy in the battery, joules; NaN if the message does not tell it."""
    if kind == "outcrop.Telemetry":
        return float(message.battery_j)
    if kind == ENERGY_TYPE:
        return float(message.data)
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
