"""Worlds, runs and targets of the tracking studies (`tracking.py`)."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import CameraModel
from rover_iface.cameras.rig import CameraRig, load_cameras
from rover_iface.errors import RoverError, TrackerError
from rover_iface.frames import Pose, Transform
from rover_iface.simulator.render.from_terrain import scene_from_terrain
from rover_iface.simulator.render.picture import AutoExposure, Frame
from rover_iface.simulator.render.renderer import Renderer, Sun
from rover_iface.simulator.render.scene import Scene
from rover_iface.terrain.generate import generate_terrain
from rover_iface.terrain.rocks import Rock
from rover_iface.terrain.terrain import Terrain
from rover_iface.vision.correlation.ncc import NccTracker
from rover_iface.vision.template import NccOptions
from rover_iface.vision.tracker import StereoView, TrackState

Array = npt.NDArray[np.float64]
PIVOT = (0.3, 0.0, 1.4)
BIG = "BIG"


@dataclass
class World:
    """A terrain with one big rock at the origin, ready to render."""

    seed: int
    terrain: Terrain
    scene: Scene
    renderer: Renderer
    rock: Rock
    rig: CameraRig
    sun: Sun

    def pose(self, x: float, y: float, heading: float, rng: np.random.Generator, roll_sd: float) -> Pose:
        """Return the pose of a rover that stands on the ground here, with some roll and pitch."""
        z = self.terrain.height_at(x, y)
        return Pose(x, y, z, heading, math.radians(rng.normal(0, 1.0)), math.radians(rng.normal(0, roll_sd)))


def make_world(
    seed: int, *, preset: str = "k9", largest_m: float = 0.35, target_m: float | None = None
) -> World:
    """Return world number `seed`: rough ground, rocks, one at the origin, sun behind the rover.

    Parameters
    ----------
    largest_m
        Other rocks are smaller than this.
    target_m
        Width of the rock at the origin; None for one of 1.0 to 1.3 m.
    """
    rng = np.random.default_rng([seed, 0xB16])
    terrain = generate_terrain(
        seed,
        64.0,
        rock_cover=0.05,
        inner_m=30.0,
        crater=False,
        outcrop=False,
        relief_m=0.6,
        ortho=False,
    )
    keep = tuple(
        r for r in terrain.rocks if math.hypot(r.x, r.y) > 1.2 + r.diameter and r.diameter < largest_m
    )
    height = float(terrain.height(0.0, 0.0, ground=True))
    rock = Rock(
        BIG,
        0.0,
        0.0,
        height,
        diameter=float(rng.uniform(1.0, 1.3)),
        height=float(rng.uniform(0.7, 0.9)),
        yaw=float(rng.uniform(0, math.tau)),
        elongation=0.9,
        burial=0.25,
        seed=1000 + seed,
    )
    if target_m is not None:
        rock = replace(rock, diameter=target_m, height=0.55 * target_m, burial=0.15)
    terrain = replace(terrain, rocks=(rock, *keep))
    scene = scene_from_terrain(terrain, (0.0, 0.0), radius_m=14.0, far_m=60.0, seed=seed)
    # the rover comes from the west, looking east: azimuth 270 is behind it
    azimuth = 270.0 + rng.uniform(-50, 50)
    sun = Sun.from_angles(math.radians(azimuth), math.radians(rng.uniform(35, 60)))
    rig = CameraRig(load_cameras(preset), PIVOT)
    return World(seed, terrain, scene, Renderer(scene), rock, rig, sun)


@dataclass
class Stop:
    """One stop of a run: the pair, the true left camera and the frame with its truth."""

    view: StereoView
    truth: Frame
    true_left: CameraModel
    step: int


@dataclass
class Believed:
    """What the rover believes of its pose: motion as measured, summed up.

    `bias` (3,) is what it is off in the same way at every move, share of the distance, site frame.
    """

    error: Transform = field(default_factory=Transform.identity)
    bias: Array = field(default_factory=lambda: np.zeros(3))

    def drift(
        self, rng: np.random.Generator, pose: Pose, moved_m: float, share: float, heading_sd: float
    ) -> None:
        """Add the error of one more move that begins at `pose`: the rover turns where it stands."""
        shift = rng.normal(0, share * moved_m, 3) * (1.0, 1.0, 0.3) + moved_m * self.bias
        turn = Transform.from_rpy(0.0, 0.0, rng.normal(0, heading_sd * math.sqrt(max(moved_m, 0.0))))
        here = self.error.apply((pose.x, pose.y, pose.z))
        self.error = Transform(turn.rotation, here - turn.rotate(here) + shift) * self.error

    def of(self, pose: Pose, rng: np.random.Generator, attitude_sd: float = math.radians(0.1)) -> Transform:
        """Return the believed pose of a true one."""
        roll, pitch = rng.normal(0, attitude_sd, 2)
        noise = Transform.from_rpy(roll, pitch, 0.0)
        return self.error * pose.site_from_rover * noise


def stop_at(
    world: World,
    pose: Pose,
    believed: Transform,
    look_site: Array,
    rng: np.random.Generator,
    *,
    step: int,
    travelled_m: float,
    names: tuple[str, str] = ("navcam_left", "navcam_right"),
    half: tuple[int, int] | None = None,
    mast_noise: float = math.radians(0.07),
    disparity_px: float = 0.0,
    sun: Sun | None = None,
) -> Stop:
    """Point the mast at what is believed to be there and take the pair.

    The right camera is turned outwards by `disparity_px` against what its model says, the left one as told.
    """
    look_rover = believed.inverse().apply(look_site)
    pan, tilt = world.rig.point_at(look_rover, names[0])
    really = pan + rng.normal(0, mast_noise), tilt + rng.normal(0, mast_noise)
    sensor = world.rig.mounted(names[0]).sensor
    frames: list[Frame] = []
    cameras: list[CameraModel] = []
    for name in names:
        told = world.rig.camera(name, pan, tilt)
        if disparity_px and frames:
            turn = Transform.from_rpy(0.0, 0.0, -disparity_px / told.hs)
            told = told.transformed(Transform(turn.rotation, told.C - turn.rotate(told.C)))
        told = told.transformed(believed)
        window = None
        if half is not None:
            middle = told.project(look_site)
            width, height = 2 * half[0] + 1, 2 * half[1] + 1
            left = int(np.clip(round(middle[0]) - half[0], 0, told.width - width))
            top = int(np.clip(round(middle[1]) - half[1], 0, told.height - height))
            window = (left, top, width, height)
        frame = world.renderer.render(
            world.rig.camera(name, *really),
            pose,
            sun or world.sun,
            window=window,
            sensor=sensor,
            exposure=frames[0].exposure if frames else AutoExposure(),
            seed=int(rng.integers(1 << 30)),
        )
        frames.append(frame)
        cameras.append(told if window is None else told.window(*window))
    view = StereoView(frames[0].unit, frames[1].unit, cameras[0], cameras[1], travelled_m=travelled_m)
    return Stop(view, frames[0], frames[0].camera, step)


def _round_the_rock(world: World, range_m: float) -> tuple[int, int]:
    """Return the half size of a window that holds the big rock and 80 px beside it: what studies render."""
    model = world.rig.mounted("navcam_left").model
    reach = math.ceil(0.75 * world.rock.diameter * model.hs / range_m) + 80
    return min(reach, model.width // 2 - 1), min(reach, model.height // 2 - 1)


def straight_approach(
    world: World, *, first_m: float = 10.0, last_m: float = 2.26, share: float = 0.05, odometry: float = 0.02
) -> list[Stop]:
    """Return the stops of the Figure 8 run: steps of 5 % of what remains, from 10 m to 2.26 m."""
    rng = np.random.default_rng([world.seed, 8])
    look = np.array([0.0, 0.0, world.rock.z + 0.45 * world.rock.height])
    believed = Believed()
    stops: list[Stop] = []
    remaining, travelled = first_m, 0.0
    while True:
        pose = world.pose(-remaining - PIVOT[0], 0.0, 0.0, rng, 2.0)
        stops.append(
            stop_at(
                world,
                pose,
                believed.of(pose, rng),
                look,
                rng,
                step=len(stops),
                travelled_m=travelled,
                half=_round_the_rock(world, remaining),
            )
        )
        if remaining <= last_m:
            return stops
        moved = share * remaining
        believed.drift(rng, pose, moved, odometry, math.radians(0.3))
        remaining -= moved
        travelled += moved


def orbit(
    world: World, *, radius_m: float = 7.0, total_deg: float = 70.0, each_deg: float = 5.0
) -> list[Stop]:
    """Return the stops of the Figure 10 run: crab motion round the target, facing it."""
    rng = np.random.default_rng([world.seed, 10])
    look = np.array([0.0, 0.0, world.rock.z + 0.45 * world.rock.height])
    believed = Believed()
    stops: list[Stop] = []
    count = round(total_deg / each_deg)
    moved = radius_m * math.radians(each_deg)
    for n in range(count + 1):
        bearing = math.pi + math.radians(total_deg / 2 - n * each_deg)
        x, y = radius_m * math.cos(bearing), radius_m * math.sin(bearing)
        pose = world.pose(x, y, math.remainder(bearing + math.pi, math.tau), rng, 2.0)
        stops.append(
            stop_at(
                world,
                pose,
                believed.of(pose, rng),
                look,
                rng,
                step=n,
                travelled_m=n * moved,
                half=_round_the_rock(world, radius_m),
            )
        )
        believed.drift(rng, pose, moved, 0.02, math.radians(0.3))
    return stops


def choose_targets(
    stops: list[Stop],
    world: World,
    count: int,
    *,
    window: int = 21,
    views: tuple[int, ...] = (0, -1),
    seen_from_all: bool = False,
) -> list[tuple[Array, Array]]:
    """Return pixels of the first view and their true points: rows of targets on the big rock.

    As in the paper not on occluding boundaries (the whole window and 4 px more on the rock, no step in
    range) and, as the published guideline has it, not in shadow: at least 80 % of the window is sunlit in
    the first view. A target must not be hidden in the last view either.
    """
    truth = stops[0].truth.truth
    half = window // 2
    rock = truth.ids.index(BIG)
    on = truth.object_index == rock
    found = []
    lines, samples = np.nonzero(on)
    if not len(lines):
        return []
    top, bottom, left, right = lines.min(), lines.max(), samples.min(), samples.max()
    for y in range(int(top) + half, int(bottom) - half, 7):
        for x in range(int(left) + half, int(right) - half, 7):
            cut = (slice(y - half - 4, y + half + 5), slice(x - half - 4, x + half + 5))
            inner = (slice(y - half, y + half + 1), slice(x - half, x + half + 1))
            if not on[cut].all() or truth.lit[inner].mean() < 0.8:
                continue
            ranges = truth.range_m[cut]
            if np.abs(np.diff(ranges, axis=0)).max() > 0.08 or np.abs(np.diff(ranges, axis=1)).max() > 0.08:
                continue
            point = truth.point_site[y, x]
            checks = stops if seen_from_all else [stops[v] for v in views[1:]]
            if all(
                world.scene.sees(stop.true_left.C, point[None])[0] and stop.true_left.sees(point, 30.0)
                for stop in checks
            ) and (not seen_from_all or all(_stays_on_rock(stop, point, half) for stop in checks)):
                found.append((np.array([x, y], dtype=np.float64), point))
    if len(found) > count:
        picks = np.linspace(0, len(found) - 1, count).round().astype(int)
        found = [found[i] for i in picks]
    return found


def _stays_on_rock(stop: Stop, point: Array, half: int) -> bool:
    """Return whether the window round a point shows nothing but the rock, seen from not too flat an angle."""
    x, y = (round(v) for v in stop.true_left.project(point))
    truth = stop.truth.truth
    cut = (slice(y - half, y + half + 1), slice(x - half, x + half + 1))
    toward = stop.true_left.C - point
    flat = float(truth.normal_site[y, x] @ toward) / float(np.linalg.norm(toward)) < 0.3
    return bool((truth.object_index[cut] == truth.ids.index(BIG)).all()) and not flat


@dataclass
class Run:
    """One target through one run."""

    errors_px: list[float]
    errors_m: list[float]
    states: list[str]
    confidences: list[float]
    end_px: float


def track(stops: list[Stop], pixel: Array, point: Array, options: NccOptions, *, stay: bool = True) -> Run:
    """Follow one target; errors against where its true point is in each image.

    With `stay` losses are only recorded: thresholds are put out of the way, as in the paper's comparison of
    matchers, and the error at the end counts.
    """
    if stay:
        options = replace(
            options,
            score_limit=-1.0,
            stereo_limit=-1.0,
            disparity_error_px=6.0,
            odometry_share=1.0,
            back_check_px=math.inf,
            lost_updates=10**6,
        )
    tracker = NccTracker(options)
    run = Run([], [], [], [], math.inf)
    try:
        tracker.start("t", None, stops[0].view, pixel=pixel)
    except TrackerError:
        run.states.append("refused")
        return run
    for stop in stops[1:]:
        update = tracker.update("t", stop.view)
        true = stop.true_left.project(point)
        run.states.append(str(update.state))
        run.confidences.append(update.confidence)
        if update.state is TrackState.TRACKED:
            error = float(np.hypot(*(update.pixel - true)))
            off = _surface_error(stop, update.pixel, point)
        else:
            error, off = math.inf, math.inf
        run.errors_px.append(error)
        run.errors_m.append(off)
    run.end_px = run.errors_px[-1]
    return run


def every(stops: list[Stop], skip: int) -> list[Stop]:
    """Return the stops that a run with larger steps makes: every `skip`-th."""
    return stops[::skip]


@dataclass
class Approach:
    """One closed-loop approach with 161 x 161 subframes."""

    states: list[str] = field(default_factory=list)
    errors_m: list[float] = field(default_factory=list)
    confidences: list[float] = field(default_factory=list)
    ranges_m: list[float] = field(default_factory=list)
    scores: list[dict[str, float]] = field(default_factory=list)
    off_m: list[float] = field(default_factory=list)
    nees: list[float] = field(default_factory=list)
    reasons: list[tuple[str, ...]] = field(default_factory=list)
    end_error_m: float = math.inf
    corrected_m: float = 0.0

    @property
    def undetected(self) -> bool:
        """Whether some answer said tracked while more than 5 cm off."""
        return any(s == "tracked" and e > 0.05 for s, e in zip(self.states, self.errors_m, strict=True))


@dataclass(frozen=True)
class NavigationErrors:
    """What is wrong with pose estimate and stereo in a closed-loop approach.

    Attributes
    ----------
    odometry
        Random error of a move, share of its length, each axis.
    bias
        The same error at every move, share of its length, site frame (east, north).
    heading_sd
        Random walk of the heading, radians per square root of a metre.
    disparity_px
        By how much the right camera's model is off.
    """

    odometry: float = 0.05
    bias: tuple[float, float] = (0.0, 0.0)
    heading_sd: float = math.radians(0.5)
    disparity_px: float = 0.0


@dataclass(frozen=True)
class Disturbance:
    """What goes wrong in an approach, from stop `at` on."""

    kind: str = ""
    at: int = 5


def designate(
    world: World, rng: np.random.Generator, *, range_m: float, window: int = 21
) -> tuple[Pose, Array, Array] | None:
    """Return a pose `range_m` from a rock, a lit target on it and the middle of the rock."""
    rocks = [r for r in world.terrain.rocks if r.diameter > 0.30 and math.hypot(r.x, r.y) < 3.0]
    if not rocks:
        return None
    rock = rocks[int(rng.integers(len(rocks)))]
    sun = world.sun.direction
    bearing = math.atan2(sun[1], sun[0]) + rng.uniform(-0.9, 0.9)
    x, y = rock.x + range_m * math.cos(bearing), rock.y + range_m * math.sin(bearing)
    pose = world.pose(x, y, math.remainder(bearing + math.pi + rng.normal(0, 0.2), math.tau), rng, 2.0)
    look = np.array([rock.x, rock.y, rock.z + 0.5 * rock.height])
    try:
        stop = stop_at(world, pose, pose.site_from_rover, look, rng, step=0, travelled_m=0.0, half=(120, 120))
    except RoverError:
        return None
    truth = stop.truth.truth
    if rock.id not in truth.ids:
        return None
    on = truth.object_index == truth.ids.index(rock.id)
    half = window // 2
    lines, samples = np.nonzero(on)
    for _ in range(60):
        if not len(lines):
            return None
        n = int(rng.integers(len(lines)))
        y0, x0 = int(lines[n]), int(samples[n])
        cut = (slice(y0 - half - 2, y0 + half + 3), slice(x0 - half - 2, x0 + half + 3))
        if not (20 < x0 < 220 and 20 < y0 < 220) or not on[cut].all() or truth.lit[cut].mean() < 0.9:
            continue
        return pose, truth.point_site[y0, x0], look
    return None


def closed_loop(
    world: World,
    pose: Pose,
    point: Array,
    rng: np.random.Generator,
    options: NccOptions,
    *,
    errors: NavigationErrors | None = None,
    slope_deg: float = 0.0,
    step_share: float = 0.10,
    last_m: float = 2.0,
    half: int = 80,
    disturbance: Disturbance | None = None,
) -> Approach | None:
    """Drive towards a target in steps of `step_share` of the range, looking where the tracker says it is.

    On a slope the rover slips: up to half of each step at 20 degrees, in a random direction, of which the
    pose estimate notices two thirds (visual odometry is not perfect). None when the target cannot be
    designated.
    """
    errors = errors or NavigationErrors()
    believed = Believed(bias=np.array([*errors.bias, 0.0]))
    tracker, run = NccTracker(options), Approach()
    travelled, stop_number = 0.0, 0
    look = point
    sun = world.sun
    disturbance = disturbance or Disturbance()
    slip_share = 0.5 * min(1.0, (slope_deg / 20.0) ** 2)
    start_position = point
    for stop_number in range(40):
        told = believed.of(pose, rng)
        hit = disturbance.kind and stop_number == disturbance.at
        if hit and disturbance.kind == "light":
            turned = math.atan2(sun.direction[0], sun.direction[1]) + math.pi * 0.75
            sun = Sun.from_angles(turned, math.radians(12.0), strength=0.5)
        if hit and disturbance.kind == "azimuth":
            pose = _beside(world, pose, point, rng)
            told = believed.of(pose, rng)
        try:
            stop = stop_at(
                world,
                pose,
                told,
                look,
                rng,
                step=stop_number,
                travelled_m=travelled,
                half=(half, half),
                disparity_px=errors.disparity_px,
                sun=sun,
            )
        except RoverError:
            return run if run.states else None
        true_pixel = stop.true_left.project(point)
        if stop_number == 0:
            try:
                update = tracker.start("t", None, stop.view, pixel=true_pixel)
            except TrackerError:
                return None
            start_position = update.position
        else:
            update = tracker.update("t", stop.view)
            run.states.append(str(update.state))
            run.confidences.append(update.confidence)
            run.scores.append(dict(update.scores))
            run.reasons.append(update.reasons)
            run.ranges_m.append(float(np.linalg.norm(point - stop.true_left.C)))
            error = math.inf
            if update.state is TrackState.TRACKED:
                error = _surface_error(stop, update.pixel, point)
                told_axes, true_axes = _axes(stop.view.left_camera), _axes(stop.true_left)
                relative = told_axes @ (update.position - stop.view.left_camera.C)
                relative -= true_axes @ (point - stop.true_left.C)
                run.off_m.append(float(np.linalg.norm(relative)))
                spread = told_axes @ update.covariance @ told_axes.T
                run.nees.append(float(relative @ np.linalg.solve(spread, relative)))
            run.errors_m.append(error)
            if update.state is TrackState.FAILED:
                return run
        look = tracker.predicted("t")
        run.corrected_m = float(np.linalg.norm(look - start_position))
        remaining = float(np.hypot(*(told.inverse().apply(look)[:2] - PIVOT[:2])))
        if remaining <= last_m:
            run.end_error_m = run.errors_m[-1] if run.errors_m else math.inf
            return run
        step = min(step_share * remaining, remaining - last_m + 0.05)
        seen = pose.site_from_rover.inverse().apply(point)
        heading = pose.heading + math.atan2(seen[1], seen[0]) * 0.5 + rng.normal(0, 0.03)
        slip = slip_share * step * rng.uniform(0.3, 1.0)
        direction = rng.uniform(0, math.tau)
        before = pose
        pose = world.pose(
            before.x + step * math.cos(heading) + slip * math.cos(direction),
            before.y + step * math.sin(heading) + slip * math.sin(direction),
            math.remainder(heading, math.tau),
            rng,
            2.0,
        )
        believed.drift(rng, before, step, errors.odometry, errors.heading_sd)
        unnoticed = np.array([math.cos(direction), math.sin(direction), 0.0]) * (-slip / 3.0)
        believed.error = Transform.from_rpy(0.0, 0.0, 0.0, unnoticed) * believed.error
        travelled += step
    return run


def _axes(camera: CameraModel) -> Array:
    """Return rows, columns and axis of a camera as the rows of a rotation."""
    return np.stack((camera.horizontal, np.cross(camera.A, camera.horizontal), camera.A))


def _beside(world: World, pose: Pose, point: Array, rng: np.random.Generator) -> Pose:
    """Return the pose 65 degrees round the target: another face of the rock looks at the rover."""
    offset = np.array([pose.x - point[0], pose.y - point[1]])
    angle = math.radians(65.0) * (1 if rng.random() < 0.5 else -1)
    c, s = math.cos(angle), math.sin(angle)
    x, y = point[0] + c * offset[0] - s * offset[1], point[1] + s * offset[0] + c * offset[1]
    return world.pose(x, y, math.remainder(pose.heading + angle, math.tau), rng, 2.0)


def _surface_error(stop: Stop, pixel: Array, point: Array) -> float:
    """Return how far the surface under a pixel lies from the true point, metres (bilinear between rays)."""
    truth = stop.truth.truth
    rows, columns = truth.range_m.shape
    x, y = min(max(pixel[0], 0.0), columns - 1.001), min(max(pixel[1], 0.0), rows - 1.001)
    i, j = int(x), int(y)
    fx, fy = x - i, y - j
    p = truth.point_site[j : j + 2, i : i + 2]
    if not np.isfinite(p).all():
        return math.inf
    weights = np.array([[(1 - fx) * (1 - fy), fx * (1 - fy)], [(1 - fx) * fy, fx * fy]])
    return float(np.linalg.norm((weights[..., None] * p).sum(axis=(0, 1)) - point))


def turn_in_place(
    world: World, *, range_m: float = 6.0, total_deg: float = 90.0, each_deg: float = 5.0
) -> list[Stop]:
    """Return the stops of a rover that turns where it stands, its mast on the target."""
    rng = np.random.default_rng([world.seed, 45])
    look = np.array([0.0, 0.0, world.rock.z + 0.45 * world.rock.height])
    believed = Believed()
    stops: list[Stop] = []
    for n in range(round(total_deg / each_deg) + 1):
        heading = math.radians(-total_deg / 2 + n * each_deg)
        pose = world.pose(-range_m, 0.0, heading, rng, 2.0)
        stops.append(
            stop_at(
                world,
                pose,
                believed.of(pose, rng),
                look,
                rng,
                step=n,
                travelled_m=0.05 * n,
                half=_round_the_rock(world, range_m),
            )
        )
        believed.drift(rng, pose, 0.05, 0.2, math.radians(1.0))
    return stops


def _checkout_path(bearing: float, drift: float, recoil: float, level: float) -> list[tuple[Array, float]]:
    """Return mast places (site, target at the origin) and headings of the first flight checkout, radians."""
    heading = 0.0
    mast = -level * np.array([math.cos(bearing), math.sin(bearing)])
    places = [(mast, heading)]
    for move in (0.425, 0.425, 0.55, 0.55, 0.55):
        middle = heading + 0.5 * drift
        mast = mast + move * np.array([math.cos(middle), math.sin(middle)])
        heading += drift
        places.append((mast, heading))
    mast = mast * (1.0 + recoil / float(np.linalg.norm(mast)))
    heading += math.radians(20.0)
    places.append((mast, heading))
    mast = mast + np.array([math.cos(heading), math.sin(heading)])
    places.append((mast, heading))
    return places


def checkout_changes(path: list[tuple[Array, float]], height: float) -> tuple[Array, Array]:
    """Return azimuth changes (degrees) and magnifications along a path."""
    azimuths = np.unwrap([math.atan2(m[1], m[0]) for m, _ in path])
    ranges = np.array([math.hypot(float(np.linalg.norm(m)), height) for m, _ in path])
    return np.degrees(np.abs(np.diff(azimuths))), ranges[:-1] / ranges[1:]


def flight_checkout_1(
    world: World, azimuths: list[float], magnifications: list[float]
) -> tuple[list[Stop], dict[str, float]]:
    """Return the eight positions of Table III: 2 x 42.5 cm, 3 x 55 cm, 20 degrees turned; target 4 m off.

    What the paper does not say is fitted to its azimuths and magnifications: the bearing of the target from
    the first heading, a steady change of heading per move, and how far the mast recedes in the turn.
    """
    rng = np.random.default_rng([world.seed, 3])
    look = np.array([0.0, 0.0, world.rock.z + 0.5 * world.rock.height])
    eye_height = PIVOT[2] + 0.15 + world.terrain.height_at(-3.7, 0.0) - look[2]
    level = math.sqrt(4.0**2 - eye_height**2)
    best: tuple[float, float, float, float] | None = None
    for bearing in np.radians(np.arange(58.0, 76.0, 0.5)):
        for drift in np.radians(np.arange(-1.0, 7.0, 0.25)):
            for recoil in (0.0, 0.04, 0.08, 0.12, 0.16):
                turned, scale = checkout_changes(_checkout_path(bearing, drift, recoil, level), eye_height)
                gap = float(
                    (((turned - azimuths) / 0.5) ** 2).sum() + (((scale - magnifications) / 0.01) ** 2).sum()
                )
                if best is None or gap < best[0]:
                    best = (gap, float(bearing), float(drift), recoil)
    assert best is not None
    _, bearing, drift, recoil = best
    believed = Believed()
    stops: list[Stop] = []
    travelled, before = 0.0, None
    for n, (mast, heading) in enumerate(_checkout_path(bearing, drift, recoil, level)):
        c, s = math.cos(heading), math.sin(heading)
        x, y = mast[0] - c * PIVOT[0], mast[1] - s * PIVOT[0]
        moved = 0.0 if before is None else float(np.linalg.norm(mast - before))
        before = mast
        travelled += moved
        pose = Pose(float(x), float(y), world.terrain.height_at(float(x), float(y)), heading)
        if n:
            believed.drift(rng, pose, max(moved, 0.05), 0.02, math.radians(0.2))
        stops.append(
            stop_at(
                world, pose, believed.of(pose, rng), look, rng, step=n, travelled_m=travelled, half=(80, 80)
            )
        )
    fitted = {
        "bearing_deg": math.degrees(bearing),
        "heading_change_per_move_deg": math.degrees(drift),
        "recoil_in_turn_m": recoil,
    }
    return stops, fitted


def point_on(world: World, eye: Array, look: Array) -> Array:
    """Return the surface point that a line of sight meets."""
    ray = (look - eye) / np.linalg.norm(look - eye)
    return np.asarray(eye + float(world.scene.ranges(eye, ray[None])[0]) * ray)
