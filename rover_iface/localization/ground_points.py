"""What stereo saw from one stop: surface points round the mast, and how far off their ranges may be.

Points come from a panorama (`points_of_panorama`) or from a file (`read_points`: CSV, NPZ or PLY with x, y, z
in metres). They are then put on a raster of directions, azimuth by elevation, in which a rock is a patch
and what hides what is plain (`DirectionRaster`).
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.panorama import Panorama, StereoWedge
from rover_iface.errors import LocalizationError

Array = npt.NDArray[np.float64]
FEWEST = 200
CELL_RAD = 0.00255
"""Side of a cell of the direction raster: 3 pixels of a MER navcam, the finer of the published grids."""

WINDOW, PASSES, MOST_PX = (5, 3), 4, 0.8
"""Half width and height, px, of the window by which disparities are refined, how often, by how much at most.

Semi-global matching (OpenCV) takes sub-pixel disparities towards whole ones, by up to 0.25 px, and on
rendered pairs to 0.07 px too little on the whole: rocks 20 m away came out 0.27 m too far. The window is wide
rather than high, as ground changes its disparity from row to row.
"""


@dataclass(frozen=True, eq=False)
class GroundPoints:
    """Points seen from one place.

    Parameters
    ----------
    points
        [n, 3], metres, z up, in the site frame as the rover believed it to be.
    eye
        [3], where they were seen from: the middle of the left cameras.
    range_factor
        Focal length in pixels times stereo base in metres: the range r errs by r^2 / range_factor per pixel.
    brightness
        [n], 0..1, of the pixel of each point, NaN where the picture ends; None of points without a picture.
    """

    points: Array
    eye: Array
    range_factor: float = 235.4
    brightness: Array | None = None

    def __post_init__(self) -> None:
        points, eye = np.asarray(self.points, dtype=float), np.asarray(self.eye, dtype=float)
        if points.ndim != 2 or points.shape[1] != 3 or eye.shape != (3,):
            raise LocalizationError(
                f"seen points are [n, 3] from an eye [3], found {points.shape} and {eye.shape}"
            )
        if len(points) < FEWEST:
            raise LocalizationError(f"{len(points)} points were seen; at least {FEWEST} are needed")
        if not (np.isfinite(points).all() and np.isfinite(eye).all()):
            raise LocalizationError("a seen point or its eye is not finite")
        if not self.range_factor > 0:
            raise LocalizationError(f"range factor is {self.range_factor} px m; it must be positive")
        if self.brightness is not None and self.brightness.shape != (len(points),):
            raise LocalizationError(
                f"{len(points)} points were seen with brightness {self.brightness.shape}; one each is needed"
            )
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "eye", eye)

    def from_eye(self) -> GroundPoints:
        """Return the same in the frame of the stop: its origin is the eye."""
        return replace(self, points=self.points - self.eye, eye=np.zeros(3))


@dataclass(frozen=True, eq=False)
class DirectionRaster:
    """Inverse range by direction; row 0 is the highest elevation, columns run counter-clockwise.

    Attributes
    ----------
    inverse
        [rows, columns], 1 / m, NaN where nothing was seen.
    left, top, step
        Azimuth (counter-clockwise from x) of column 0, elevation of row 0, side of a cell; radians.
    brightness
        [rows, columns], 0..1, NaN where nothing was seen; None of points without a picture.
    """

    inverse: Array
    left: float
    top: float
    step: float
    eye: Array
    brightness: Array | None = None

    def directions(self) -> Array:
        """Return unit vectors [rows, columns, 3]."""
        rows, columns = self.inverse.shape
        azimuth = self.left + self.step * np.arange(columns)
        elevation = (self.top - self.step * np.arange(rows))[:, None]
        level = np.cos(elevation)
        z = np.broadcast_to(np.sin(elevation), (rows, columns))
        return np.stack((level * np.cos(azimuth), level * np.sin(azimuth), z), axis=-1)

    def points(self) -> Array:
        """Return points [rows, columns, 3], NaN where nothing was seen."""
        return np.asarray(self.eye + self.directions() / self.inverse[..., None])


def direction_raster(
    seen: GroundPoints, *, step: float = CELL_RAD, farthest_m: float = 40.0
) -> DirectionRaster:
    """Return the points on a raster of directions; several in one cell count by their mean disparity.

    `step` is the width of a cell, rad. The seam of a full circle lies in its widest gap.
    """
    rays = seen.points - seen.eye
    away = np.linalg.norm(rays, axis=1)
    good = (away > 0.5) & (away < farthest_m)
    rays, away = rays[good], away[good]
    if len(away) < FEWEST:
        raise LocalizationError(
            f"{len(away)} points lie within {farthest_m:g} m; at least {FEWEST} are needed"
        )
    azimuth = np.arctan2(rays[:, 1], rays[:, 0])
    order = np.sort(azimuth)
    gaps = np.diff(np.append(order, order[0] + math.tau))
    widest = int(gaps.argmax())
    left = float(order[(widest + 1) % len(order)])
    elevation = np.arcsin(np.clip(rays[:, 2] / away, -1.0, 1.0))
    top = float(elevation.max())
    column = np.rint(np.mod(azimuth - left, math.tau) / step).astype(np.int64)
    row = np.rint((top - elevation) / step).astype(np.int64)
    shape = int(row.max()) + 1, int(column.max()) + 1
    at = row * shape[1] + column
    count = np.bincount(at, minlength=shape[0] * shape[1])

    def on_cells(values: Array) -> Array:
        total = np.bincount(at, weights=values, minlength=shape[0] * shape[1])
        return np.where(count > 0, total / np.maximum(count, 1), np.nan).reshape(shape)

    bright = None if seen.brightness is None else on_cells(seen.brightness[good])
    return DirectionRaster(on_cells(1.0 / away), left, top, step, seen.eye, bright)


def points_of_panorama(
    panorama: Panorama, *, nearest_m: float = 2.0, farthest_m: float = 40.0, step_px: int = 3
) -> GroundPoints:
    """Return the dense stereo points of all wedges of a panorama on a grid of `step_px` pixels.

    Dense matching is semi-global (the publication's follows a triangulation); points that the Förstner points
    round them do not bear out are dropped.

    Raises
    ------
    LocalizationError
        If the wedges together show too few points.
    """
    clouds = [_wedge_points(wedge, nearest_m, step_px) for wedge in panorama.wedges]
    points, brightness = (np.concatenate([cloud[k] for cloud in clouds]) for k in (0, 1))
    near = np.linalg.norm(points - panorama.eye, axis=1) < farthest_m
    factor = max(cloud[2] for cloud in clouds)
    return GroundPoints(points[near], panorama.eye, factor, brightness[near])


def _wedge_points(wedge: StereoWedge, nearest_m: float, step_px: int) -> tuple[Array, Array, float]:
    """Return points [n, 3] of one pair, their brightness [n] and its focal length times base, px m."""
    from rover_iface.cameras.linear import aligned_pair, warp
    from rover_iface.cameras.stereo import dense_stereo
    from rover_iface.localization.disparity_kernels import refine_disparities
    from rover_iface.localization.interest_points import confirmed, match_interest_points

    left, right = (image.astype(np.float32) / np.float32(255.0) for image in (wedge.left, wedge.right))
    cloud = dense_stereo(
        left, right, wedge.left_camera, wedge.right_camera, nearest_m=nearest_m, step=step_px
    )
    one, two = aligned_pair(wedge.left_camera, wedge.right_camera)
    aligned = warp(left, wedge.left_camera, one), warp(right, wedge.right_camera, two)
    factor = one.hs * cloud.baseline_m
    # the cloud's own picture is wider to the left by the largest disparity
    pixels = np.asarray(one.project(cloud.points), dtype=np.float64)
    disparities = np.empty(len(pixels))
    refine_disparities(*aligned, pixels, cloud.disparities, WINDOW, PASSES, MOST_PX, disparities)
    rays = one.back_project(pixels)[1]
    points = one.C + rays * (factor / disparities / (rays @ one.A))[:, None]
    cloud = replace(cloud, points=points, pixels=pixels, disparities=disparities, camera=one)
    keep = confirmed(cloud, *match_interest_points(*aligned, most_px=factor / nearest_m))
    at = np.rint(pixels[keep]).astype(np.int64)
    inside = (at >= 0) & (at < aligned[0].shape[::-1])
    at = np.where(inside, at, 0)
    brightness = np.where(inside.all(axis=1), aligned[0][at[:, 1], at[:, 0]], np.nan)
    return cloud.points[keep], brightness, float(factor)


def read_points(
    path: Path | str, eye: npt.ArrayLike = (0.0, 0.0, 0.0), *, range_factor: float = 235.4
) -> GroundPoints:
    """Return the points of a file: CSV (x, y, z, with or without a header), NPZ (`points`, `eye`) or PLY.

    `eye` [3], m, is where the camera stood, in the frame of the points; an NPZ's own goes before it.

    Raises
    ------
    LocalizationError
        If the file cannot be read, or holds no points x, y, z.
    """
    path = Path(path)
    where = np.asarray(eye, dtype=float)
    try:
        match path.suffix.lower():
            case ".npz":
                with np.load(path) as arrays:
                    points = np.asarray(arrays["points"], dtype=float)
                    where = np.asarray(arrays["eye"], dtype=float) if "eye" in arrays else where
            case ".csv" | ".txt" | ".xyz":
                first = path.read_text().split("\n", 1)[0]
                header = 1 if any(c.isalpha() and c not in "eE" for c in first) else 0
                separator = "," if "," in first else None
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", UserWarning)  # an empty file is told of below
                    points = np.loadtxt(path, delimiter=separator, skiprows=header, ndmin=2)[:, :3]
            case ".ply":
                import trimesh

                points = np.asarray(trimesh.load(path, process=False).vertices, dtype=float)
            case other:
                raise LocalizationError(
                    f'{path}: "{other}" is not a point file; .csv, .txt, .xyz, .npz or .ply are'
                )
    except (OSError, ValueError, KeyError, IndexError, AttributeError) as err:
        raise LocalizationError(f"{path}: points cannot be read: {err}") from err
    if points.ndim != 2 or points.shape[1] != 3:
        raise LocalizationError(f"{path}: points cannot be read: numbers of shape {points.shape}, not [n, 3]")
    return GroundPoints(points, where, range_factor)
