"""The messages of a run as standard messages of ROS 2 in CDR: what a bag holds.

Needs no message package of ours: poses, transforms, battery, pictures, diagnostics, log and trail have the
types that RViz, rqt and Foxglove show; what ROS has no type for (events of the plan, commands, products,
telemetry) is `std_msgs/String` with the JSON of the usual export. All types are the same from Humble on.

Frames (REP 105): `map` is the site, east-north-up; `base_link` is the rover as dead reckoning has it, level
on the ground; `CAMERA_optical` is a camera at the time of its picture (z forward, x right, y down), by the
model in the picture's label.
"""

from __future__ import annotations

import base64
import json
import math
import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from executive.runtime.codec import Json
from ground.errors import InvalidInputError
from ground.uplink.product_labels import whole_label
from ground.uplink.run_messages import WARNING, Encoded, Message
from rover_iface.errors import FrameError
from rover_iface.frames import Transform, quaternion_of, rotation_from_quaternion

MAP, BASE = "map", "base_link"
LAST_NS = (2**31 - 1) * 1_000_000_000
"""Stamps of ROS 2 count seconds in 32 bits with a sign: to January 2038."""
ROS_INFO, ROS_WARN = 20, 30
"""Levels of `rcl_interfaces/Log`."""
OK, WARN, ERROR = 0, 1, 2
"""Levels of `diagnostic_msgs/DiagnosticStatus`."""
LEVELS = {"SUSPENDED": WARN, "FAILED": ERROR, "ABORTED": ERROR}
LOST = "lost"
TRAIL_M = 0.05
"""Width of the trail; markers have none that keeps its size on the screen."""
LINE_STRIP = 4
UNKNOWN = 0
"""Status, health and technology of a battery that tells none."""
NO_NUMBER = math.nan


