"""Types of ROS by their names, and messages filled field by field; knows messages, not rclpy."""

from __future__ import annotations

import importlib
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from rover_iface.errors import RosError
from rover_iface.ros2.field_paths import AbsentError, Step, steps_of
from rover_iface.ros2.goals import Filling, Now
from rover_iface.ros2.mapping import ActionCall, ImageCall, Reading, Ros2Mapping, ServiceCall, TimerCall
from rover_iface.ros2.poses import RosPose


def ros_type(kind: str) -> Any:
    """Return the class of a type by its name, `nav2_msgs/action/NavigateToPose`.

    Raises
    ------
    RosError
        If its package is not installed, or has no such type.
    """
    package, part, name = kind.split("/")
    try:
        module = importlib.import_module(f"{package}.{part}")
        return getattr(module, name)
    except ImportError as err:
        raise RosError(
            f"the type {kind} needs the ROS package {package}, which is not here ({err}); source the "
            "setup file of your ROS and its workspaces first"
        ) from err
    except AttributeError as err:
        raise RosError(f"the ROS package {package} has no type {part}/{name}") from err


def fill(message: Any, fields: Mapping[str, Filling], now: Any) -> Any:
    """Return a message with its fields set; `now` is the present time of ROS as a message.

    Raises
    ------
    AbsentError
        If there is no such field, or it takes no such value.
    """
    for path, given in fields.items():
        *way, last = steps_of(path)
        found = message
        for step in way:
            found = _member(found, step, path)
        _member(found, last, path)
        kind = found.get_fields_and_field_types()[last.member]
        try:
            setattr(found, last.member, _as(kind, given, now, path))
        except (AssertionError, TypeError, ValueError) as err:
            raise AbsentError(f"the field {path} of the type {kind} does not take {given!r:.60}") from err
    return message


def _member(message: Any, step: Step, path: str) -> Any:
    if not step.member or not hasattr(message, step.member):
        raise AbsentError(f"{type(message).__name__} has no {step.member or 'such entry'} on the way {path}")
    return getattr(message, step.member)


_NUMBERS = ("int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64")


def _as(kind: str, given: Filling, now: Any, path: str) -> Any:
    """Return a value as a field of some type takes it."""
    if isinstance(given, tuple):
        return [_as(kind.removeprefix("sequence<").removesuffix(">"), one, now, path) for one in given]
    if isinstance(given, Now):
        return now
    if isinstance(given, RosPose):
        return _pose(kind, given, now, path)
    if isinstance(given, bool) or kind == "boolean":
        if kind != "boolean" or not isinstance(given, bool):
            raise AbsentError(f"the field {path} of the type {kind} does not take {given!r:.60}")
        return given
    if kind in _NUMBERS:
        if not isinstance(given, int | float) or int(given) != given:
            raise AbsentError(f"the field {path} takes whole numbers, not {given!r:.60}")
        return int(given)
    if kind in ("float", "double") and isinstance(given, int | float):
        return float(given)
    if kind == "builtin_interfaces/Duration" and isinstance(given, int | float):
        whole = int(given // 1)
        return ros_type("builtin_interfaces/msg/Duration")(sec=whole, nanosec=int((given - whole) * 1e9))
    return given


def _pose(kind: str, pose: RosPose, now: Any, path: str) -> Any:
    plain = ros_type("geometry_msgs/msg/Pose")()
    plain.position.x, plain.position.y, plain.position.z = pose.position
    turn = plain.orientation
    turn.w, turn.x, turn.y, turn.z = pose.quaternion
    if kind == "geometry_msgs/Pose":
        return plain
    if kind != "geometry_msgs/PoseStamped":
        raise AbsentError(f"the field {path} is a {kind}; a pose fills geometry_msgs/Pose or PoseStamped")
    stamped = ros_type("geometry_msgs/msg/PoseStamped")()
    stamped.header.frame_id, stamped.header.stamp, stamped.pose = pose.frame, now, plain
    return stamped


def misfits(mapping: Ros2Mapping) -> Iterator[str]:
    """Yield each field of a mapping that its type does not have; raises as `ros_type` does."""
    for action, call in mapping.actions.items():
        way = f"actions.{action}"
        match call:
            case ActionCall():
                kind = ros_type(call.type)
                yield from _paths(kind.Goal(), call.fields, f"{way}.fields", call.type)
                yield from _paths(kind.Result(), _read_of(call), f"{way}.results", call.type)
                feedback = {key: reading.field for key, reading in call.feedback.items()}
                yield from _paths(kind.Feedback(), feedback.values(), f"{way}.feedback", call.type)
            case ServiceCall():
                kind = ros_type(call.type)
                yield from _paths(kind.Request(), call.fields, f"{way}.fields", call.type)
                yield from _paths(kind.Response(), _read_of(call), f"{way}.results", call.type)
            case ImageCall():
                ros_type(call.type)
            case TimerCall():
                pass
    for name, topic in mapping.telemetry.items():
        read = [reading.field for reading in topic.keys.values()]
        yield from _paths(ros_type(topic.type)(), read, f"telemetry.{name}", topic.type)


def _read_of(call: ActionCall | ServiceCall) -> list[str]:
    readings: Mapping[str, Reading] = call.results
    return [*(r.field for r in readings.values()), *filter(None, (call.success, call.reason))]


def _paths(message: Any, paths: Iterable[str], way: str, kind: str) -> Iterator[str]:
    """Yield the ways that lead nowhere; what lies in a list that is filled at run time is not looked at."""
    for path in paths:
        found = message
        for step in steps_of(path):
            if not step.member:
                break
            if not hasattr(found, step.member):
                has = ", ".join(getattr(found, "get_fields_and_field_types", dict)()) or "no members"
                yield f"{way}: {path}: {kind} has no {step.member} there; it has {has}"
                break
            found = getattr(found, step.member)
