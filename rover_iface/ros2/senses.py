"""Telemetry keys out of topics and transforms, each topic looked at as often as its mapping says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from executive.crl.dictionary import ValueSpec
from executive.ports import Value
from rover_iface.frames import Pose, Transform
from rover_iface.ros2.field_paths import AbsentError
from rover_iface.ros2.mapping import Ros2Mapping, Topic
from rover_iface.ros2.port import Ear, RosPort
from rover_iface.ros2.poses import part, pose_in_site
from rover_iface.ros2.readings import Reader, held_to

TF_TYPE = "tf2_msgs/msg/TFMessage"
TF_DEPTH = 100
SILENT_S = 10.0
"""A topic that tells nothing for so long is named in the log."""


class Body(Protocol):
    """What telemetry needs of the rover that it belongs to."""

    mapping: Ros2Mapping
    port: RosPort
    reader: Reader

    def now_s(self) -> float: ...

    def note(self, text: str) -> None: ...

    def tell(self, values: Mapping[str, Value]) -> None: ...

    def key_spec(self, key: str) -> ValueSpec | None: ...


@dataclass(slots=True)
class _Sense:
    """One topic: who listens, and when it is looked at next."""

    topic: Topic
    ear: Ear
    specs: Mapping[str, ValueSpec]
    due: float
    heard: float


class Senses:
    """All topics of a mapping."""

    def __init__(self, body: Body) -> None:
        self._body, self._reader = body, body.reader
        now = body.now_s()
        self._senses = [
            _Sense(
                topic,
                body.port.listen(topic.topic, topic.type, topic.qos, topic.depth),
                self._specs(topic.keys),
                now,
                now,
            )
            for topic in body.mapping.telemetry.values()
        ]
        tf = body.mapping.tf
        self._tf_ears: list[Ear] = []
        self._tf_due = now
        self._tf_specs = self._specs(tf.keys) if tf is not None else {}
        if tf is not None:
            self._tf_ears = [
                body.port.listen("/tf", TF_TYPE, "reliable", TF_DEPTH),
                body.port.listen("/tf_static", TF_TYPE, "latched", TF_DEPTH),
            ]

    def _specs(self, keys: Mapping[str, object]) -> dict[str, ValueSpec]:
        return {key: spec for key in keys if (spec := self._body.key_spec(key)) is not None}

    def look(self, *, at_all: bool = False) -> None:
        """Tell what is new on each topic whose time has come, or on all of them."""
        now = self._body.now_s()
        if self._tf_ears and (at_all or now >= self._tf_due):
            self._look_at_transforms(now)
        for sense in self._senses:
            if at_all or now >= sense.due:
                sense.due = now + 1 / sense.topic.rate_hz
                self._look_at(sense, now)

    def _look_at(self, sense: _Sense, now: float) -> None:
        topic, messages = sense.topic, sense.ear.take()
        if messages:
            sense.heard = now
        elif now - sense.heard >= SILENT_S:
            self._body.note(f"{topic.topic} ({topic.type}) has told nothing for {SILENT_S:g} s")
        told: dict[str, Value] = {}
        for message in messages:
            values, wrong = self._reader.values(message, topic.keys, sense.specs)
            told |= values
            if len(messages) == 1 or not values:
                for what in wrong:
                    self._body.note(f"{topic.topic}: {what}; it is not told")
        self._body.tell(told)

    def _look_at_transforms(self, now: float) -> None:
        tf, site = self._body.mapping.tf, self._body.mapping.site
        assert tf is not None
        self._tf_due = now + 1 / tf.rate_hz
        for ear in self._tf_ears:
            for what in self._reader.tree.take(ear.take()):
                self._body.note(f"{what}; it is not used")
        try:
            pose: Pose = pose_in_site(site, self._reader.tree, tf.child, Transform.identity())
        except AbsentError:
            return  # the tree is not whole yet
        told: dict[str, Value] = {}
        for key, of in tf.keys.items():
            try:
                told[key] = held_to(self._tf_specs[key], part(pose, of))
            except AbsentError as err:
                self._body.note(f"/tf: {key}: {err}; it is not told")
        self._body.tell(told)
