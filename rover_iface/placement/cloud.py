"""The points that segmentation and placement work on, with what stereo errs in each of them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from rover_iface.errors import PlacementError
from rover_iface.frames import Transform

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

    from rover_iface.cameras.stereo import Cloud

Array = npt.NDArray[np.float64]

DISPARITY_RAD = 0.0015
"""Error of a disparity of dense stereo as an angle, of rendered hazcam pairs (docs/results/placement.md)."""

NAVCAM_DISPARITY_RAD = 0.0003
"""The same of the navcams."""

NARROW_DISPARITY_RAD = 0.00024
"""The same of the pancams, binned by two (`behaviour.close_look`)."""


@dataclass(frozen=True, eq=False)
class SurfaceCloud:
    """Points of the ground ahead, z (or `up`) upwards, metres.

    Attributes
    ----------
    points
        (n, 3), finite.
    covariances
        (n, 3, 3), m^2: what each point may be off.
    eye
        (3,), where they were seen from; None when that is not known (a mesh of several views).
    up
        (3,), unit vector.
    pixels
        (n, 2) whole (sample, line) of an organised cloud; None when the points have no order.
    pitch_rad
        Angle between neighbouring pixels, radians; 0 when the points have no order.
    intensity
        (n,), 0..1, brightness of the pixels; None when the points have none.
    """

    points: Array
    covariances: Array
    eye: Array | None = None
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)
    pixels: npt.NDArray[np.int64] | None = None
    pitch_rad: float = 0.0
    intensity: Array | None = None

    def __post_init__(self) -> None:
        points = np.asarray(self.points, dtype=np.float64)
        covariances = np.asarray(self.covariances, dtype=np.float64)
        if points.ndim != 2 or points.shape[1] != 3:
            raise PlacementError(f"points of a cloud have shape {points.shape}; (n, 3) is needed")
        if covariances.shape != (len(points), 3, 3):
            raise PlacementError(
                f"covariances of {len(points)} points have shape {covariances.shape}; (n, 3, 3) is needed"
            )
        bad = int((~np.isfinite(points).all(axis=1)).sum())
        if bad:
            raise PlacementError(
                f"{bad} of {len(points)} points are not finite; make the cloud with `cloud_of_points`"
            )
        if not np.isfinite(covariances).all():
            raise PlacementError("a covariance of the cloud is not finite")
        up = np.asarray(self.up, dtype=np.float64)
        if up.shape != (3,) or abs(float(np.linalg.norm(up)) - 1.0) > 1e-6:
            raise PlacementError(f"up is {tuple(self.up)}; a unit vector is needed")
        if self.pixels is not None and self.pixels.shape != (len(points), 2):
            raise PlacementError(f"pixels of {len(points)} points have shape {self.pixels.shape}")
        if self.intensity is not None and self.intensity.shape != (len(points),):
            raise PlacementError(f"intensity of {len(points)} points has shape {self.intensity.shape}")

    def __len__(self) -> int:
        return len(self.points)

    @cached_property
    def tree(self) -> cKDTree:
        """Return the points ordered for search."""
        from scipy.spatial import cKDTree

        return cKDTree(self.points)

    @cached_property
    def spacing_m(self) -> Array:
        """Return (n,) the distance that a point's neighbours should have, metres.

        By the pitch of the pixels where there is one; otherwise by the eight nearest points.
        """
        if self.pitch_rad > 0.0 and self.eye is not None:
            return np.asarray(np.linalg.norm(self.points - self.eye, axis=1) * self.pitch_rad)
        if len(self.points) < 9:
            return np.full(len(self.points), np.inf)
        return np.asarray(self.tree.query(self.points, 9)[0][:, -1] / math.sqrt(8.0 / math.pi))

    def sigma_along(self, directions: npt.ArrayLike) -> Array:
        """Return (n,) the deviation of each point along a unit vector (3,) or one each (n, 3), metres."""
        d = np.broadcast_to(np.asarray(directions, dtype=np.float64), self.points.shape)
        return np.asarray(np.sqrt(np.maximum(np.einsum("ni,nij,nj->n", d, self.covariances, d), 0.0)))

    def moved(self, motion: Transform, *, up: tuple[float, float, float] | None = None) -> SurfaceCloud:
        """Return the cloud in another frame, whose z axis is up unless `up` says otherwise."""
        r = motion.rotation
        return SurfaceCloud(
            np.asarray(motion.apply(self.points), dtype=np.float64).reshape(-1, 3),
            r @ self.covariances @ r.T,
            None if self.eye is None else np.asarray(motion.apply(self.eye), dtype=np.float64),
            up or (0.0, 0.0, 1.0),
            self.pixels,
            self.pitch_rad,
            self.intensity,
        )

    def subset(self, keep: npt.NDArray[np.generic]) -> SurfaceCloud:
        """Return the chosen points; `keep` is a mask (n,) or indices (k,) of points."""
        pixels, intensity = (None if v is None else v[keep] for v in (self.pixels, self.intensity))
        return SurfaceCloud(
            self.points[keep],
            self.covariances[keep],
            self.eye,
            self.up,
            pixels,
            self.pitch_rad,
            intensity,
        )

    def thinned(self, step: int) -> SurfaceCloud:
        """Return every `step`-th column and row of an organised cloud, as a coarser one.

        Raises
        ------
        PlacementError
            If the cloud has no pixels.
        """
        if self.pixels is None:
            raise PlacementError("a cloud without pixels has no columns and rows")
        part = self.subset((self.pixels % step == 0).all(axis=1))
        assert part.pixels is not None
        return replace(part, pixels=part.pixels // step, pitch_rad=step * self.pitch_rad)


def cloud_of_stereo(
    cloud: Cloud,
    *,
    disparity_rad: float = DISPARITY_RAD,
    farthest_m: float = 6.0,
    field_rad: float = math.radians(50.0),
) -> SurfaceCloud:
    """Return the cloud of a stereo pair in the frame of its cameras, as far as `farthest_m` from the eye and
    `field_rad` to either side of the axis: beyond, an aligned fisheye pair is stretched too far to be
    matched.

    `disparity_rad` is the standard deviation of a disparity divided by the focal length in pixels.
    """
    eye = np.asarray(cloud.camera.C, dtype=np.float64)
    away = cloud.points - eye
    aside = np.arctan2(np.abs(away @ cloud.camera.horizontal), away @ cloud.camera.A)
    near = (np.linalg.norm(away, axis=1) < farthest_m) & (aside < field_rad)
    return SurfaceCloud(
        cloud.points[near],
        cloud.covariances(disparity_rad * cloud.camera.hs / math.sqrt(2.0))[near],
        eye,
        pixels=np.round(cloud.pixels[near]).astype(np.int64),
        pitch_rad=1.0 / cloud.camera.hs,
        intensity=cloud.intensity[near].astype(np.float64),
    )


def cloud_of_points(
    points: npt.ArrayLike,
    *,
    sigma_m: float = 0.005,
    eye: npt.ArrayLike | None = None,
) -> SurfaceCloud:
    """Return a cloud of points (n, 3), or of a raster (height, width, 3) in which NaN is a missing pixel.

    Points that are not finite are left out; every point errs by `sigma_m` in all directions. `eye` (3,), m,
    in the frame of the points, is where the cameras stood.

    Raises
    ------
    PlacementError
        If a shape does not fit or `sigma_m` is not positive.
    """
    array = np.asarray(points, dtype=np.float64)
    if array.ndim not in (2, 3) or array.shape[-1] != 3:
        raise PlacementError(f"points have shape {array.shape}; (n, 3) or (height, width, 3) is needed")
    if not sigma_m > 0:
        raise PlacementError(f"sigma_m is {sigma_m} m; it must be positive")
    known: npt.NDArray[np.bool_] = np.asarray(np.isfinite(array).all(axis=-1))
    spread = np.broadcast_to(np.eye(3) * sigma_m**2, (int(known.sum()), 3, 3)).copy()
    place = None if eye is None else np.asarray(eye, dtype=np.float64)
    pixels, pitch = None, 0.0
    if array.ndim == 3:
        lines, samples = np.nonzero(known)
        pixels = np.column_stack((samples, lines)).astype(np.int64)
        if place is not None:
            pitch = _pitch(array, known, place)
    return SurfaceCloud(array[known], spread, place, pixels=pixels, pitch_rad=pitch)


def _pitch(raster: Array, known: npt.NDArray[np.bool_], eye: Array) -> float:
    """Return the median angle between rays of neighbouring pixels; 0 when no two lie side by side."""
    rays = raster - eye
    with np.errstate(invalid="ignore"):
        rays = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
        pairs = known[:, 1:] & known[:, :-1]
        cosine = (rays[:, 1:] * rays[:, :-1]).sum(axis=-1)[pairs]
    return float(np.median(np.arccos(np.clip(cosine, -1.0, 1.0)))) if len(cosine) else 0.0
