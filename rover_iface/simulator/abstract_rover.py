"""The `abstract` rover: durations, energies, losses from the planning problem, or from a given future of it.

It is an echo of the planner's model on purpose: with the same future, the executive running the emitted CRL
on this rover must earn what the planner's own evaluation earns. Its rules, those of the problem's format:

- a leg takes its drawn time plus the overhead for each target tracked when it starts; when it ends, each
  tracked target is lost iff its number is below its chance; driving to where the rover stands takes nothing;
- a leg whose number is below its chance to fail fails when it ends: the rover is back where it began, and no
  drive leads to that target any more;
- `navigate` with `require_tracked` fails before leaving if the target needs its track and has lost it;
- `trackstart` works before the first drive only, for a target with an observation that needs it and no track
  yet;
- an observation fails at once, without time or energy, if the rover is not at its place, it was made before,
  one that must precede it was not made, or it needs its target tracked and the target is not;
- otherwise it takes its drawn time and energy and is then *made*, whether or not its success coin showed a
  usable product; the action succeeds iff the coin did (result `made` tells the two kinds of failure apart);
- a target whose observations that need the track are all made is tracked no longer;
- one kind of sol is drawn: its factors are in the drawn amounts of the future, and that on all energies is on
  the hotel load and on starts of tracks too.

Durations are rounded to whole milliseconds, the half to even, each on its own. Energy used is the sum of the
drawn energies in the order of the actions plus `hotel_w` times the clock in seconds.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cache, lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from executive.ports import Command, Value
from rover_iface.behaviour.action import Action, Outcome, Route, Step, number
from rover_iface.behaviour.products import png
from rover_iface.errors import WorldError
from rover_iface.frames import Pose
from rover_iface.profile import RoverProfile
from rover_iface.simulator.engine import along, milliseconds, route_length
from rover_iface.simulator.faults import Fault
from rover_iface.simulator.model import AbstractModel, Future
from rover_iface.simulator.routine import RoutineRover
from rover_iface.simulator.world import World, WorldSource, load_world
from rover_iface.telemetry import TrackState
from rover_iface.terrain.terrain import Terrain

TAKEN = 24
"""Pictures that are kept as PNG: as many as a plan for twelve targets takes, 0.1 MB each."""

PICTURE_PX = 128
"""Rows and columns of a picture: enough to know the ground by; four of 160 were 180 of a dry run's 200 kB."""


def make_rover(
    world: WorldSource,
    *,
    out: Path | None = None,
    seed: int | None = None,
    draws: Any = None,
    faults: Sequence[Fault] = (),
    progress_s: float | None = None,
    terrain: Terrain | None = None,
    battery_j: float | None = None,
    tracker: str = "",
) -> AbstractRover:
    """Return an abstract rover; the entry point `abstract` of the group `outcrop.rovers`.

    Parameters
    ----------
    world
        A world, a `world/1` document, a document of a problem (`model.PROBLEM_FORMATS`), or the file of one.
    out
        Folder of the run, into which products are written (`products/`); without it there are none.
    seed
        Draws one future of the problem; 0 or the seed of the world when absent. Ignored with `draws`.
    draws
        One future: a `model.Future`, or plain arrays, a mapping or an object with its names: `leg_time_s`
        [n+1, n+1], `leg_energy_j`, `leg_loss_u` [n+1, n+1, n+1], `leg_fail_u` [n+1, n+1], `obs_time_s` [m],
        `obs_energy_j`, `obs_success_u`, `energy_factor` [1]; a leading axis of length 1 is allowed.
        Places are 0 = start, then the targets in order.
    faults
        Faults on demand, besides those of the world.
    progress_s
        Report the pose so often during a drive; 0 (default) = only with results.
    terrain
        Gives products their picture; the world's own terrain when absent.
    battery_j
        Energy at the start; the energy budget of the problem when absent.

    Raises
    ------
    WorldError
        If the world, the problem or the draws are malformed.
    """
    if tracker:
        raise WorldError(f'tracker "{tracker}": the abstract rover draws what it loses and has no tracker')
    place = load_world(world)
    return AbstractRover(
        _model(place),
        _future(place, seed, draws),
        profile=place.profile,
        out=out,
        progress_s=place.progress_s if progress_s is None else progress_s,
        progress_at_bends=place.progress_at_bends,
        faults=(*place.faults, *faults),
        terrain=terrain,
        load_terrain=place.load_terrain if out is not None else None,
        battery_j=battery_j if battery_j is not None else place.battery_j,
        seed=place.seed if seed is None else seed,
    )


