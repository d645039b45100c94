"""Make a day ready to plan: where the rover stands for each target, the path network, the planning problem.

This is the one module that joins the planner and the rover: the rover's room finds stands and samples the
terrain, the network and the problem are the planner's.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from ground.errors import InvalidInputError
from mission import Amount, Day, KeepOut, Pose, Request, Target, TerrainGrid

if TYPE_CHECKING:
    from planner.day_problem import Refusal, RoverCosts
    from planner.path_network import Calibration, PathNetwork, RoverParameters
    from planner.problem import Problem
    from rover_iface.placement.base_placement import ObservationPoint
    from rover_iface.profile import RoverProfile
    from rover_iface.terrain import Terrain

NETWORK_POSTS_M = 0.25
"""Spacing of the heights that the path network is given; finer than a wheel is of no use to it."""

NETWORK_MARGIN_M = 15.0
"""How far beyond start and targets the path network may look for a route round an obstacle."""


@dataclass(frozen=True)
class PreparedDay:
    """A day made ready to plan; `observation_points` holds where the rover stands for each target."""

    problem: Problem
    network: PathNetwork
    observation_points: Mapping[str, Pose]
    refused: tuple[Refusal, ...]


Report = Callable[[float, str], None]
"""Told the share that is done, and what is being done."""


def prepare_day(
    terrain: Terrain,
    profile: RoverProfile,
    day: Day,
    *,
    calibration: Calibration | None = None,
    report: Report | None = None,
) -> PreparedDay:
    """Return the planning problem of a day, its path network, and what had to be refused.

    Raises
    ------
    InvalidInputError
        If a request asks of the rover what it cannot do.
    NetworkError, TerrainError
        If the start or a keep-out is impossible on this terrain.
    """
    from planner.day_problem import network_request_of, problem_of
    from planner.path_network import build_network

    tell = report or (lambda _share, _what: None)
    day = named_as_in(profile, day)
    check_requests(profile, day)
    tell(0.0, "observation points")
    poses, refused = _observation_points(terrain, profile, day)
    tell(0.3, "path network")
    places = [(day.start.east_m, day.start.north_m), *(t.point_site[:2] for t in day.targets)]
    heights = network_heights(terrain, places)
    model = calibration or calibration_of(profile)
    network = build_network(network_request_of(day, poses, heights, rover_parameters(profile), model))
    tell(0.8, "planning problem")
    found = problem_of(day, network, rover_costs(profile, model))
    return PreparedDay(found.problem, network, found.observation_points, (*refused, *found.refused))


def named_as_in(profile: RoverProfile, day: Day) -> Day:
    """Return a day whose requests call instruments as the profile does.

    Raises
    ------
    InvalidInputError
        If a request names one that the rover does not carry.
    """
    from rover_iface.errors import ProfileError

    requests = []
    for request in day.requests:
        try:
            requests.append(replace(request, instrument=profile.instrument_key(request.instrument)))
        except ProfileError as err:
            raise InvalidInputError(f"observation request {request.id}: {err}") from err
    return replace(day, requests=tuple(requests))


def check_requests(profile: RoverProfile, day: Day) -> None:
    """Raise InvalidInputError if a request asks of the rover what it cannot do."""
    for request in day.requests:
        instrument = profile.instrument(request.instrument)
        if instrument.tracks and not request.tracked:
            why = "is placed by the arm" if instrument.contact else "looks at a tracked target alone"
            raise InvalidInputError(
                f"observation request {request.id}: {request.instrument} {why}, so its target must be tracked"
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


def rover_costs(profile: RoverProfile, learned: Calibration) -> RoverCosts:
    """Return what a rover spends beside its drives, and its odds there: as learned, else the profile's."""
    from planner.day_problem import RoverCosts
    from planner.path_network import TRACK_START

    instruments = dict(profile.instruments)
    for name, instrument in profile.instruments.items():
        seen = learned.activity(name)
        if seen is not None:
            instruments[name] = replace(
                instrument,
                p_success=seen.p_success,
                time_s=Amount(seen.time_mean_s, seen.time_sd_s),
                energy_j=Amount(seen.energy_mean_j, seen.energy_sd_j),
            )
    together = {one.name: round(one.expected_correlation, 6) for one in learned.activities if one.days}
    begins = learned.activity(TRACK_START)
    if begins is None:
        tracking = profile.activity("trackstart")
        return RoverCosts(instruments, tracking.fixed_s, tracking.fixed_j, intraday_correlation=together)
    return RoverCosts(instruments, begins.time_mean_s, begins.energy_mean_j, 1.0 - begins.p_success, together)


