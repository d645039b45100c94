"""Surfaces as they were seen, the virtual range sensor over one of them, and how they are registered."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import Array, pinhole
from rover_iface.cameras.stereo import Cloud
from rover_iface.errors import TrackerError
from rover_iface.frames import Transform
from rover_iface.vision import shape_kernels
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
        """Return the part within a radius, m, of `centre` (3,), in the frame of the surface."""
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
class Sensor:
    """The virtual range sensor: a pinhole over the scene and the depth it sees of it."""

    sensor_from_site: Transform
    focal: float
    depth: Array

    @classmethod
    def over(cls, scene: Surface, centre: Array, options: ShapeOptions) -> Sensor:
        """Return a sensor at the eye of the scene that frames what takes part round `centre` [3], site frame,
        m.
        """
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
        """Return signed depth deviations (n,), m, of points (n, 3), m, that `motion` takes to the site frame,
        NaN where no depth is known.
        """
        out = np.empty(len(points))
        local = self.sensor_from_site * motion
        rotation, shift = (
            np.ascontiguousarray(v, dtype=np.float64) for v in (local.rotation, local.translation)
        )
        shape_kernels.deviations(points, rotation, shift, self.depth, self.focal, cap_m, out)
        return out

    def search(self, points: Array, centre: Array, options: ShapeOptions) -> list[Transform]:
        """Return the best motions of the correlation search, best first; none without half an overlap.

        `points` [n, 3] are moved, turns are about `centre` [3]; both in the site frame, m.
        """
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
