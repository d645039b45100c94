"""Registration of two views of a surface, and what it is worth.

Two engines behind one call. `nelder-mead` is the published one (Deans, Kunz, Sargent and others 2005, section
2): a virtual range sensor renders the fixed mesh, a correlation search over the sensor's x and y with the
median depth difference comes first, the simplex over six parameters with two restarts after it. `gicp` is
generalised ICP (small-gicp) after the same search, which also tries turns.

A registration says whether it is to be believed: share of overlap, depth deviation left, and how far the
target moves when the engine starts beside its own result. A smooth face slides along itself with a small
residual; only the last tells.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import Array, pinhole
from rover_iface.cameras.stereo import Cloud
from rover_iface.errors import TrackerError
from rover_iface.frames import Transform
from rover_iface.vision import shape_kernels
from rover_iface.vision.shape_engines import Gicp, NelderMead
from rover_iface.vision.sift_motion import small_rotation

DISPARITY_PX = 0.15
"""Error of dense stereo's disparities."""


@dataclass(frozen=True, slots=True)
class ShapeOptions:
    """Parameters of registration.

    Attributes
    ----------
    engine
        `gicp` or `nelder-mead`.
    radius_m
        How much of the surface round the target takes part.
    search_m
        Reach of the correlation search to either side in the sensor's x and y.
    turn_rad
        Turn about each axis that the search of `gicp` tries to either side; 0 for none.
    candidates
        How many results of the search are refined; the one that fits best is kept.
    voxel_m, neighbours
        Spacing of the points that GICP works on, and how many tell the shape round each.
    sensor_px
        Side of the virtual range sensor.
    cap_m
        Deviation above which a point counts as not belonging.
    least_overlap, most_deviation_m, most_spread_m, most_ahead
        What a registration needs to be believed.
    """

    engine: Literal["gicp", "nelder-mead"] = "gicp"
    radius_m: float = 0.75
    search_m: float = 0.36
    turn_rad: float = 0.15
    candidates: int = 3
    voxel_m: float = 0.02
    neighbours: int = 30
    sensor_px: int = 96
    cap_m: float = 0.05
    least_overlap: float = 0.3
    most_deviation_m: float = 0.012
    most_spread_m: float = 0.006
    most_ahead: float = 0.08

    def __post_init__(self) -> None:
        if not (self.radius_m > 0 and self.voxel_m > 0 and self.cap_m > 0 and self.sensor_px >= 24):
            raise TrackerError(
                f"registration within {self.radius_m} m, voxels of {self.voxel_m} m, cap {self.cap_m} m, "
                f"sensor {self.sensor_px} px; lengths must be positive, the sensor at least 24 px"
            )


@dataclass(frozen=True, eq=False)
class Surface:
    """A piece of surface as stereo gave it.

    Attributes
    ----------
    points
        (n, 3), metres.
    triangles
        (m, 3), between neighbouring pixels without a step in depth.
    eye
        (3,), where it was seen from.
    noise_m
        What stereo errs along the ray at its median range.
    """

    points: Array
    triangles: npt.NDArray[np.int32]
    eye: Array
    noise_m: float = 0.0

    def near(self, centre: npt.ArrayLike, radius_m: float) -> Surface:
        """Return the part within a radius."""
        keep = np.linalg.norm(self.points - np.asarray(centre), axis=1) < radius_m
        number = np.cumsum(keep) - 1
        whole = keep[self.triangles].all(axis=1)
        return Surface(
            self.points[keep], number[self.triangles[whole]].astype(np.int32), self.eye, self.noise_m
        )

    def moved(self, motion: Transform) -> Surface:
        """Return the surface in another frame."""
        points, eye = (np.asarray(motion.apply(v), dtype=np.float64) for v in (self.points, self.eye))
        return Surface(points, self.triangles, eye, self.noise_m)


