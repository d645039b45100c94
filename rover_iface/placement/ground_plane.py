"""The ground under a cloud: a plane by RANSAC, and the gentle surface over it that rocks stand on.

Pedersen, Smith, Deans and others 2005, section 7, begin with "the plane containing the largest number of
points". Natural ground departs from a plane by several centimetres over the four metres before a rover, as
much as a small rock is high; so a smooth surface over the plane is fitted to what belongs to the ground.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_iface.errors import PlacementError
from rover_iface.frames import across
from rover_iface.placement.cloud import Array, SurfaceCloud
from rover_iface.streams import stream

CELL_M = 0.05
"""Side of the cells that the points are thinned to, so that near ground does not outvote the far."""

HALVED = 2
"""How often the nearer half of the points is asked alone: a quarter of what the hazcams see is within 1.2 m
of them, as far as the arm reaches."""


@dataclass(frozen=True, slots=True)
class GroundOptions:
    """Parameters of the ground.

    Attributes
    ----------
    tolerance_m
        How far a point of natural ground may lie off the plane, beside what stereo errs.
    max_tilt_rad
        A plane steeper than this against `up` is a face, no ground.
    least_share
        Share of the (thinned) points that must lie on the plane.
    trials
        Planes that RANSAC tries, each through three points.
    post_m, stiffness
        Distance between the posts of the surface over the plane; how much it resists bending (larger:
        flatter).
    """

    tolerance_m: float = 0.03
    max_tilt_rad: float = math.radians(35.0)
    least_share: float = 0.25
    trials: int = 200
    post_m: float = 0.2
    stiffness: float = 0.5

    def __post_init__(self) -> None:
        if not (self.tolerance_m > 0 and self.post_m > 0 and self.stiffness > 0 and self.trials >= 1):
            raise PlacementError(
                f"ground: tolerance {self.tolerance_m} m, posts {self.post_m} m, stiffness {self.stiffness}, "
                f"{self.trials} trials; all must be positive"
            )


@dataclass(frozen=True, eq=False)
class GroundPlane:
    """A plane in the frame of the cloud.

    Attributes
    ----------
    normal
        (3,), unit, upwards.
    origin
        (3,), a point on it.
    axes
        (2, 3), unit vectors along it.
    share
        Of the thinned points, how many lie on it.
    rms_m
        Deviation of those.
    """

    normal: Array
    origin: Array
    axes: Array
    share: float
    rms_m: float

    def local(self, points: Array) -> Array:
        """Return (n, 3) of points (n, 3) of the cloud's frame: two coordinates along the plane, the height
        over it; m.
        """
        return np.asarray((points - self.origin) @ np.vstack((self.axes, self.normal)).T)

    def points_of(self, local: Array) -> Array:
        """Return points (n, 3) of the cloud's frame from coordinates (n, 3) along and over the plane, m."""
        return np.asarray(self.origin + local @ np.vstack((self.axes, self.normal)))


def thinned(cloud: SurfaceCloud, cell_m: float = CELL_M) -> npt.NDArray[np.int64]:
    """Return indices of one point for each cube of side `cell_m`, the first that lies in it."""
    cells = np.floor((cloud.points - cloud.points.min(axis=0)) / cell_m).astype(np.int64)
    size = cells.max(axis=0) + 1
    flat = (cells[:, 0] * size[1] + cells[:, 1]) * size[2] + cells[:, 2]
    return np.asarray(np.unique(flat, return_index=True)[1])


def fit_ground_plane(
    cloud: SurfaceCloud, options: GroundOptions | None = None, *, seed: int = 0
) -> GroundPlane | None:
    """Return the plane that holds most of the points, or None when no plane holds `least_share` of them.

    RANSAC over the thinned points with a tolerance that grows with each point's own error, then least squares
    on the points it holds until those stay the same. Where that finds none, what is farther may be a face
    that holds more points than the ground: then the nearer half of them is asked, and once more its half.
    """
    options = options or GroundOptions()
    if len(cloud) < 3:
        return None
    part = cloud.subset(thinned(cloud))
    for _ in range(HALVED):
        plane = _plane_of(part, options, seed)
        if plane is not None or part.eye is None:
            return plane
        away = np.linalg.norm(part.points - part.eye, axis=1)
        part = part.subset(np.flatnonzero(away <= np.median(away)))
    return _plane_of(part, options, seed)


