"""Features of a stereo pair, ranged, and their matches: left to right and before to after.

Matches are gated before descriptors are compared: a right feature must lie on the left one's epipolar line, a
new feature where the pose estimate puts the old one. A rival outside the gate cannot spoil the ratio test.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import Array, CameraModel
from rover_iface.cameras.stereo import triangulate
from rover_iface.frames import Transform
from rover_iface.side_by_side import side_by_side
from rover_iface.vision.tracker import Image, StereoView

Descriptors = npt.NDArray[np.float32]
NEAREST_M, FARTHEST_M = 0.3, 60.0
CELLS = 6
"""Parts of an image, either way, that share the features."""


class Detector(Protocol):
    """Find the features of an image (rows, columns) and describe them: pixels (n, 2) and descriptors (n, d).

    At most `count`, the strongest of all parts of the image; an image without any gives none of either. What
    looks alike has descriptors that are near each other, by the sum of squares. The same image gives the same
    answer, and threads may ask at the same time.
    """

    def __call__(self, image: Image, count: int) -> tuple[Array, Descriptors]:
        """Return pixels (n, 2) and descriptors (n, d), float32."""
        ...


@dataclass(frozen=True, eq=False)
class Features:
    """Ranged features of one stop.

    Attributes
    ----------
    points
        (n, 3), frame of the view's cameras, metres.
    unit_covariance
        (n, 3, 3), m^2, of the points for an error of one pixel in each of the four coordinates.
    left_px, right_px
        (n, 2), pixels.
    descriptors
        (n, d), of the left image; SIFT's have 128 numbers.
    """

    points: Array
    unit_covariance: Array
    left_px: Array
    right_px: Array
    descriptors: Descriptors

    def __len__(self) -> int:
        return len(self.points)

    def moved(self, motion: Transform) -> Features:
        """Return the features with their points in another frame."""
        points = np.asarray(motion.apply(self.points), dtype=np.float64)
        covariance = np.asarray(motion.covariance(self.unit_covariance), dtype=np.float64)
        return replace(self, points=points, unit_covariance=covariance)


def none() -> Features:
    """Return no features."""
    empty = np.empty((0, 2))
    return Features(np.empty((0, 3)), np.empty((0, 3, 3)), empty, empty, np.empty((0, 128), np.float32))


def find_features(
    view: StereoView,
    *,
    count: int,
    ratio: float,
    row_px: float,
    in_left: tuple[Array, Descriptors] | None = None,
    detector: Detector | None = None,
) -> Features:
    """Return the features of a pair that both images show, at most `count` an image, strongest first.

    `in_left` are those of the left image, pixels (n, 2) and descriptors (n, d), if they are known already;
    `detector` is SIFT unless another is given.
    """
    found_by = detector or detect
    images = (view.left, view.right) if in_left is None else (view.right,)
    found = side_by_side(lambda image: found_by(image, count), images)
    left, right = found if in_left is None else (in_left, *found)
    if len(left[0]) < 2 or len(right[0]) < 2:
        return none()
    gate = _near_epipolar(view.left_camera, view.right_camera, left[0], right[0], row_px)
    pairs = mutual(left[1], right[1], ratio, gate)
    a, b = left[0][pairs[:, 0]], right[0][pairs[:, 1]]
    points, covariance = triangulate(view.left_camera, view.right_camera, a, b, sigma_px=1.0)
    miss = np.hypot(*(view.left_camera.project(points) - a).T)
    miss += np.hypot(*(view.right_camera.project(points) - b).T)
    with np.errstate(invalid="ignore"):
        near = np.linalg.norm(points - view.left_camera.C, axis=1) < FARTHEST_M
        good = np.isfinite(miss) & (miss < row_px) & near & np.isfinite(covariance).all(axis=(1, 2))
    return Features(points[good], covariance[good], a[good], b[good], left[1][pairs[good, 0]])


def match_moved(
    old: Features, new: Features, expected_px: Array, *, ratio: float, gate_px: float
) -> npt.NDArray[np.int64]:
    """Return index pairs (n, 2) of old and new features that match within a gate round the expected pixels.

    `expected_px` (len(old), 2) is where the pose estimate puts the old points in the new left image; an
    infinite gate compares everything with everything.
    """
    if len(old) < 2 or len(new) < 2:
        return np.empty((0, 2), np.int64)
    gate = None
    if np.isfinite(gate_px):
        with np.errstate(invalid="ignore"):
            away = np.abs(expected_px[:, None, :] - new.left_px[None]).max(axis=2)
            gate = away < gate_px
    return mutual(old.descriptors, new.descriptors, ratio, gate)


def detect(image: Image, count: int) -> tuple[Array, Descriptors]:
    """Return pixels (n, 2) and descriptors (n, 128) of the strongest features of an image (rows, columns) by
    SIFT (Lowe 2004).
    """
    import cv2

    image = np.nan_to_num(image)
    # without it every feature lies 0.25 px too far right and down (OpenCV's pyramid is doubled off centre)
    found, descriptors = cv2.SIFT.create(enable_precise_upscale=True).detectAndCompute(stretched(image), None)
    if descriptors is None or not found:
        return np.empty((0, 2)), np.empty((0, 128), np.float32)
    pixels = np.array([k.pt for k in found], dtype=np.float64)
    kept = strongest(pixels, np.array([k.response for k in found]), count, image.shape)
    return pixels[kept], np.asarray(descriptors[kept], dtype=np.float32)


def stretched(image: Image) -> npt.NDArray[np.uint8]:
    """Return an image [rows, columns] in 8 bits; 1 % of it is beyond either end of their range."""
    low, high = np.percentile(image[::3, ::3], (0.5, 99.5))
    return np.clip(255.0 * (image - low) / max(1e-6, float(high - low)), 0, 255).astype(np.uint8)


def strongest(pixels: Array, strength: Array, count: int, shape: tuple[int, ...]) -> npt.NDArray[np.int64]:
    """Return the numbers (k,) of the strongest features, at most `count`.

    Pixels (n, 2) and strengths (n,) in an image of a shape (rows, columns). Strongest within each of `CELLS`
    x `CELLS` parts of it, so that one garish thing in view does not take the places of all the rest.
    """
    if len(pixels) <= count:
        return np.arange(len(pixels))
    size = np.array([shape[1], shape[0]]) / CELLS
    cell = np.minimum(pixels // size, CELLS - 1) @ np.array([1, CELLS])
    order = np.lexsort((-strength, cell))
    first = np.searchsorted(cell[order], cell[order])
    rank = np.empty(len(order))
    rank[order] = np.arange(len(order)) - first
    return np.lexsort((-strength, rank))[:count]


def mutual(
    a: Descriptors, b: Descriptors, ratio: float, gate: npt.NDArray[np.bool_] | None = None
) -> npt.NDArray[np.int64]:
    """Return index pairs (n, 2) of descriptors that are each other's nearest and clearly so.

    `gate` (len(a), len(b)) says which pairs are possible at all. A feature without a rival in its gate passes
    the ratio test if it is nearer than the median second-best distance allows.

    Descriptors (n, d); `ratio` is that of Lowe 2004 between the nearest and the second.
    """
    if len(a) < 2 or len(b) < 2:
        return np.empty((0, 2), np.int64)
    distance = (a * a).sum(1)[:, None] + (b * b).sum(1)[None] - 2.0 * (a @ b.T)
    np.maximum(distance, 0.0, out=distance)
    if gate is not None:
        distance[~gate] = np.inf
    first = distance.argmin(axis=1)
    rows = np.arange(len(a))
    best = distance[rows, first]
    second = np.partition(distance, 1, axis=1)[:, 1]
    rivals = second[np.isfinite(second)]
    second = np.where(np.isfinite(second), second, np.median(rivals) if len(rivals) else np.inf)
    back = distance.argmin(axis=0)
    keep = np.isfinite(best) & (back[first] == rows) & (best < ratio**2 * second)
    return np.column_stack((rows[keep], first[keep]))


def _near_epipolar(
    left: CameraModel, right: CameraModel, left_px: Array, right_px: Array, row_px: float
) -> npt.NDArray[np.bool_]:
    """Return (n, m): which right pixels lie within `row_px` of the epipolar segment of which left pixel."""
    from rover_iface.vision import sift_kernels as kernels

    origins, rays = left.back_project(left_px)
    near, far = (right.project(origins + range_m * rays) for range_m in (NEAREST_M, FARTHEST_M))
    near_segment = np.empty((len(left_px), len(right_px)), np.bool_)
    kernels.near_segments(far, near, np.asarray(right_px, dtype=np.float64), row_px, near_segment)
    return near_segment
