"""Stereo: one point along its epipolar line, the slant of the patch round it, or a dense cloud.

Camera models may be any of the three kinds and of a subframe; nothing is rectified except for the dense
cloud.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.linear import FAR_M, aligned_pair, warp
from rover_iface.cameras.model import Array, CameraModel, ModelKind
from rover_iface.errors import CameraError

Image = npt.NDArray[np.float32]
NARROWER = 0.5
"""Of a patch: what is compared with the whole."""


@dataclass(frozen=True, slots=True)
class PointMatch:
    """A point seen by both cameras.

    Attributes
    ----------
    left_px, right_px
        (sample, line) in each image.
    score
        Normalised cross-correlation of the two patches, -1 to 1.
    point
        (3,), frame of the cameras, metres: on the ray of the left pixel, whatever the rows disagree by.
    covariance
        (3, 3), m^2, from `sigma_px` in each of the four coordinates.
    normal
        (3,), of the surface patch, towards the left camera.
    disparity_px2
        Variance of the disparity, px^2, by what the parts of the patch disagree by.
    surface_covariance
        (3, 3), m^2, of the surface under exactly this left pixel: from `disparity_px2` alone.
    """

    left_px: Array
    right_px: Array
    score: float
    point: Array
    covariance: Array
    normal: Array
    disparity_px2: float
    surface_covariance: Array


@dataclass(frozen=True, slots=True)
class PointStereo:
    """Parameters of point stereo. Kim et al. 2009, section 4.4: rows +-2 px, window 21."""

    template_px: int = 21
    row_tolerance_px: float = 2.0
    nearest_m: float = 0.5
    farthest_m: float = 60.0
    plane_px: int = 31
    slant_sigma: float = 1.0
    sigma_px: float = 0.30
    least_px: float = 0.04
    """What a disparity is never better than: bias of bilinear interpolation (Stein and others 2006)."""
    told: bool = True
    """Whether it is worked out how far a disparity may be off, which takes as long as finding it: infinite
    where it is not."""

    def __post_init__(self) -> None:
        if self.template_px < 5 or self.template_px % 2 == 0 or self.plane_px % 2 == 0:
            raise CameraError(f"stereo window is {self.template_px} and {self.plane_px} px; odd, at least 5")
        if not 0 < self.nearest_m < self.farthest_m:
            raise CameraError(f"stereo ranges {self.nearest_m} to {self.farthest_m} m are not a range")


def triangulate(
    left: CameraModel,
    right: CameraModel,
    left_px: npt.ArrayLike,
    right_px: npt.ArrayLike,
    *,
    sigma_px: float = 0.5,
) -> tuple[Array, Array]:
    """Return points (..., 3), m, and covariances (..., 3, 3), m^2, in the cameras' frame, that best explain
    pixels (..., 2) in both cameras.

    Least squares over the four coordinates by Gauss and Newton from the middle of the shortest line between
    the rays; NaN where the rays do not meet in front of the cameras.
    """
    from rover_iface.cameras import triangulation_kernels as k

    a, b = np.asarray(left_px, dtype=np.float64), np.asarray(right_px, dtype=np.float64)
    shape = a.shape[:-1]
    a, b = np.ascontiguousarray(a.reshape(-1, 2)), np.ascontiguousarray(b.reshape(-1, 2))
    points, inverses = np.empty((len(a), 3)), np.empty((len(a), 3, 3))
    k.triangulate_many(left.packed, right.packed, a, b, points, inverses)
    return points.reshape(*shape, 3), sigma_px**2 * inverses.reshape(*shape, 3, 3)


def point_stereo(
    left_image: Image,
    right_image: Image,
    left: CameraModel,
    right: CameraModel,
    pixel: npt.ArrayLike,
    *,
    options: PointStereo | None = None,
    expected_range_m: float | None = None,
    range_spread: float = 0.5,
) -> PointMatch | None:
    """Return the point under a pixel of the left image, or None when the right image does not show it.

    The right image is searched along the epipolar curve within the row tolerance, between the nearest and the
    farthest range, or within `range_spread` (a share) of the expected one. The best place is then refined
    together with the slant of the patch, so that a tilted face is matched to a fraction of a pixel.

    Images [rows, columns], float32 in 0..1; `pixel` [2] is (sample, line). The point is in the frame of the
    cameras.
    """
    from rover_iface.cameras import stereo_kernels as k
    from rover_iface.cameras import triangulation_kernels

    options = options or PointStereo()
    at = np.asarray(pixel, dtype=np.float64)
    near, far = options.nearest_m, options.farthest_m
    if expected_range_m is not None:
        near = max(near, expected_range_m / (1.0 + range_spread))
        far = min(far, expected_range_m * (1.0 + range_spread)) if range_spread < 1 else far
    if not near < far:
        return None
    half = options.template_px // 2
    if not _inside(at, left_image.shape, half):
        return None
    found = k.search_epipolar(
        left_image,
        right_image,
        left.packed,
        right.packed,
        at,
        half,
        options.row_tolerance_px,
        1.0 / far,
        1.0 / near,
    )
    inverse, row_offset, coarse = float(found[0]), float(found[1]), float(found[2])
    if not coarse > -1.0:
        return None
    plane = np.array([inverse, 0.0, 0.0])
    right_px = np.empty(2)
    wide = min(options.plane_px // 2, int(_room(at, left_image.shape)))
    score = k.refine_plane(
        left_image,
        right_image,
        left.packed,
        right.packed,
        at,
        wide,
        row_offset,
        options.slant_sigma,
        plane,
        right_px,
    )
    if not score > -1.0:
        return None
    points, covariances = triangulate(left, right, at[None], right_px[None], sigma_px=options.sigma_px)
    origin, direction = left.back_project(at)
    point = origin + direction / plane[0]
    beside = right.project(point)
    if not (np.isfinite(points).all() and np.isfinite(beside).all()):
        return None
    row = float(right_px[1] - beside[1])
    normal = np.empty(3)
    triangulation_kernels.plane_normal(left.packed, float(at[0]), float(at[1]), plane, normal)
    ray = point - left.C
    variance, along = np.inf, np.full((3, 3), np.inf)
    if options.told:
        variance = _disparity_px2(
            left_image, right_image, left, right, at, wide, row, options, plane, right_px
        )
        # pixels of disparity per metre along the ray
        per_m = float(np.linalg.norm(right.jacobian(point) @ ray)) / float(np.linalg.norm(ray))
        along = np.outer(ray, ray) / float(ray @ ray) * variance / max(per_m, 1e-9) ** 2
    return PointMatch(at, right_px, float(score), point, covariances[0], normal, variance, along)


def _disparity_px2(
    left_image: Image,
    right_image: Image,
    left: CameraModel,
    right: CameraModel,
    at: Array,
    wide: int,
    row: float,
    options: PointStereo,
    plane: Array,
    right_px: Array,
) -> float:
    """Return the variance, px^2, of the disparity of a plane [3] that was found for a patch.

    Images [rows, columns]; the patch of `wide` px to either side lies round pixel `at` [2] of the left one
    and is found at `right_px` [2] of the right one, `row` px off the epipolar curve.
    """
    from rover_iface.cameras import stereo_kernels as k

    images = left_image, right_image, left.packed, right.packed, at
    found = float(k.disparity_spread(*images, wide, row, options.slant_sigma, plane))
    variance = found + options.least_px**2 if found >= 0.0 else (0.5 * wide) ** 2
    # what surrounds the point leads a wide patch: a narrower one tells by how much
    inner, narrow_px = plane.copy(), np.empty(2)
    less = max(4, round(NARROWER * wide))
    if k.refine_plane(*images, less, row, options.slant_sigma, inner, narrow_px) > -1.0:
        variance += float((narrow_px - right_px) @ (narrow_px - right_px))
    # rows that do not meet tell of a calibration that is off, and columns are off as easily
    return variance + row**2


def _room(at: Array, shape: tuple[int, ...]) -> float:
    return float(min(at[0], at[1], shape[1] - 1 - at[0], shape[0] - 1 - at[1])) - 1.0


def _inside(at: Array, shape: tuple[int, ...], half: int) -> bool:
    return bool(np.isfinite(at).all()) and _room(at, shape) >= half


@dataclass(frozen=True, slots=True)
class Cloud:
    """Points of a dense stereo pair, frame of the cameras.

    Attributes
    ----------
    points
        (n, 3), metres.
    pixels
        (n, 2), in the aligned left image.
    disparities
        (n,), pixels.
    camera
        The aligned left camera, of which `pixels` are; `baseline_m` to the right one.
    intensity
        (n,), 0..1.
    """

    points: Array
    pixels: Array
    disparities: Array
    camera: CameraModel
    baseline_m: float
    intensity: npt.NDArray[np.float32]

    def covariances(self, sigma_px: float = 0.35) -> Array:
        """Return (n, 3, 3), m^2, from independent errors in the four image coordinates."""
        a = self.camera.A
        row = self.camera.horizontal
        column = np.cross(a, row)
        focal = self.camera.hs
        relative = self.points - self.camera.C
        z = relative @ a
        # d(point) = M d(u_left, v, disparity), M in the axes (row, column, depth)
        x, y = relative @ row, relative @ column
        m = np.zeros((len(z), 3, 3))
        m[:, 0, 0] = z / focal
        m[:, 1, 1] = z / focal
        shrink = -z / self.disparities
        m[:, 0, 2], m[:, 1, 2], m[:, 2, 2] = shrink * x / z, shrink * y / z, shrink
        s = sigma_px**2 * np.array([[1.0, 0.0, 1.0], [0.0, 0.5, 0.0], [1.0, 0.0, 2.0]])
        axes = np.stack((row, column, a), axis=1)
        full = axes @ m
        return np.asarray(full @ s @ np.swapaxes(full, 1, 2))


def dense_stereo(
    left_image: Image,
    right_image: Image,
    left: CameraModel,
    right: CameraModel,
    *,
    nearest_m: float = 1.0,
    block_px: int = 7,
    step: int = 1,
    least_contrast: float = 2.5,
    scale: float = 1.0,
    farthest_m: float | None = None,
) -> Cloud:
    """Return the cloud of a stereo pair, images float in 0..1, by semi-global matching on an aligned pair.

    Every `step`-th pixel gives a point, if its 9 x 9 neighbourhood varies by `least_contrast` of 255 and both
    images agree on it. Nothing may be nearer than `nearest_m` (depth along the axis): what is matches
    falsely. With `farthest_m` nothing beyond that depth is searched for either, and a subframe of a near
    thing, whose disparities are wider than itself, can be matched. The aligned pair is enlarged by `scale`:
    an aligned fisheye pair is coarser in its middle than the images are, which costs depth.

    The frame is widened to the left by the largest disparity. What lies there has no match inside the frame
    of the right camera, but may have one in its image: in subframes that were cut differently, or where
    aligning turned the cameras.

    Images [rows, columns]; the points are in the frame of the cameras.

    Raises
    ------
    CameraError
        If the pair cannot be aligned.
    """
    import cv2

    one, two = aligned_pair(left, right)
    if scale != 1.0:
        one, two = one.scaled(scale), two.scaled(scale)
    baseline = float(np.linalg.norm(two.C - one.C))
    least = 0 if farthest_m is None else int(one.hs * baseline / farthest_m)
    count = int(np.ceil((one.hs * baseline / nearest_m - least) / 16.0)) * 16
    room = one.width // 2 if farthest_m is None else one.width
    count = max(16, min(count, room // 16 * 16))
    widest = least + count
    # the axis of a subframe's camera need not lie in its middle: keep what the left image shows
    middle = (left.width - 1) / 2.0, (left.height - 1) / 2.0
    origin, ray = left.back_project(middle)
    across, down = one.project(origin + FAR_M * ray) - ((one.width - 1) / 2.0, (one.height - 1) / 2.0)
    corner = round(float(across)) - widest, round(float(down))
    one, two = (c.window(*corner, c.width + widest, c.height) for c in (one, two))
    # rays of a CAHVORE camera do not start in one point: warp for the ranges that matter
    focus = FAR_M if left.kind is not ModelKind.CAHVORE else 3.0 * nearest_m
    pair = [
        np.round(255.0 * np.clip(warp(image, source, to, range_m=focus, fill=0.0), 0, 1)).astype(np.uint8)
        for image, source, to in ((left_image, left, one), (right_image, right, two))
    ]
    matcher = cv2.StereoSGBM.create(
        minDisparity=least,
        numDisparities=count,
        blockSize=block_px,
        P1=8 * block_px**2,
        P2=32 * block_px**2,
        disp12MaxDiff=1,
        uniquenessRatio=8,
        speckleWindowSize=120,
        speckleRange=2,
        preFilterCap=31,
        mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY,
    )
    disparity = matcher.compute(pair[0], pair[1]).astype(np.float64) / 16.0
    valid = (disparity > least + 0.5) & (pair[0] > 0)
    # beyond its image the right camera shows nothing, which matches nothing
    lines, samples = np.nonzero(valid)
    met = np.round(samples - disparity[lines, samples]).astype(np.int64)
    valid[lines, samples] = (met >= 0) & (pair[1][lines, np.maximum(met, 0)] > 0)
    # a patch without contrast (sky, full shade) matches anywhere
    grey = pair[0].astype(np.float32)
    mean = cv2.blur(grey, (9, 9))
    valid &= cv2.blur(grey * grey, (9, 9)) - mean * mean > least_contrast**2
    lines, samples = np.nonzero(valid[::step, ::step])
    lines, samples = lines * step, samples * step
    d = disparity[lines, samples]
    pixels = np.column_stack((samples, lines)).astype(np.float64)
    z = one.hs * baseline / d
    rays = one.back_project(pixels)[1]
    points = one.C + rays * (z / (rays @ one.A))[:, None]
    return Cloud(points, pixels, d, one, baseline, pair[0][lines, samples].astype(np.float32) / 255.0)