def _plane_of(part: SurfaceCloud, options: GroundOptions, seed: int) -> GroundPlane | None:
    """Return the plane that holds most of a thinned cloud; None where none is level and holds enough."""
    points, up = part.points, np.asarray(part.up)
    if len(points) < 3:
        return None
    rng = stream("ground plane", seed)
    chosen = rng.integers(0, len(points), (options.trials, 3))
    a, b, c = (points[chosen[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    length = np.linalg.norm(normals, axis=1)
    usable = length > 1e-4
    normals, a = normals[usable] / length[usable, None], a[usable]
    normals *= np.where(normals @ up < 0, -1.0, 1.0)[:, None]
    level = normals @ up > math.cos(options.max_tilt_rad)
    normals, a = normals[level], a[level]
    if not len(normals):
        return None
    # errors across any of these planes are close to those along `up`
    limit = np.hypot(options.tolerance_m, 2.0 * part.sigma_along(up))
    off = np.abs(normals @ points.T - (normals * a).sum(axis=1)[:, None])
    score = np.maximum(0.0, 1.0 - (off / limit) ** 2).sum(axis=1)
    best = int(score.argmax())
    normal, origin = normals[best], a[best]
    held = np.abs((points - origin) @ normal) < limit
    for _ in range(20):
        if held.sum() < 3:
            return None
        normal, origin = _least_squares(points[held], limit[held], up)
        again = np.abs((points - origin) @ normal) < limit
        if (again == held).all():
            break
        held = again
    share = float(held.mean())
    if share < options.least_share or normal @ up < math.cos(options.max_tilt_rad):
        return None
    rms = float(np.sqrt((((points[held] - origin) @ normal) ** 2).mean()))
    return GroundPlane(normal, origin, across(normal), share, rms)


def _least_squares(points: Array, sigma: Array, up: Array) -> tuple[Array, Array]:
    weight = 1.0 / sigma**2
    middle = np.asarray((weight[:, None] * points).sum(axis=0) / weight.sum())
    away = (points - middle) * np.sqrt(weight)[:, None]
    normal = np.linalg.eigh(away.T @ away)[1][:, 0]
    return np.asarray(normal if normal @ up >= 0 else -normal), middle


@dataclass(frozen=True, eq=False)
class GroundSurface:
    """Heights over a plane on a raster of posts [rows, columns], bilinear between them, flat beyond."""

    plane: GroundPlane
    posts: Array
    low: Array
    post_m: float

    def height(self, along: Array) -> Array:
        """Return heights (n,) over the plane at coordinates (n, 2) along it, m."""
        columns, _ = self.posts.shape[1], self.posts.shape[0]
        index, share = _corners(along, self.low, self.post_m, self.posts.shape)
        flat = self.posts.ravel()
        out = np.zeros(len(along))
        for k, offset in enumerate((0, 1, columns, columns + 1)):
            out += share[:, k] * flat[index + offset]
        return out

    def height_over(self, points: Array) -> Array:
        """Return (n,) the height of points (n, 3) of the cloud's frame over the surface, along the plane's
        normal, metres.
        """
        local = self.plane.local(points)
        return np.asarray(local[:, 2] - self.height(local[:, :2]))


def _corners(
    along: Array, low: Array, post_m: float, shape: tuple[int, ...]
) -> tuple[npt.NDArray[np.int64], Array]:
    """Return the flat index of the lower left post (n,) and the weights (n, 4) of the four round a point."""
    rows, columns = shape
    x = np.clip((along[:, 0] - low[0]) / post_m, 0.0, columns - 1.000001)
    y = np.clip((along[:, 1] - low[1]) / post_m, 0.0, rows - 1.000001)
    i, j = np.floor(y).astype(np.int64), np.floor(x).astype(np.int64)
    fx, fy = x - j, y - i
    share = np.stack(((1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy), axis=1)
    return i * columns + j, share


def fit_surface(
    plane: GroundPlane, local: Array, weight: Array, options: GroundOptions | None = None
) -> GroundSurface:
    """Return the smooth surface through points (n, 3), m, in the plane's coordinates.

    `weight` (n,), m^-2, is the inverse variance of each height times the chance that it is ground. The sum of
    weighted squared deviations, each cell of `CELL_M` counted as one point, and of squared second
    differences is least.
    """
    from scipy import sparse
    from scipy.sparse.linalg import spsolve

    options = options or GroundOptions()
    low = local[:, :2].min(axis=0) - 1e-6
    high = local[:, :2].max(axis=0)
    columns, rows = (max(3, math.ceil(v / options.post_m) + 1) for v in high - low)
    cells = np.floor((local[:, :2] - low) / CELL_M).astype(np.int64)
    width = int(cells[:, 0].max()) + 1
    flat = cells[:, 1] * width + cells[:, 0]
    count = np.bincount(flat)
    total = np.bincount(flat, weights=weight)
    used = total > 1e-9
    mean = np.stack(
        [np.bincount(flat, weights=weight * local[:, i])[used] / total[used] for i in range(3)], axis=1
    )
    index, share = _corners(mean[:, :2], low, options.post_m, (rows, columns))
    number = np.repeat(np.arange(len(mean)), 4)
    column = (index[:, None] + np.array([0, 1, columns, columns + 1])).ravel()
    design = sparse.csr_matrix((share.ravel(), (number, column)), shape=(len(mean), rows * columns))
    inverse = total[used] / count[used]
    bend = _bending(rows, columns)
    scale = options.stiffness * float(np.median(inverse))
    left = design.T @ sparse.diags(inverse) @ design + scale * bend.T @ bend
    # a slope or a level that no point tells stays that of the plane
    left = left + 1e-6 * float(np.median(inverse)) * sparse.identity(rows * columns)
    posts = spsolve(left.tocsc(), design.T @ (inverse * mean[:, 2]))
    return GroundSurface(plane, np.asarray(posts).reshape(rows, columns), low, options.post_m)


def _bending(rows: int, columns: int) -> Any:
    """Return the matrix of second differences along rows, columns and the diagonal."""
    from scipy import sparse

    def second(n: int) -> Any:
        return sparse.diags(
            [np.ones(n - 2), -2 * np.ones(n - 2), np.ones(n - 2)], [0, 1, 2], shape=(n - 2, n)
        )

    def first(n: int) -> Any:
        return sparse.diags([-np.ones(n - 1), np.ones(n - 1)], [0, 1], shape=(n - 1, n))

    along = sparse.kron(sparse.identity(rows), second(columns))
    up = sparse.kron(second(rows), sparse.identity(columns))
    twist = math.sqrt(2.0) * sparse.kron(first(rows), first(columns))
    return sparse.vstack([along, up, twist])
