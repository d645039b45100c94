"""Translate between the rooms: terrain, targets and requests in, planning problem out.

This is the one module that knows the values of both the planner and the rover. Positions are metres in the
site frame (east, north, up), headings radians from east.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ground.errors import InvalidInputError

if TYPE_CHECKING:
    from planner.path_network import Calibration, HeightGrid, PathNetwork, RoverParameters
    from rover_iface.profile import RoverProfile
    from rover_iface.terrain import Terrain

NETWORK_POSTS_M = 0.25
"""Spacing of the heights that the path network is given; finer than a wheel is of no use to it."""

NETWORK_MARGIN_M = 15.0
"""How far beyond start and targets the path network may look for a way round."""


@dataclass(frozen=True, slots=True)
class StandPose:
    """Where the rover stands: metres east and north, heading in radians from east."""

    east_m: float
    north_m: float
    heading_rad: float = 0.0


@dataclass(frozen=True, slots=True)
class DayTarget:
    """A target as the planner and the rover need it."""

    id: str
    name: str
    point_site: tuple[float, float, float]
    normal_site: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class DayRequest:
    """An observation request; `observation_point` overrides base placement, `after` names earlier ones."""

    id: str
    target_id: str
    instrument: str
    value: float
    tracked: bool
    window_s: tuple[float, float] | None = None
    after: tuple[str, ...] = ()
    must_do: bool = False
    dwell_s: float | None = None
    observation_point: StandPose | None = None


@dataclass(frozen=True, slots=True)
class DayKeepOut:
    """A region the rover must not enter; corners are (east, north)."""

    id: str
    polygon_m: tuple[tuple[float, float], ...]


@dataclass(frozen=True, slots=True)
class DayDriveRule:
    """A drive between two targets' stands (None: the start) that is taken out, or has to go by corners."""

    from_target_id: str | None
    to_target_id: str
    via_m: tuple[tuple[float, float], ...] | None


@dataclass(frozen=True, slots=True)
class DayLimits:
    """Where the day begins and what it may use. The energy budget is above the floor already."""

    name: str
    start: StandPose
    time_s: float
    energy_j: float
    overrun_penalty: float = 0.0
    data_mbit: float | None = None
    max_overrun_probability: float | None = None
    refs: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Refusal:
    """A request that cannot enter the problem, and why."""

    request_id: str
    target_id: str
    reason: str


@dataclass(frozen=True)
class PreparedDay:
    """A day made ready to plan: `problem` is a `problem/1` document."""

    problem: dict[str, Any]
    network: PathNetwork
    observation_points: Mapping[str, StandPose]
    refused: tuple[Refusal, ...]


Report = Callable[[float, str], None]


