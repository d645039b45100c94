"""Mappings (`ros2-mapping/1`, YAML): what a dictionary's actions and telemetry keys are called in ROS 2."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from dataclasses import field as member
from typing import Annotated, Literal

from mission.codec import Codec
from mission.errors import MissionError
from mission.values import NotNegative, Positive, ToldBy, value
from rover_iface.errors import MappingError
from rover_iface.profile.dictionary import STANDARD_DICTIONARY

Scalar = float | str | bool


@value
class Site:
    """Where the site frame lies in a frame of ROS: its origin, metres, and its turn about z, radians."""

    frame: str = "map"
    x_m: float = 0.0
    y_m: float = 0.0
    z_m: float = 0.0
    yaw_rad: float = 0.0


@value
class PoseSource:
    """Parameters that make a pose: a place in the site frame, and a heading.

    Without a heading the pose looks the way the rover comes from.
    """

    x: str
    y: str
    heading: str | None = None


@value
class Source:
    """What a field of a goal or request is filled with: one of `parameter`, `value`, `pose`, `route`, `now`.

    Attributes
    ----------
    parameter
        Parameter of the action; its number is turned from the dictionary's unit into `unit`.
    default
        For a parameter that a command does not have; without it the field stays as ROS makes it.
    pose
        Fills a Pose or PoseStamped.
    route
        Parameter that holds places of the site frame as text, `x y; x y heading; ...`, metres and radians;
        fills a list of Pose or PoseStamped.
    now
        The ROS time at which the goal is sent.
    """

    parameter: str | None = None
    unit: str = ""
    default: Scalar | None = None
    value: Scalar | None = None
    pose: PoseSource | None = None
    route: str | None = None
    now: bool = False

    def __post_init__(self) -> None:
        given = [name for name in ("parameter", "value", "pose", "route") if getattr(self, name) is not None]
        given += ["now"] if self.now else []
        if len(given) != 1:
            raise MissionError(
                f"a field has {' and '.join(given) or 'nothing'}; it takes exactly one of parameter, value, "
                "pose, route, now"
            )


@value
class Reading:
    """What a telemetry key or a result is read from.

    Attributes
    ----------
    field
        Way to a field of the message: `pose.pose.position.x`, `ranges[0]`, `status[name=base].level`.
    of
        The field is a pose or transform, of which this is told, in the site frame.
    unit
        Unit of the field, where it is not the dictionary's.
    scale, offset
        Told is `scale * field + offset`, before units are changed.
    words
        Text told for each value of the field: `{"0": ok, "1": warning}`.
    """

    field: str
    of: Literal["x", "y", "z", "heading"] | None = None
    unit: str = ""
    scale: float = 1.0
    offset: float = 0.0
    words: Mapping[str, str] = member(default_factory=dict)


Qos = Literal["sensor", "reliable", "latched"]
"""`sensor`: best effort. `reliable`: every message. `latched`: reliable, also what was said before."""


@value
class ActionCall:
    """A dictionary action as a goal of a ROS action.

    Attributes
    ----------
    results, feedback
        Results of the dictionary by fields of the result; telemetry keys by fields of the feedback.
    success
        Way to a truth value of the result that must hold, too.
    reason
        Way to a text or number of the result that tells why it failed.
    server_s, accept_s
        How long the server may be away when a command comes, and how long it may think about a goal.
    cancel_s
        How often a cancel is asked for again; a goal that goes on is never told as stopped.
    lost_s
        After so long without a server, or without the result of a goal that is over, the goal is lost.
    limit_s
        A goal that takes longer, by the rover's clock, is cancelled and has failed; absent: none does.
    """

    via: Literal["action"]
    name: str
    type: str
    fields: Mapping[str, Source] = field(default_factory=dict)
    results: Mapping[str, Reading] = field(default_factory=dict)
    feedback: Mapping[str, Reading] = field(default_factory=dict)
    feedback_hz: Positive = 2.0
    success: str | None = None
    reason: str | None = None
    server_s: NotNegative = 5.0
    accept_s: Positive = 5.0
    cancel_s: Positive = 1.0
    lost_s: Positive = 5.0
    limit_s: Positive | None = None


@value
class ServiceCall:
    """A dictionary action as a request to a ROS service; it cannot be called off, and ends by `answer_s`."""

    via: Literal["service"]
    name: str
    type: str
    fields: Mapping[str, Source] = field(default_factory=dict)
    results: Mapping[str, Reading] = field(default_factory=dict)
    success: str | None = None
    reason: str | None = None
    server_s: NotNegative = 5.0
    answer_s: Positive = 10.0


@value
class ImageCall:
    """A dictionary action as the next image on a topic, which becomes a data product of kind `product`."""

    via: Literal["image"]
    name: str
    type: Literal["sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"] = "sensor_msgs/msg/Image"
    product: str = "image"
    qos: Qos = "sensor"
    answer_s: Positive = 5.0


@value
class TimerCall:
    """A dictionary action that lasts as many seconds of the rover's clock as its parameter says."""

    via: Literal["timer"]
    duration: str = "duration_s"


Call = Annotated[ActionCall | ServiceCall | ImageCall | TimerCall, ToldBy("via")]


@value
class Topic:
    """Telemetry keys by fields of the messages on a topic.

    `rate_hz` is how often the topic is looked at: whatever more is said costs nothing. `depth` is how many
    messages a look takes, the newest.
    """

    topic: str
    type: str
    keys: Mapping[str, Reading]
    rate_hz: Positive = 2.0
    depth: int = 1
    qos: Qos = "sensor"

    def __post_init__(self) -> None:
        if not 1 <= self.depth <= 1000:
            raise MissionError(f"depth is {self.depth}; it must be 1 to 1000")
        if not 0.01 <= self.rate_hz <= 50:
            raise MissionError(f"rate_hz is {self.rate_hz:g}; it must be 0.01 to 50")


@value
class TransformTelemetry:
    """Telemetry keys by the transform from the site frame to `child`, from `/tf` and `/tf_static`."""

    child: str
    keys: Mapping[str, Literal["x", "y", "z", "heading"]]
    rate_hz: Positive = 2.0


@value
class Ros2Mapping:
    """What a mapping file holds.

    Attributes
    ----------
    name
        Name of the rover, and of the ROS node.
    dictionary
        Name of a dictionary, or a file beside the mapping.
    sim_time
        The rover's clock is `/clock`; `rate` is how many of its seconds a second has.
    start
        Values told from the start, for keys that no topic tells.
    """

    name: str
    dictionary: str = STANDARD_DICTIONARY
    doc: str = ""
    sim_time: bool = False
    rate: Positive = 1.0
    site: Site = Site()
    actions: Mapping[str, Call] = field(default_factory=dict)
    telemetry: Mapping[str, Topic] = field(default_factory=dict)
    tf: TransformTelemetry | None = None
    start: Mapping[str, Scalar] = field(default_factory=dict)


MAPPINGS = Codec(Ros2Mapping, "ros2-mapping/1", "ROS 2 mapping", error=MappingError)
