"""The `mujoco` rover: the dynamics of MuJoCo under the plan's drives, the rest from the `abstract` rover.

A rocker-bogie made from the rover profile drives on the terrain of the world. It shares terrain and profile
with the `subframe` and `full` rovers, no chassis, no soil and no driver: a second opinion on the time, energy
and slip of drives. Grip of the wheels is drawn from the seed; rocks that are not on the map are those of the
other rovers.

It has no eyes: it knows its pose exactly, follows the plan's path whatever lies there, and stands at each
`step_m` as long as a look takes (activity `navigator_step`; not with the mode `blind`). Lost tracks, cameras,
arm and all that takes no wheels are the `abstract` rover's, drawn from the planning problem.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from executive.ports import Command
from rover_iface.behaviour.action import Action, Doing, Outcome, Route, Step, number
from rover_iface.errors import WorldError
from rover_iface.frames import Pose, wrap_angle
from rover_iface.mujoco.engine import import_mujoco
from rover_iface.mujoco.model import HeightField
from rover_iface.mujoco.options import PilotOptions, VehicleOptions
from rover_iface.mujoco.pilot import DriveLog, Pilot
from rover_iface.mujoco.vehicle import Vehicle
from rover_iface.simulator.abstract_rover import AbstractRover
from rover_iface.simulator.engine import milliseconds
from rover_iface.simulator.faults import Fault, FaultKind
from rover_iface.simulator.model import AbstractModel, Future
from rover_iface.simulator.true_ground import true_terrain, world_targets
from rover_iface.simulator.world import World, WorldSource, load_world
from rover_iface.streams import stream
from rover_iface.terrain.grid import Bounds
from rover_iface.terrain.terrain import Terrain

MARGIN_M = 64.0
"""Ground is known so far beyond the start and all targets; a drive that leaves it ends there."""

WHEELS = frozenset({"navigate", "turn"})


def make_rover(
    world: WorldSource,
    *,
    out: Path | None = None,
    seed: int | None = None,
    faults: Sequence[Fault] = (),
    progress_s: float | None = None,
    terrain: Terrain | None = None,
    battery_j: float | None = None,
    tracker: str = "",
    vehicle: VehicleOptions | None = None,
    pilot: PilotOptions | None = None,
) -> MujocoRover:
    """Return a rover in MuJoCo; the entry point `mujoco` of the group `outcrop.rovers`.

    Parameters
    ----------
    world
        A world, a `world/1` document, its file or its folder. It must have a terrain, here or as `terrain`.
    out
        Folder of the run, into which products are written.
    seed
        Of the wheels' grip, unmapped rocks, and of the future that gives losses and observations; the seed of
        the world when absent.
    faults
        Faults on demand, besides those of the world.
    progress_s
        Report the pose so often during a drive; the pose is reported with results alone if 0.
    battery_j
        Energy at the start; that of the world, or the budget of its problem, when absent.
    vehicle, pilot
        Other numbers than the usual ones.

    Raises
    ------
    RoverError
        If the package mujoco is not installed.
    WorldError
        If the world is malformed or has no terrain.
    """
    if tracker:
        raise WorldError(f'tracker "{tracker}": the mujoco rover draws what it loses and has no tracker')
    import_mujoco()
    place = load_world(world)
    ground = terrain if terrain is not None else place.load_terrain()
    if ground is None:
        raise WorldError(f'world "{place.name}" has no terrain; a rover on terrain needs one')
    ground.require_inside(place.start.x, place.start.y, "start of the rover")
    drawn = place.seed if seed is None else seed
    model = AbstractModel.from_problem(place.problem_document())
    if place.future is not None and seed is None:
        future = Future.from_arrays(place.future, model)
    else:
        future = Future.draw(model, drawn)
    return MujocoRover(
        model,
        future,
        vehicle=_vehicle(place, ground, drawn, vehicle or VehicleOptions()),
        pilot=pilot or PilotOptions(),
        profile=place.profile,
        out=out,
        progress_s=place.progress_s if progress_s is None else progress_s,
        progress_at_bends=place.progress_at_bends,
        faults=(*place.faults, *faults),
        terrain=ground,
        battery_j=battery_j if battery_j is not None else place.battery_j,
        seed=drawn,
    )


def _vehicle(world: World, terrain: Terrain, seed: int, options: VehicleOptions) -> Vehicle:
    """Return the vehicle of a world at its start, on soil drawn from a seed."""
    targets = world_targets(world)
    places = [(world.start.x, world.start.y), *((t.point[0], t.point[1]) for t in targets)]
    places += [
        (t.observation_point.x, t.observation_point.y) for t in targets if t.observation_point is not None
    ]
    box = _box(places)
    half = max(abs(edge) for edge in box) - MARGIN_M + 6.0
    ground = true_terrain(world, terrain, targets, seed, half)
    spread = math.sqrt(math.log1p(options.friction_cv**2))
    grip = math.exp(spread * float(stream("grip of the wheels", seed).standard_normal()) - spread**2 / 2)
    friction = options.friction * grip / world.map_error.softer
    field = HeightField.of(ground, box, options.spacing_m)
    return Vehicle(world.profile, field, world.start, friction, options)


def _box(places: Iterable[tuple[float, float]]) -> Bounds:
    xs, ys = zip(*places, strict=True)
    return min(xs) - MARGIN_M, min(ys) - MARGIN_M, max(xs) + MARGIN_M, max(ys) + MARGIN_M


class MujocoRover(AbstractRover):
    """See the module; `odometry` holds (s, pose, slip of the step) whenever the rover has moved, slip
    None where it turned or hardly moved.
    """

    def __init__(
        self, model: AbstractModel, future: Future, *, vehicle: Vehicle, pilot: PilotOptions, **options: Any
    ) -> None:
        super().__init__(model, future, **options)
        self.vehicle = vehicle
        self.pilot = Pilot(vehicle, pilot)
        self.odometry: list[tuple[float, Pose, float | None]] = []
        self._last = vehicle.pose
        self._wheels_busy = False
        self._step_since_ms: int | None = None
        self._take_pose(0.0)
        self.report()

    # ---- actions

    def act(self, command: Command) -> Action:
        """Return the generator of an action."""
        action = self.profile.usual_action(command.action, command.parameters)
        return self._with_wheels(command, action) if action in WHEELS else super().act(command)

    def _with_wheels(self, command: Command, action: str) -> Action:
        if self._wheels_busy:
            return Outcome(False, "the wheels are busy with another command")
        self._wheels_busy = True
        try:
            return (yield from self._turn(command) if action == "turn" else self._navigate(command))
        finally:
            self._wheels_busy = False

    def _turn(self, command: Command) -> Action:
        start = self.pose.heading
        if "heading" in command.parameters:
            angle = wrap_angle(number(command, "heading", 0.0) - start)
        else:
            angle = number(command, "angle", 0.0)
        # More than half a turn is taken in parts, each the shorter way round.
        parts = max(1, math.ceil(abs(angle) / 3.0))
        log = DriveLog()
        for k in range(1, parts + 1):
            aim = start + angle * k / parts
            yield from self._follow((), wrap_angle(aim), log)
            if log.reason:
                return Outcome(False, log.reason, {"energy_j": log.energy_j})
        return Outcome(True, values={"energy_j": log.energy_j})

    def _navigate(self, command: Command) -> Action:
        if "target" not in command.parameters:
            goal = (number(command, "x", 0.0), number(command, "y", 0.0))
            route = _short_of((self.pose.x, self.pose.y), goal, number(command, "standoff_m", 0.0))
            heading = number(command, "heading", 0.0) if "heading" in command.parameters else None
            self._from, self.place = self.place if self.place is not None else self._from, None
            return (yield from self._drive(command, route, heading))
        target = str(command.parameters["target"])
        to = self._index.get(target)
        if to is None:
            return Outcome(False, f"unknown target {target}")
        if self._lacks_track(command, to):
            return Outcome(False, f"target {target} is not tracked")
        if self.place == to:
            return Outcome(True, values={"distance_m": 0.0, "energy_j": 0.0, "error_m": 0.0})
        pose = self.model.poses[to]
        if pose is None:
            return Outcome(False, f"target {target} has no observation point")
        origin = self._from if self.place is None else self.place
        route = self._route(origin, to)
        self._from, self.place = origin, None
        outcome = yield from self._drive(command, route, pose.heading or None)
        if outcome.success:
            self.place = to
            self._draw_losses(origin, to)
            self._set_range(to)
        return outcome

    def _drive(self, command: Command, route: Route, heading_rad: float | None) -> Action:
        """Drive along a path, with a look at each of its steps unless the drive is blind."""
        end = route[-1] if route else (self.pose.x, self.pose.y)
        log = DriveLog(left_m=math.hypot(end[0] - self.pose.x, end[1] - self.pose.y))
        if self.stuck_from_ms is not None:
            log.reason = "wheel stuck"
        overhead = milliseconds(self.model.track_overhead_s) * len(self._tracked)
        if overhead and not log.reason:
            yield Step(overhead)
        blind = command.parameters.get("mode") == "blind"
        if not log.reason:
            yield from self._follow(
                route, heading_rad, log, look_m=math.inf if blind else self.profile.mobility.step_m
            )
        for k in self._tracked:
            self._set_range(k)
        values = {"distance_m": log.distance_m, "energy_j": log.energy_j, "error_m": log.left_m}
        self._write_odometry(command)
        return Outcome(not log.reason, log.reason, values)

    def _follow(
        self, route: Route, heading_rad: float | None, log: DriveLog, look_m: float = math.inf
    ) -> Doing[None]:
        """Let the pilot drive, and watch tilt, battery, ground and faults after each of its steps."""
        slow = self.slow_factor
        mobility = self.profile.mobility
        self.pilot.speed_m_s, self.pilot.turn_rate_rad_s = (
            mobility.speed_m_s / slow,
            mobility.turn_rate_rad_s / slow,
        )
        looked_m = 0.0 if math.isfinite(look_m) else math.inf
        wheels_m = log.wheels_m
        for step in self.pilot.follow(route, heading_rad, log):
            self._step_since_ms = self._now
            yield step
            self._step_since_ms = None
            self._take_pose(log.wheels_m - wheels_m)
            wheels_m = log.wheels_m
            log.reason = log.reason or self._trouble()
            if log.reason:
                break
            if log.distance_m >= looked_m:
                looked_m = log.distance_m + look_m
                duration_ms, energy_j = self.spread("navigator_step")
                log.energy_j += energy_j
                yield Step(duration_ms, energy_j)
        self.pilot.stop()

    def _trouble(self) -> str:
        """Return what ends a drive here and now, or an empty string."""
        self.refresh()
        unknown = self.vehicle.unknown_ground()
        if unknown is not None:
            return f"the ground at ({unknown[0]:.2f}, {unknown[1]:.2f}) is unknown"
        tilt, limit = (math.degrees(v) for v in (self.vehicle.tilt_rad, self.profile.mobility.max_tilt_rad))
        if tilt > limit:
            return f"tilt {tilt:.1f} deg is over the limit of {limit:.1f} deg"
        if self.battery_j <= 0.0:
            return "the battery is empty"
        return "wheel stuck" if self.stuck_from_ms is not None else ""

    # ---- state

    def _take_pose(self, wheels_m: float) -> None:
        """Take over where the dynamics have come to."""
        before, pose = self._last, self.vehicle.pose
        moved = math.hypot(pose.x - before.x, pose.y - before.y)
        straight = moved > 0.01 and abs(wrap_angle(pose.heading - before.heading)) < 0.02
        slip = 1.0 - moved / wheels_m if straight and wheels_m > 0.01 else None
        self.odometry.append((self.t_s, pose, slip))
        self._last = pose
        self.set_pose(pose)
        self.set("tilt", self.vehicle.tilt_rad)
        self.set("heartbeat", self.t_s)

    def _write_odometry(self, command: Command) -> None:
        """Keep where the rover has been as a product, as rovers on terrain do; it knows it exactly."""
        rows = []
        for t_s, pose, slip in self.odometry:
            place = [pose.x, pose.y, pose.z, pose.heading]
            rows.append({"t_s": t_s, "true": place, "believed": place, "slip": slip})
        data = (json.dumps(rows) + "\n").encode()
        self.write_product(command, "odometry", data, ".json", {"frame": "site", "rows": len(rows)})

    def interrupted(self, command: Command) -> None:
        """Stand where an aborted drive was at this time."""
        super().interrupted(command)
        if self._step_since_ms is not None:
            self.pilot.cut((self._now - self._step_since_ms) / 1000.0)
            self._step_since_ms = None
            self._take_pose(0.0)

    def apply_fault(self, fault: Fault) -> None:
        """Bring a fault into effect now; a burst of slip takes grip."""
        if fault.kind is FaultKind.SLIP_BURST:
            self.vehicle.set_friction(self.vehicle.friction / fault.strength)
        else:
            super().apply_fault(fault)


def _short_of(here: tuple[float, float], goal: tuple[float, float], standoff_m: float) -> Route:
    """Return the straight path to a place, or to `standoff_m` before it; none where the rover is there."""
    length = math.hypot(goal[0] - here[0], goal[1] - here[1])
    if length - standoff_m <= 0.01:
        return ()
    share = (length - standoff_m) / length
    return (here, (here[0] + share * (goal[0] - here[0]), here[1] + share * (goal[1] - here[1])))