def surface_from_cloud(cloud: Cloud, step: int, *, jump: float = 0.03) -> Surface:
    """Return the mesh of a stereo cloud of every `step`-th pixel; steps of `jump` of the range are cut."""
    x, y = (cloud.pixels[:, i].astype(np.int64) // step for i in (0, 1))
    index = np.full((int(y.max(initial=0)) + 2, int(x.max(initial=0)) + 2), -1)
    index[y, x] = np.arange(len(x))
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    triangles = np.concatenate([np.stack(t, axis=-1).reshape(-1, 3) for t in ((a, d, b), (b, d, c))])
    triangles = triangles[(triangles >= 0).all(axis=1)]
    ranges = np.linalg.norm(cloud.points - cloud.camera.C, axis=1)
    if len(triangles):
        corners = ranges[triangles]
        triangles = triangles[np.ptp(corners, axis=1) < jump * step / 2.0 * corners.min(axis=1)]
    middle = float(np.median(ranges)) if len(ranges) else 0.0
    noise = DISPARITY_PX * middle**2 / (cloud.camera.hs * cloud.baseline_m)
    return Surface(cloud.points, triangles.astype(np.int32), cloud.camera.C, noise)


@dataclass(frozen=True, eq=False)
class Registration:
    """How one surface lies on another.

    Attributes
    ----------
    scene_from_model
        The motion that lays the model on the scene.
    overlap
        Share of the model's points that the scene's sensor knows within the cap.
    deviation_m
        Median absolute depth deviation of those.
    spread_m
        How far the target moves when the engine starts beside its result.
    ahead
        Share of either surface that would lie in front of what the other eye saw there.
    reasons
        Why it is not to be believed; empty if it is.
    """

    scene_from_model: Transform
    overlap: float
    deviation_m: float
    spread_m: float
    ahead: float
    reasons: tuple[str, ...]

    @property
    def accepted(self) -> bool:
        """Return whether the registration passed its tests."""
        return not self.reasons

    def covariance(self) -> Array:
        """Return (3, 3), m^2, of a point carried by it: round, from deviation and spread."""
        sigma = math.hypot(0.5 * self.deviation_m, self.spread_m) + 0.001
        return np.asarray(sigma**2 * np.eye(3))


def register(
    model: Surface,
    scene: Surface,
    guess: Transform,
    target: npt.ArrayLike,
    options: ShapeOptions | None = None,
) -> Registration:
    """Return how `model` lies on `scene`, from a first guess, tested round `target` (3,) of the model.

    Too few points is a registration that is not accepted, with the guess as its motion.
    """
    options = options or ShapeOptions()
    at = np.asarray(target, dtype=np.float64)
    part = model.near(at, options.radius_m).moved(guess)
    centre = np.asarray(guess.apply(at), dtype=np.float64)
    other = scene.near(centre, options.radius_m + options.search_m)
    if len(part.points) < 100 or len(other.points) < 100 or len(other.triangles) < 50:
        why = f"{len(part.points)} and {len(other.points)} points are too few; 100 are needed"
        return Registration(guess, 0.0, math.inf, math.inf, 1.0, (why,))
    sensor = Sensor.over(other, centre, options)
    rough = sensor.search(part.points, centre, options)
    if not rough:
        why = f"no shift within {options.search_m:.2f} m gives half an overlap"
        return Registration(guess, 0.0, math.inf, math.inf, 1.0, (why,))
    refine: Gicp | NelderMead
    if options.engine == "gicp":
        refine = Gicp(part, other, centre, options)
    else:
        refine = NelderMead(part, sensor, centre, options)
    found = refine.all_of(rough)
    back = Sensor.over(part, centre, options)
    pairs = [
        (sensor.gaps(part.points, m, options.cap_m), back.gaps(other.points, m.inverse(), options.cap_m))
        for m in found
    ]
    best = int(np.argmin([sum(_cost(g, options.cap_m) for g in pair) for pair in pairs]))
    beside = refine(_beside(found[best], centre))
    spread = float(np.linalg.norm(beside.apply(centre) - found[best].apply(centre)))
    gaps = pairs[best][0]
    close = np.abs(gaps) < options.cap_m
    overlap = float(close.mean())
    deviation = float(np.median(np.abs(gaps[close]))) if close.any() else math.inf
    ahead = max(_ahead(g, options.cap_m) for g in pairs[best])
    reasons = []
    if overlap < options.least_overlap:
        reasons.append(f"overlap {overlap:.2f} is below {options.least_overlap:.2f}")
    # what the stereo of both allows, as long as it tells rock from ground
    limit_m = min(options.most_deviation_m + math.hypot(model.noise_m, scene.noise_m), 0.5 * options.cap_m)
    if not deviation <= limit_m:
        reasons.append(f"deviation {1000 * deviation:.1f} mm is above {1000 * limit_m:.1f} mm")
    if ahead > options.most_ahead:
        reasons.append(f"{ahead:.2f} lies in front of what was seen; the limit is {options.most_ahead:.2f}")
    if spread > options.most_spread_m:
        reasons.append(
            f"a start beside it ends {1000 * spread:.1f} mm away; "
            f"the limit is {1000 * options.most_spread_m:.1f} mm"
        )
    return Registration(found[best] * guess, overlap, deviation, spread, ahead, tuple(reasons))


@dataclass(frozen=True, eq=False)
class Sensor:
    """The virtual range sensor: a pinhole over the scene and the depth it sees of it."""

    sensor_from_site: Transform
    focal: float
    depth: Array

    @classmethod
    def over(cls, scene: Surface, centre: Array, options: ShapeOptions) -> Sensor:
        """Return a sensor at the eye of the scene that frames what takes part."""
        away = float(np.linalg.norm(centre - scene.eye))
        side = options.sensor_px
        focal = 0.5 * side * away / (options.radius_m + 0.5 * options.search_m)
        camera = pinhole(
            focal_px=focal, width=side, height=side, center=scene.eye, forward=centre - scene.eye
        )
        axes = np.stack((camera.horizontal, np.cross(camera.A, camera.horizontal), camera.A))
        sensor_from_site = Transform(axes, -axes @ scene.eye)
        depth = np.empty((side, side))
        points = np.ascontiguousarray(sensor_from_site.apply(scene.points), dtype=np.float64)
        shape_kernels.z_buffer(points, scene.triangles, focal, depth)
        return cls(sensor_from_site, focal, depth)

    def gaps(self, points: Array, motion: Transform, cap_m: float) -> Array:
        """Return signed depth deviations (n,) of moved points, NaN where no depth is known."""
        out = np.empty(len(points))
        local = self.sensor_from_site * motion
        rotation, shift = (
            np.ascontiguousarray(v, dtype=np.float64) for v in (local.rotation, local.translation)
        )
        shape_kernels.deviations(points, rotation, shift, self.depth, self.focal, cap_m, out)
        return out

    def search(self, points: Array, centre: Array, options: ShapeOptions) -> list[Transform]:
        """Return the best motions of the correlation search, best first; none without half an overlap."""
        few = points[:: max(1, len(points) // 350)]
        local = np.ascontiguousarray(self.sensor_from_site.apply(few), dtype=np.float64)
        middle = np.asarray(self.sensor_from_site.apply(centre), dtype=np.float64)
        turns = [np.zeros(3)]
        if options.engine == "gicp" and options.turn_rad > 0:
            steps = (-options.turn_rad, 0.0, options.turn_rad)
            turns = [np.array([a, b, c]) for a in steps for b in steps for c in steps]
        rotations = np.array([small_rotation(t) for t in turns])
        grid = np.arange(-options.search_m, options.search_m + 1e-9, 0.04)
        offsets = np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2)
        near = np.stack(np.meshgrid(*(np.linspace(-0.03, 0.03, 7),) * 2), axis=-1).reshape(-1, 2)
        arguments = (self.depth, self.focal, options.cap_m, 0.5)
        best = np.empty((len(rotations), 4))
        shape_kernels.correlate(local, rotations, offsets, middle, *arguments, best)
        out = []
        for k in np.argsort(best[:, 0])[: options.candidates]:
            if not np.isfinite(best[k, 0]):
                break
            turn, fine = rotations[k], np.empty((1, 4))
            shape_kernels.correlate(local, turn[None], near + best[k, 1:3], middle, *arguments, fine)
            shift = fine[0, 1:] if np.isfinite(fine[0, 0]) else best[k, 1:]
            step = Transform(turn, middle + shift - turn @ middle)
            out.append(self.sensor_from_site.inverse() * step * self.sensor_from_site)
        return out


def _beside(motion: Transform, centre: Array) -> Transform:
    """Return a start 2 cm and 2 degrees beside a motion."""
    place = np.asarray(motion.apply(centre), dtype=np.float64)
    turn = small_rotation(0.035 * np.array([0.6, -0.5, 0.6]))
    return Transform(turn, place - turn @ place + 0.02 * np.array([0.6, 0.6, -0.5])) * motion


def _cost(gaps: Array, cap_m: float) -> float:
    """Return the mean deviation, capped: whole for points in front of what was seen, half for hidden ones."""
    deviation = np.where(np.abs(gaps) < cap_m, np.abs(gaps), np.where(gaps < 0.0, cap_m, 0.5 * cap_m))
    return float(deviation.mean())


def _ahead(gaps: Array, cap_m: float) -> float:
    """Return the share of points with known depth that lie in front of what was seen."""
    known = np.isfinite(gaps)
    return float((gaps[known] < -cap_m).mean()) if known.any() else 1.0