class Ros2Messages:
    """Turns the messages of one run into those of ROS 2, in their order.

    `capacity_j` is the energy of the full battery; 0 leaves its share of charge unknown.

    Raises
    ------
    InvalidInputError
        If the package `rosbags` is not installed.
    """

    profile, encoding = "ros2", "cdr"

    def __init__(self, run: Path, zero_ns: int, capacity_j: float = 0.0) -> None:
        try:
            from rosbags.typesys import Stores, get_typestore
        except ImportError:
            raise InvalidInputError("messages of ROS 2 need rosbags: pip install 'outcrop[mcap]'") from None
        self._store: Any = get_typestore(Stores.ROS2_HUMBLE)
        self._run, self._zero_ns, self._capacity_j = run, zero_ns, capacity_j
        self._site_from_base: Transform | None = None
        self._product: Json = {}
        self._trackers: dict[str, tuple[str, float]] = {}
        self._trail = 0
        self._turns: Mapping[str, Callable[[Message], Iterator[Encoded]]] = {
            "foxglove.PoseInFrame": self._pose,
            "foxglove.Log": self._log,
            "foxglove.CompressedImage": self._picture,
            "foxglove.SceneUpdate": self._segment,
            "outcrop.Telemetry": self._telemetry,
            "outcrop.NodeState": self._node,
        }

    def schema(self, name: str) -> tuple[str, bytes]:
        """Return encoding and text of a type's definition, with those it is made of."""
        return "ros2msg", str(self._store.generate_msgdef(name, ros_version=2)[0]).encode()

    def encoded(self, message: Message) -> Iterator[Encoded]:
        """Yield what a message is in ROS 2, at the same time."""
        if message.topic == "/products":
            self._product = message.content
        turn = self._turns.get(message.schema)
        if turn is None:
            yield self._words(message)
        else:
            yield from turn(message)

    # ---- each kind

    def _pose(self, message: Message) -> Iterator[Encoded]:
        pose = message.content["pose"]
        position, turn = pose["position"], pose["orientation"]
        rotation = rotation_from_quaternion(*(turn[of] for of in "wxyz"))
        self._site_from_base = Transform(rotation, np.array([position[of] for of in "xyz"]))
        yield self._transform(message.t_ms, MAP, BASE, position, turn)
        stamped = self._make(
            "geometry_msgs/msg/PoseStamped",
            header=self._header(message.t_ms, MAP),
            pose=self._make(
                "geometry_msgs/msg/Pose",
                position=self._make("geometry_msgs/msg/Point", **position),
                orientation=self._make("geometry_msgs/msg/Quaternion", **turn),
            ),
        )
        yield self._cdr(message.topic, stamped)

    def _telemetry(self, message: Message) -> Iterator[Encoded]:
        told = message.content
        yield self._words(message)
        for name in ("battery_j", "energy_used_j"):
            yield self._cdr(f"/energy/{name}", self._make("std_msgs/msg/Float64", data=_number(told[name])))
        none = np.zeros(0, dtype=np.float32)
        share = _number(told["battery_j"]) / self._capacity_j if self._capacity_j > 0 else NO_NUMBER
        unmeasured = ("voltage", "temperature", "current", "charge", "capacity", "design_capacity")
        battery = self._make(
            "sensor_msgs/msg/BatteryState",
            header=self._header(message.t_ms, BASE),
            **dict.fromkeys(unmeasured, NO_NUMBER),
            percentage=share,
            power_supply_status=UNKNOWN,
            power_supply_health=UNKNOWN,
            power_supply_technology=UNKNOWN,
            present=True,
            cell_voltage=none,
            cell_temperature=none,
            location="",
            serial_number="",
        )
        yield self._cdr("/battery", battery)
        changed = {}
        for target, tracker in told["trackers"].items():
            now = (str(tracker["state"]), _number(tracker["confidence"]))
            if self._trackers.get(target) != now:
                self._trackers[target] = changed[target] = now
        if changed:
            statuses = [
                self._status(
                    f"tracker/{target}", WARN if state == LOST else OK, state, confidence=str(confidence)
                )
                for target, (state, confidence) in changed.items()
            ]
            yield self._diagnostics(message.t_ms, statuses)

    def _node(self, message: Message) -> Iterator[Encoded]:
        state = message.content["state"]
        status = self._status(f"plan/{message.content['node']}", LEVELS.get(state, OK), state)
        yield self._diagnostics(message.t_ms, [status])

    def _log(self, message: Message) -> Iterator[Encoded]:
        told = message.content
        log = self._make(
            "rcl_interfaces/msg/Log",
            stamp=self._time(message.t_ms),
            level=ROS_WARN if told["level"] >= WARNING else ROS_INFO,
            name=_text(told["name"]),
            msg=_text(told["message"]),
            file="",
            function="",
            line=0,
        )
        yield self._cdr("/rosout", log)

    def _segment(self, message: Message) -> Iterator[Encoded]:
        for entity in message.content["entities"]:
            for line in entity["lines"]:
                self._trail += 1
                marker = self._make(
                    "visualization_msgs/msg/Marker",
                    header=self._header(message.t_ms, MAP),
                    ns="trail",
                    id=self._trail,
                    type=LINE_STRIP,
                    action=0,
                    pose=self._make(
                        "geometry_msgs/msg/Pose",
                        position=self._make("geometry_msgs/msg/Point", **line["pose"]["position"]),
                        orientation=self._make("geometry_msgs/msg/Quaternion", **line["pose"]["orientation"]),
                    ),
                    scale=self._make("geometry_msgs/msg/Vector3", x=TRAIL_M, y=0.0, z=0.0),
                    color=self._make("std_msgs/msg/ColorRGBA", **line["color"]),
                    lifetime=self._make("builtin_interfaces/msg/Duration", sec=0, nanosec=0),
                    frame_locked=False,
                    points=[self._make("geometry_msgs/msg/Point", **point) for point in line["points"]],
                    colors=[],
                    texture_resource="",
                    texture=self._image(message.t_ms, "", "", b""),
                    uv_coordinates=[],
                    text="",
                    mesh_resource="",
                    mesh_file=self._make(
                        "visualization_msgs/msg/MeshFile", filename="", data=np.zeros(0, dtype=np.uint8)
                    ),
                    mesh_use_embedded_materials=False,
                )
                yield self._cdr(message.topic, marker)

    def _picture(self, message: Message) -> Iterator[Encoded]:
        """Yield where the camera was, then the picture.

        A picture whose label has no camera model is in `map` if it is one of the ground, seen from above, and
        else in `base_link`, the nearest frame that is known.
        """
        told, product = message.content, self._product
        label = {**whole_label(self._run / product["path"], product["sha256"]), **product["label"]}
        site_from_camera = camera_pose(label.get("camera_model"))
        base = self._site_from_base
        if site_from_camera is not None and base is not None:
            name = label.get("camera") or label.get("instrument") or product["kind"]
            frame = f"{frame_name(str(name))}_optical"
            turn = dict(zip("wxyz", quaternion_of(base.rotation), strict=True))
            yield self._transform(message.t_ms, MAP, BASE, _xyz(base), turn)
            base_from_camera = base.inverse() * site_from_camera
            turn = dict(zip("wxyz", quaternion_of(base_from_camera.rotation), strict=True))
            yield self._transform(message.t_ms, BASE, frame, _xyz(base_from_camera), turn)
        else:
            frame = MAP if label.get("frame") == "site" else BASE
        data = base64.b64decode(told["data"])
        topic = f"/images/{frame_name(told['frame_id'])}"
        yield self._cdr(topic, self._image(message.t_ms, frame, told["format"], data))

    def _words(self, message: Message) -> Encoded:
        text = json.dumps(message.content, allow_nan=False)
        return self._cdr(message.topic, self._make("std_msgs/msg/String", data=text))

    # ---- parts

    def _make(self, name: str, /, **members: Any) -> Any:
        return self._store.types[name](**members)

    def _cdr(self, topic: str, message: Any) -> Encoded:
        name = message.__msgtype__
        return Encoded(topic, name, bytes(self._store.serialize_cdr(message, name)))

    def _time(self, t_ms: int) -> Any:
        at_ns = self._zero_ns + 1_000_000 * t_ms
        if not 0 <= at_ns <= LAST_NS:
            raise InvalidInputError(f"a time of {at_ns / 1e9:g} s since 1970; stamps of ROS 2 end in 2038")
        return self._make(
            "builtin_interfaces/msg/Time", sec=at_ns // 1_000_000_000, nanosec=at_ns % 1_000_000_000
        )

    def _header(self, t_ms: int, frame: str) -> Any:
        return self._make("std_msgs/msg/Header", stamp=self._time(t_ms), frame_id=frame)

    def _transform(
        self, t_ms: int, parent: str, child: str, place: Mapping[str, float], turn: Mapping[str, float]
    ) -> Encoded:
        one = self._make(
            "geometry_msgs/msg/TransformStamped",
            header=self._header(t_ms, parent),
            child_frame_id=child,
            transform=self._make(
                "geometry_msgs/msg/Transform",
                translation=self._make("geometry_msgs/msg/Vector3", **place),
                rotation=self._make("geometry_msgs/msg/Quaternion", **turn),
            ),
        )
        return self._cdr("/tf", self._make("tf2_msgs/msg/TFMessage", transforms=[one]))

    def _image(self, t_ms: int, frame: str, kind: str, data: bytes) -> Any:
        return self._make(
            "sensor_msgs/msg/CompressedImage",
            header=self._header(t_ms, frame),
            format=kind,
            data=np.frombuffer(data, dtype=np.uint8),
        )

    def _status(self, name: str, level: int, words: str, /, **values: str) -> Any:
        return self._make(
            "diagnostic_msgs/msg/DiagnosticStatus",
            level=level,
            name=_text(name),
            message=_text(words),
            hardware_id="outcrop",
            values=[
                self._make("diagnostic_msgs/msg/KeyValue", key=key, value=_text(value))
                for key, value in values.items()
            ],
        )

    def _diagnostics(self, t_ms: int, statuses: list[Any]) -> Encoded:
        header = self._header(t_ms, "")
        array = self._make("diagnostic_msgs/msg/DiagnosticArray", header=header, status=statuses)
        return self._cdr("/diagnostics", array)