def prepare_day(
    terrain: Terrain,
    profile: RoverProfile,
    limits: DayLimits,
    targets: Sequence[DayTarget],
    requests: Sequence[DayRequest],
    keep_outs: Sequence[DayKeepOut] = (),
    *,
    drive_rules: Sequence[DayDriveRule] = (),
    calibration: Calibration | None = None,
    report: Report | None = None,
) -> PreparedDay:
    """Return the planning problem of a day, its path network, and what had to be refused.

    Raises
    ------
    InvalidInputError
        If a request names an unknown target, instrument or request.
    NetworkError, TerrainError
        If the start or a keep-out is impossible on this terrain.
    """
    from planner.path_network import START, DriveRule, NetworkRequest, ObservationPoint, Pose, build_network
    from planner.path_network import KeepOut as NetworkKeepOut
    from planner.path_network import Target as NetworkTarget

    tell = report or (lambda _share, _what: None)
    by_id = {target.id: target for target in targets}
    check_requests(profile, by_id, requests)
    tell(0.0, "observation points")
    poses, refused = _observation_points(terrain, profile, limits.start, by_id, requests, keep_outs)
    tell(0.3, "path network")
    start = limits.start
    tracked = {r.target_id for r in requests if r.tracked}
    reachable = [t for t in targets if t.id in poses]
    network = build_network(
        NetworkRequest(
            start=Pose(start.east_m, start.north_m, start.heading_rad),
            targets=tuple(
                NetworkTarget(t.id, t.point_site[0], t.point_site[1], t.point_site[2], t.id in tracked)
                for t in reachable
            ),
            observation_points=tuple(
                ObservationPoint(f"{target}.{k + 1}", target, Pose(p.east_m, p.north_m, p.heading_rad))
                for target, stands in poses.items()
                for k, p in enumerate(stands)
            ),
            keep_outs=tuple(NetworkKeepOut(k.id, k.polygon_m) for k in keep_outs),
            terrain=network_heights(
                terrain,
                [(start.east_m, start.north_m), *((t.point_site[0], t.point_site[1]) for t in targets)],
            ),
            rover=rover_parameters(profile),
            calibration=calibration or calibration_of(profile),
            drive_rules=tuple(
                DriveRule(rule.from_target_id or START, rule.to_target_id, rule.via_m)
                for rule in drive_rules
                if {rule.from_target_id, rule.to_target_id} <= {None, *(t.id for t in reachable)}
            ),
        )
    )
    tell(0.8, "planning problem")
    best = network.best_points()
    unreachable = {point.target: point.reason for point in network.unreachable}
    for request in requests:
        if request.target_id in poses and request.target_id not in best:
            reason = unreachable.get(request.target_id, "no drive leads to its observation point")
            refused.append(Refusal(request.id, request.target_id, reason))
    stand = {target: _pose_of(network, point) for target, point in best.items()}
    gone = {refusal.request_id for refusal in refused}
    kept = [r for r in requests if r.id not in gone]
    problem = _problem(profile, limits, network, by_id, stand, best, kept)
    return PreparedDay(problem, network, stand, tuple(refused))


def check_requests(
    profile: RoverProfile, targets: Mapping[str, DayTarget], requests: Sequence[DayRequest]
) -> None:
    """Raise InvalidInputError if a request names what does not exist."""
    known = {request.id for request in requests}
    for request in requests:
        if request.target_id not in targets:
            raise InvalidInputError(f"observation request {request.id}: unknown target {request.target_id}")
        if request.instrument not in profile.instruments:
            names = ", ".join(sorted(profile.instruments))
            raise InvalidInputError(
                f"observation request {request.id}: rover {profile.name} has no instrument "
                f'"{request.instrument}"; it has {names}'
            )
        if profile.instrument(request.instrument).kind == "contact" and not request.tracked:
            raise InvalidInputError(
                f"observation request {request.id}: {request.instrument} is placed by the arm, so its target "
                "must be tracked"
            )
        for other in request.after:
            if other not in known:
                raise InvalidInputError(
                    f"observation request {request.id}: comes after the unknown request {other}"
                )


def rover_parameters(profile: RoverProfile) -> RoverParameters:
    """Return what the path network must know of a rover."""
    from planner.path_network import RoverParameters

    drive = profile.activity("navigate")
    return RoverParameters(
        speed_m_s=profile.mobility.speed_m_s,
        turn_rate_rad_s=profile.mobility.turn_rate_rad_s,
        drive_power_w=drive.per_m_j / drive.per_m_s if drive.per_m_s > 0 else profile.power.drive_w,
        hotel_w=profile.power.hotel_w,
        clearance_m=profile.body.width_m / 2,
        maximum_slope_rad=profile.mobility.max_slope_rad,
        maximum_step_m=profile.mobility.max_step_m,
        mass_kg=profile.body.mass_kg,
        track_overhead_s=profile.activity("track_overhead").fixed_s,
        mast_height_m=profile.mast.height_m,
    )