@lru_cache(maxsize=8)
def _model(world: World) -> AbstractModel:
    return AbstractModel.from_problem(world.problem_document())


def _future(world: World, seed: int | None, draws: Any) -> Future | None:
    model = _model(world)
    if isinstance(draws, Future):
        return draws
    if draws is not None:
        return Future.from_arrays(draws, model)
    if world.future is not None and seed is None:
        return Future.from_arrays(world.future, model)
    return Future.draw(model, world.seed if seed is None else seed)


class AbstractRover(RoutineRover):
    """A rover that lives in a planning problem.

    For thousands of days build the model once: ``AbstractRover(model, Future.from_arrays(row, model))``.
    """

    def __init__(
        self,
        model: AbstractModel,
        future: Future | None = None,
        *,
        profile: RoverProfile | None = None,
        out: Path | None = None,
        progress_s: float = 0.0,
        progress_at_bends: bool = False,
        faults: Sequence[Fault] = (),
        terrain: Terrain | None = None,
        load_terrain: Any = None,
        battery_j: float | None = None,
        seed: int = 0,
    ) -> None:
        future = Future.draw(model, seed) if future is None else future
        energy_factor = float(future.energy_factor[0])
        super().__init__(
            hotel_w=model.hotel_w * energy_factor,
            battery_j=model.battery_j if battery_j is None else battery_j,
            pose=model.poses[0] or Pose(0.0, 0.0),
            out=out,
            progress_s=progress_s,
            progress_at_bends=progress_at_bends,
            faults=faults,
            profile=profile,
            seed=seed,
        )
        self.model = model
        self.future = future
        self._track_energy_j = model.track_energy_j * energy_factor
        self._terrain = terrain
        self._load_terrain = load_terrain
        self.place: int | None = 0
        self._from = 0
        self._index = model.index
        self._tracked: list[int] = []
        self._made: set[int] = set()
        self._closed: set[int] = set()
        self.set_pose(self.pose)
        self.set("tilt", 0.0)
        self.set("novelty", 0.0)
        self.set("heartbeat", 0.0)
        for k, target in enumerate(model.targets, start=1):
            self.set(f"trackerstate {target}", TrackState.IDLE.value)
            self.set(f"trackerconfidence {target}", 0.0)
            self._set_range(k)
        self.report()

    # ---- helpers

    def _set_range(self, place: int) -> None:
        point = self.model.points[place - 1]
        if point is not None:
            distance = math.hypot(point[0] - self.pose.x, point[1] - self.pose.y)
            self.set(f"range {self.model.targets[place - 1]}", distance)

    def _track(self, place: int, state: TrackState, confidence: float) -> None:
        target = self.model.targets[place - 1]
        if state is TrackState.TRACKED:
            if place not in self._tracked:
                self._tracked.append(place)
                self._tracked.sort()
        elif place in self._tracked:
            self._tracked.remove(place)
        self.set(f"trackerstate {target}", state.value)
        self.set(f"trackerconfidence {target}", confidence)

    def lose_target(self, target: str, confidence: float = 0.1) -> None:
        """Make a tracked target lost, by a fault."""
        place = self._index.get(target)
        if place is not None and place in self._tracked:
            self._track(place, TrackState.LOST, confidence)

    def _needs_track(self, place: int) -> bool:
        return any(o.needs_track for o in self.model.observations if o.place == place)

    # ---- actions

    def act(self, command: Command) -> Action:
        """Return the generator of an action."""
        match self.profile.usual_action(command.action, command.parameters):
            case "navigate":
                return self._navigate(command)
            case "trackstart":
                return self._track_start(command)
            case "trackstop":
                return self._track_stop(command)
            case "ipplaceinstrument":
                return self._observe(command, contact=True)
            case "image":
                return self._image(command)
            case "turn":
                return self._turn(command)
            case "imagepanorama":
                return self._panorama(command)
            case "handoff":
                return self._handoff(command)
            case _:
                return self.routine(command)

    def _turn(self, command: Command) -> Action:
        if "heading" in command.parameters:
            angle = math.remainder(number(command, "heading", 0.0) - self.pose.heading, 2 * math.pi)
        else:
            angle = number(command, "angle", 0.0)
        mobility, power = self.profile.mobility, self.profile.power
        fixed, energy = self.spread("turn")
        seconds = abs(angle) / mobility.turn_rate_rad_s
        energy += power.turn_w * seconds
        yield Step(fixed + milliseconds(seconds), energy)
        pose = self.pose
        heading = math.remainder(pose.heading + angle, 2 * math.pi)
        self.set_pose(Pose(pose.x, pose.y, pose.z, heading, pose.pitch, pose.roll))
        return Outcome(True, values={"energy_j": energy})

    def _track_start(self, command: Command) -> Action:
        target = str(command.parameters["target"])
        place = self._index.get(target)
        if place is None:
            return Outcome(False, f"unknown target {target}")
        if self.place != 0 or self._closed:
            return Outcome(False, "not at the start" if self.place != 0 else "a drive was tried already")
        if not self._needs_track(place):
            return Outcome(False, "target needs no track")
        if place in self._tracked:
            return Outcome(False, "already tracked")
        yield Step(milliseconds(self.model.track_time_s), self._track_energy_j)
        self._track(place, TrackState.TRACKED, 0.95)
        self._set_range(place)
        return Outcome(True, values={"confidence": 0.95, "energy_j": self._track_energy_j})

    def _track_stop(self, command: Command) -> Action:
        place = self._index.get(str(command.parameters["target"]))
        if place is not None and place in self._tracked:
            self._track(place, TrackState.IDLE, 0.0)
        yield from ()
        return Outcome(True)

    def _navigate(self, command: Command) -> Action:
        if self.stuck_from_ms is not None:
            duration, energy = self.spread("navigator_step")
            yield Step(duration, energy)
            return Outcome(False, "wheel stuck")
        if "target" not in command.parameters:
            return (yield from self._drive_free(command))
        target = str(command.parameters["target"])
        to = self._index.get(target)
        if to is None:
            return Outcome(False, f"unknown target {target}")
        if self._lacks_track(command, to):
            return Outcome(False, f"target {target} is not tracked")
        if self.place == to:
            return Outcome(True, values={"distance_m": 0.0, "energy_j": 0.0, "error_m": 0.0})
        if to in self._closed:
            return Outcome(False, f"a drive to {target} failed before")
        origin = self._from if self.place is None else self.place
        seconds = float(self.future.leg_time_s[origin, to])
        if math.isnan(self.model.leg_time_s[origin, to, 0]):
            return Outcome(False, "no path there")
        energy = float(self.future.leg_energy_j[origin, to])
        overhead = milliseconds(self.model.track_overhead_s) * len(self._tracked)
        duration = milliseconds(seconds)
        if self.place is None:
            # Cut short before: what is left of the leg, by the distance that is left.
            share = self._share_left(origin, to)
            duration, energy = round(duration * share), energy * share
        if self.slow_factor != 1.0:
            duration = round(duration * self.slow_factor)
        route = self._route(origin, to)
        fails = bool(self.future.leg_fail_u[origin, to] < self.model.p_fail[origin, to])
        self._from, self.place = origin, None
        yield Step(duration + overhead, energy, there_and_back(route) if fails else route)
        self.place = origin if fails else to
        self._draw_losses(origin, to)
        if fails:
            self._closed.add(to)
            for place in range(1, len(self.model.poses)):
                self._set_range(place)
            return Outcome(False, "no way through", {"distance_m": route_length(route), "energy_j": energy})
        pose = self.model.poses[to]
        if pose is not None:
            heading = pose.heading if pose.heading or len(route) < 2 else self.pose.heading
            self.set_pose(Pose(pose.x, pose.y, self.pose.z, heading))
        self._set_range(to)
        length = route_length(route)
        return Outcome(True, values={"distance_m": length, "energy_j": energy, "error_m": 0.0})

    def _lacks_track(self, command: Command, to: int) -> bool:
        """Return whether a drive to a place must not begin, because its target has lost its track."""
        required = command.parameters.get("require_tracked") is True
        return required and self._needs_track(to) and to not in self._tracked

    def _draw_losses(self, origin: int, to: int) -> None:
        """Lose those of the tracked targets that the future has lost on a leg."""
        chance, drawn = self.model.p_lose[origin, to], self.future.leg_loss_u[origin, to]
        for k in tuple(self._tracked):
            if drawn[k] < chance[k]:
                self._track(k, TrackState.LOST, 0.1)
            else:
                self._set_range(k)

    def _route(self, origin: int, to: int) -> Route:
        here = (self.pose.x, self.pose.y)
        pose = self.model.poses[to]
        if pose is None:
            return ()
        listed = self.model.routes.get((origin, to))
        if listed is None or math.hypot(listed[0][0] - here[0], listed[0][1] - here[1]) > 0.05:
            return (here, (pose.x, pose.y))
        return listed

    def _share_left(self, origin: int, to: int) -> float:
        a, b = self.model.poses[origin], self.model.poses[to]
        if a is None or b is None:
            return 1.0
        whole = math.hypot(b.x - a.x, b.y - a.y)
        return math.hypot(b.x - self.pose.x, b.y - self.pose.y) / whole if whole > 0 else 1.0

    def _drive_free(self, command: Command) -> Action:
        goal = (number(command, "x", 0.0), number(command, "y", 0.0))
        here = (self.pose.x, self.pose.y)
        length = math.hypot(goal[0] - here[0], goal[1] - here[1])
        stop_short = number(command, "standoff_m", 0.0)
        length = max(0.0, length - stop_short)
        if length <= 0.01:
            return Outcome(True, values={"distance_m": 0.0, "energy_j": 0.0, "error_m": 0.0})
        drive = self.profile.activity("navigate")
        energy = drive.energy_j(length).mean
        duration = milliseconds(drive.time_s(length).mean * self.slow_factor)
        duration += milliseconds(self.model.track_overhead_s) * len(self._tracked)
        whole = length + stop_short
        end = along(self.pose, (here, goal), length / whole)
        self._from, self.place = self.place if self.place is not None else self._from, None
        yield Step(duration, energy, (here, (end.x, end.y)))
        for k in self._tracked:
            self._set_range(k)
        return Outcome(True, values={"distance_m": length, "energy_j": energy, "error_m": 0.0})

    def _pick(self, command: Command, target: str, contact: bool) -> int | None:
        """Return the observation a command carries out: by its metadata, else the first fitting one."""
        wanted = command.metadata.get("observation")
        place = self._index.get(target)
        instrument = command.parameters.get("instrument")
        fitting = [
            k for k, o in enumerate(self.model.observations) if o.place == place and o.contact is contact
        ]
        for k in fitting:
            if self.model.observations[k].id == wanted:
                return k
        if instrument is not None:
            named = [k for k in fitting if self.model.observations[k].instrument in ("", instrument)]
            fitting = named or fitting
        return next((k for k in fitting if k not in self._made), fitting[0] if fitting else None)

    def _image(self, command: Command) -> Action:
        target = command.parameters.get("target")
        if target is not None and self._pick(command, str(target), contact=False) is not None:
            return (yield from self._observe(command, contact=False))
        if self.camera_failed:
            return Outcome(False, "camera failed")
        scicam = next((i for i in self.profile.instruments.values() if not i.contact), None)
        duration, energy = (
            (milliseconds(scicam.time_s.mean), scicam.energy_j.mean) if scicam is not None else (0, 0.0)
        )
        yield Step(duration, energy)
        count = self._picture(command, "image", str(target) if target is not None else "", {})
        return Outcome(True, values={"products": float(count), "energy_j": energy})

    def _observe(self, command: Command, *, contact: bool) -> Action:
        target = str(command.parameters["target"])
        k = self._pick(command, target, contact)
        if k is None:
            return Outcome(False, f"no such observation of target {target}", {"made": False})
        observation = self.model.observations[k]
        if self.place != observation.place:
            return Outcome(False, f"not at the observation point of {target}", {"made": False})
        if k in self._made:
            return Outcome(False, f"observation {observation.id} was made before", {"made": False})
        if observation.needs_track and observation.place not in self._tracked:
            return Outcome(False, f"target {target} is not tracked", {"made": False})
        if any(other not in self._made for other in observation.before):
            return Outcome(False, f"observation {observation.id} must wait for another", {"made": False})
        energy = float(self.future.obs_energy_j[k])
        yield Step(milliseconds(float(self.future.obs_time_s[k])), energy)
        self._made.add(k)
        if observation.needs_track and all(
            j in self._made
            for j, o in enumerate(self.model.observations)
            if o.needs_track and o.place == observation.place
        ):
            self._track(observation.place, TrackState.IDLE, 0.0)
        success = bool(self.future.obs_success_u[k] < observation.p_success) and not self.camera_failed
        values: dict[str, Value] = {"made": True, "energy_j": energy}
        if not success:
            return Outcome(False, "no usable product", values)
        count = self._picture(
            command,
            "microscopic" if contact else "image",
            target,
            {"observation": observation.id, "instrument": observation.instrument},
        )
        values["products"] = float(count)
        return Outcome(True, values=values)

    def _panorama(self, command: Command) -> Action:
        if self.camera_failed:
            return Outcome(False, "camera failed")
        duration, energy = self.spread("imagepanorama")
        yield Step(duration, energy)
        count = self._picture(command, "panorama", "", {})
        return Outcome(True, values={"products": float(count), "energy_j": energy})

    def _handoff(self, command: Command) -> Action:
        target = str(command.parameters["target"])
        place = self._index.get(target)
        duration, energy = self.spread("handoff")
        yield Step(duration, energy)
        if place is None or place not in self._tracked:
            return Outcome(False, f"target {target} is not tracked", {"energy_j": energy})
        return Outcome(True, values={"error_px": 1.0, "confidence": 0.9, "energy_j": energy})

    # ---- products

    def _picture(self, command: Command, kind: str, target: str, label: Mapping[str, Any]) -> int:
        """Write a picture of the ground round the target (or the rover); return how many there are.

        Without a folder nothing is written and the answer is the same, so that a plan that asks for the
        products of a task runs as it would with one.
        """
        if self.out is None:
            return 1
        if self._terrain is None and self._load_terrain is not None:
            self._terrain = self._load_terrain()
            self._load_terrain = None
        place = self._index.get(target)
        point = self.model.points[place - 1] if place is not None else None
        x, y = (point[0], point[1]) if point is not None else (self.pose.x, self.pose.y)
        size_m = {"microscopic": 0.4, "image": 4.0, "panorama": 24.0}[kind]
        data = ground_picture(self._terrain, x, y, size_m)
        whole: dict[str, Any] = {"frame": "site", "east_m": x, "north_m": y, "size_m": size_m, **label}
        if target:
            whole["target"] = target
        if point is not None:
            whole["point_m"] = list(point)
        return int(self.write_product(command, kind, data, ".png", whole))


