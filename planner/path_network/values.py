"""What goes into the path network and what comes out, as frozen values.

Positions are metres in the site frame (east, north, up). Headings are radians from east,
counter-clockwise (REP 103: x east, y north).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from mission import KeepOut, Pose, TerrainGrid
from planner.errors import NetworkError
from planner.path_network.calibration import K9_CALIBRATION, Calibration
from planner.path_network.day_factor import SharedFactor

START = "start"

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
Point = tuple[float, float]


def _require(holds: bool, owner: object, name: str, rule: str) -> None:
    if not holds:
        raise NetworkError(f"{type(owner).__name__}.{name} is {getattr(owner, name)!r}; it {rule}")


@dataclass(frozen=True, slots=True)
class Target:
    """A point on a rock.

    Parameters
    ----------
    id, east_m, north_m
        Name and place in the site frame.
    height_m
        Height of the point in the frame of the height grid; `None` takes the grid's height there.
    tracked
        Whether an observation of it needs its track alive.
    first_seen
        Place from which the rover first imaged it; `None` means the start pose.
    """

    id: str
    east_m: float
    north_m: float
    height_m: float | None = None
    tracked: bool = True
    first_seen: Point | None = None


@dataclass(frozen=True, slots=True)
class ObservationPoint:
    """A candidate pose from which `target` can be observed; a target may have several."""

    id: str
    target: str
    pose: Pose


@dataclass(frozen=True, slots=True)
class DriveRule:
    """What people say of the drive between two places, in both directions.

    Parameters
    ----------
    first, second
        `"start"` or a target: the rule holds for each of its observation points.
    via
        Corners of the way from `first` to `second` that the rover has to take, metres; none is a straight
        line. `None` takes the drive out.
    """

    first: str
    second: str
    via: tuple[Point, ...] | None = None


@dataclass(frozen=True, slots=True)
class RoverParameters:
    """What the path network must know of a rover; defaults are K9's (Pedersen et al. 2005).

    Parameters
    ----------
    speed_m_s
        Speed while the wheels turn (K9: about 6 cm/s).
    turn_rate_rad_s
        Rate of a turn in place.
    drive_power_w
        Mean power during a drive **above** the hotel load. K9's `navigate` used 174345 J in 1457 s, of
        which 38 W x 1457 s is hotel load; the rest is 81.7 W.
    hotel_w
        Load that goes on whatever the rover does; not part of any energy in the network.
    clearance_m
        Distance the rover's centre keeps from keep-outs and hazards.
    maximum_slope_rad, maximum_step_m
        Ground steeper than this, or with a step higher than this, is a hazard.
    mass_kg, gravity_m_s2, climb_efficiency
        For the energy of climbing.
    track_overhead_s
        Time per leg and tracked target; handed through to the planner, not part of any duration here.
    cone_half_angle_rad
        Half angle of the tracking region.
    mast_height_m
        Height of the tracking camera over the ground, for occlusion.
    """

    speed_m_s: float = 0.06
    turn_rate_rad_s: float = 0.1
    drive_power_w: float = 81.7
    hotel_w: float = 38.0
    clearance_m: float = 0.6
    maximum_slope_rad: float = math.radians(20.0)
    maximum_step_m: float = 0.25
    mass_kg: float = 70.0
    gravity_m_s2: float = 3.71
    climb_efficiency: float = 0.3
    track_overhead_s: float = 45.0
    cone_half_angle_rad: float = math.radians(20.0)
    mast_height_m: float = 1.5

    def __post_init__(self) -> None:
        for name in ("speed_m_s", "turn_rate_rad_s", "climb_efficiency", "maximum_step_m"):
            _require(
                getattr(self, name) > 0 and math.isfinite(getattr(self, name)), self, name, "must be > 0"
            )
        for name in (
            "drive_power_w",
            "hotel_w",
            "clearance_m",
            "mass_kg",
            "gravity_m_s2",
            "track_overhead_s",
            "mast_height_m",
        ):
            _require(
                getattr(self, name) >= 0 and math.isfinite(getattr(self, name)), self, name, "must be >= 0"
            )
        _require(0 < self.maximum_slope_rad < math.pi / 2, self, "maximum_slope_rad", "must lie in (0, pi/2)")
        _require(0 < self.cone_half_angle_rad <= math.pi, self, "cone_half_angle_rad", "must lie in (0, pi]")


@dataclass(frozen=True, slots=True)
class NetworkOptions:
    """How the network is thinned and how finely it is computed.

    Parameters
    ----------
    stretch
        A segment is redundant when kept segments join its ends at a length of at most
        `1 + stretch` times its own. 0 keeps every shortest route.
    maximum_loss
        A drive whose chance to lose the track it is made for exceeds this is taken out.
    sample_m
        Spacing of the samples along segments for tracking, slope and climb.
    terrain_cell_m
        Smallest cell on which slopes and steps are judged.
    maximum_corners
        With more corners than this, outlines are simplified outward.
    outward_m
        How far outlines are simplified outward then, at most.
    all_pairs
        With more corners than this after that, only near pairs of them are looked at.
    unknown_is_hazard
        Whether cells without height may not be driven on.
    """

    stretch: float = 0.015
    """A drive may be 3 % longer than the shortest on a fine grid; margins take some of that."""
    maximum_loss: float = 0.9
    sample_m: float = 0.25
    terrain_cell_m: float = 0.25
    maximum_corners: int = 1_000
    outward_m: float = 0.02
    """By hand: margins of up to 0.70 m make drives a few tenths of a per cent longer. Where they would close
    a gap they are not used.
    """
    all_pairs: int = 12_000
    """By hand: all pairs of so many take a second. Near ones led up to 9 % farther in maps of 60 m."""
    unknown_is_hazard: bool = True

    def __post_init__(self) -> None:
        _require(0 <= self.stretch <= 1, self, "stretch", "must lie in [0, 1]")
        _require(0 < self.maximum_loss <= 1, self, "maximum_loss", "must lie in (0, 1]")
        _require(self.sample_m > 0, self, "sample_m", "must be > 0")
        _require(self.terrain_cell_m > 0, self, "terrain_cell_m", "must be > 0")
        _require(0 < self.outward_m <= 1, self, "outward_m", "must lie in (0, 1]")
        for name in ("maximum_corners", "all_pairs"):
            _require(getattr(self, name) >= 8, self, name, "must be >= 8")


@dataclass(frozen=True, slots=True)
class NetworkRequest:
    """All that `build_network` needs.

    `bounds_m` is (west, south, east, north) of the map; `None` takes the height grid's edges, or no limit
    without a grid.
    """

    start: Pose
    targets: tuple[Target, ...]
    observation_points: tuple[ObservationPoint, ...]
    keep_outs: tuple[KeepOut, ...] = ()
    terrain: TerrainGrid | None = None
    bounds_m: tuple[float, float, float, float] | None = None
    rover: RoverParameters = RoverParameters()
    calibration: Calibration = K9_CALIBRATION
    options: NetworkOptions = NetworkOptions()
    drive_rules: tuple[DriveRule, ...] = ()

    @property
    def track_overhead_s(self) -> float:
        """Return what a drive takes longer for each tracked target, s: as learned, else the rover's."""
        learned = self.calibration.track_s
        return self.rover.track_overhead_s if learned is None else learned