def calibration_of(profile: RoverProfile) -> Calibration:
    """Return the leg model of a rover profile; rates of lost tracks are published K9 and flight figures."""
    from planner.path_network import K9_CALIBRATION

    drive = profile.activity("navigate")
    return dataclasses.replace(
        K9_CALIBRATION,
        name=f"profile-{profile.name}-{profile.version}",
        source=(
            f"rover profile {profile.name} {profile.version}; rates of lost tracks: {K9_CALIBRATION.source}"
        ),
        fixed_s=drive.fixed_s,
        drive_factor=drive.per_m_s * profile.mobility.speed_m_s,
        duration_cv=drive.cv,
        energy_cv=drive.energy_cv,
    )


def stand_for(
    terrain: Terrain,
    profile: RoverProfile,
    start: StandPose,
    target: DayTarget,
    instrument: str,
    *,
    keep_outs: Sequence[DayKeepOut] = (),
    count: int = 4,
) -> list[StandPose]:
    """Return observation points of a target for an instrument, best first.

    Raises
    ------
    PlacementError
        If there is none; the message names the figures that stand in the way.
    """
    from rover_iface.frames import Pose
    from rover_iface.placement.base_placement import place_base

    found = place_base(
        terrain,
        profile,
        target.point_site,
        target.normal_site,
        target=target.name or target.id,
        instrument=instrument,
        start=Pose(start.east_m, start.north_m, 0.0, start.heading_rad),
        keep_out=[k.polygon_m for k in keep_outs],
        count=count,
    )
    return [StandPose(p.pose.x, p.pose.y, p.pose.heading) for p in found]


def _observation_points(
    terrain: Terrain,
    profile: RoverProfile,
    start: StandPose,
    targets: Mapping[str, DayTarget],
    requests: Sequence[DayRequest],
    keep_outs: Sequence[DayKeepOut],
) -> tuple[dict[str, list[StandPose]], list[Refusal]]:
    """Return candidate poses per target: those of the arm serve its remote observations too."""
    from rover_iface.errors import PlacementError

    poses: dict[str, list[StandPose]] = {}
    refused: list[Refusal] = []
    asked: dict[str, list[DayRequest]] = {}
    for request in requests:
        asked.setdefault(request.target_id, []).append(request)
    for target_id, group in asked.items():
        manual = [r.observation_point for r in group if r.observation_point is not None]
        if manual:
            poses[target_id] = manual[:1]
            continue
        contact = [r for r in group if profile.instrument(r.instrument).kind == "contact"]
        remote = [r for r in group if r not in contact]
        for choice in (contact, remote):
            if not choice or target_id in poses:
                continue
            instrument = choice[0].instrument
            try:
                poses[target_id] = stand_for(
                    terrain, profile, start, targets[target_id], instrument, keep_outs=keep_outs
                )
            except PlacementError as err:
                refused.extend(Refusal(r.id, target_id, str(err)) for r in choice)
    return poses, refused


def network_heights(terrain: Terrain, points: Sequence[tuple[float, float]]) -> HeightGrid:
    """Return the heights round points (east, north), as the path network takes them."""
    from planner.path_network import HeightGrid

    west, south, east, north = terrain.bounds
    margin = NETWORK_MARGIN_M
    window = (
        max(west, min(p[0] for p in points) - margin),
        max(south, min(p[1] for p in points) - margin),
        min(east, max(p[0] for p in points) + margin),
        min(north, max(p[1] for p in points) + margin),
    )
    grid = terrain.as_height_grid(max(NETWORK_POSTS_M, terrain.spacing), window)
    rows = grid.heights_m.shape[0]
    return HeightGrid(  # the planner's rows run from north to south, the terrain's from south to north
        origin_east_m=grid.west_m,
        origin_north_m=grid.south_m + (rows - 1) * grid.spacing_m,
        spacing_m=grid.spacing_m,
        heights_m=grid.heights_m[::-1],
    )


def _pose_of(network: PathNetwork, point: str) -> StandPose:
    pose = network.places[point]
    return StandPose(pose.east_m, pose.north_m, pose.heading_rad)


