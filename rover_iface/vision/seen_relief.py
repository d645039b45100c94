"""How a view looks from elsewhere, by what its own stereo pair ranges: rendered and matched.

What lies round a target lies at other depths. As the rover passes by, ground far behind a rock moves against
it by whole windows, which no plane, scale or roll takes out: the surroundings of a rock 0.3 m wide, 7 m off,
agreed by 0.14 to 0.46 after one step of half a metre, and by 0.8 with depth taken in (days 5003 and 5007 of
`studies.subframe_day`, looked at while this was written).
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from rover_iface.cameras.model import Array, CameraModel
from rover_iface.cameras.stereo import Cloud, dense_stereo
from rover_iface.errors import CameraError
from rover_iface.vision.tracker import Image, StereoView

NEAREST_SHARE, FARTHEST_SHARE = 0.6, 3.0
"""Of the target's range: nothing nearer or farther is ranged. A subframe has no room for the disparities of
the rest."""
LEAST_CONTRAST = 0.5
"""Of 255: a smooth patch between rough ones is ranged too; what it is taken for, correlation tells."""
HOLE_PARTS = 4
"""Known neighbours, of nine pixels, that fill one that no point falls on."""
BLUR_SHARE = 0.45
"""Standard deviation, px, for each pixel of this view beyond one that another camera sees as one."""
LEAST_BLUR_PX = 0.3


class SeenRelief:
    """The points that a stereo pair ranges; worked out when first asked for."""

    def __init__(self, view: StereoView, range_m: float) -> None:
        self.view = view
        self.range_m = range_m

    @cached_property
    def cloud(self) -> Cloud | None:
        """Return what the pair ranges, None where it cannot be aligned or has pixels without a number."""
        view = self.view
        if not (np.isfinite(view.left).all() and np.isfinite(view.right).all()):
            return None
        try:
            return dense_stereo(
                view.left,
                view.right,
                view.left_camera,
                view.right_camera,
                nearest_m=NEAREST_SHARE * self.range_m,
                farthest_m=FARTHEST_SHARE * self.range_m,
                least_contrast=LEAST_CONTRAST,
            )
        except CameraError:
            return None

    def seen_by(self, camera: CameraModel, point: Array, moved: Array, half: int) -> Image | None:
        """Return what another camera sees round a point, square with `half` px to either side; NaN unknown.

        Parameters
        ----------
        point
            (3,), m, frame of `camera`: the middle of the picture.
        moved
            (3,), m, added to the points of this view: by how much the frame has been corrected since.
        """
        import cv2

        cloud = self.cloud
        if cloud is None or not len(cloud.points):
            return None
        from rover_iface.vision import drape_kernels

        middle = camera.project(point)
        ranges = np.full((2 * half + 1, 2 * half + 1), np.nan, np.float32)
        if np.isfinite(middle).all():
            eye, shift = (np.asarray(v, dtype=np.float64) for v in (camera.C, moved))
            drape_kernels.nearest_ranges(cloud.points, shift, camera.packed, eye, middle, half, ranges)
        empty = np.isnan(ranges)
        part = cv2.blur((~empty).astype(np.float32), (3, 3))
        mean = cv2.blur(np.where(empty, np.float32(0.0), ranges), (3, 3)) / np.maximum(part, np.float32(1e-6))
        holes = empty & (part > (HOLE_PARTS - 0.5) / 9.0)
        ranges[holes] = mean[holes]
        return self._sampled(camera, middle, moved, ranges)

    def _sampled(self, camera: CameraModel, middle: Array, moved: Array, ranges: Image) -> Image:
        """Return the brightness (n, n) of this view where rays of `camera` round a pixel end at `ranges`."""
        import cv2

        half = ranges.shape[0] // 2
        away = float(np.nanmedian(ranges)) if np.isfinite(ranges).any() else self.range_m
        finer = away / camera.hs / (self.range_m / self.view.left_camera.hs)
        blur_px = BLUR_SHARE * max(0.0, finer - 1.0)
        left = (
            self.view.left if blur_px < LEAST_BLUR_PX else cv2.GaussianBlur(self.view.left, (0, 0), blur_px)
        )
        lines, samples = np.nonzero(np.isfinite(ranges))
        origin, rays = camera.back_project(middle + np.column_stack((samples, lines)) - half)
        ends = origin + rays * ranges[lines, samples][:, None]
        source = self.view.left_camera.project(ends - moved).astype(np.float32)
        out = np.full(ranges.shape, np.nan, np.float32)
        if len(source):
            grey = cv2.remap(
                left,
                source[:, 0][None],
                source[:, 1][None],
                cv2.INTER_CUBIC,
                borderMode=cv2.BORDER_CONSTANT,
                borderValue=float("nan"),
            )
            out[lines, samples] = grey.ravel()
        return out
