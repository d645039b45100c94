"""Planning problem as frozen values, made from its documents and turned into them again.

Three forms are read: `contingency/1` (one observation per target), `problem/1`, its superset (several
observations per target, precedence, must-do, windows, diminishing value, downlink volume, energy floor,
chance constraint, asymmetric legs with their route on the ground, references to the mission's rows), and
`problem/2`, in which drives may fail, the kind of sol may be hidden, targets have normals and successes of
a day may go together. Times are
seconds from the start of the plan, energies joules, lengths metres in the site frame (east, north), angles
radians.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections import Counter
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, field
from enum import StrEnum
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Any, NewType

from mission.codec import shown
from mission.geometry import Pose
from mission.values import Point3
from planner.errors import ProblemError
from planner.problem_document import (
    CONTINGENCY,
    PROBLEMS,
    AmountDocument,
    LegDocument,
    ObservationDocument,
    PoseDocument,
    PositiveDocument,
    ProblemDocument,
    TargetDocument,
    contingency_document,
    problem_document,
    says_all,
)
from planner.sol_kind import SolKind, read_kinds, written_kinds

TargetId = NewType("TargetId", str)
ObservationId = NewType("ObservationId", str)

UNIT = 1e-3
"""By which the length of a normal may differ from 1: documents round to five digits."""

START = "start"
"""Name of the place where the rover stands when the plan begins."""

MAX_OBSERVATIONS = 5_000
"""By hand: what a survey of `MAX_TARGETS` targets may ask for."""


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
class Observation:
    """One observation request as the planner sees it.

    `utility` is earned with `p_success` when the observation ends within the budgets; it may start only at
    times in `window_s` (inclusive). Where `must_do`, every plan must contain it. `data_mbit` counts
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
    normal: Point3 | None = None
    """Outward, of the surface at the point; site frame."""
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
    on it, `p_fail` that it fails: it takes its time and energy, the rover then counts as back where it began,
    and no drive leads to that target any more on this day.
    """

    origin: str
    to: TargetId
    time_s: Amount
    energy_j: Amount
    p_lose: Mapping[TargetId, float] = field(default_factory=dict)
    p_fail: float = 0.0
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
    b): observation b may only be made after a was made. One of `sol_kinds`, or the ordinary sol with the rest
    of the probability, is drawn and hidden. `intraday_correlation` is that of the successes of an
    instrument's observations on one day (`planner.outlook`), by the instrument; 0 for others.
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
    sol_kinds: tuple[SolKind, ...] = ()
    intraday_correlation: Mapping[str, float] = field(default_factory=dict)

    @property
    def observations(self) -> tuple[Observation, ...]:
        """All observations, in the order of the targets."""
        return tuple(o for t in self.targets for o in t.observations)

    @property
    def utility_sum(self) -> float:
        return sum(o.utility for o in self.observations)

    def digest(self) -> str:
        """Return the SHA-256 of the problem in its canonical JSON form.

        Chances to lose targets that nothing here tracks are left out of it: stored plans know their problem
        by a digest without them.
        """
        document = problem_to_dict(self)
        tracked = {t.id for t in self.targets if t.tracked_kind}
        for leg in document["legs"]:
            leg["p_lose"] = {target: p for target, p in leg["p_lose"].items() if target in tracked}
        text = json.dumps(document, sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(text.encode()).hexdigest()


# ----------------------------------------------------------------------------------------------- reading


def problem_from_dict(data: object, where: str = "") -> Problem:
    """Return the problem that a JSON document describes; `where` it is from stands before messages.

    Raises
    ------
    ProblemError
        If the document is not a well-formed `contingency/1`, `problem/1` or `problem/2`; the message names
        the member, its value and the limit.
    """
    document = PROBLEMS.from_document(data, where)
    assert isinstance(data, Mapping)  # as the codec found
    budget = document["budget"]
    floor = budget.get("energy_floor_j") or 0.0
    if floor > budget["energy_j"]:
        raise ProblemError(
            f"problem budget.energy_floor_j is {floor:g}; it must be at most energy_j, {budget['energy_j']:g}"
        )
    targets = tuple(map(_target, document["targets"]))
    _check_names("target", [t.id for t in targets])
    observations = [o.id for t in targets for o in t.observations]
    _check_names("observation", observations)
    if len(observations) > MAX_OBSERVATIONS:
        raise ProblemError(
            f"problem has {len(observations)} observations; at most {MAX_OBSERVATIONS} are allowed"
        )
    names = {t.id for t in targets}
    legs = tuple(_leg(leg, names) for leg in document["legs"])
    twice = [ends for ends, count in Counter((leg.origin, leg.to) for leg in legs).items() if count > 1]
    if twice:
        raise ProblemError(f"leg {twice[0][0]} -> {twice[0][1]} is given twice")
    start, tracking = document.get("start"), document["track_start"]
    return Problem(
        name=document["name"],
        targets=targets,
        legs=legs,
        budget=Budget(budget["time_s"], budget["energy_j"], floor, budget.get("data_mbit")),
        hotel_w=document["hotel_w"],
        track_start_time_s=tracking["time_s"],
        track_start_energy_j=tracking["energy_j"],
        track_overhead_s_per_leg=document["track_overhead_s_per_leg"],
        overrun_penalty=document.get("overrun_penalty") or 0.0,
        max_overrun_probability=document.get("max_overrun_probability"),
        precedence=_precedence(document.get("precedence") or (), set(observations)),
        start=None if start is None else _pose(start),
        refs=document.get("refs") or {},
        source_format=str(data["format"]),
        sol_kinds=read_kinds(document.get("sol_kinds") or ()),
        intraday_correlation={k: v for k, v in (document.get("intraday_correlation") or {}).items() if v},
    )


def _check_names(what: str, names: Sequence[str]) -> None:
    for name, count in Counter(names).items():
        if name == START:
            raise ProblemError(f'{what} id "{START}" is kept for the place where the rover starts')
        if any(c.isspace() or c in '()";=<>/' for c in name):
            raise ProblemError(f'{what} id "{name}" holds a blank or one of ( ) " ; = < > /')
        if count > 1:
            raise ProblemError(f'{what} id "{name}" is used twice')


def _amount(amount: AmountDocument | PositiveDocument, what: str) -> Amount:
    mean, sd = amount["mean"], amount.get("sd") or 0.0
    if mean == 0.0 and sd > 0.0:
        raise ProblemError(f"{what}.sd is {sd:g} but the mean is 0; a mean of 0 allows only sd 0")
    return Amount(mean, sd)


def _pose(pose: PoseDocument) -> Pose:
    return Pose(pose["east_m"], pose["north_m"], pose.get("heading_rad") or 0.0)


def _observation(o: ObservationDocument, target: str) -> Observation:
    what = f"target {target}, observation {o['id']}"
    window = o.get("window_s")
    if window is not None and window[0] > window[1]:
        raise ProblemError(f"{what}: window_s opens at {window[0]:g} s after it closes at {window[1]:g} s")
    p_success = o.get("p_success")
    return Observation(
        id=ObservationId(o["id"]),
        target=TargetId(target),
        kind=Kind(o["kind"]),
        utility=o["utility"],
        time_s=_amount(o["observe"]["time_s"], f"{what}: observe.time_s"),
        energy_j=_amount(o["observe"]["energy_j"], f"{what}: observe.energy_j"),
        p_success=1.0 if p_success is None else p_success,
        instrument=o.get("instrument") or "",
        window_s=None if window is None else (window[0], window[1]),
        must_do=o.get("must_do", False),
        data_mbit=o.get("data_mbit") or 0.0,
        tracked=o.get("tracked", False),
        action=o.get("action") or "",
        refs=o.get("refs") or {},
    )


def _target(t: TargetDocument) -> Target:
    pose, diminishing, normal = t.get("observation_point"), t.get("diminishing"), t.get("normal")
    if normal is not None and not abs((length := math.hypot(*normal)) - 1.0) <= UNIT:
        said = ", ".join(f"{v:g}" for v in normal)
        raise ProblemError(f"target {t['id']}: its normal ({said}) has a length of {length:g}; it must be 1")
    return Target(
        id=TargetId(t["id"]),
        observations=tuple(_observation(o, t["id"]) for o in t["observations"]),
        point_m=t.get("point_m"),
        normal=normal,
        observation_point=None if pose is None else _pose(pose),
        diminishing=1.0 if diminishing is None else diminishing,
        refs=t.get("refs") or {},
    )


def _leg(leg: LegDocument, targets: Set[TargetId]) -> Leg:
    origin, to = leg["from"], TargetId(leg["to"])
    what = f"leg {origin} -> {to}"
    if origin != START and origin not in targets:
        raise ProblemError(f'{what}: "from" names no target and is not "{START}"')
    if to not in targets:
        raise ProblemError(f'{what}: "to" names no target')
    if origin == to:
        raise ProblemError(f"{what}: a leg must join two different places")
    losses = {TargetId(target): p for target, p in (leg.get("p_lose") or {}).items()}
    if unknown := sorted(losses.keys() - targets):
        raise ProblemError(f'{what}: p_lose names the unknown target "{unknown[0]}"')
    return Leg(
        origin=origin,
        to=to,
        time_s=_amount(leg["time_s"], f"{what}: time_s"),
        energy_j=_amount(leg["energy_j"], f"{what}: energy_j"),
        p_lose=losses,
        p_fail=leg.get("p_fail") or 0.0,
        length_m=leg.get("length_m"),
        route=tuple((p[0], p[1]) for p in leg.get("route") or ()),
    )


def _precedence(
    pairs: Sequence[tuple[str, ...]], observations: Set[str]
) -> tuple[tuple[ObservationId, ObservationId], ...]:
    before: dict[str, list[str]] = {}
    for first, second in pairs:
        for name in (first, second):
            if name not in observations:
                raise ProblemError(f"problem precedence names the unknown observation {shown(name)}")
        before.setdefault(second, []).append(first)
    try:
        TopologicalSorter(before).prepare()
    except CycleError as err:
        raise ProblemError("problem precedence has the cycle " + " -> ".join(err.args[1])) from err
    return tuple((ObservationId(first), ObservationId(second)) for first, second in pairs)


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
    return problem_from_dict(PROBLEMS.parsed_file(Path(source)), str(source))


# ----------------------------------------------------------------------------------------------- writing


def _amount_document(amount: Amount) -> AmountDocument:
    return {"mean": amount.mean, "sd": amount.sd}


def _pose_document(pose: Pose) -> PoseDocument:
    return {"east_m": pose.east_m, "north_m": pose.north_m, "heading_rad": pose.heading_rad}


def _observation_document(o: Observation) -> ObservationDocument:
    d: ObservationDocument = {
        "id": o.id,
        "kind": o.kind.value,
        "utility": o.utility,
        "p_success": o.p_success,
        "observe": {"time_s": _amount_document(o.time_s), "energy_j": _amount_document(o.energy_j)},
    }
    if o.instrument:
        d["instrument"] = o.instrument
    if o.action:
        d["action"] = o.action
    if o.window_s is not None:
        d["window_s"] = o.window_s
    if o.must_do:
        d["must_do"] = True
    if o.data_mbit:
        d["data_mbit"] = o.data_mbit
    if o.tracked:
        d["tracked"] = True
    if o.refs:
        d["refs"] = dict(o.refs)
    return d


def _target_document(t: Target) -> TargetDocument:
    d: TargetDocument = {"id": t.id, "observations": tuple(map(_observation_document, t.observations))}
    if t.point_m is not None:
        d["point_m"] = t.point_m
    if t.normal is not None:
        d["normal"] = t.normal
    if t.observation_point is not None:
        d["observation_point"] = _pose_document(t.observation_point)
    if t.diminishing != 1.0:
        d["diminishing"] = t.diminishing
    if t.refs:
        d["refs"] = dict(t.refs)
    return d


def _leg_document(leg: Leg) -> LegDocument:
    d: LegDocument = {
        "from": leg.origin,
        "to": leg.to,
        "time_s": {"mean": leg.time_s.mean, "sd": leg.time_s.sd},
        "energy_j": _amount_document(leg.energy_j),
        "p_lose": {str(target): p for target, p in leg.p_lose.items()},
    }
    if leg.p_fail:
        d["p_fail"] = leg.p_fail
    if leg.length_m is not None:
        d["length_m"] = leg.length_m
    if leg.route:
        d["route"] = leg.route
    return d


def problem_to_dict(problem: Problem) -> dict[str, Any]:
    """Return the JSON form of a problem, in the format it was read from if that can say all of it, else
    `problem/1`, or `problem/2` where drives may fail, the kind of sol is hidden, a target has a normal or
    successes of a day go together.
    """
    budget, start = problem.budget, problem.start
    d: ProblemDocument = {
        "name": problem.name,
        "budget": {"time_s": budget.time_s, "energy_j": budget.energy_j},
        "hotel_w": problem.hotel_w,
        "overrun_penalty": problem.overrun_penalty,
        "track_start": {"time_s": problem.track_start_time_s, "energy_j": problem.track_start_energy_j},
        "track_overhead_s_per_leg": problem.track_overhead_s_per_leg,
        "targets": tuple(map(_target_document, problem.targets)),
        "legs": tuple(map(_leg_document, problem.legs)),
    }
    if budget.energy_floor_j:
        d["budget"]["energy_floor_j"] = budget.energy_floor_j
    if budget.data_mbit is not None:
        d["budget"]["data_mbit"] = budget.data_mbit
    if problem.max_overrun_probability is not None:
        d["max_overrun_probability"] = problem.max_overrun_probability
    if start is not None:
        d["start"] = _pose_document(start)
    if problem.refs:
        d["refs"] = dict(problem.refs)
    if problem.precedence:
        d["precedence"] = problem.precedence
    if problem.sol_kinds:
        d["sol_kinds"] = written_kinds(problem.sol_kinds)
    if problem.intraday_correlation:
        d["intraday_correlation"] = dict(problem.intraday_correlation)
    if problem.source_format == CONTINGENCY.format and says_all(d):
        return CONTINGENCY.document(contingency_document(d))
    return problem_document(d)