def _problem(
    profile: RoverProfile,
    limits: DayLimits,
    network: PathNetwork,
    targets: Mapping[str, DayTarget],
    stand: Mapping[str, StandPose],
    points: Mapping[str, str],
    requests: Sequence[DayRequest],
) -> dict[str, Any]:
    """Return the `problem/1` document; targets without a request left are not in it."""
    asked: dict[str, list[DayRequest]] = {}
    for request in requests:
        asked.setdefault(request.target_id, []).append(request)
    tracking = profile.activity("trackstart")
    kept = {request.id for request in requests}
    document: dict[str, Any] = {
        "format": "problem/1",
        "name": limits.name,
        "budget": {"time_s": limits.time_s, "energy_j": limits.energy_j},
        "hotel_w": profile.power.hotel_w,
        "overrun_penalty": limits.overrun_penalty,
        "track_start": {"time_s": tracking.fixed_s, "energy_j": tracking.fixed_j},
        "track_overhead_s_per_leg": network.track_overhead_s,
        "start": _pose_document(limits.start),
        "targets": [_target(profile, targets[t], stand[t], asked[t]) for t in asked],
        "legs": _legs(network, {t: points[t] for t in asked}),
        "precedence": [[a, r.id] for r in requests for a in r.after if a in kept],
        "refs": dict(limits.refs),
    }
    if limits.data_mbit is not None:
        document["budget"]["data_mbit"] = limits.data_mbit
    if limits.max_overrun_probability is not None:
        document["max_overrun_probability"] = limits.max_overrun_probability
    return document


def _pose_document(pose: StandPose) -> dict[str, float]:
    return {
        "east_m": round(pose.east_m, 4),
        "north_m": round(pose.north_m, 4),
        "heading_rad": round(pose.heading_rad, 5),
    }


def _target(
    profile: RoverProfile, target: DayTarget, stand: StandPose, requests: Sequence[DayRequest]
) -> dict[str, Any]:
    return {
        "id": target.id,
        "point_m": [round(v, 4) for v in target.point_site],
        "observation_point": _pose_document(stand),
        "refs": {"target": target.id, "name": target.name},
        "observations": [_observation(profile, request) for request in requests],
    }


def _observation(profile: RoverProfile, request: DayRequest) -> dict[str, Any]:
    instrument = profile.instrument(request.instrument)
    dwell_s = request.dwell_s or 0.0
    document: dict[str, Any] = {
        "id": request.id,
        "instrument": request.instrument,
        "kind": "place" if instrument.kind == "contact" else "image",
        "utility": request.value,
        "p_success": instrument.p_success,
        "observe": {
            "time_s": {"mean": instrument.time_s.mean + dwell_s, "sd": instrument.time_s.sd},
            "energy_j": {"mean": instrument.energy_j.mean, "sd": instrument.energy_j.sd},
        },
        "must_do": request.must_do,
        "data_mbit": instrument.volume_mb * 8.0,
        "tracked": request.tracked and instrument.kind != "contact",
        "refs": {"request": request.id},
    }
    if request.window_s is not None:
        document["window_s"] = list(request.window_s)
    return document


def _legs(network: PathNetwork, points: Mapping[str, str]) -> list[dict[str, Any]]:
    """Return the drives between the places of the problem; a target stands for its observation point."""
    target_of = {point: target for target, point in points.items()}
    legs = []
    for route in network.routes:
        origin = "start" if route.origin == "start" else target_of.get(route.origin)
        destination = target_of.get(route.destination)
        if origin is None or destination is None or origin == destination:
            continue
        legs.append(
            {
                "from": origin,
                "to": destination,
                "length_m": round(route.length_m, 3),
                "time_s": {"mean": round(route.duration_mean_s, 3), "sd": round(route.duration_sd_s, 3)},
                "energy_j": {"mean": round(route.energy_mean_j, 1), "sd": round(route.energy_sd_j, 1)},
                "p_lose": {t: round(p, 6) for t, p in route.p_lose.items() if t in points},
                "route": [[round(x, 3), round(y, 3)] for x, y in route.points],
            }
        )
    return legs
