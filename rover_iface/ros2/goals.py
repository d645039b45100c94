"""Fields of goals and requests from a command's parameters."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from executive.crl.dictionary import ActionSpec
from executive.ports import Value
from rover_iface.ros2.field_paths import AbsentError
from rover_iface.ros2.mapping import PoseSource, Site, Source
from rover_iface.ros2.poses import RosPose, ros_pose
from rover_iface.ros2.readings import held_to
from rover_iface.ros2.units import factor


@dataclass(frozen=True, slots=True)
class Now:
    """The ROS time at which a goal is sent."""


Filling = Value | RosPose | tuple[RosPose, ...] | Now
MOST_PLACES = 1000


def filled(
    fields: Mapping[str, Source],
    spec: ActionSpec,
    parameters: Mapping[str, Value],
    site: Site,
    here: tuple[float, float] | None,
) -> dict[str, Filling]:
    """Return what each field is set to; `here` is where the rover stands in the site frame, metres.

    Raises
    ------
    AbsentError
        If a parameter is missing that is needed, or no value of its kind.
    """
    checked: dict[str, Value] = {}
    for name, given in parameters.items():
        known = spec.parameter(name)
        if known is None:
            raise AbsentError(f"the action {spec.name} has no parameter {name!r}")
        try:
            checked[name] = held_to(known, given)
        except AbsentError as err:
            raise AbsentError(f"parameter {name}: {err}") from err
    _need_required(spec, checked)
    result: dict[str, Filling] = {}
    for path, source in fields.items():
        found = _filling(source, spec, checked, site, here)
        if found is not None:
            result[path] = found
    return result


def _need_required(spec: ActionSpec, given: Mapping[str, Value]) -> None:
    for known in spec.parameters:
        if known.required and known.name not in given:
            raise AbsentError(f"the parameter {known.name} is missing")


def _filling(
    source: Source,
    spec: ActionSpec,
    given: Mapping[str, Value],
    site: Site,
    here: tuple[float, float] | None,
) -> Filling | None:
    if source.now:
        return Now()
    if source.value is not None:
        return source.value
    if source.pose is not None:
        return _pose(source.pose, given, site, here)
    if source.route is not None:
        return _route(_needed(given, source.route), site, here)
    name = source.parameter or ""
    if name not in given:
        return source.default
    known = spec.parameter(name)
    found = given[name]
    if isinstance(found, float) and not isinstance(found, bool):
        return found * factor(known.unit if known is not None else "", source.unit)
    return found


def _needed(given: Mapping[str, Value], name: str) -> Value:
    if name not in given:
        raise AbsentError(f"the parameter {name} is missing")
    return given[name]


def _pose(
    source: PoseSource, given: Mapping[str, Value], site: Site, here: tuple[float, float] | None
) -> RosPose:
    x, y = float(_needed(given, source.x)), float(_needed(given, source.y))
    if source.heading is not None and source.heading in given:
        return ros_pose(site, x, y, float(given[source.heading]))
    return ros_pose(site, x, y, _towards(here, (x, y), 0.0))


def _towards(start: tuple[float, float] | None, end: tuple[float, float], otherwise: float) -> float:
    if start is None or math.dist(start, end) < 1e-6:
        return otherwise
    return math.atan2(end[1] - start[1], end[0] - start[0])


def _route(text: Value, site: Site, here: tuple[float, float] | None) -> tuple[RosPose, ...]:
    """Return the poses of `x y; x y heading; ...`; without a heading a pose looks the way it is come to."""
    places: list[RosPose] = []
    before, heading = here, 0.0
    for entry in str(text).split(";")[: MOST_PLACES + 1]:
        try:
            numbers = [float(word) for word in entry.split()]
        except ValueError as err:
            raise AbsentError(
                f"{entry.strip()[:40]!r} is not a place of a route; write x y or x y heading"
            ) from err
        if len(numbers) not in (2, 3) or not all(map(math.isfinite, numbers)):
            raise AbsentError(f"{entry.strip()[:40]!r} is not a place of a route; write x y or x y heading")
        place = (numbers[0], numbers[1])
        heading = numbers[2] if len(numbers) == 3 else _towards(before, place, heading)
        places.append(ros_pose(site, *place, heading))
        before = place
    if len(places) > MOST_PLACES:
        raise AbsentError(f"a route has at most {MOST_PLACES} places")
    return tuple(places)
