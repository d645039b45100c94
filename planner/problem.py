"""Planning problem as frozen values, and the strict readers and writers of its JSON forms.

Two forms are read: `contingency/1` (one observation per target) and `problem/1`, its superset (several
observations per target, precedence, must-do, windows, diminishing value, downlink volume, energy floor,
chance constraint, asymmetric legs with their route on the ground, references to the mission's rows). Times
are seconds from the start of the plan, energies joules, lengths metres in the site frame (east, north),
angles radians.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any, NewType

from planner.errors import ProblemError

TargetId = NewType("TargetId", str)
ObservationId = NewType("ObservationId", str)

START = "start"
"""Name of the place where the rover stands when the plan begins."""

MAX_TARGETS = 2_000
MAX_OBSERVATIONS = 5_000


class Kind(StrEnum):
    """How an observation is made: the instrument is placed on a tracked target, or looks from where the
    rover is.
    """

    PLACE = "place"
    IMAGE = "image"


@dataclass(frozen=True, slots=True)
class Amount:
    """A positive random amount, log-normal with this mean and standard deviation; `sd` 0 is a constant."""

    mean: float
    sd: float = 0.0


@dataclass(frozen=True, slots=True)
class Pose:
    """A pose on the ground in the site frame; heading counter-clockwise from east."""

    east_m: float
    north_m: float
    heading_rad: float = 0.0


@dataclass(frozen=True, slots=True)
class Observation:
    """One observation request as the planner sees it.

    `utility` is earned with `p_success` when the observation ends within the budgets; it may start only at
    times in `window_s` (inclusive). Where `must_do`, a plan without it is no plan. `data_mbit` counts
    against the budget of downlink volume. An image with `tracked` needs its target tracked like a placement.
    `action` is the rover's that makes it, empty for the usual one of its kind. `refs` travels untouched into
    the plan's metadata (request id and the like).
    """

    id: ObservationId
    target: TargetId
    kind: Kind
    utility: float
    time_s: Amount
    energy_j: Amount
    p_success: float = 1.0
    instrument: str = ""
    window_s: tuple[float, float] | None = None
    must_do: bool = False
    data_mbit: float = 0.0
    tracked: bool = False
    action: str = ""
    refs: Mapping[str, str] = field(default_factory=dict)

    @property
    def needs_track(self) -> bool:
        """Whether it can be made only while its target is tracked."""
        return self.tracked or self.kind is Kind.PLACE


@dataclass(frozen=True, slots=True)
class Target:
    """A point on a rock, and the one pose from which its observations are made.

    The k-th observation carried out on one target (k = 0, 1, ...) is worth `utility * diminishing ** k`.
    """

    id: TargetId
    observations: tuple[Observation, ...]
    point_m: tuple[float, ...] | None = None
    observation_point: Pose | None = None
    diminishing: float = 1.0
    refs: Mapping[str, str] = field(default_factory=dict)

    @property
    def tracked_kind(self) -> bool:
        """Whether some observation of the target needs it tracked."""
        return any(o.needs_track for o in self.observations)


@dataclass(frozen=True, slots=True)
class Leg:
    """The drive from one place to a target's observation point. `p_lose[i]` is the chance to lose target i
    on it.
    """

    origin: str
    to: TargetId
    time_s: Amount
    energy_j: Amount
    p_lose: Mapping[TargetId, float] = field(default_factory=dict)
    length_m: float | None = None
    route: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True, slots=True)
class Budget:
    """What may be used in all. Energy counts down to the floor: `energy_j - energy_floor_j` may be used."""

    time_s: float
    energy_j: float
    energy_floor_j: float = 0.0
    data_mbit: float | None = None

    @property
    def usable_energy_j(self) -> float:
        return self.energy_j - self.energy_floor_j


@dataclass(frozen=True, slots=True)
class Problem:
    """A planning problem. Energy used = `hotel_w` x elapsed time + the drive and instrument energies of the
    actions.

    The first action that ends over a budget ends the run, earns nothing and costs `overrun_penalty`. Where
    `max_overrun_probability` is given, the chance of that must not exceed it. `precedence` holds pairs (a,
    b): observation b may only be made after a was made.
    """

    name: str
    targets: tuple[Target, ...]
    legs: tuple[Leg, ...]
    budget: Budget
    hotel_w: float
    track_start_time_s: float
    track_start_energy_j: float
    track_overhead_s_per_leg: float
    overrun_penalty: float = 0.0
    max_overrun_probability: float | None = None
    precedence: tuple[tuple[ObservationId, ObservationId], ...] = ()
    start: Pose | None = None
    refs: Mapping[str, str] = field(default_factory=dict)
    source_format: str = "problem/1"

    @property
    def observations(self) -> tuple[Observation, ...]:
        """All observations, in the order of the targets."""
        return tuple(o for t in self.targets for o in t.observations)

    @property
    def utility_sum(self) -> float:
        return sum(o.utility for o in self.observations)

    def digest(self) -> str:
        """Return the SHA-256 of the problem in its canonical JSON form."""
        text = json.dumps(problem_to_dict(self), sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(text.encode()).hexdigest()


# ----------------------------------------------------------------------------------------------- reading


class _Reader:
    """Takes members out of one JSON object and names what is wrong with them."""

    def __init__(self, value: Any, what: str, allowed: Iterable[str]) -> None:
        if not isinstance(value, Mapping):
            raise ProblemError(f"{what} must be an object, found {_show(value)}")
        unknown = sorted(set(map(str, value)) - set(allowed))
        if unknown:
            raise ProblemError(
                f'{what}: unknown member "{unknown[0]}"; known are {", ".join(sorted(allowed))}'
            )
        self.value, self.what = value, what

    def has(self, key: str) -> bool:
        return self.value.get(key) is not None

    def raw(self, key: str) -> Any:
        if key not in self.value:
            raise ProblemError(f'{self.what}: "{key}" is missing')
        return self.value[key]

    def number(
        self,
        key: str,
        default: float | None = None,
        *,
        at_least: float | None = None,
        above: float | None = None,
        at_most: float | None = None,
    ) -> float:
        if default is not None and not self.has(key):
            return default
        return _number(
            self.raw(key), f'{self.what}: "{key}"', at_least=at_least, above=above, at_most=at_most
        )

    def text(self, key: str, default: str | None = None) -> str:
        if default is not None and not self.has(key):
            return default
        value = self.raw(key)
        if not isinstance(value, str) or (default is None and not value):
            raise ProblemError(f'{self.what}: "{key}" must be a non-empty string, found {_show(value)}')
        return value

    def truth(self, key: str) -> bool:
        value = self.value.get(key, False)
        if not isinstance(value, bool):
            raise ProblemError(f'{self.what}: "{key}" must be true or false, found {_show(value)}')
        return value

    def array(self, key: str, *, optional: bool = False) -> Sequence[Any]:
        if optional and not self.has(key):
            return ()
        value = self.raw(key)
        if not isinstance(value, list | tuple):
            raise ProblemError(f'{self.what}: "{key}" must be an array, found {_show(value)}')
        return value

    def amount(self, key: str, *, zero: bool = False) -> Amount:
        inner = _Reader(self.raw(key), f'{self.what}: "{key}"', ("mean", "sd"))
        limit = {"at_least": 0.0} if zero else {"above": 0.0}
        mean = inner.number("mean", **limit)
        sd = inner.number("sd", 0.0, at_least=0.0)
        if mean == 0.0 and sd > 0.0:
            raise ProblemError(
                f'{inner.what}: "sd" is {sd:g} but the mean is 0; a mean of 0 allows only sd 0'
            )
        return Amount(mean, sd)

    def refs(self) -> dict[str, str]:
        found: dict[str, str] = {}
        if self.has("refs"):
            inner = self.value["refs"]
            if not isinstance(inner, Mapping):
                raise ProblemError(f'{self.what}: "refs" must be an object, found {_show(inner)}')
            for key, value in inner.items():
                if not isinstance(value, str):
                    raise ProblemError(f'{self.what}: "refs.{key}" must be a string, found {_show(value)}')
                found[str(key)] = value
        return found


def _show(value: Any) -> str:
    text = json.dumps(value, default=str)
    return text if len(text) <= 60 else text[:57] + "..."


def _number(
    value: Any,
    what: str,
    *,
    at_least: float | None = None,
    above: float | None = None,
    at_most: float | None = None,
) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ProblemError(f"{what} must be a number, found {_show(value)}")
    number = float(value)
    if not math.isfinite(number):
        raise ProblemError(f"{what} is {value}; it must be finite")
    if at_least is not None and number < at_least:
        raise ProblemError(f"{what} is {number:g}; it must be at least {at_least:g}")
    if above is not None and number <= above:
        raise ProblemError(f"{what} is {number:g}; it must be more than {above:g}")
    if at_most is not None and number > at_most:
        raise ProblemError(f"{what} is {number:g}; it must be at most {at_most:g}")
    return number


def _pose(value: Any, what: str) -> Pose:
    reader = _Reader(value, what, ("east_m", "north_m", "heading_rad"))
    return Pose(reader.number("east_m"), reader.number("north_m"), reader.number("heading_rad", 0.0))


def _window(reader: _Reader) -> tuple[float, float] | None:
    if not reader.has("window_s"):
        return None
    pair = reader.array("window_s")
    if len(pair) != 2:
        raise ProblemError(f'{reader.what}: "window_s" must hold two times, found {_show(list(pair))}')
    opens, closes = (_number(v, f'{reader.what}: "window_s"') for v in pair)
    if opens > closes:
        raise ProblemError(f'{reader.what}: "window_s" opens at {opens:g} s after it closes at {closes:g} s')
    return opens, closes


_OBSERVATION = (
    "id", "instrument", "action", "kind", "tracked", "utility", "p_success", "observe", "window_s", "must_do",
    "data_mbit", "refs",
)  # fmt: skip


def _observation(reader: _Reader, target: str, oid: str, legacy: bool) -> Observation:
    kind = reader.text("kind")
    if kind not in ("place", "image"):
        raise ProblemError(f'{reader.what}: "kind" is "{kind}"; it must be "place" or "image"')
    observe = _Reader(reader.raw("observe"), f'{reader.what}: "observe"', ("time_s", "energy_j"))
    return Observation(
        id=ObservationId(oid),
        target=TargetId(target),
        kind=Kind(kind),
        utility=reader.number("utility", at_least=0.0),
        time_s=observe.amount("time_s", zero=True),
        energy_j=observe.amount("energy_j", zero=True),
        p_success=reader.number("p_success", None if legacy else 1.0, above=0.0, at_most=1.0),
        instrument="" if legacy else reader.text("instrument", ""),
        action="" if legacy else reader.text("action", ""),
        window_s=_window(reader),
        must_do=False if legacy else reader.truth("must_do"),
        data_mbit=0.0 if legacy else reader.number("data_mbit", 0.0, at_least=0.0),
        tracked=False if legacy else reader.truth("tracked"),
        refs={} if legacy else reader.refs(),
    )


def _identifier(reader: _Reader, seen: set[str]) -> str:
    value = reader.text("id")
    if value == START:
        raise ProblemError(f'{reader.what}: the id "{START}" is kept for the place where the rover starts')
    if any(c.isspace() or c in '()";=<>/' for c in value):
        raise ProblemError(f'{reader.what}: id "{value}" holds a blank or one of ( ) " ; = < > /')
    if value in seen:
        raise ProblemError(f'{reader.what}: id "{value}" is used twice')
    seen.add(value)
    return value


_LEGACY_TARGET = (
    "id", "kind", "utility", "p_success", "observe", "window_s", "target_m", "observation_point_m", "point_m",
)  # fmt: skip
_TARGET = ("id", "observations", "point_m", "observation_point", "diminishing", "refs")


def _coordinates(value: Any, what: str) -> tuple[float, ...]:
    if not isinstance(value, list | tuple) or len(value) not in (2, 3):
        raise ProblemError(f"{what} must hold two or three numbers, found {_show(value)}")
    return tuple(_number(v, what) for v in value)


def _legacy_target(value: Any, place: int, ids: set[str]) -> Target:
    name = value.get("id", f"number {place + 1}") if isinstance(value, Mapping) else f"number {place + 1}"
    reader = _Reader(value, f"target {name}", _LEGACY_TARGET)
    tid = _identifier(reader, ids)
    point = _coordinates(value["target_m"], f'target {tid}: "target_m"') if reader.has("target_m") else None
    pose = None
    if reader.has("observation_point_m"):
        east, north = _coordinates(value["observation_point_m"], f'target {tid}: "observation_point_m"')[:2]
        pose = Pose(east, north)
    return Target(TargetId(tid), (_observation(reader, tid, tid, legacy=True),), point, pose)


def _target(value: Any, place: int, ids: set[str], observation_ids: set[str]) -> Target:
    name = value.get("id", f"number {place + 1}") if isinstance(value, Mapping) else f"number {place + 1}"
    reader = _Reader(value, f"target {name}", _TARGET)
    tid = _identifier(reader, ids)
    observations = []
    for k, item in enumerate(reader.array("observations")):
        label = item.get("id", f"number {k + 1}") if isinstance(item, Mapping) else f"number {k + 1}"
        inner = _Reader(item, f"target {tid}, observation {label}", _OBSERVATION)
        observations.append(_observation(inner, tid, _identifier(inner, observation_ids), legacy=False))
    point = _coordinates(value["point_m"], f'target {tid}: "point_m"') if reader.has("point_m") else None
    pose = None
    if reader.has("observation_point"):
        pose = _pose(value["observation_point"], f'target {tid}: "observation_point"')
    return Target(
        id=TargetId(tid),
        observations=tuple(observations),
        point_m=point,
        observation_point=pose,
        diminishing=reader.number("diminishing", 1.0, at_least=0.0, at_most=1.0),
        refs=reader.refs(),
    )


def _leg(value: Any, place: int, ids: set[str], tracked: set[str], legacy: bool) -> Leg:
    ends = f"number {place + 1}"
    if isinstance(value, Mapping) and "from" in value and "to" in value:
        ends = f"{value['from']} -> {value['to']}"
    reader = _Reader(
        value, f"leg {ends}", ("from", "to", "length_m", "time_s", "energy_j", "p_lose", "route", "refs")
    )
    origin, to = reader.text("from"), reader.text("to")
    if origin != START and origin not in ids:
        raise ProblemError(f'{reader.what}: "from" names no target and is not "{START}"')
    if to not in ids:
        raise ProblemError(f'{reader.what}: "to" names no target')
    if origin == to:
        raise ProblemError(f"{reader.what}: a leg must join two different places")
    losses: dict[TargetId, float] = {}
    if reader.has("p_lose"):
        table = reader.raw("p_lose")
        if not isinstance(table, Mapping):
            raise ProblemError(f'{reader.what}: "p_lose" must be an object, found {_show(table)}')
        for key, chance in table.items():
            if key not in ids:
                raise ProblemError(f'{reader.what}: "p_lose" names the unknown target "{key}"')
            p = _number(chance, f'{reader.what}: "p_lose.{key}"', at_least=0.0, at_most=1.0)
            if key in tracked:
                losses[TargetId(str(key))] = p
    elif legacy:
        reader.raw("p_lose")
    route = tuple(
        (float(p[0]), float(p[1]))
        for p in (_coordinates(v, f'{reader.what}: "route"') for v in reader.array("route", optional=True))
    )
    return Leg(
        origin=origin,
        to=TargetId(to),
        time_s=reader.amount("time_s"),
        energy_j=reader.amount("energy_j", zero=True),
        p_lose=losses,
        length_m=reader.number("length_m", at_least=0.0) if reader.has("length_m") else None,
        route=route,
    )


_TOP = ("format", "name", "units", "budget", "hotel_w", "overrun_penalty", "track_start",
        "track_overhead_s_per_leg", "targets", "legs")  # fmt: skip
_TOP_LEGACY = (*_TOP, "family", "seed", "cone_half_angle_deg")
_TOP_NEW = (*_TOP, "max_overrun_probability", "precedence", "start", "refs")


def problem_from_dict(data: Any) -> Problem:
    """Return the problem that a JSON document describes.

    Raises
    ------
    ProblemError
        If the document is not a well-formed `contingency/1` or `problem/1`; the message names the member, its
        value and the limit.
    """
    if not isinstance(data, Mapping):
        raise ProblemError(f"a problem must be an object, found {_show(data)}")
    form = data.get("format")
    if form not in ("contingency/1", "problem/1"):
        raise ProblemError(f'problem: "format" is {_show(form)}; it must be "contingency/1" or "problem/1"')
    legacy = form == "contingency/1"
    top = _Reader(data, "problem", _TOP_LEGACY if legacy else _TOP_NEW)
    limits = _Reader(
        top.raw("budget"),
        "budget",
        ("time_s", "energy_j") if legacy else ("time_s", "energy_j", "energy_floor_j", "data_mbit"),
    )
    budget = Budget(
        time_s=limits.number("time_s", at_least=0.0),
        energy_j=limits.number("energy_j", at_least=0.0),
        energy_floor_j=0.0 if legacy else limits.number("energy_floor_j", 0.0, at_least=0.0),
        data_mbit=None if legacy or not limits.has("data_mbit") else limits.number("data_mbit", at_least=0.0),
    )
    if budget.energy_floor_j > budget.energy_j:
        raise ProblemError(
            f'budget: "energy_floor_j" is {budget.energy_floor_j:g}; it must be at most energy_j, '
            f"{budget.energy_j:g}"
        )
    rows = top.array("targets")
    if len(rows) > MAX_TARGETS:
        raise ProblemError(f"problem: {len(rows)} targets; at most {MAX_TARGETS} are allowed")
    ids: set[str] = set()
    observation_ids: set[str] = set()
    targets = tuple(
        _legacy_target(row, k, ids) if legacy else _target(row, k, ids, observation_ids)
        for k, row in enumerate(rows)
    )
    if len(observation_ids) > MAX_OBSERVATIONS:
        raise ProblemError(
            f"problem: {len(observation_ids)} observations; at most {MAX_OBSERVATIONS} are allowed"
        )
    tracked = {t.id for t in targets if t.tracked_kind}
    legs = []
    seen: set[tuple[str, str]] = set()
    for k, row in enumerate(top.array("legs")):
        leg = _leg(row, k, ids, set(tracked), legacy)
        if (leg.origin, leg.to) in seen:
            raise ProblemError(f"leg {leg.origin} -> {leg.to} is given twice")
        seen.add((leg.origin, leg.to))
        legs.append(leg)
    tracking = _Reader(top.raw("track_start"), "track_start", ("time_s", "energy_j"))
    precedence = [] if legacy else _precedence(top, observation_ids)
    return Problem(
        name=top.text("name"),
        targets=targets,
        legs=tuple(legs),
        budget=budget,
        hotel_w=top.number("hotel_w", at_least=0.0),
        track_start_time_s=tracking.number("time_s", at_least=0.0),
        track_start_energy_j=tracking.number("energy_j", at_least=0.0),
        track_overhead_s_per_leg=top.number("track_overhead_s_per_leg", at_least=0.0),
        overrun_penalty=top.number("overrun_penalty", 0.0, at_least=0.0),
        max_overrun_probability=(
            top.number("max_overrun_probability", at_least=0.0, at_most=1.0)
            if not legacy and top.has("max_overrun_probability")
            else None
        ),
        precedence=tuple(precedence),
        start=_pose(data["start"], "start") if not legacy and top.has("start") else None,
        refs={} if legacy else top.refs(),
        source_format=str(form),
    )


def _precedence(top: _Reader, observation_ids: set[str]) -> list[tuple[ObservationId, ObservationId]]:
    pairs: list[tuple[ObservationId, ObservationId]] = []
    for pair in top.array("precedence", optional=True):
        if not isinstance(pair, list | tuple) or len(pair) != 2:
            raise ProblemError(
                f'problem: "precedence" must hold pairs of observation ids, found {_show(pair)}'
            )
        for name in pair:
            if name not in observation_ids:
                raise ProblemError(f'problem: "precedence" names the unknown observation {_show(name)}')
        pairs.append((ObservationId(pair[0]), ObservationId(pair[1])))
    after: dict[str, list[str]] = {}
    for first, second in pairs:
        after.setdefault(first, []).append(second)
    state: dict[str, int] = {}
    for root in after:  # depth-first search for a cycle
        stack = [(root, iter(after.get(root, ())))]
        if state.get(root):
            continue
        state[root] = 1
        while stack:
            node, rest = stack[-1]
            for child in rest:
                if state.get(child) == 1:
                    cycle = [n for n, _ in stack]
                    raise ProblemError(
                        'problem: "precedence" has the cycle '
                        + " -> ".join([*cycle[cycle.index(child) :], child])
                    )
                if not state.get(child):
                    state[child] = 1
                    stack.append((child, iter(after.get(child, ()))))
                    break
            else:
                state[node] = 2
                stack.pop()
    return pairs


def load_problem(source: Mapping[str, Any] | str | Path) -> Problem:
    """Return the problem in a JSON document, a file (`Path`, or a string naming one), or an object already
    read.

    Raises
    ------
    ProblemError
        If the file cannot be read, is not JSON, or does not describe a problem.
    """
    if isinstance(source, Mapping):
        return problem_from_dict(source)
    path = Path(source)
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as err:
        raise ProblemError(f"problem file {path}: {err.strerror or err}") from err
    except UnicodeDecodeError as err:
        raise ProblemError(f"problem file {path} is not UTF-8 text: byte {err.start}") from err
    try:
        data = json.loads(text)
    except json.JSONDecodeError as err:
        raise ProblemError(
            f"problem file {path} is not JSON: line {err.lineno}, column {err.colno}: {err.msg}"
        ) from err
    except RecursionError as err:
        raise ProblemError(f"problem file {path} is nested too deeply") from err
    return problem_from_dict(data)


# ----------------------------------------------------------------------------------------------- writing


def _amount(amount: Amount) -> dict[str, float]:
    return {"mean": amount.mean, "sd": amount.sd}


def _observation_dict(o: Observation, legacy: bool) -> dict[str, Any]:
    d: dict[str, Any] = {} if legacy else {"id": o.id}
    if o.instrument and not legacy:
        d["instrument"] = o.instrument
    if o.action and not legacy:
        d["action"] = o.action
    d |= {
        "kind": o.kind.value,
        "utility": o.utility,
        "p_success": o.p_success,
        "observe": {"time_s": _amount(o.time_s), "energy_j": _amount(o.energy_j)},
    }
    if o.window_s is not None:
        d["window_s"] = list(o.window_s)
    if not legacy:
        if o.must_do:
            d["must_do"] = True
        if o.data_mbit:
            d["data_mbit"] = o.data_mbit
        if o.tracked:
            d["tracked"] = True
        if o.refs:
            d["refs"] = dict(o.refs)
    return d


def _pose_dict(pose: Pose) -> dict[str, float]:
    return {"east_m": pose.east_m, "north_m": pose.north_m, "heading_rad": pose.heading_rad}


def _target_dict(t: Target, legacy: bool) -> dict[str, Any]:
    d: dict[str, Any] = {"id": t.id}
    if legacy:
        d |= _observation_dict(t.observations[0], legacy=True)
        if t.point_m is not None:
            d["target_m"] = list(t.point_m)
        if t.observation_point is not None:
            d["observation_point_m"] = [t.observation_point.east_m, t.observation_point.north_m]
        return d
    if t.point_m is not None:
        d["point_m"] = list(t.point_m)
    if t.observation_point is not None:
        d["observation_point"] = _pose_dict(t.observation_point)
    if t.diminishing != 1.0:
        d["diminishing"] = t.diminishing
    if t.refs:
        d["refs"] = dict(t.refs)
    d["observations"] = [_observation_dict(o, legacy=False) for o in t.observations]
    return d


def _leg_dict(leg: Leg) -> dict[str, Any]:
    d: dict[str, Any] = {"from": leg.origin, "to": leg.to}
    if leg.length_m is not None:
        d["length_m"] = leg.length_m
    d |= {"time_s": _amount(leg.time_s), "energy_j": _amount(leg.energy_j), "p_lose": dict(leg.p_lose)}
    if leg.route:
        d["route"] = [list(p) for p in leg.route]
    return d


def problem_to_dict(problem: Problem) -> dict[str, Any]:
    """Return the JSON form of a problem, in the format it was read from (`problem/1` unless stated
    otherwise).
    """
    legacy = problem.source_format == "contingency/1"
    budget: dict[str, Any] = {"time_s": problem.budget.time_s, "energy_j": problem.budget.energy_j}
    if problem.budget.energy_floor_j:
        budget["energy_floor_j"] = problem.budget.energy_floor_j
    if problem.budget.data_mbit is not None:
        budget["data_mbit"] = problem.budget.data_mbit
    d: dict[str, Any] = {
        "format": problem.source_format,
        "name": problem.name,
        "budget": budget,
        "hotel_w": problem.hotel_w,
        "overrun_penalty": problem.overrun_penalty,
        "track_start": {"time_s": problem.track_start_time_s, "energy_j": problem.track_start_energy_j},
        "track_overhead_s_per_leg": problem.track_overhead_s_per_leg,
    }
    if problem.max_overrun_probability is not None:
        d["max_overrun_probability"] = problem.max_overrun_probability
    if problem.start is not None:
        d["start"] = _pose_dict(problem.start)
    if problem.refs:
        d["refs"] = dict(problem.refs)
    if problem.precedence:
        d["precedence"] = [list(pair) for pair in problem.precedence]
    d["targets"] = [_target_dict(t, legacy) for t in problem.targets]
    d["legs"] = [_leg_dict(leg) for leg in problem.legs]
    return d