@dataclass(frozen=True, slots=True)
class Route:
    """One drive between two places.

    Parameters
    ----------
    origin, destination
        Place ids: `"start"` or an observation point's.
    points
        The polyline, from the origin's position to the destination's.
    length_m, turn_rad, climb_m
        Length; sum of all turns in place from the origin's heading to the destination's; sum of all rises.
    duration_mean_s, duration_sd_s
        Of the drive, without overhead for tracked targets.
    energy_mean_j, energy_sd_j
        Drive energy, without the hotel load.
    p_lose
        Target id -> chance that its track is lost on the way, for every tracked target.
    p_fail
        Chance that the drive ends short of its destination.
    segments
        Indices into `PathNetwork.segments`, in driving order.
    """

    origin: str
    destination: str
    points: tuple[Point, ...]
    length_m: float
    turn_rad: float
    climb_m: float
    duration_mean_s: float
    duration_sd_s: float
    energy_mean_j: float
    energy_sd_j: float
    p_lose: Mapping[str, float]
    segments: tuple[int, ...]
    p_fail: float = 0.0


@dataclass(frozen=True, slots=True)
class MissingRoute:
    """A pair of places that has no drive, and why."""

    origin: str
    destination: str
    reason: str


@dataclass(frozen=True, slots=True)
class UnreachablePoint:
    """An observation point that no drive from the start reaches, and why."""

    id: str
    target: str
    reason: str