def camera_pose(document: object) -> Transform | None:
    """Return `site_from_camera` of a camera model in a label, None if it has none that can be used.

    Optical frame: z along A, x along H without its part in A, so that y is down in the picture.
    """
    if not isinstance(document, dict):
        return None
    try:
        centre, axis, across = (np.array(document[letter], dtype=float) for letter in "CAH")
        if centre.shape != (3,) or axis.shape != (3,) or across.shape != (3,):
            return None
        with np.errstate(all="ignore"):
            z = axis / np.linalg.norm(axis)
            x = across - (across @ z) * z
            x = x / np.linalg.norm(x)
        if not np.isfinite(np.concatenate([centre, z, x])).all():
            return None
        return Transform(np.column_stack([x, np.cross(z, x), z]), centre)
    except (KeyError, TypeError, ValueError, FrameError):
        return None


def frame_name(name: str) -> str:
    """Return a name as topics and frames of ROS may have it: letters, digits, `_`, no digit first."""
    plain = re.sub(r"[^A-Za-z0-9_]+", "_", name) or "_"
    return f"_{plain}" if plain[0].isdigit() else plain


def _xyz(transform: Transform) -> dict[str, float]:
    return {of: float(value) for of, value in zip("xyz", transform.translation, strict=True)}


def _number(value: object) -> float:
    """Return a number of the usual export, where null stands for what is none."""
    return float(value) if isinstance(value, int | float) else NO_NUMBER


def _text(value: object) -> str:
    """Return text that a string of ROS can hold: UTF-8 without zero bytes."""
    return str(value).replace("\0", "\ufffd").encode("utf-8", "replace").decode()
