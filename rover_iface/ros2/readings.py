"""Values of telemetry keys and results out of ROS messages; what is not a value of its kind is left out."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from executive.crl.dictionary import ValueSpec, ValueType
from executive.ports import Value
from rover_iface.ros2.field_paths import AbsentError, read_field
from rover_iface.ros2.mapping import Reading, Site
from rover_iface.ros2.poses import TransformTree, part, pose_in_site, transform_of
from rover_iface.ros2.units import factor


@dataclass(slots=True)
class Reader:
    """Reads messages by the rules of a mapping."""

    site: Site
    tree: TransformTree = field(default_factory=TransformTree)

    def values(
        self, message: object, readings: Mapping[str, Reading], specs: Mapping[str, ValueSpec]
    ) -> tuple[dict[str, Value], list[str]]:
        """Return the values of keys, and a sentence for each that has none."""
        told: dict[str, Value] = {}
        wrong: list[str] = []
        for key, reading in readings.items():
            try:
                told[key] = held_to(specs[key], self._value(message, reading, specs[key]))
            except AbsentError as err:
                wrong.append(f"{key}: {err}")
        return told, wrong

    def _value(self, message: object, reading: Reading, spec: ValueSpec) -> object:
        found = read_field(message, reading.field)
        if reading.of is not None:
            frame = _frame_of(found) or _frame_of(message) or self.site.frame
            return part(pose_in_site(self.site, self.tree, frame, transform_of(found)), reading.of)
        plain = plain_value(found)
        if reading.words:
            name = str(int(plain)) if isinstance(plain, float) and plain.is_integer() else str(plain)
            if name not in reading.words:
                raise AbsentError(f"{name[:40]!r} is none of {', '.join(reading.words)}")
            return reading.words[name]
        if spec.type is ValueType.NUMBER and isinstance(plain, str):
            plain = _number_in(plain)
        if isinstance(plain, float):
            return (plain * reading.scale + reading.offset) * factor(reading.unit, spec.unit)
        return plain


def plain_value(found: object) -> Value:
    """Return a field as number, text or truth value; a time or duration is its seconds.

    Raises
    ------
    AbsentError
        If it is none.
    """
    if isinstance(found, bool | str):
        return found
    if isinstance(found, bytes) and len(found) == 1:  # the type `byte`
        return float(found[0])
    if isinstance(found, int | float):
        return float(found)
    sec, nanosec = getattr(found, "sec", None), getattr(found, "nanosec", None)
    if isinstance(sec, int) and isinstance(nanosec, int):
        return sec + nanosec * 1e-9
    item = getattr(found, "item", None)  # numpy, in arrays of numbers
    if callable(item) and getattr(found, "shape", None) == ():
        return plain_value(item())
    raise AbsentError(f"a {type(found).__name__} is not a number, text or truth value")


def _number_in(text: str) -> float:
    try:
        return float(text)
    except ValueError as err:
        raise AbsentError(f"{text[:40]!r} is not a number") from err


def _frame_of(message: object) -> str:
    return str(getattr(getattr(message, "header", None), "frame_id", ""))


def held_to(spec: ValueSpec, found: object) -> Value:
    """Return a value that keeps to the dictionary.

    Raises
    ------
    AbsentError
        If it is not finite, of another type, out of range or none of the choices.
    """
    if spec.type is ValueType.NUMBER:
        if isinstance(found, bool) or not isinstance(found, int | float):
            raise AbsentError(f"{str(found)[:40]!r} is not a number")
        number = float(found)
        if not math.isfinite(number):
            raise AbsentError(f"{number} is not finite")
        low, high = spec.minimum, spec.maximum
        if (low is not None and number < low) or (high is not None and number > high):
            raise AbsentError(f"{number:g} is out of range; allowed are {_range(low, high)}")
        return number
    if spec.type is ValueType.BOOLEAN:
        if not isinstance(found, bool):
            raise AbsentError(f"{str(found)[:40]!r} is not a truth value")
        return found
    if not isinstance(found, str):
        raise AbsentError(f"{str(found)[:40]!r} is not text")
    if spec.choices and found not in spec.choices:
        raise AbsentError(f"{found[:40]!r} is none of {', '.join(spec.choices)}")
    return found


def _range(low: float | None, high: float | None) -> str:
    return f"{'...' if low is None else f'{low:g}'} to {'...' if high is None else f'{high:g}'}"
