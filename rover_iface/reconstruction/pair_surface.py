"""What one stereo pair ranges, and what its heights may be off."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.linear import aligned_pair
from rover_iface.cameras.model import Array, CameraModel
from rover_iface.cameras.stereo import dense_stereo
from rover_iface.errors import CameraError
from rover_iface.reconstruction.outcomes import Reason, RefusedError
from rover_iface.reconstruction.picture_pairs import PicturePair
from rover_iface.reconstruction.row_check import RowCheck

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

Mask = npt.NDArray[np.bool_]

MARGIN = 1.25
"""Of the widest disparity that is searched over that of the points of the row check: SIFT finds few of them
on the nearest ground, which is at the frame's edge and seen from different sides."""

MOST_SAMPLES = 3000
"""Points of a pair at which the errors of its calibration are worked out: they change over the frame, not
from pixel to pixel."""


NOTCHES = 16
"""Steps of a disparity by which OpenCV counts them: sixteenths of a pixel."""


@dataclass(frozen=True, slots=True)
class SurfaceOptions:
    """How a pair is ranged.

    `disparity_px`: what a disparity errs at random; on the Aloe pair of Middlebury 2006, whose true
    disparities are known, 67 % of the pixels err by less, 89 % by less than twice
    and 96 % by less than three times as much. `nearest_m`:
    depth of what is nearest; without it a quarter more disparity than the points of the row check have. What
    is nearer matches falsely.
    `jump_px`: neighbours whose disparities differ by more see different things.
    `least_grazing_rad`: surface that is seen at a flatter angle between two neighbouring pixels is not seen:
    a rim hides what lies behind it. Level ground 1.5 m below the cameras reaches 3 degrees at 30 m.
    `neighbour_px`: by what the disparities of two neighbours differ for their noise; at 0 a third of what
    was seen beyond 10 m falls out, at 0.35 hidden ground in a crater is bridged (set on the generated site
    of seed 11). `least_piece_px`: pieces of fewer pixels that hang together by `jump_px` are chance matches:
    on the K10 pair such pieces lay up to 4.5 m below a level yard and were told to be known to 15 cm.
    `lost_margin_px`: half of the widest window that dense stereo compares, doubled.
    """

    nearest_m: float | None = None
    reach_m: float = 30.0
    disparity_px: float = 0.5
    jump_px: float = 1.0
    neighbour_px: float = 0.2
    least_grazing_rad: float = 0.05
    lost_margin_px: int = 9
    least_piece_px: int = 400
    least_share: float = 0.02
    most_range_sigma_m: float = 1.0


