"""What the navigator looks with: four stereo pairs at set pan and tilt, as ranges with the noise of stereo.

The ranges are cast on the true ground; the noise is that of a stereo pair (sigma = R^2 sigma_d / (f B)). A
rover with full images puts its own clouds in the place of these.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rover_iface.frames import Pose
from rover_iface.navigation.kernels import cast_ranges
from rover_iface.profile import RoverProfile
from rover_iface.terrain.terrain import Terrain

Array = NDArray[np.floating]


@dataclass(frozen=True)
class GroundRaster:
    """The true ground as one raster, quick to ask: heights [rows, columns], row 0 south."""

    heights: Array
    west: float
    south: float
    spacing: float

    @staticmethod
    def of(terrain: Terrain, half_m: float = 20.0, spacing_m: float = 0.05) -> GroundRaster:
        """Return the ground round the origin, as far as the terrain and `half_m` reach."""
        west, south, east, north = terrain.bounds
        box = (max(west, -half_m), max(south, -half_m), min(east, half_m), min(north, half_m))
        grid = terrain.as_height_grid(spacing_m, box)
        return GroundRaster(np.ascontiguousarray(grid.heights_m), grid.west_m, grid.south_m, grid.spacing_m)

    def height(self, x: object, y: object) -> Array:
        """Return bilinear heights at points, NaN outside."""
        px, py = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
        rows, columns = self.heights.shape
        c = (px - self.west) / self.spacing
        r = (py - self.south) / self.spacing
        outside = (c < 0) | (r < 0) | (c > columns - 1) | (r > rows - 1) | ~np.isfinite(c) | ~np.isfinite(r)
        c = np.where(outside, 0.0, c)
        r = np.where(outside, 0.0, r)
        j = np.minimum(c.astype(np.int64), columns - 2)
        i = np.minimum(r.astype(np.int64), rows - 2)
        fc, fr = c - j, r - i
        h = self.heights
        lower = h[i, j] * (1 - fc) + h[i, j + 1] * fc
        upper = h[i + 1, j] * (1 - fc) + h[i + 1, j + 1] * fc
        value: Array = np.where(outside, np.nan, lower * (1 - fr) + upper * fr)
        return value


@dataclass(frozen=True)
class StereoSensor:
    """Four views of the ground ahead. Angles in radians; the grid of rays is `columns` x `rows` per view."""

    profile: RoverProfile
    pans: tuple[float, ...] = tuple(math.radians(a) for a in (-60.0, -20.0, 20.0, 60.0))
    tilt: float = math.radians(-32.0)
    tilt_down: float = math.radians(-64.0)
    hfov: float = math.radians(45.0)
    vfov: float = math.radians(36.0)
    columns: int = 64
    rows: int = 48
    focal_px: float = 1236.0
    baseline_m: float = 0.20
    sigma_px: float = 0.3
    reach_m: float = 6.0
    drop_share: float = 0.05

    @property
    def pairs_around(self) -> int:
        """Return how many stereo pairs a look all round takes."""
        return len(self.directions) + len(self.directions_around)

    @cached_property
    def directions(self) -> list[Array]:
        """Return unit directions [rows x columns, 3] of each view in the rover frame."""
        return self._views(self.pointings())

    @cached_property
    def directions_around(self) -> list[Array]:
        """Return the same for the views that a look all round adds: sides, back, and near the wheels."""
        return self._views(self.pointings(around=True)[len(self.pans) :])

    def pointings(self, *, around: bool = False) -> list[tuple[float, float]]:
        """Return pan and tilt of each view; `around` adds the sides, the back, and the ground near the
        wheels.
        """
        ahead = [(pan, self.tilt) for pan in self.pans]
        if not around:
            return ahead
        limit = self.profile.mast.pan_limit_rad
        back = [s * min(math.radians(a), limit) for a in (100.0, 140.0, 180.0) for s in (-1, 1)]
        return [
            *ahead,
            *((pan, self.tilt) for pan in back),
            *((pan, self.tilt_down) for pan in (*self.pans, *back)),
        ]

    def _views(self, pointings: Sequence[tuple[float, float]]) -> list[Array]:
        views = []
        u = np.tan(self.hfov / 2) * np.linspace(-1, 1, self.columns)
        v = np.tan(self.vfov / 2) * np.linspace(-1, 1, self.rows)
        uu, vv = (g.ravel() for g in np.meshgrid(u, v))
        for pan, tilt in pointings:
            ct, st = math.cos(tilt), math.sin(tilt)
            cp, sp = math.cos(pan), math.sin(pan)
            forward = np.array([cp * ct, sp * ct, st])
            left = np.array([-sp, cp, 0.0])
            up = np.cross(forward, left)
            way = forward - uu[:, None] * left + vv[:, None] * up
            views.append(way / np.linalg.norm(way, axis=1, keepdims=True))
        return views

    @property
    def eye(self) -> Array:
        """Return the place of the cameras in the rover frame."""
        mast = self.profile.mast
        return np.array([mast.base_m[0], mast.base_m[1], mast.height_m])

    def look(
        self, ground: GroundRaster, true_pose: Pose, rng: np.random.Generator, *, around: bool = False
    ) -> list[Array]:
        """Return one cloud [n, 3] per view, in the rover frame, with noise; `around` adds views to all sides
        and of the near ground, for the first look at a place.
        """
        site_from_rover = true_pose.site_from_rover
        eye = site_from_rover.apply(self.eye)
        clouds = []
        for directions in [*self.directions, *(self.directions_around if around else ())]:
            world = np.ascontiguousarray(site_from_rover.rotate(directions))
            ranges = cast_ranges(
                ground.heights, ground.west, ground.south, ground.spacing, eye, world, self.reach_m
            )
            sigma = ranges**2 * self.sigma_px / (self.focal_px * self.baseline_m)
            seen = np.isfinite(ranges) & (rng.random(len(ranges)) >= self.drop_share)
            noisy = ranges + sigma * rng.standard_normal(len(ranges))
            clouds.append(self.eye + directions[seen] * noisy[seen, None])
        return clouds
