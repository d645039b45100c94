"""The `subframe` rover: a body on true ground, with eyes that are rendered.

It drives by the navigator on cast ranges with the noise of stereo, tracks targets by correlation on rendered
161 x 161 subframes as flown on Opportunity, slips, drifts, uses power and loses its way a little. Its world
may differ from the map the planner had: rocks that are not on the map, softer soil.

Two site frames are kept apart. The *true* one is the terrain's. The *believed* one is where dead reckoning
puts things; targets, goals and telemetry live in it. Both agree at the start. A tracked target corrects what
matters: the
goal of an approach is laid out from where the target is now believed to be, not from where the map had it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from executive.ports import Command, Value
from rover_iface.cameras.model import CameraModel, pinhole
from rover_iface.cameras.rig import CameraRig, load_cameras, preset_names
from rover_iface.errors import CameraError, PlacementError, RenderError, RoverError, TrackerError, WorldError
from rover_iface.frames import Pose, Transform, wrap_angle
from rover_iface.mobility import settled_pose
from rover_iface.navigation.navigator import Navigator, Way
from rover_iface.navigation.sensor import GroundRaster, StereoSensor
from rover_iface.placement.base_placement import check_observation_point
from rover_iface.simulator.abstract_rover import _png
from rover_iface.simulator.chassis import Chassis
from rover_iface.simulator.engine import Action, Outcome, Step, milliseconds, number
from rover_iface.simulator.faults import Fault, FaultKind
from rover_iface.simulator.render.from_terrain import scene_from_terrain
from rover_iface.simulator.render.renderer import Frame, Renderer, Sun
from rover_iface.simulator.routine import RoutineRover
from rover_iface.simulator.world import World, WorldTarget, load_world
from rover_iface.soltime import SunClock
from rover_iface.telemetry import TrackState
from rover_iface.terrain.strew import add_rocks
from rover_iface.terrain.terrain import Terrain
from rover_iface.vision.ncc import NccTracker
from rover_iface.vision.template import NccOptions
from rover_iface.vision.tracker import StereoView, TrackUpdate
from rover_iface.vision.tracker import TrackState as TrackerState

Array = NDArray[np.floating]

SUBFRAME_PX = 161
RIGHT_MARGIN_PX = 60


def make_rover(
    world: World | Mapping[str, Any] | Path | str,
    *,
    out: Path | None = None,
    seed: int | None = None,
    faults: Sequence[Fault] = (),
    progress_s: float | None = None,
    terrain: Terrain | None = None,
    battery_j: float | None = None,
) -> SubframeRover:
    """Return a subframe rover; the entry point `subframe` of the group `outcrop.rovers`.

    Parameters
    ----------
    world
        A world, a `world/1` document, its file or its folder. It must have a terrain, here or as `terrain`.
    out
        Folder of the run, into which products are written.
    seed
        Of everything that is drawn: errors, noise, unmapped rocks; the seed of the world when absent.
    faults
        Faults on demand, besides those of the world.
    progress_s
        Report the pose so often during a drive; 0 = at the end of each way.

    Raises
    ------
    WorldError
        If the world is malformed or has no terrain.
    """
    place = load_world(world)
    ground = terrain if terrain is not None else place.load_terrain()
    if ground is None:
        raise WorldError(f'world "{place.name}" has no terrain; a subframe rover needs one')
    return SubframeRover(
        place,
        ground,
        out=out,
        seed=place.seed if seed is None else seed,
        faults=(*place.faults, *faults),
        progress_s=place.progress_s if progress_s is None else progress_s,
        battery_j=battery_j if battery_j is not None else place.battery_j,
    )


@dataclass(frozen=True, slots=True)
class TrackRecord:
    """One answer of the tracker and, for the study of it, how far off it truly was."""

    t_s: float
    target: str
    state: str
    confidence: float
    range_m: float
    error_m: float
    reasons: tuple[str, ...]


@dataclass(slots=True)
class _Followed:
    """A target being tracked: what the map said, and which surface point it truly is."""

    target: WorldTarget
    truth: Array
    update: TrackUpdate
    gone: bool = False
    shaded: bool = False


class SubframeRover(RoutineRover):
    """See the module. `history` holds every answer of the tracker, `odometry` true and believed poses."""

    def __init__(
        self,
        world: World,
        terrain: Terrain,
        *,
        out: Path | None = None,
        seed: int = 0,
        faults: Sequence[Fault] = (),
        progress_s: float = 0.0,
        battery_j: float | None = None,
        options: NccOptions | None = None,
    ) -> None:
        profile = world.profile
        super().__init__(
            hotel_w=profile.power.hotel_w,
            battery_j=profile.power.initial_j if battery_j is None else battery_j,
            pose=world.start,
            out=out,
            progress_s=progress_s,
            faults=faults,
            profile=profile,
            seed=seed,
        )
        self.world = world
        self.rng = np.random.default_rng([seed, 0x5B])
        self.map = terrain
        terrain.require_inside(world.start.x, world.start.y, "start of the rover")
        self.targets = {t.id: t for t in _targets(world)}
        self.terrain = self._true_terrain(terrain)
        self.ground = GroundRaster.of(self.terrain, _half_width(world))
        self.sensor = StereoSensor(profile)
        self.chassis = Chassis(
            self.ground,
            profile,
            world.start,
            soil=world.soil,
            softer=world.map_error.softer,
            rng=self.rng,
        )
        if math.isnan(self.chassis.pose.z):
            raise WorldError(
                f"the rover cannot stand at its start ({world.start.x:.2f}, {world.start.y:.2f})"
            )
        cameras = profile.name if profile.name in preset_names() else "k9"
        mast = profile.mast
        self.rig = CameraRig(
            load_cameras(cameras),
            (mast.base_m[0], mast.base_m[1], mast.height_m),
            mast.pan_limit_rad,
            mast.tilt_limits_rad,
        )
        self.tracker = NccTracker(
            options or NccOptions(odometry_share=max(0.15, 3 * profile.mobility.odometry_error))
        )
        self.sun = SunClock.at(world.sun.ls_deg, world.sun.latitude_deg, world.sun.start_lmst_h)
        self.history: list[TrackRecord] = []
        self.odometry: list[tuple[float, Pose, Pose]] = []
        self._followed: dict[str, _Followed] = {}
        self._made: set[tuple[str, str]] = set()
        self._pictures = 0
        self._mast_bias = mast.bias_rad * self.rng.standard_normal(2)
        self._solar_to_s = 0.0
        self._solar_j = 0.0
        self._navigator: Navigator | None = None
        self._believe()
        self.set("novelty", 0.0)
        self.set("heartbeat", 0.0)
        for name in self.targets:
            self.set(f"trackerstate {name}", TrackState.IDLE.value)
            self.set(f"trackerconfidence {name}", 0.0)
            self._set_range(name)
        self.report()

    # ---- the true world

    def _true_terrain(self, terrain: Terrain) -> Terrain:
        """Return the map with the rocks that are not on it."""
        density = self.world.map_error.unmapped_rocks_per_m2
        if density <= 0:
            return terrain
        rng = np.random.default_rng([self._seed, 0xD1])
        half = min(_half_width(self.world), 20.0)
        count = int(rng.poisson(density * 4 * half * half))
        table = np.column_stack([rng.uniform(-half, half, (count, 2)), rng.uniform(0.18, 0.45, count)])
        clear = [(self.world.start.x, self.world.start.y, 1.6)]
        for target in self.targets.values():
            clear.append((target.point[0], target.point[1], 0.7))
            if target.observation_point is not None:
                clear.append((target.observation_point.x, target.observation_point.y, 1.0))
        return add_rocks(terrain, table, seed=self._seed, keep_clear=clear, prefix="U")

    @cached_property
    def renderer(self) -> Renderer:
        """Return the eye of the simulation; made when first needed."""
        return Renderer(
            scene_from_terrain(
                self.terrain, (self.world.start.x, self.world.start.y), radius_m=_half_width(self.world)
            )
        )

    def sun_now(self) -> Sun:
        """Return the light of the moment."""
        return Sun(self.sun.direction(self.t_s))

    # ---- telemetry

    def _believe(self) -> None:
        believed = self.chassis.believed
        self.set_pose(believed)
        self.set("tilt", self.chassis.pose.tilt)
        self.odometry.append((self.t_s, self.chassis.pose, believed))

    def _set_range(self, name: str) -> None:
        here = self.chassis.believed
        followed = self._followed.get(name)
        x, y = self.targets[name].point[:2] if followed is None else followed.update.position[:2]
        self.set(f"range {name}", float(math.hypot(x - here.x, y - here.y)))

    def refresh(self) -> None:
        """Bring battery, sun and heartbeat up to date; the panels charge as the sun stands."""
        now = self.t_s
        elevation = self.sun.elevation_rad(now)
        if now > self._solar_to_s:
            middle = self.sun.elevation_rad((now + self._solar_to_s) / 2)
            light = max(0.0, math.sin(middle))
            gained = self.profile.power.solar_peak_w * light * (now - self._solar_to_s)
            room = self.profile.power.battery_j - self.battery_j
            self.charged_j += max(0.0, min(gained, room))
            self._solar_to_s = now
        self.set("sun-elevation", elevation)
        self.set("heartbeat", now)
        super().refresh()

    # ---- actions

    def act(self, command: Command) -> Action:
        """Return the generator of an action."""
        match command.action:
            case "navigate":
                return self._navigate(command)
            case "turn":
                return self._turn(command)
            case "trackstart":
                return self._track_start(command)
            case "trackstop":
                return self._track_stop(command)
            case "ipplaceinstrument":
                return self._place(command)
            case "image":
                return self._image(command)
            case "imagepanorama":
                return self._panorama(command)
            case "pointmast":
                return self._point_mast(command)
            case "handoff":
                return self._handoff(command)
            case "recharge":
                return self._rest(command)
            case _:
                return self.routine(command)

    def _rest(self, command: Command) -> Action:
        """Sit in the sun; the panels charge all the time, so there is nothing to add but waiting."""
        duration, _ = self.spread("recharge")
        seconds = number(command, "duration_s", duration / 1000.0)
        until = number(command, "until_j", math.inf)
        before = self.charged_j
        left = seconds
        while left > 0 and self.battery_j < until:
            part = min(60.0, left)
            yield Step(milliseconds(part))
            self.refresh()
            left -= part
        return Outcome(True, values={"charged_j": self.charged_j - before})

    def _turn(self, command: Command) -> Action:
        if "heading" in command.parameters:
            angle = wrap_angle(number(command, "heading", 0.0) - self.chassis.believed.heading)
        else:
            angle = number(command, "angle", 0.0)
        before = self.drawn_j
        reason = yield from self._go(Way(angle, 0.0, 0.0))
        return Outcome(not reason, reason, {"energy_j": self.drawn_j - before})

    def _go(self, way: Way) -> Any:
        """Drive one way; return why it went wrong, or an empty string."""
        start = self.chassis.believed
        self.chassis.slow_factor = self.slow_factor
        self.chassis.wheel_stuck = self.stuck_from_ms is not None
        driven = self.chassis.follow(way)
        end = self.chassis.believed
        yield Step(milliseconds(driven.duration_s), driven.energy_j, ((start.x, start.y), (end.x, end.y)))
        self._believe()
        if driven.collision:
            return f"hazard: {driven.collision}"
        return "wheel stuck" if driven.stuck else ""

    def _navigate(self, command: Command) -> Action:
        name = str(command.parameters.get("target", ""))
        if name and name not in self.targets:
            return Outcome(False, f"unknown target {name}")
        required = command.parameters.get("require_tracked") is True
        if (
            required
            and self.track_state(name) is not TrackState.TRACKED
            and self.targets[name].kind == "place"
        ):
            return Outcome(False, f"target {name} is not tracked")
        mode = str(command.parameters.get("mode", "track" if self._tracked() else "avoid"))
        begin_j, begin_m = self.drawn_j, self.chassis.travelled_m
        goal, heading = self._goal(command, name)
        self._navigator = None
        nearest, since, looks = math.inf, 0, 0
        reason = "too many looks"
        while looks < 150:
            goal, heading = self._goal(command, name)
            here = self.chassis.believed
            left = math.hypot(goal[0] - here.x, goal[1] - here.y)
            tolerance = 0.08 if name else 0.25
            if left <= tolerance:
                reason = ""
                break
            if left < nearest - 0.05:
                nearest, since = left, looks
            elif looks - since >= 6:
                reason = "" if left <= 0.35 else f"no nearer than {nearest:.2f} m to the goal"
                break
            looks += 1
            way: Way | None
            if mode == "blind":
                way = self._straight(goal, left)
            else:
                way = yield from self._look_and_choose(goal, name)
            if way is None:
                if self._gave_up():
                    reason = "no safe way"
                    break
                way = Way(math.radians(40.0), 0.0, 0.0)
            trouble = yield from self._go(way)
            if trouble:
                reason = trouble
                break
            if mode == "track":
                yield from self._track_all()
                if required and self.track_state(name) is TrackState.FAILED:
                    reason = f"target {name} was lost"
                    break
            self._set_ranges()
            self.report()
        if not reason and heading is not None:
            angle = wrap_angle(heading - self.chassis.believed.heading)
            if abs(angle) > math.radians(3):
                reason = yield from self._go(Way(angle, 0.0, 0.0))
                if not reason and mode == "track":
                    yield from self._track_all()
        self._set_ranges()
        self._drive_products(command, goal)
        here = self.chassis.believed
        values: dict[str, Value] = {
            "distance_m": self.chassis.travelled_m - begin_m,
            "energy_j": self.drawn_j - begin_j,
            "error_m": math.hypot(goal[0] - here.x, goal[1] - here.y),
        }
        return Outcome(not reason, reason, values)

    def _gave_up(self) -> bool:
        return self._navigator is not None and self._navigator.given_up

    def _straight(self, goal: tuple[float, float], left: float) -> Way:
        here = self.chassis.believed
        turn = wrap_angle(math.atan2(goal[1] - here.y, goal[0] - here.x) - here.heading)
        return Way(turn if abs(turn) > 0.02 else 0.0, 0.0, min(left, self.profile.mobility.step_m))

    def _look_and_choose(self, goal: tuple[float, float], name: str) -> Any:
        duration, energy = self.spread("navigator_step")
        here = self.chassis.believed
        if self._navigator is None:
            self._navigator = Navigator.fresh(self.profile, (here.x, here.y), goal)
        navigator = self._navigator
        first = navigator.map.updates == 0
        if first:
            pairs = self.sensor.pairs_around / len(self.sensor.pans)
            duration, energy = round(duration * pairs), energy * pairs
        clouds = self.sensor.look(self.ground, self.chassis.pose, self.rng, around=first)
        navigator.look(clouds, self.sensor.eye, here)
        navigator.step_m = self._step_limit()
        if name:
            followed = self._followed.get(name)
            x, y = self.targets[name].point[:2] if followed is None else followed.update.position[:2]
            navigator.ignore = (*navigator.on_map(float(x), float(y)), 0.45)
        yield Step(duration, energy)
        return navigator.choose(navigator.where(here), navigator.on_map(*goal))

    def _step_limit(self) -> float:
        """Return the longest way the tracker can follow: a share of the nearest tracked target's range."""
        step = self.profile.mobility.step_m
        here = self.chassis.believed
        for followed in self._tracked():
            away = math.hypot(*(followed.update.position[:2] - (here.x, here.y)))
            step = min(step, max(0.25, 0.2 * away))
        return step

    def _goal(self, command: Command, name: str) -> tuple[tuple[float, float], float | None]:
        """Return where to drive in the believed frame, and the heading to end with."""
        heading = number(command, "heading", math.nan)
        wanted = None if math.isnan(heading) else heading
        standoff = number(command, "standoff_m", 0.0)
        here = self.chassis.believed
        if not name:
            x, y = number(command, "x", here.x), number(command, "y", here.y)
            away = math.hypot(x - here.x, y - here.y)
            share = max(0.0, 1.0 - standoff / away) if away > 0 else 0.0
            return (here.x + share * (x - here.x), here.y + share * (y - here.y)), wanted
        target = self.targets[name]
        followed = self._followed.get(name)
        centre = np.array(target.point[:2])
        now = centre if followed is None else np.asarray(followed.update.position[:2], dtype=float)
        stand = target.observation_point
        if stand is None or standoff > 0:
            away = math.hypot(now[0] - here.x, now[1] - here.y)
            reach = standoff if standoff > 0 else 0.9
            share = max(0.0, 1.0 - reach / away) if away > 0 else 0.0
            face = math.atan2(now[1] - here.y, now[0] - here.x)
            return (
                (here.x + share * (now[0] - here.x), here.y + share * (now[1] - here.y)),
                face if wanted is None else wanted,
            )
        goal = now + (np.array([stand.x, stand.y]) - centre)
        return (float(goal[0]), float(goal[1])), stand.heading if wanted is None else wanted

    # ---- tracking

    def track_state(self, name: str) -> TrackState:
        """Return the state of a target's tracker as telemetry has it."""
        return TrackState(str(self.get(f"trackerstate {name}")))

    def _tracked(self) -> list[_Followed]:
        return [f for f in self._followed.values() if self.track_state(f.target.id) is not TrackState.FAILED]

    def _set_ranges(self) -> None:
        for name in self.targets:
            self._set_range(name)

    def lose_target(self, target: str, confidence: float = 0.1) -> None:
        """Hide a target from the tracker for good (a shadow only darkens it), by a fault."""
        followed = self._followed.get(target)
        if followed is None:
            return
        if confidence >= 0.25:
            followed.shaded = True
        else:
            followed.gone = True
            self.set(f"trackerstate {target}", TrackState.LOST.value)
            self.set(f"trackerconfidence {target}", confidence)

    def apply_fault(self, fault: Fault) -> None:
        """Bring a fault into effect now; a burst of slip is the soil's here."""
        if fault.kind is FaultKind.SLIP_BURST:
            self.chassis.extra_slip = 1.0 - 1.0 / fault.amount
        else:
            super().apply_fault(fault)

    def _view(self, point_believed: Array, camera: str = "navcam") -> tuple[StereoView, Frame, Frame]:
        """Point the mast at a believed point and take a stereo pair of subframes round it.

        Raises
        ------
        CameraError, RenderError, TrackerError
            If the mast cannot point there or the frame does not hold the point.
        """
        believed, true = self.chassis.believed.site_from_rover, self.chassis.pose.site_from_rover
        target_rover = believed.inverse().apply(point_believed)
        left_name, right_name = f"{camera}_left", f"{camera}_right"
        pan, tilt = self.rig.point_at(target_rover, left_name)
        jitter = self._mast_bias + self.profile.mast.noise_rad * self.rng.standard_normal(2)
        sun = self.sun_now()
        frames: list[Frame] = []
        models: list[CameraModel] = []
        exposure: float | None = None
        for name, width in ((left_name, SUBFRAME_PX), (right_name, SUBFRAME_PX + 2 * RIGHT_MARGIN_PX)):
            model = self.rig.camera(name, pan, tilt).transformed(believed)
            pixel = model.project(point_believed)
            if not np.isfinite(pixel).all():
                raise TrackerError("target is behind the camera")
            window = _window(pixel, width, SUBFRAME_PX, model)
            actual = self.rig.camera(name, pan + float(jitter[0]), tilt + float(jitter[1])).transformed(true)
            self._pictures += 1
            frame = self.renderer.render(
                actual,
                None,
                sun,
                window=window,
                sensor=self.rig.mounted(name).sensor,
                exposure=exposure,
                seed=self._seed * 100_003 + self._pictures,
            )
            exposure = frame.exposure
            frames.append(frame)
            models.append(model.window(*window))
        view = StereoView(
            frames[0].unit, frames[1].unit, models[0], models[1], self.t_s, self.chassis.travelled_m
        )
        return view, frames[0], frames[1]

    def _track_start(self, command: Command) -> Action:
        name = str(command.parameters["target"])
        if name not in self.targets:
            return Outcome(False, f"unknown target {name}")
        if name in self._followed:
            return Outcome(False, "already tracked")
        if self.camera_failed:
            return Outcome(False, "camera failed")
        duration, energy = self.spread("trackstart")
        yield Step(duration, energy)
        target = self.targets[name]
        point = np.array(target.point)
        try:
            view, left, _ = self._view(point)
            update = self.tracker.start(name, point, view)
        except (CameraError, TrackerError, RenderError) as err:
            return Outcome(False, str(err), {"energy_j": energy})
        truth = self._surface_near(left, update)
        if truth is None:
            self.tracker.clear(name)
            return Outcome(False, f"target {name} is not on the ground", {"energy_j": energy})
        self._followed[name] = _Followed(target, truth, update)
        self._tell(self._followed[name], update)
        return Outcome(
            True,
            values={
                "confidence": float(update.confidence),
                "range_m": float(update.scores.get("range_m", 0.0)),
                "energy_j": energy,
            },
        )

    def _surface_near(self, frame: Frame, update: TrackUpdate, reach_px: int = 4) -> Array | None:
        """Return the surface point that a new track stands for: seen near its pixel, nearest to its position.

        On a crest the pixel itself, off by the mast's error, may see the ground behind.
        """
        column, row = (round(float(v)) for v in update.pixel)
        rows = slice(max(0, row - reach_px), row + reach_px + 1)
        columns = slice(max(0, column - reach_px), column + reach_px + 1)
        points = frame.truth.point_site[rows, columns].reshape(-1, 3)
        points = points[np.isfinite(points).all(axis=1)]
        if not len(points):
            return None
        away = np.linalg.norm(points - self.true_from_believed.apply(update.position), axis=1)
        return np.asarray(points[int(np.argmin(away))], dtype=float)

    def _track_stop(self, command: Command) -> Action:
        yield from ()
        self._forget(str(command.parameters["target"]))
        return Outcome(True)

    def _forget(self, name: str) -> None:
        if self._followed.pop(name, None) is not None:
            self.tracker.clear(name)
            self.set(f"trackerstate {name}", TrackState.IDLE.value)
            self.set(f"trackerconfidence {name}", 0.0)

    def _track_all(self) -> Any:
        """Update every tracked target, each with its own pointing and pair of pictures."""
        for followed in self._tracked():
            duration, energy = self.spread("track_update")
            yield Step(duration, energy)
            self._tell(followed, self._follow(followed))

    def _follow(self, followed: _Followed) -> TrackUpdate:
        name = followed.target.id
        try:
            view, _, _ = self._view(self.tracker.predicted(name))
        except (CameraError, TrackerError, RenderError) as err:
            return self._unseen(followed, str(err))
        if followed.gone or self.camera_failed:
            noise = self.rng.random(view.left.shape).astype(np.float32)
            view = replace(view, left=noise)
        elif followed.shaded:
            shade = np.linspace(0.15, 1.6, view.left.shape[1], dtype=np.float32)[None, :] ** 2
            view = replace(view, left=np.clip(view.left * shade, 0, 1))
        return self.tracker.update(name, view)

    def _unseen(self, followed: _Followed, why: str) -> TrackUpdate:
        """Return the last answer, less sure: the mast cannot look there now, which is no miss of the tracker.

        After three such stops in a row the target counts as lost, until it is seen again.
        """
        confidence = 0.8 * followed.update.confidence
        state = followed.update.state
        if state is TrackerState.TRACKED and confidence < 0.5:
            state = TrackerState.LOST
        return replace(followed.update, state=state, confidence=confidence, reasons=(why,))

    def _tell(self, followed: _Followed, update: TrackUpdate) -> None:
        """Put an answer of the tracker into telemetry and history."""
        name = followed.target.id
        followed.update = update
        self.set(f"trackerstate {name}", update.state.value)
        self.set(f"trackerconfidence {name}", float(min(1.0, max(0.0, update.confidence))))
        self._set_range(name)
        self.history.append(
            TrackRecord(
                self.t_s,
                name,
                update.state.value,
                float(update.confidence),
                float(self.get(f"range {name}") or 0.0),
                self.true_error_m(name),
                tuple(update.reasons),
            )
        )

    @property
    def true_from_believed(self) -> Transform:
        """Return how the believed site frame lies in the true one, by where the rover is in both."""
        return self.chassis.pose.site_from_rover * self.chassis.believed.site_from_rover.inverse()

    def true_error_m(self, name: str) -> float:
        """Return how far the tracked position of a target is from the surface point it stands for."""
        followed = self._followed[name]
        here = self.true_from_believed.apply(followed.update.position)
        return float(np.linalg.norm(here - followed.truth))

    # ---- observations

    def _place(self, command: Command) -> Action:
        name = str(command.parameters["target"])
        instrument = str(command.parameters.get("instrument", self._contact_instrument()))
        if name not in self.targets:
            return Outcome(False, f"unknown target {name}", {"made": False})
        followed = self._followed.get(name)
        if followed is None or self.track_state(name) is not TrackState.TRACKED:
            return Outcome(False, f"target {name} is not tracked", {"made": False})
        try:
            figures = self.profile.instrument(instrument)
        except RoverError as err:
            return Outcome(False, str(err), {"made": False})
        contact = self.true_from_believed.apply(followed.update.position)
        spot = [float(v) for v in contact]
        try:
            check_observation_point(
                self.terrain, self.profile, self.chassis.pose, spot, target=name, instrument=instrument
            )
        except (PlacementError, RoverError) as err:
            duration, energy = self.spread("handoff")
            yield Step(duration, energy)
            return Outcome(False, str(err), {"made": False, "energy_j": energy})
        dwell = number(command, "dwell_s", 0.0)
        duration_ms, energy = self._drawn(figures.time_s.mean, figures.time_s.sd, figures.energy_j.mean)
        yield Step(duration_ms + milliseconds(dwell), energy)
        error = float(np.linalg.norm(contact - followed.truth))
        values: dict[str, Value] = {"made": True, "energy_j": energy, "placement_error_m": error}
        if self.rng.random() >= figures.p_success or self.camera_failed:
            self._forget(name)
            return Outcome(False, "no usable product", values)
        count = self._contact_products(command, name, instrument, contact, error)
        values["products"] = float(count)
        self._forget(name)
        return Outcome(True, values=values)

    def _contact_instrument(self) -> str:
        return next((n for n, i in self.profile.instruments.items() if i.kind == "contact"), "mi")

    def _drawn(self, mean_s: float, sd_s: float, energy_j: float) -> tuple[int, float]:
        """Return a duration drawn log-normal with this mean and spread, and the energy in proportion."""
        spread = math.sqrt(math.log1p((sd_s / mean_s) ** 2)) if mean_s > 0 else 0.0
        factor = math.exp(spread * float(self.rng.standard_normal()) - spread**2 / 2)
        return milliseconds(mean_s * factor), energy_j * factor

    def _image(self, command: Command) -> Action:
        if self.camera_failed:
            return Outcome(False, "camera failed", {"made": False})
        name = str(command.parameters.get("target", ""))
        if name and name not in self.targets:
            return Outcome(False, f"unknown target {name}", {"made": False})
        instrument = str(command.parameters.get("instrument", ""))
        figures = self.profile.instruments.get(instrument)
        if figures is None:
            figures = next(i for i in self.profile.instruments.values() if i.kind == "remote")
        camera = figures.camera or self.profile.cameras.science
        duration, energy = self._drawn(figures.time_s.mean, figures.time_s.sd, figures.energy_j.mean)
        yield Step(duration, energy)
        here = self.chassis.believed
        if name:
            followed = self._followed.get(name)
            point = np.array(self.targets[name].point) if followed is None else followed.update.position
        else:
            azimuth, elevation = number(command, "azimuth", 0.0), number(command, "elevation", 0.0)
            eye = here.site_from_rover.apply(self.sensor.eye)
            level = math.cos(elevation)
            point = eye + 20.0 * np.array(
                [level * math.cos(azimuth), level * math.sin(azimuth), math.sin(elevation)]
            )
        values: dict[str, Value] = {"made": True, "energy_j": energy}
        try:
            frame, pan, tilt = self._shoot(np.asarray(point, dtype=float), camera, 400)
        except (CameraError, RenderError) as err:
            return Outcome(False, str(err), {"made": False, "energy_j": energy})
        label = {
            "instrument": instrument or camera,
            "camera": camera,
            "camera_model": camera_label(frame.camera),
            "pan_rad": pan,
            "tilt_rad": tilt,
            "point_m": [float(v) for v in point],
        }
        if name:
            label["target"] = name
        values["products"] = float(self.write_product(command, "image", _png(frame.image8), ".png", label))
        return Outcome(True, values=values)

    def _shoot(self, point: Array, camera: str, size: int) -> tuple[Frame, float, float]:
        """Return a picture with a believed point in its middle."""
        believed, true = self.chassis.believed.site_from_rover, self.chassis.pose.site_from_rover
        pan, tilt = self.rig.point_at(believed.inverse().apply(point), camera)
        jitter = self._mast_bias + self.profile.mast.noise_rad * self.rng.standard_normal(2)
        model = self.rig.camera(camera, pan + float(jitter[0]), tilt + float(jitter[1])).transformed(true)
        window = _window(np.array([model.width / 2, model.height / 2]), size, size, model)
        self._pictures += 1
        frame = self.renderer.render(
            model,
            None,
            self.sun_now(),
            window=window,
            sensor=self.rig.mounted(camera).sensor,
            seed=self._seed * 100_003 + self._pictures,
        )
        return frame, pan, tilt

    def _panorama(self, command: Command) -> Action:
        if self.camera_failed:
            return Outcome(False, "camera failed")
        duration, energy = self.spread("imagepanorama")
        yield Step(duration, energy)
        count = 0
        if self.out is not None:
            strip = self._panorama_strip(
                number(command, "from_azimuth", math.pi), number(command, "to_azimuth", -math.pi)
            )
            label = {"camera": self.profile.cameras.navigation}
            count = int(self.write_product(command, "panorama", _png(strip), ".png", label))
        return Outcome(True, values={"products": float(count), "energy_j": energy})

    def _panorama_strip(self, left: float, right: float) -> NDArray[np.uint8]:
        """Return pictures side by side, from one azimuth to the other, clockwise; a fourth of full
        resolution.
        """
        span = (left - right) % (2 * math.pi) or 2 * math.pi
        name = self.profile.cameras.navigation
        true = self.chassis.pose.site_from_rover
        small = self.rig.mounted(name).model.scaled(0.25)
        fov = 2 * math.atan(small.width / 2 / small.hs)
        count = max(1, math.ceil(span / (0.9 * fov)))
        exposure: float | None = None
        strips = []
        for k in range(count):
            azimuth = left - span * (k + 0.5) / count - self.chassis.pose.heading
            mast = self.rig.rover_from_mast(wrap_angle(azimuth), math.radians(-18))
            frame = self.renderer.render(
                small.transformed(mast).transformed(true), None, self.sun_now(), exposure=exposure, seed=k
            )
            exposure = frame.exposure
            strips.append(frame.image8)
        return np.concatenate(strips, axis=1)

    def _point_mast(self, command: Command) -> Action:
        duration, energy = self.spread("pointmast")
        yield Step(duration, energy)
        name = str(command.parameters.get("target", ""))
        here = self.chassis.believed
        if name:
            if name not in self.targets:
                return Outcome(False, f"unknown target {name}")
            followed = self._followed.get(name)
            point = np.array(self.targets[name].point) if followed is None else followed.update.position
            try:
                pan, tilt = self.rig.point_at(here.site_from_rover.inverse().apply(point))
            except CameraError as err:
                return Outcome(False, str(err))
        else:
            pan = wrap_angle(number(command, "azimuth", 0.0) - here.heading)
            tilt = number(command, "elevation", 0.0)
        return Outcome(True, values={"pan": float(pan), "tilt": float(tilt)})

    def _handoff(self, command: Command) -> Action:
        name = str(command.parameters["target"])
        duration, energy = self.spread("handoff")
        yield Step(duration, energy)
        followed = self._followed.get(name)
        if followed is None or self.track_state(name) is not TrackState.TRACKED:
            return Outcome(False, f"target {name} is not tracked", {"energy_j": energy})
        rover = self.chassis.believed.site_from_rover.inverse().apply(followed.update.position)
        camera = self.rig.camera(self.profile.cameras.hazard)
        if not bool(camera.sees(rover)):
            return Outcome(False, f"the hazard camera does not see target {name}", {"energy_j": energy})
        away = float(np.linalg.norm(rover - camera.C))
        sigma = math.sqrt(float(np.trace(followed.update.covariance)) / 3)
        return Outcome(
            True,
            values={
                "error_px": float(camera.hs * sigma / max(away, 0.1)),
                "confidence": float(followed.update.confidence),
                "energy_j": energy,
            },
        )

    # ---- products

    def _contact_products(
        self, command: Command, name: str, instrument: str, contact: Array, error: float
    ) -> int:
        """Write what the hazard camera and the contact instrument see."""
        if self.out is None:
            return 0
        count = 0
        label: dict[str, Any] = {"target": name, "instrument": instrument, "placement_error_m": error}
        hazard = self.profile.cameras.hazard
        model = self.rig.camera(hazard).transformed(self.chassis.pose.site_from_rover)
        if max(model.width, model.height) > 700:
            model = model.scaled(0.5)
        try:
            frame = self.renderer.render(model, None, self.sun_now(), sensor=self.rig.mounted(hazard).sensor)
            seen = {**label, "camera": hazard, "camera_model": camera_label(frame.camera)}
            count += self.write_product(command, "hazcam", _png(frame.image8), ".png", seen)
        except RenderError:
            pass
        close = close_up(contact, self.terrain.normal(float(contact[0]), float(contact[1]), 0.08))
        try:
            frame = self.renderer.render(close, None, self.sun_now(), samples=2)
        except RenderError:
            return count
        shown = {**label, "camera_model": camera_label(close), "point_m": [float(v) for v in contact]}
        return count + self.write_product(command, "microscopic", _png(frame.image8), ".png", shown)

    def _drive_products(self, command: Command, goal: tuple[float, float]) -> None:
        """Write the hazard map, the odometry and the tracking history of a drive."""
        if self.out is None:
            return
        import json

        here = self.chassis.believed
        if self._navigator is not None:
            picture = self._navigator.map.picture(16.0, (here.x, here.y))
            label = {"frame": "site", "size_m": 16.0, "goal_m": list(goal)}
            self.write_product(command, "hazardmap", _png(picture), ".png", label)
        rows = [
            {
                "t_s": t,
                "true": [true.x, true.y, true.z, true.heading],
                "believed": [believed.x, believed.y, believed.z, believed.heading],
            }
            for t, true, believed in self.odometry
        ]
        tracks = [
            {
                "t_s": r.t_s,
                "target": r.target,
                "state": r.state,
                "confidence": r.confidence,
                "range_m": r.range_m,
                "error_m": r.error_m,
                "reasons": list(r.reasons),
            }
            for r in self.history
        ]
        for kind, table in (("odometry", rows), ("tracking", tracks)):
            if table:
                data = (json.dumps(table) + "\n").encode()
                self.write_product(command, kind, data, ".json", {"frame": "site", "rows": len(table)})