@dataclass(frozen=True, eq=False)
class PairSurface:
    """Points of a pair in the order of its pixels, site frame.

    Attributes
    ----------
    points, disparities
        (lines, samples, 3), m, and (lines, samples), px; NaN where nothing was matched.
    eye
        The aligned left camera, of which the pixels are.
    row_px
        What the rows of the pair differed by: columns may be off by as much.
    """

    pair: PicturePair
    check: RowCheck
    points: Array
    disparities: Array
    eye: CameraModel
    baseline_m: float
    matched: float
    options: SurfaceOptions

    @property
    def disparity_px(self) -> float:
        """Return what a disparity errs at random, px."""
        return self.options.disparity_px

    @property
    def row_px(self) -> float:
        """Return what disparities may be off all alike, px: as much as the rows of the pair differed."""
        return self.check.bias_px

    def height_variance(self, places: Array, slopes: Array) -> Array:
        """Return (n,) variances, m^2, of heights at places (n, 3), m, on ground of slopes (n, 2), east and
        north.

        What is off along the ray moves the ground sideways too: on a slope that is another height. Errors of
        the match are random, those of rows and calibration are common to the pair; both are in the sum.
        """
        ray = places - self.eye.C
        depth = ray @ self.eye.A
        disparity = self.eye.hs * self.baseline_m / depth
        normal = np.column_stack(
            (-slopes, np.ones(len(slopes)))
        )  # height error of a moved point: normal . move
        along = (normal * ray).sum(axis=1) / disparity
        across = depth / self.eye.hs * self.disparity_px
        variance = along**2 * (self.disparity_px**2 + self.row_px**2)
        variance += across**2 * (normal * normal).sum(axis=1) / 2.0
        if self.pair.errors is not None:
            variance += np.einsum("ni,nij,nj->n", normal, self._calibration(places), normal)
        return np.asarray(variance)

    def _calibration(self, places: Array) -> Array:
        """Return (n, 3, 3), m^2, what the calibration lets places (n, 3) be off: that of the nearest of a
        sample.
        """
        tree, covariances = self._sample
        return np.asarray(covariances[tree.query(places)[1]])

    @cached_property
    def _sample(self) -> tuple[cKDTree, Array]:
        from scipy.spatial import cKDTree

        assert self.pair.errors is not None
        known = self.points[np.isfinite(self.disparities)]
        some = known[:: max(1, len(known) // MOST_SAMPLES)]
        return cKDTree(some), self.pair.errors(some)


def pair_surface(pair: PicturePair, check: RowCheck, options: SurfaceOptions | None = None) -> PairSurface:
    """Return the surface that a pair ranges.

    Raises
    ------
    RefusedError
        If hardly a pixel is matched within reach.
    """
    options = options or SurfaceOptions()
    left, right = (np.ascontiguousarray(image, dtype=np.float32) for image in (pair.left, pair.right))
    try:
        one, two = aligned_pair(pair.left_camera, check.right_camera)
        nearest = options.nearest_m
        if nearest is None:
            nearest = one.hs * float(np.linalg.norm(two.C - one.C)) / max(MARGIN * check.widest_px, 16.0)
        cloud = dense_stereo(left, right, pair.left_camera, check.right_camera, nearest_m=nearest)
    except CameraError as err:
        raise RefusedError(Reason.NO_DEPTH, pair.name, str(err)) from err
    keep = np.linalg.norm(cloud.points - cloud.camera.C, axis=1) <= options.reach_m
    depth = (cloud.points - cloud.camera.C) @ cloud.camera.A
    error = np.hypot(options.disparity_px, check.bias_px)
    keep &= depth * error / cloud.disparities <= options.most_range_sigma_m
    for image, camera in ((pair.left, pair.left_camera), (pair.right, check.right_camera)):
        keep &= ~_beside_lost(image, camera, cloud.points, options.lost_margin_px)
    share = float(keep.sum()) / pair.left.size
    if share < options.least_share:
        raise RefusedError(
            Reason.NO_DEPTH,
            pair.name,
            f"{100 * share:.1f} % of its pixels are ranged within {options.reach_m:g} m; "
            f"{100 * options.least_share:g} % are needed",
        )
    shape = (cloud.camera.height, cloud.camera.width)
    points, disparities = np.full((*shape, 3), np.nan), np.full(shape, np.nan)
    samples, lines = cloud.pixels[keep].astype(np.int64).T
    points[lines, samples], disparities[lines, samples] = cloud.points[keep], cloud.disparities[keep]
    lone = lone_pieces(disparities, options.jump_px, options.least_piece_px)
    points[lone], disparities[lone] = np.nan, np.nan
    return PairSurface(
        pair,
        check,
        points,
        disparities,
        cloud.camera,
        cloud.baseline_m,
        share,
        options,
    )


def lone_pieces(disparities: Array, jump_px: float, least_px: int) -> Mask:
    """Return which pixels belong to pieces of fewer than `least_px`.

    Disparities [n, m], px, are NaN where unknown; neighbours that differ by more than `jump_px` do not hang
    together.
    """
    import cv2

    unknown = np.isnan(disparities)
    steps = np.where(unknown, -NOTCHES, np.round(np.nan_to_num(disparities) * NOTCHES)).astype(np.int16)
    kept = steps.copy()
    cv2.filterSpeckles(kept, -NOTCHES, least_px - 1, NOTCHES * jump_px)
    return np.asarray((kept != steps) & ~unknown)


def _beside_lost(image: Array, camera: CameraModel, points: Array, margin_px: int) -> Mask:
    """Return which points (n, 3) lie within a margin of pixels that are lost: a window there compares
    nothing.
    """
    import cv2

    lost = (image <= 0.0).astype(np.uint8)
    if not lost.any():
        return np.zeros(len(points), dtype=bool)
    wide = cv2.dilate(lost, np.ones((2 * margin_px + 1, 2 * margin_px + 1), np.uint8))
    pixels = np.nan_to_num(np.round(camera.project(points)), nan=-1.0).astype(np.int64)
    samples, lines = np.clip(pixels[:, 0], 0, camera.width - 1), np.clip(pixels[:, 1], 0, camera.height - 1)
    return np.asarray(wide[lines, samples] > 0)