def there_and_back(route: Route) -> Route:
    """Return half of a way and the same back to where it began: a drive that found none through."""
    whole = route_length(route)
    if len(route) < 2 or whole <= 0.0:
        return route
    out, gone = [route[0]], 0.0
    for here, there in pairwise(route):
        step = math.dist(here, there)
        share = min(1.0, (whole / 2.0 - gone) / step) if step > 0.0 else 1.0
        out.append((here[0] + share * (there[0] - here[0]), here[1] + share * (there[1] - here[1])))
        gone += step
        if gone >= whole / 2.0:
            break
    return (*out, *out[-2::-1])


@cache
def _blank() -> bytes:
    return png(np.full((PICTURE_PX, PICTURE_PX, 3), (150, 117, 97), dtype=np.uint8))


def ground_picture(terrain: Terrain | None, x: float, y: float, size_m: float) -> bytes:
    """Return a PNG of the ortho image round a point (site frame, m), north up; plain ground without one."""
    if terrain is None or not terrain.orthos:
        return _blank()
    half = size_m / 2
    for ortho in terrain.orthos:
        west, south, east, north = ortho.bounds
        if x - half >= west and x + half <= east and y - half >= south and y + half <= north:
            return _encoded(ortho.crop(x, y, size_m, PICTURE_PX))
    return _encoded(terrain.orthos[-1].crop(x, y, size_m, PICTURE_PX))


def _encoded(pixels: NDArray[np.uint8]) -> bytes:
    return _encoded_once(pixels.shape, pixels.tobytes())


@lru_cache(maxsize=TAKEN)
def _encoded_once(shape: tuple[int, ...], content: bytes) -> bytes:
    """Return pixels as PNG. Runs of one plan take the same pictures, and encoding one costs 4 ms."""
    return png(np.frombuffer(content, dtype=np.uint8).reshape(shape))
