"""The planning problem of a day: its requests on the drives of a path network."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from mission import Amount, Day, Instrument, MissionError, Pose, Request, TerrainGrid
from planner.constraints.registry import stated
from planner.constraints.rule import Stated
from planner.path_network import (
    START,
    Calibration,
    DriveRule,
    NetworkRequest,
    ObservationPoint,
    PathNetwork,
    RoverParameters,
    Target,
)
from planner.problem import Problem, problem_from_dict
from planner.problem_document import (
    AmountDocument,
    LegDocument,
    ObservationDocument,
    PoseDocument,
    ProblemDocument,
    TargetDocument,
    problem_document,
)


@dataclass(frozen=True, slots=True)
class Refusal:
    """A request that cannot enter the problem, and why."""

    request_id: str
    target_id: str
    reason: str


@dataclass(frozen=True, slots=True)
class RoverCosts:
    """What the rover spends beside its drives: on observations by instrument, and to begin a track; and the
    chance that a track does not begin. `intraday_correlation` is that of an instrument's successes on one
    day, by instrument; 0 for others.
    """

    instruments: Mapping[str, Instrument]
    track_start_s: float
    track_start_j: float
    p_unbegun: float = 0.0
    intraday_correlation: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class DayProblem:
    """A problem, where the rover stands for each target, and the requests that could not enter."""

    problem: Problem
    observation_points: Mapping[str, Pose]
    refused: tuple[Refusal, ...]


def network_request_of(
    day: Day,
    stands: Mapping[str, Sequence[Pose]],
    terrain: TerrainGrid,
    rover: RoverParameters,
    calibration: Calibration,
) -> NetworkRequest:
    """Return what the path network of a day is made from; `stands` are the poses to try for each target."""
    tracked = {r.target_id for r in day.requests if _asks_for_track(r, day)}
    known = {None, *stands}
    return NetworkRequest(
        start=day.start,
        targets=tuple(Target(t.id, *t.point_site, t.id in tracked) for t in day.targets if t.id in stands),
        observation_points=tuple(
            ObservationPoint(f"{target}.{k + 1}", target, pose)
            for target, poses in stands.items()
            for k, pose in enumerate(poses)
        ),
        keep_outs=day.keep_outs,
        terrain=terrain,
        rover=rover,
        calibration=calibration,
        drive_rules=tuple(
            DriveRule(rule.from_target_id or START, rule.to_target_id, rule.via_m)
            for rule in day.drive_rules
            if {rule.from_target_id, rule.to_target_id} <= known
        ),
    )


def problem_of(day: Day, network: PathNetwork, costs: RoverCosts) -> DayProblem:
    """Return the planning problem of a day; each target stands for its best observation point.

    Targets that are not in the network are left out without a word: who made it knows why.

    Raises
    ------
    ProblemError
        If what was asked contradicts itself, as a circle of requests that each come after another.
    """
    points = network.best_points()
    stands = {target: network.places[point] for target, point in points.items()}
    terms, refused = _terms(day, network, points)
    asked: dict[str, list[Request]] = {}
    for request in day.requests:
        if request.id in terms:
            asked.setdefault(request.target_id, []).append(request)
    limits = day.limits
    document: ProblemDocument = {
        "name": day.name,
        "budget": {"time_s": limits.time_s, "energy_j": limits.energy_j, "data_mbit": limits.data_mbit},
        "hotel_w": network.hotel_w,
        "overrun_penalty": limits.overrun_penalty,
        "max_overrun_probability": limits.max_overrun_probability,
        "track_start": {"time_s": costs.track_start_s, "energy_j": costs.track_start_j},
        "track_overhead_s_per_leg": network.track_overhead_s,
        "start": _pose(day.start),
        "targets": tuple(
            _target(day, stands[target], target, [_observation(costs, r, terms[r.id]) for r in requests])
            for target, requests in asked.items()
        ),
        "legs": _legs(network, {target: points[target] for target in asked}, costs.p_unbegun),
        "precedence": tuple((a, r) for r, request in terms.items() for a in request.after),
        "refs": dict(day.refs),
    }
    if network.sol_kinds:
        document["sol_kinds"] = tuple(
            {
                "name": kind.name,
                "p": kind.p,
                "drive_time_factor": kind.drive_time_factor,
                "drive_energy_factor": kind.drive_energy_factor,
            }
            for kind in network.sol_kinds
        )
    used = {r.instrument for r in day.requests if r.id in terms}
    together = {k: v for k, v in sorted(costs.intraday_correlation.items()) if k in used and v > 0.0}
    if together:
        document["intraday_correlation"] = together
    return DayProblem(problem_from_dict(problem_document(document)), stands, tuple(refused))


def _asks_for_track(request: Request, day: Day) -> bool:
    try:
        return stated(request, day.sky, day.limits.time_s).tracked
    except MissionError:  # `problem_of` refuses it
        return request.tracked


def _terms(
    day: Day, network: PathNetwork, points: Mapping[str, str]
) -> tuple[dict[str, Stated], list[Refusal]]:
    """Return what the requests that can enter come to, and those that cannot.

    One that comes after a request that is not in the problem could never be made, and is refused as well.
    """
    unreachable = {point.target: point.reason for point in network.unreachable}
    known = set(network.target_of.values())
    refused: list[Refusal] = []
    terms: dict[str, Stated] = {}
    for request in day.requests:
        if request.target_id not in known:
            continue
        if request.target_id not in points:
            reason = unreachable.get(request.target_id, "no drive leads to its observation point")
            refused.append(Refusal(request.id, request.target_id, reason))
            continue
        try:
            terms[request.id] = stated(request, day.sky, day.limits.time_s)
        except MissionError as err:
            refused.append(Refusal(request.id, request.target_id, str(err)))
    target_of = {request.id: request.target_id for request in day.requests}
    while lacking := {name: gone for name, term in terms.items() if (gone := set(term.after) - terms.keys())}:
        for name, gone in lacking.items():
            reason = f"comes after observation request {', '.join(sorted(gone))}, which cannot be made"
            refused.append(Refusal(name, target_of[name], reason))
            del terms[name]
    return terms, refused


def _target(day: Day, stand: Pose, name: str, observations: list[ObservationDocument]) -> TargetDocument:
    target = day.target(name)
    length = math.hypot(*target.normal_site) or 1.0  # a day's file may give any vector along it
    east, north, up = (v / length for v in target.normal_site)
    return {
        "id": name,
        "point_m": tuple(round(v, 4) for v in target.point_site),
        "normal": (round(east, 5), round(north, 5), round(up, 5)),
        "observation_point": _pose(stand),
        "refs": {"target": name, "name": target.name},
        "observations": tuple(observations),
    }


def _pose(pose: Pose) -> PoseDocument:
    return {
        "east_m": round(pose.east_m, 4),
        "north_m": round(pose.north_m, 4),
        "heading_rad": round(pose.heading_rad, 5),
    }


def _amount(amount: Amount, more: float = 0.0) -> AmountDocument:
    return {"mean": amount.mean + more, "sd": amount.sd}


def _observation(costs: RoverCosts, request: Request, terms: Stated) -> ObservationDocument:
    instrument = costs.instruments[request.instrument]
    document: ObservationDocument = {
        "id": request.id,
        "instrument": request.instrument,
        "action": instrument.action,
        "kind": "place" if instrument.contact else "image",
        "utility": request.value,
        "p_success": instrument.p_success,
        "observe": {
            "time_s": _amount(instrument.time_s, request.dwell_s or 0.0),
            "energy_j": _amount(instrument.energy_j),
        },
        "must_do": terms.must_do,
        "data_mbit": instrument.data_mbit,
        "tracked": terms.tracked and not instrument.contact,
        "refs": {"request": request.id, **terms.refs},
    }
    if windows := terms.windows():
        # `problem/1` holds one window; of several the longest is planned with.
        document["window_s"] = max(windows, key=lambda w: w[1] - w[0])
    return document


def _legs(network: PathNetwork, points: Mapping[str, str], p_unbegun: float) -> tuple[LegDocument, ...]:
    """Return the drives between the places of the problem; a target stands for its observation point.

    Tracks begin at the start and nowhere else, so one that does not begin counts as lost on the drive from
    there: what is left to do is the same, but a drive to that target is refused instead of driven.
    """
    target_of = {point: target for target, point in points.items()}
    legs = []
    for route in network.routes:
        origin = START if route.origin == START else target_of.get(route.origin)
        to = target_of.get(route.destination)
        if origin is None or to is None or origin == to:
            continue
        gone = p_unbegun if origin == START else 0.0
        leg: LegDocument = {
            "from": origin,
            "to": to,
            "length_m": round(route.length_m, 3),
            "time_s": {"mean": round(route.duration_mean_s, 3), "sd": round(route.duration_sd_s, 3)},
            "energy_j": {"mean": round(route.energy_mean_j, 1), "sd": round(route.energy_sd_j, 1)},
            "p_lose": {t: round(p + (1.0 - p) * gone, 6) for t, p in route.p_lose.items() if t in points},
            "route": tuple((round(x, 3), round(y, 3)) for x, y in route.points),
        }
        if route.p_fail > 0.0:
            leg["p_fail"] = round(route.p_fail, 6)
        legs.append(leg)
    return tuple(legs)