@dataclass(frozen=True, slots=True)
class Segment:
    """A straight piece of the network, for drawing: ends, and per tracked target the chance of loss on it."""

    a: Point
    b: Point
    length_m: float
    p_lose: Mapping[str, float]
    routes: int

    @property
    def worst_loss(self) -> float:
        """The largest chance of loss over the tracked targets."""
        return max(self.p_lose.values(), default=0.0)


@dataclass(frozen=True, slots=True)
class TrackingRegion:
    """The cone in which a target is tracked well: apex at it, open towards where it was first seen."""

    target: str
    apex: Point
    axis_rad: float
    half_angle_rad: float
    range_m: float
    polygon: tuple[Point, ...]


@dataclass(frozen=True)
class PathNetwork:
    """Every drive the planner may use, and what the map shows of it.

    Parameters
    ----------
    places
        Place id -> pose; `"start"` first.
    routes
        One for each ordered pair that can be driven.
    missing
        The other pairs with their reasons.
    unreachable
        Observation points that cannot be driven to from the start.
    segments, regions, hazards, margins
        Drawing data: straight pieces, tracking cones, hazards found in the heights, and keep-outs and
        hazards with the clearance around them (outlines; holes follow their outline).
    shortest_m
        Length of the shortest route of each pair in `routes`, before consolidation.
    notes
        What a reader should know, one sentence each.
    target_of
        Observation point -> target.
    sol_kinds
        Kinds of sols by what the drives of a day have in common; empty where days are alike.
    """

    places: Mapping[str, Pose]
    routes: tuple[Route, ...]
    missing: tuple[MissingRoute, ...]
    unreachable: tuple[UnreachablePoint, ...]
    segments: tuple[Segment, ...]
    regions: tuple[TrackingRegion, ...]
    hazards: tuple[tuple[Point, ...], ...] = ()
    margins: tuple[tuple[Point, ...], ...] = ()
    shortest_m: Mapping[tuple[str, str], float] = field(default_factory=dict)
    track_overhead_s: float = 0.0
    hotel_w: float = 0.0
    notes: tuple[str, ...] = ()
    target_of: Mapping[str, str] = field(default_factory=dict, repr=False)
    sol_kinds: tuple[SharedFactor, ...] = ()

    @cached_property
    def _index(self) -> dict[tuple[str, str], Route]:
        return {(r.origin, r.destination): r for r in self.routes}

    def route(self, origin: str, destination: str) -> Route | None:
        """Return the drive between two places, or None where there is none."""
        return self._index.get((origin, destination))

    def best_points(self) -> dict[str, str]:
        """Return for each target the observation point that is quickest to get to from the start.

        Time is divided by the chance to keep the target's own track, so that a longer way that keeps the
        track wins over a short one that loses it. Targets without a reachable point are absent.
        """
        best: dict[str, tuple[float, str]] = {}
        for point, target in self.target_of.items():
            drive = self.route(START, point)
            if drive is None:
                continue
            keep = 1.0 - drive.p_lose.get(target, 0.0)
            score = (drive.duration_mean_s / max(keep, 1e-3), point)
            if target not in best or score < best[target]:
                best[target] = score
        return {target: point for target, (_, point) in best.items()}
