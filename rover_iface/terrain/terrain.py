"""Terrain: heights, ortho images and rocks of a site, with the questions one asks of them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rover_iface.errors import OutsideTerrainError, TerrainFormatError
from rover_iface.terrain.grid import Array, Bounds, HeightGrid, HeightLayer, Ortho
from rover_iface.terrain.rocks import Mesh, Rock, rock_meshes
from rover_iface.terrain.surface import Surface


@dataclass(frozen=True)
class Terrain:
    """The ground of a site in its site frame (east-north-up, metres).

    Where a method takes `x` and `y`, they are site coordinates, m, of any one shape [...], or numbers;
    answered is one value for each, [...].

    Parameters
    ----------
    layers
        Height rasters, finest first: a question is answered by the first that covers the point.
    orthos
        Ortho images, finest first.
    rocks
        Rocks with known geometry, where the terrain was generated; they are part of the heights.
    panorama
        Files of the pictures that the heights were made from, the document `panorama/1` first; none as a
        rule.
    surface
        What lies on the ground where a geology made it; none: as on any site.
    """

    name: str
    layers: tuple[HeightLayer, ...]
    orthos: tuple[Ortho, ...] = ()
    rocks: tuple[Rock, ...] = ()
    credits: str = ""
    origin: Mapping[str, float | str] = field(default_factory=dict)
    sha256: str = ""
    panorama: tuple[Path, ...] = ()
    surface: Surface | None = None

    def __post_init__(self) -> None:
        if not self.layers:
            raise TerrainFormatError(f'terrain "{self.name}" has no heights')
        heading = self.origin.get("heading_rad", 0.0)
        if not isinstance(heading, int | float) or not abs(heading) <= math.tau or isinstance(heading, bool):
            raise TerrainFormatError(
                f'terrain "{self.name}": heading_rad of its origin is {str(heading)[:40]!r}; it must be a '
                "number from -2 pi to 2 pi"
            )

    @property
    def start_heading_rad(self) -> float:
        """Return where a rover looks that starts in the origin of the site frame; 0 is east."""
        return float(self.origin.get("heading_rad", 0.0))

    # ---- extent

    @property
    def bounds(self) -> Bounds:
        """Return west, south, east, north of the widest layer."""
        boxes = np.array([layer.bounds for layer in self.layers])
        lo, hi = boxes.min(axis=0), boxes.max(axis=0)
        return float(lo[0]), float(lo[1]), float(hi[2]), float(hi[3])

    @property
    def spacing(self) -> float:
        """Return the finest distance between posts, metres."""
        return self.layers[0].spacing

    def inside(self, x: ArrayLike, y: ArrayLike) -> NDArray[np.bool_]:
        """Return where the height is known; shape of x."""
        x, y = _pair(x, y)
        found = np.zeros(x.shape, dtype=bool)
        for layer in self.layers:
            found |= layer.covers(x, y)
        return found

    def require_inside(self, x: float, y: float, what: str = "point") -> None:
        """Raise `OutsideTerrainError`, which names the point and the extent, if the height there is
        unknown.
        """
        if not bool(self.inside(x, y)):
            west, south, east, north = self.bounds
            if west <= x <= east and south <= y <= north:
                raise OutsideTerrainError(
                    f'{what} ({x:.2f}, {y:.2f}) lies in a hole of the terrain "{self.name}": no height is '
                    "known there"
                )
            raise OutsideTerrainError(
                f'{what} ({x:.2f}, {y:.2f}) lies outside the terrain "{self.name}", which reaches from '
                f"({west:.1f}, {south:.1f}) to ({east:.1f}, {north:.1f}) m"
            )

    # ---- heights and shape

    def height(self, x: ArrayLike, y: ArrayLike, *, ground: bool = False) -> Array:
        """Return heights, m, at points, NaN outside; `ground` leaves the rocks away where they are known."""
        x, y = _pair(x, y)
        value = np.full(x.shape, np.nan)
        places = x.ravel(), y.ravel()
        for layer in self.layers:
            if not layer.fill(value.reshape(-1), *places, ground=ground):
                break
        return value

    def height_at(self, x: float, y: float, what: str = "point") -> float:
        """Return the height of one point.

        Raises
        ------
        OutsideTerrainError
            If the point lies outside.
        """
        self.require_inside(x, y, what)
        return float(self.height(x, y))

    def normal(self, x: ArrayLike, y: ArrayLike, baseline_m: float | None = None) -> Array:
        """Return upward unit normals [..., 3] from central differences over `baseline_m` (default 2 posts).

        At the rim of the terrain the one-sided difference is taken.
        """
        x, y = _pair(x, y)
        half = (baseline_m if baseline_m is not None else 2 * self.spacing) / 2
        off = np.reshape((half, -half, 0.0, 0.0, 0.0), (5, *(1,) * x.ndim))
        heights = self.height(x + off, y + np.roll(off, 2, axis=0))
        known = ~np.isnan(heights)
        ends = np.where(known[:4], heights[:4], heights[4])
        span = half * (known[0:4:2].astype(float) + known[1:4:2])
        gx, gy = (ends[0:4:2] - ends[1:4:2]) / np.where(span > 0, span, np.nan)
        normal = np.stack([-gx, -gy, np.ones_like(gx)], axis=-1)
        return normal / np.linalg.norm(normal, axis=-1, keepdims=True)

    def slope(self, x: ArrayLike, y: ArrayLike, baseline_m: float = 1.0) -> Array:
        """Return the steepest slope in radians over `baseline_m`, about a rover's length by default."""
        up = self.normal(x, y, baseline_m)[..., 2]
        return np.arccos(np.clip(up, -1.0, 1.0))

    def roughness(self, x: ArrayLike, y: ArrayLike, radius_m: float = 0.5) -> Array:
        """Return the rms distance in metres of a disc of `radius_m` from its best plane."""
        x, y = _pair(x, y)
        step = max(self.spacing, radius_m / 6)
        count = math.floor(radius_m / step)
        ax = np.arange(-count, count + 1) * step
        dx, dy = (g.ravel() for g in np.meshgrid(ax, ax))
        keep = np.hypot(dx, dy) <= radius_m
        dx, dy = dx[keep], dy[keep]
        basis = np.column_stack([dx, dy, np.ones_like(dx)])
        heights = self.height(x[..., None] + dx, y[..., None] + dy)
        residual = heights - (heights @ np.linalg.pinv(basis).T) @ basis.T
        result: Array = np.sqrt(np.mean(residual**2, axis=-1))
        return result

    def observed(self, x: ArrayLike, y: ArrayLike) -> NDArray[np.bool_]:
        """Return where the ground was seen by the rover's own cameras (true where no mask says otherwise)."""
        x, y = _pair(x, y)
        seen = np.zeros(x.shape, dtype=bool)
        open_ = np.ones(x.shape, dtype=bool)
        for layer in self.layers:
            take = open_ & layer.covers(x, y)
            if layer.mask is None:
                seen |= take
            else:
                seen |= take & layer.mask[layer.nearest_post(x, y)]
            open_ &= ~take
        return seen

    def sigma(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Return the standard deviation, m, of the heights at points; NaN where the terrain does not tell
        it.
        """
        x, y = _pair(x, y)
        told = np.full(x.shape, np.nan)
        open_ = np.ones(x.shape, dtype=bool)
        for layer in self.layers:
            take = open_ & layer.covers(x, y)
            if layer.sigma is not None:
                told[take] = layer.sigma[layer.nearest_post(x, y)][take]
            open_ &= ~take
        return told

    # ---- sight

    def line_of_sight(
        self, eye: ArrayLike, target: ArrayLike, *, clearance_m: float = 0.02, end_gap_m: float = 0.15
    ) -> NDArray[np.bool_]:
        """Return whether the straight line from `eye` [..., 3] to `target` [..., 3], site frame, m, stays
        above the ground.

        The last `end_gap_m` before the target is not tested: a target lies on the surface it is picked from.
        """
        a, b = np.broadcast_arrays(np.asarray(eye, dtype=float), np.asarray(target, dtype=float))
        length = np.linalg.norm(b - a, axis=-1)
        far = float(length.max(initial=0.0))
        count = int(min(2000, max(2, math.ceil(far / max(self.spacing, 0.05)))))
        share = np.linspace(0.0, 1.0, count + 1)
        reach = np.clip(1.0 - end_gap_m / np.maximum(length, 1e-9), 0.0, 1.0)
        t = share * reach[..., None]
        points = a[..., None, :] + t[..., None] * (b - a)[..., None, :]
        ground = self.height(points[..., 0], points[..., 1])
        blocked = (ground > points[..., 2] + clearance_m).any(axis=-1)
        clear: NDArray[np.bool_] = ~blocked
        return clear

    def intersect_rays(
        self, eyes: ArrayLike, directions: ArrayLike, max_range_m: float = 100.0, *, coarsening: float = 0.0
    ) -> Array:
        """Return the points (..., 3) where rays from `eyes` (..., 3) along `directions` (..., 3), site frame,
        m, first meet the surface; NaN where a ray meets none or begins below it.

        A ridge that is thinner along a ray than half a post, or than `coarsening` times its distance, may be
        passed through.
        """
        starts, ways = np.broadcast_arrays(np.asarray(eyes, dtype=float), np.asarray(directions, dtype=float))
        starts, ways = starts.reshape(-1, 3), ways.reshape(-1, 3)
        ways = ways / np.linalg.norm(ways, axis=1, keepdims=True)
        near, far = np.zeros(len(starts)), np.full(len(starts), np.nan)
        active = np.flatnonzero(self._above(starts, ways, near) > 0)
        t, step = 0.0, max(0.02, self.spacing / 2)
        while t < max_range_m and active.size:
            t = min(max_range_m, t + max(step, coarsening * t))
            met = self._above(starts[active], ways[active], np.full(active.size, t)) <= 0
            far[active[met]] = t
            active = active[~met]
            near[active] = t
        near, far = near.copy(), far.copy()
        for _ in range(30):
            middle = (near + far) / 2
            above = self._above(starts, ways, middle) > 0
            near, far = np.where(above, middle, near), np.where(above, far, middle)
        shape = np.broadcast_shapes(np.shape(eyes), np.shape(directions))
        return (starts + far[:, None] * ways).reshape(shape)

    def _above(self, starts: Array, ways: Array, t: Array) -> Array:
        """Return how far points on rays stand above the surface, m; NaN outside the terrain."""
        points = starts + t[:, None] * ways
        above: Array = points[:, 2] - self.height(points[:, 0], points[:, 1])
        return above

    # ---- rocks

    @cached_property
    def _rock_table(self) -> Array:
        return np.array([(r.x, r.y, r.diameter / 2) for r in self.rocks], dtype=float).reshape(-1, 3)

    def nearest_rock(self, x: float, y: float) -> tuple[Rock, float] | None:
        """Return the rock whose edge is nearest and the distance to that edge, m (0 on the rock), or None."""
        table = self._rock_table
        if not len(table):
            return None
        distance = np.hypot(table[:, 0] - x, table[:, 1] - y) - table[:, 2]
        k = int(np.argmin(distance))
        return self.rocks[k], max(0.0, float(distance[k]))

    def rocks_near(self, x: float, y: float, radius_m: float) -> list[Rock]:
        """Return rocks that reach into a circle, nearest first."""
        table = self._rock_table
        if not len(table):
            return []
        distance = np.hypot(table[:, 0] - x, table[:, 1] - y) - table[:, 2]
        order = np.argsort(distance, kind="stable")
        return [self.rocks[int(k)] for k in order if distance[k] <= radius_m]

    # ---- for others

    def as_height_grid(self, spacing_m: float, bounds: Bounds | None = None) -> HeightGrid:
        """Return heights sampled at `spacing_m` over `bounds` (default: everything).

        Raises
        ------
        TerrainFormatError
            If the spacing is not positive or the grid would hold more than 64 million posts.
        """
        west, south, east, north = bounds if bounds is not None else self.bounds
        if not spacing_m > 0:
            raise TerrainFormatError(f"spacing of a height grid is {spacing_m} m; it must be positive")
        columns = math.floor((east - west) / spacing_m + 1e-9)
        rows = math.floor((north - south) / spacing_m + 1e-9)
        if columns < 2 or rows < 2 or columns * rows > 64_000_000:
            raise TerrainFormatError(
                f"height grid of {columns} x {rows} posts at {spacing_m} m; "
                "2 x 2 to 64 million posts are possible"
            )
        first_x, first_y = west + spacing_m / 2, south + spacing_m / 2
        gx = first_x + np.arange(columns) * spacing_m
        gy = first_y + np.arange(rows) * spacing_m
        heights = np.concatenate(
            [self.height(*np.meshgrid(gx, part)) for part in np.array_split(gy, max(1, rows // 256))]
        )
        return HeightGrid(heights, first_x, first_y, spacing_m)

    def mesh(
        self, bounds: Bounds | None = None, spacing_m: float | None = None, *, ground: bool = True
    ) -> Mesh:
        """Return the ground as triangles; without rocks by default, since `rock_meshes` gives those.

        Vertices [n, 3] in the site frame; triangles [m, 3] wound so that normals point up. Cells that touch
        an unknown height are left out.
        """
        west, south, east, north = bounds if bounds is not None else self.bounds
        step = spacing_m if spacing_m is not None else self.spacing
        gx = np.arange(west + step / 2, east - step / 2 + 1e-9, step)
        gy = np.arange(south + step / 2, north - step / 2 + 1e-9, step)
        xx, yy = np.meshgrid(gx, gy)
        zz = self.height(xx, yy, ground=ground)
        rows, columns = zz.shape
        index = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
        a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]
        triangles = np.concatenate(
            [np.stack([a, b, d], axis=-1).reshape(-1, 3), np.stack([a, d, c], axis=-1).reshape(-1, 3)]
        )
        known = np.isfinite(zz).ravel()
        triangles = triangles[known[triangles].all(axis=1)]
        vertices = np.column_stack([xx.ravel(), yy.ravel(), np.nan_to_num(zz).ravel()]).astype(np.float32)
        return Mesh(vertices, triangles)

    def rock_meshes(self, x: float, y: float, radius_m: float, *, detail: int | None = None) -> list[Mesh]:
        """Return one closed mesh per rock that reaches into a circle; `Mesh.id` is the rock's id."""
        return rock_meshes(self.rocks_near(x, y, radius_m), detail=detail)


def stereo_covariance(
    eye: ArrayLike,
    point: ArrayLike,
    *,
    focal_px: float,
    baseline_m: float,
    sigma_px: float = 0.5,
) -> Array:
    """Return the covariance [3, 3] of a point picked in a stereo pair, in the frame of `eye` and `point`.

    Parameters
    ----------
    eye, point
        [3], middle of the baseline and the point, metres.
    focal_px, baseline_m
        Focal length in pixels and distance between the cameras, metres.
    sigma_px
        Error of each of the four image coordinates.

    Notes
    -----
    Across the view sigma is R sigma_px / f; along it R^2 sigma_d / (f B) with sigma_d = sqrt(2) sigma_px, the
    disparity being a difference of two coordinates (Kim et al. 2009, section on the error model).
    """
    a, b = np.asarray(eye, dtype=float), np.asarray(point, dtype=float)
    ray = b - a
    distance = float(np.linalg.norm(ray))
    if not (distance > 0 and focal_px > 0 and baseline_m > 0):
        raise TerrainFormatError(
            "stereo geometry needs a positive range, focal length and baseline: "
            f"{distance}, {focal_px}, {baseline_m}"
        )
    forward = ray / distance
    across = distance * sigma_px / focal_px
    along = distance**2 * math.sqrt(2) * sigma_px / (focal_px * baseline_m)
    covariance: Array = across**2 * np.eye(3) + (along**2 - across**2) * np.outer(forward, forward)
    return covariance


def _pair(x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
    a, b = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    if a.shape != b.shape:
        a, b = np.broadcast_arrays(a, b)
    return a, b
