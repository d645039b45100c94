"""The stop-and-go navigator: look, map, choose an arc, drive it, look again.

After section 5 of the single-cycle instrument placement paper (Morphin and GESTALT before it): at each stop
four
stereo pairs become a grid of local planes; cells are judged by residual, tilt and step; the cost of a cell
joins
that with the way to the goal over the cumulative map; the arc of least cost is driven. Three things are
added: the way to the goal is worked out over the whole map (so that the rover leaves dead ends), turns in
place are candidates, and each look is registered to the map before it is merged (`registration.py`), so that
a rock stays where it was seen while dead reckoning drifts.

Two frames are kept apart: the *believed* one of dead reckoning, and the *map's*, which is the same at the
first look. `where` and `on_map` lead from one to the other.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rover_iface.errors import RoverError
from rover_iface.frames import Pose, Transform, wrap_angle
from rover_iface.navigation.footing import FootingLimits, free_lengths
from rover_iface.navigation.hazard_map import HazardMap, MapParameters
from rover_iface.navigation.kernels import cost_to_go, obstacle_distance, try_ways
from rover_iface.navigation.registration import Correction
from rover_iface.profile import RoverProfile

Array = NDArray[np.floating]

KEEP_OFF_M = 0.1
"""How far round a target whose place is to be kept off the ground is closed: a cell, and less than what lies
between the rover's nose and a target at its arm's least reach."""
CLOSED = 2.0
"""Hazard of such ground: what no wheel climbs, however low it is."""


@dataclass(frozen=True, slots=True)
class NavigatorParameters:
    """How arcs are chosen. Margins in metres round the rover's outline; costs are in metres of way.

    `drift_share` and `drift_floor_m` give a standard deviation of dead reckoning between two looks. A way
    that ends before an obstacle is cut short by `short_share` of its length and `short_m`, for wheels that
    slide.
    """

    curvatures: int = 15
    turns_deg: tuple[float, ...] = (15, 30, 50, 75, 105, 140, 180)
    margin_m: float = 0.13
    least_margin_m: float = 0.07
    lookahead: float = 1.6
    unknown_cost: float = 0.35
    hazard_cost: float = 1.6
    turn_cost_m: float = 0.22
    curve_cost: float = 0.08
    coarse_m: float = 0.2
    patience: int = 5
    drift_share: float = 0.08
    drift_floor_m: float = 0.01
    short_share: float = 0.15
    short_m: float = 0.03
    footing: FootingLimits = field(default_factory=FootingLimits)

    def __post_init__(self) -> None:
        if not 0 <= self.least_margin_m <= self.margin_m:
            raise RoverError(
                f"margins are {self.least_margin_m} and {self.margin_m} m; the least must not be the larger"
            )


@dataclass(frozen=True, slots=True)
class Way:
    """What to drive next: turn in place, then an arc (backwards if the length is negative)."""

    turn_rad: float
    curvature_1_m: float
    length_m: float


@dataclass(frozen=True, slots=True, eq=False)
class SeenWay:
    """A way as the looks from both its ends tell it.

    Attributes
    ----------
    began
        Where dead reckoning had the rover at the first look.
    ended
        Where it stood at the second, in the believed frame as that was at the first.
    covariance
        (4, 4) of that place, m, and heading, rad, relative to where it began.
    """

    began: Pose
    ended: Pose
    covariance: NDArray[np.float64]


@dataclass
class Progress:
    """Tells when a drive is as near its goal as the ground allows.

    Far from the goal a way round may lead away from it for long, so only within `near_m` of it do `patience`
    looks without a gain of 10 cm end a drive; farther off it takes `far_patience` and `looks_per_m` more for
    each metre that was left at best, without which a rover shut in by rocks wanders until it has used up its
    looks. `waited` counts the looks since the last gain.
    """

    near_m: float
    patience: int = 6
    far_patience: int = 150
    looks_per_m: float = 0.0
    nearest_m: float = math.inf
    waited: int = 0

    def stalled(self, left_m: float) -> bool:
        """Return whether this look, `left_m` from the goal, is one too many."""
        if left_m < self.nearest_m - 0.1:
            self.nearest_m, self.waited = left_m, 0
            return False
        self.waited += 1
        far_patience = self.far_patience + self.looks_per_m * self.nearest_m
        return self.waited >= (self.patience if left_m <= self.near_m else far_patience)


@dataclass
class Navigator:
    """Chooses ways to a goal from what has been mapped. One for a drive; the map may outlive it.

    Parameters
    ----------
    step_m
        Longest way between two looks; a tracker may ask for less.
    ignore
        Circle (x, y, radius) whose obstacles may be come near to: the tracked target's own rock.
    keep_off
        Places (x, y) of the map that the rover drives round however low they are: targets still to be
        measured. It may leave one that it stands on.
    way
        What the rover came since the look before the last; None where the last did not fit the map.
    """

    profile: RoverProfile
    map: HazardMap
    parameters: NavigatorParameters = field(default_factory=NavigatorParameters)
    step_m: float | None = None
    ignore: tuple[float, float, float] = (0.0, 0.0, -1.0)
    keep_off: Sequence[tuple[float, float]] = ()
    correction: Correction = field(default_factory=Correction)
    sigma_m: float = 0.0
    way: SeenWay | None = None
    _map_from_believed: Transform = field(default_factory=Transform.identity)
    _believed: Pose | None = None
    _stuck: int = 0
    _last_turn: float = 0.0

    @staticmethod
    def fresh(
        profile: RoverProfile,
        start: tuple[float, float],
        goal: tuple[float, float],
        *,
        map_parameters: MapParameters | None = None,
    ) -> Navigator:
        """Return a navigator with an empty map that holds start and goal with room to go round."""
        centre = ((start[0] + goal[0]) / 2, (start[1] + goal[1]) / 2)
        size = math.hypot(goal[0] - start[0], goal[1] - start[1]) + 16.0
        return Navigator(profile, HazardMap(profile, centre, size, map_parameters))

    def look(self, clouds: list[Array], eye: Array, believed: Pose) -> int:
        """Merge clouds [n, 3] seen from `eye` [3], both in the rover frame, m; return the points used.

        `believed` is where dead reckoning puts the rover. The look is fitted to the map first; `correction`
        says how well that went, `sigma_m` how sure the rover's place on the map is now.
        """
        p = self.parameters
        way = 0.0
        began, stood = self._believed, None
        if began is not None:
            way = math.hypot(believed.x - began.x, believed.y - began.y)
            stood = self._map_from_believed * began.site_from_rover
        self._believed, self.way = believed, None
        if self.map.updates:
            self.sigma_m = math.hypot(self.sigma_m, p.drift_floor_m + p.drift_share * way)
        seen_from = self._map_from_believed * believed.site_from_rover
        at = seen_from.translation
        correction = self.map.fit(
            [seen_from.apply(c) for c in clouds],
            seen_from.apply(eye),
            (float(at[0]), float(at[1])),
            self.sigma_m,
        )
        self.correction = correction
        if correction.made:
            self.sigma_m = correction.sigma_m
            alone = _moved(seen_from, correction.alone)
            shift = at + np.array([correction.east_m, correction.north_m, correction.rise_m])
            lean = Transform.from_rpy(
                correction.tilt_north_rad, -correction.tilt_east_rad, correction.turn_rad
            )
            back = Transform(np.eye(3), -at)
            seen_from = Transform(np.eye(3), shift) * lean * back * seen_from
            # Attitude comes from the inertial sensor anew at each stop: only its turn is carried on.
            turn = Transform.from_rpy(0.0, 0.0, correction.turn_rad)
            self._map_from_believed = Transform(np.eye(3), shift) * turn * back * self._map_from_believed
            if began is not None and stood is not None:
                # what its place on the map was off before is in the ground that the look was fitted to
                ended = Pose.from_transform(began.site_from_rover * stood.inverse() * alone)
                back = Transform.from_rpy(0.0, 0.0, began.heading - Pose.from_transform(stood).heading)
                self.way = SeenWay(began, ended, _turned(correction.alone_covariance, back))
        return self.map.update([seen_from.apply(c) for c in clouds], seen_from.apply(eye))

    @property
    def looked_from(self) -> Pose | None:
        """Return where dead reckoning had the rover at the last look; None before the first."""
        return self._believed

    def where(self, believed: Pose) -> Pose:
        """Return a pose of dead reckoning as it lies on the map."""
        return Pose.from_transform(self._map_from_believed * believed.site_from_rover)

    def on_map(self, x: float, y: float) -> tuple[float, float]:
        """Return a place of the believed site frame, m, as it lies on the map, as seen by the rover."""
        moved = self._map_from_believed.apply(np.array([x, y, 0.0]))
        return float(moved[0]), float(moved[1])

    def choose(self, pose: Pose, goal: tuple[float, float]) -> Way | None:
        """Return the way to drive next from a pose on the map to a goal on it, or None if none is safe."""
        p = self.parameters
        hazard = self._closed()
        field_ = self._cost_field(hazard, goal)
        step = self.step_m if self.step_m is not None else self.profile.mobility.step_m
        left = math.hypot(goal[0] - pose.x, goal[1] - pose.y)
        step = min(step, max(left, 0.05))
        candidates = self._candidates(step * p.lookahead, pose, goal)
        body = self.profile.body
        drift = min(0.15, 2.0 * self.sigma_m)
        stands = np.minimum(self._footing(pose, candidates), self._clear(hazard, pose, candidates))
        for margin in (p.margin_m, (p.margin_m + p.least_margin_m) / 2, p.least_margin_m):
            seen = try_ways(
                hazard,
                self.map.west,
                self.map.south,
                self.map.cell,
                pose.x,
                pose.y,
                pose.heading,
                candidates,
                body.length_m / 2,
                body.width_m / 2,
                margin + drift,
                p.unknown_cost,
                *self.ignore,
            )
            seen[:, 0] = np.maximum(seen[:, 0], stands)
            way = self._best(pose, goal, step, candidates, seen, field_)
            if way is not None:
                self._stuck = 0
                self._last_turn = way.turn_rad
                return way
        self._stuck += 1
        return None

    def look_aside(self, pose: Pose) -> Way | None:
        """Return a turn in place from a pose on the map for when no way is safe; None where none is either.

        To the left and right in turn, ever farther; the other way round where that would touch something.
        """
        turn = math.radians(40.0) * (1 if self._stuck % 2 else -1) * self._stuck
        turns = np.array([[share * turn, 0.0, 0.0] for share in (1.0, -1.0, 0.5, -0.5)])
        stands = self._footing(pose, turns)
        return next((Way(*w) for w, well in zip(turns.tolist(), stands, strict=True) if well >= 0.0), None)

    @property
    def given_up(self) -> bool:
        """Return whether so many looks in a row showed no way that it is time to give up."""
        return self._stuck >= self.parameters.patience

    def closed(self, pose: Pose) -> bool:
        """Return whether a rover at a pose on the map would stand on an obstacle other than its own rock."""
        grid, body = self.map, self.profile.body
        x, y, radius = self.ignore
        rows, columns = np.nonzero((grid.hazard >= 1.0) & (grid.away(x, y) > radius))
        off = grid.west + columns * grid.cell - pose.x + 1j * (grid.south + rows * grid.cell - pose.y)
        off = off * np.exp(-1j * pose.heading)
        under = (np.abs(off.real) <= body.length_m / 2) & (np.abs(off.imag) <= body.width_m / 2)
        return bool(under.any())

    def _closed(self) -> Array:
        """Return the hazard of the map [rows, columns] with the places to keep off closed."""
        grid = self.map
        if not self.keep_off:
            return grid.hazard
        hazard = grid.hazard.copy()
        for x, y in self.keep_off:
            hazard[grid.away(x, y) <= KEEP_OFF_M] = CLOSED
        return hazard

    def _clear(self, hazard: Array, pose: Pose, ways: Array) -> Array:
        """Return how far [n], m, the outline keeps clear of what no wheel climbs and of the own rock."""
        grid, body = self.map, self.profile.body
        x, y, radius = self.ignore
        own = grid.away(x, y) <= radius
        climbed = np.nan_to_num(hazard) * np.where(own, 1.0, grid.parameters.step_share)
        half = body.length_m / 2, body.width_m / 2
        at = grid.west, grid.south, grid.cell, pose.x, pose.y, pose.heading
        return try_ways(climbed, *at, ways, *half, self.parameters.least_margin_m, 0.0, *self.ignore)[:, 0]

    def _footing(self, pose: Pose, ways: Array) -> Array:
        body = self.profile.body
        half_m = float(np.abs(ways[:, 2]).max()) + math.hypot(body.length_m, body.width_m)
        ground = self.map.ground(pose.x, pose.y, half_m)
        return free_lengths(ground, self.profile, pose, ways, self.parameters.footing)

    def _candidates(self, length: float, pose: Pose, goal: tuple[float, float]) -> Array:
        p = self.parameters
        sharp = 1.0 / self.profile.mobility.min_arc_radius_m
        curvature = np.linspace(-sharp, sharp, p.curvatures)
        arcs = np.column_stack([np.zeros_like(curvature), curvature, np.full_like(curvature, length)])
        turns = np.radians(np.array(p.turns_deg))
        direct = wrap_angle(math.atan2(goal[1] - pose.y, goal[0] - pose.x) - pose.heading)
        turns = np.concatenate([turns, -turns, [direct]])
        straight = np.column_stack([turns, np.zeros_like(turns), np.full_like(turns, length)])
        back = np.array(
            [[0.0, 0.0, -0.6 * length], [0.0, 0.5 * sharp, -0.6 * length], [0.0, -0.5 * sharp, -0.6 * length]]
        )
        return np.concatenate([arcs, straight, back])

    def _best(
        self, pose: Pose, goal: tuple[float, float], step: float, ways: Array, seen: Array, field_: Array
    ) -> Way | None:
        p = self.parameters
        best, best_cost = None, math.inf
        for (turn, curvature, length), (free, hazard, _, _, _, _) in zip(
            ways.tolist(), seen.tolist(), strict=True
        ):
            wanted = min(step, abs(length))
            usable = min(wanted, free)
            if free < abs(length):
                usable = min(wanted, free * (1.0 - p.short_share) - p.short_m)
            if usable < min(0.6 * wanted, 0.3) or usable < 0.02:
                continue
            x, y, heading = end_of(pose, turn, curvature, math.copysign(usable, length))
            togo = self._togo(field_, x, y)
            if not math.isfinite(togo):
                continue
            facing = abs(wrap_angle(math.atan2(goal[1] - y, goal[0] - x) - heading))
            near = math.hypot(goal[0] - x, goal[1] - y)
            cost = togo + p.hazard_cost * hazard * abs(length)
            cost += p.turn_cost_m * min(1.0, abs(turn) / 1.5) + (0.08 if turn else 0.0)
            cost += p.curve_cost * abs(curvature) * abs(length)
            cost += 0.06 * facing * min(1.0, near)
            # A way that ends against an obstacle soon is worth less than one that goes on.
            cost += 0.5 * max(0.0, abs(length) - free)
            if turn * self._last_turn < -1e-9:
                cost += 0.25
            if length < 0:
                cost += 0.6
            if cost < best_cost:
                best_cost = cost
                best = Way(turn, curvature, math.copysign(usable, length))
        return best

    def _cost_field(self, hazard: Array, goal: tuple[float, float]) -> Array:
        """Return the cost to reach the goal over hazards, on cells of `coarse_m`; closed cells cost, not
        forbid.
        """
        p = self.parameters
        factor = max(1, round(p.coarse_m / self.map.cell))
        rows, columns = (n // factor for n in hazard.shape)
        block = hazard[: rows * factor, : columns * factor].reshape(rows, factor, columns, factor)
        known = ~np.isnan(block)
        level = np.where(known, np.nan_to_num(block), -1.0).max(axis=(1, 3))
        unknown = level < 0
        coarse = self.map.cell * factor
        blocked = level >= 1.0
        first = self.map.cell * (factor - 1) / 2
        self._west, self._south, self._coarse = self.map.west + first, self.map.south + first, coarse
        gr, gc = self._index(goal[0], goal[1], rows, columns)
        distance = obstacle_distance(blocked, coarse)
        inner = self.profile.body.width_m / 2 + p.least_margin_m
        outer = self.profile.body.radius_m + p.margin_m
        price = 1.0 + p.hazard_cost * np.where(unknown, p.unknown_cost, np.clip(level, 0, 1))
        tight = np.clip((outer - distance) / max(outer - inner, 1e-6), 0.0, 1.0)
        price += 3.0 * tight
        price = np.where(distance < inner, price + 12.0, price)
        price = np.where(blocked, price + 25.0, price)
        price[gr, gc] = 1.0
        return cost_to_go(price, coarse, gr, gc)

    def _index(self, x: float, y: float, rows: int, columns: int) -> tuple[int, int]:
        r = round((y - self._south) / self._coarse)
        c = round((x - self._west) / self._coarse)
        return min(max(r, 0), rows - 1), min(max(c, 0), columns - 1)

    def _togo(self, field_: Array, x: float, y: float) -> float:
        rows, columns = field_.shape
        fx = min(max((x - self._west) / self._coarse, 0.0), columns - 1.001)
        fy = min(max((y - self._south) / self._coarse, 0.0), rows - 1.001)
        c, r = int(fx), int(fy)
        u, v = fx - c, fy - r
        return float(
            (field_[r, c] * (1 - u) + field_[r, c + 1] * u) * (1 - v)
            + (field_[r + 1, c] * (1 - u) + field_[r + 1, c + 1] * u) * v
        )


def _moved(seen_from: Transform, shift: Array) -> Transform:
    """Return a stand on the map moved by east, north and rise, m, and turned about its place (4,)."""
    place = Transform(np.eye(3), seen_from.translation + shift[:3])
    return place * Transform.from_rpy(0.0, 0.0, float(shift[3])) * Transform(seen_from.rotation, np.zeros(3))


def _turned(covariance: Array, by: Transform) -> NDArray[np.float64]:
    """Return the covariance (4, 4) of a place and a heading in axes that are turned about the vertical."""
    turn = np.eye(4)
    turn[:3, :3] = by.rotation
    return np.asarray(turn @ covariance @ turn.T, dtype=np.float64)


def end_of(pose: Pose, turn: float, curvature: float, length: float) -> tuple[float, float, float]:
    """Return x, y (m), heading (rad) after a turn (rad) and an arc of a length (m) and curvature (1/m)."""
    start = pose.heading + turn
    heading = start + curvature * length
    if abs(curvature) < 1e-9:
        return pose.x + length * math.cos(start), pose.y + length * math.sin(start), wrap_angle(heading)
    return (
        pose.x + (math.sin(heading) - math.sin(start)) / curvature,
        pose.y - (math.cos(heading) - math.cos(start)) / curvature,
        wrap_angle(heading),
    )