def _targets(world: World) -> list[WorldTarget]:
    """Return the targets of a world, from its problem where it lists none itself."""
    if world.targets:
        return list(world.targets)
    from rover_iface.simulator.model import AbstractModel

    if world.problem is None:
        return []
    model = AbstractModel.from_problem(world.problem)
    found = []
    for k, name in enumerate(model.targets):
        point = model.points[k]
        if point is None:
            raise WorldError(f'target {name} has no "point_m"; a subframe rover needs it')
        contact = any(o.contact for o in model.observations if o.place == k + 1)
        found.append(
            WorldTarget(
                name, point, kind="place" if contact else "image", observation_point=model.poses[k + 1]
            )
        )
    return found


def _half_width(world: World) -> float:
    """Return how far from the origin the rover may get: its targets and 6 m more, 12 to 40 m."""
    far = [abs(world.start.x), abs(world.start.y)]
    for target in _targets(world):
        far += [abs(target.point[0]), abs(target.point[1])]
    return min(40.0, max(12.0, max(far) + 6.0))


def _window(pixel: Array, width: int, height: int, model: CameraModel) -> tuple[int, int, int, int]:
    """Return the subframe round a pixel, moved inside the frame where it must be."""
    width, height = min(width, model.width), min(height, model.height)
    left = min(max(round(float(pixel[0])) - width // 2, 0), model.width - width)
    top = min(max(round(float(pixel[1])) - height // 2, 0), model.height - height)
    return left, top, width, height


def close_up(point: Array, normal: Array, distance_m: float = 0.11, field_m: float = 0.05) -> CameraModel:
    """Return the camera of a microscopic imager over a point [3], looking against the normal [3], site
    frame.
    """
    away = np.asarray(normal, dtype=float)
    away = away / np.linalg.norm(away)
    up = np.array([0.0, 1.0, 0.0]) if abs(away[2]) > 0.9 else np.array([0.0, 0.0, 1.0])
    pixels = 256
    return pinhole(
        focal_px=pixels * distance_m / field_m,
        width=pixels,
        height=pixels,
        center=np.asarray(point, dtype=float) + distance_m * away,
        forward=-away,
        up=up,
    )


def camera_label(camera: CameraModel) -> dict[str, Any]:
    """Return a camera model as plain values for a product's label; vectors in the true site frame."""
    label: dict[str, Any] = {"kind": camera.kind.value, "width": camera.width, "height": camera.height}
    for letter in camera.kind.value:
        label[letter] = [float(v) for v in getattr(camera, letter)]
    return label


def stand(rover: SubframeRover, pose: Pose) -> Pose:
    """Return where the rover would stand on the true ground of a subframe rover."""
    return settled_pose(rover.ground, rover.profile, pose.x, pose.y, pose.heading)