def calibration_of(profile: RoverProfile) -> Calibration:
    """Return the leg model of a rover profile as the path network takes it."""
    from planner.path_network import Calibration

    drive, legs = profile.activity("navigate"), profile.leg_model
    return Calibration(
        name=f"profile-{profile.name}-{profile.version}",
        source=f"rover profile {profile.name} {profile.version}; rates of lost tracks: {legs.source}",
        fixed_s=drive.fixed_s,
        drive_factor=drive.per_m_s * profile.mobility.speed_m_s,
        turn_factor=legs.turn_factor,
        slope_gain=legs.slope_gain,
        duration_cv=drive.cv,
        energy_factor=legs.energy_factor,
        energy_cv=drive.energy_cv,
        inside_per_m=legs.inside_per_m,
        outside_per_m=legs.outside_per_m,
        occluded_per_m=legs.occluded_per_m,
        angle_gain_per_rad=legs.angle_gain_per_rad,
    )


def stands_of(
    terrain: Terrain,
    profile: RoverProfile,
    start: Pose,
    target: Target,
    instrument: str,
    *,
    keep_outs: Sequence[KeepOut] = (),
    count: int = 4,
) -> list[ObservationPoint]:
    """Return observation points of a target for an instrument, best first.

    Raises
    ------
    PlacementError
        If there is none; the message names the figures that stand in the way.
    """
    from rover_iface.frames import Pose as Pose3
    from rover_iface.placement.base_placement import place_base

    return place_base(
        terrain,
        profile,
        target.point_site,
        target.normal_site,
        target=target.name or target.id,
        instrument=instrument,
        start=Pose3(start.east_m, start.north_m, 0.0, start.heading_rad),
        keep_out=[k.polygon_m for k in keep_outs],
        count=count,
    )


def stand_for(
    terrain: Terrain,
    profile: RoverProfile,
    start: Pose,
    target: Target,
    instrument: str,
    *,
    keep_outs: Sequence[KeepOut] = (),
    count: int = 4,
) -> list[Pose]:
    """Return where the rover may stand for a target, best first; see `stands_of`."""
    found = stands_of(terrain, profile, start, target, instrument, keep_outs=keep_outs, count=count)
    return [Pose(p.pose.x, p.pose.y, p.pose.heading) for p in found]


def _observation_points(
    terrain: Terrain, profile: RoverProfile, day: Day
) -> tuple[dict[str, list[Pose]], list[Refusal]]:
    """Return candidate poses per target: those of the arm serve its remote observations too."""
    from planner.day_problem import Refusal
    from rover_iface.errors import PlacementError

    poses: dict[str, list[Pose]] = {}
    refused: list[Refusal] = []
    asked: dict[str, list[Request]] = {}
    for request in day.requests:
        asked.setdefault(request.target_id, []).append(request)
    for target_id, group in asked.items():
        manual = [r.observation_point for r in group if r.observation_point is not None]
        if manual:
            poses[target_id] = manual[:1]
            continue
        contact = [r for r in group if profile.instrument(r.instrument).contact]
        remote = [r for r in group if r not in contact]
        target = day.target(target_id)
        for choice in (contact, remote):
            if not choice or target_id in poses:
                continue
            instrument = choice[0].instrument
            try:
                poses[target_id] = stand_for(
                    terrain, profile, day.start, target, instrument, keep_outs=day.keep_outs
                )
            except PlacementError as err:
                refused.extend(Refusal(r.id, target_id, str(err)) for r in choice)
    return poses, refused


def network_heights(terrain: Terrain, points: Sequence[tuple[float, float]]) -> TerrainGrid:
    """Return the heights round points (east, north), as the path network takes them."""
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
    return TerrainGrid(  # the planner's rows run from north to south, the terrain's from south to north
        origin_east_m=grid.west_m,
        origin_north_m=grid.south_m + (rows - 1) * grid.spacing_m,
        spacing_m=grid.spacing_m,
        heights_m=grid.heights_m[::-1],
    )
