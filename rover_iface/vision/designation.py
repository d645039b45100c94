"""Whether stereo sees a target where it was designated."""

from __future__ import annotations

import math

import numpy as np

from rover_iface.cameras.model import Array
from rover_iface.cameras.stereo import PointMatch
from rover_iface.errors import TrackerError
from rover_iface.vision.tracker import StereoView

DISPARITY_PX = 1.0
"""Three sigma of a disparity between designation and start (Kim et al. 2009, eq. 1)."""
MAP_SHARE = 0.02
"""Three sigma of the designated range besides: dead reckoning since (eq. 3)."""


def require_range(target: str, view: StereoView, designated: Array, match: PointMatch) -> None:
    """Refuse a target that stereo ranges elsewhere than designated.

    A camera model that is off, pictures of two times and a patch that repeats itself show here, and nowhere
    else: what the pair says by itself is consistent.

    Raises
    ------
    TrackerError
        If the ranges differ by more than both can be off.
    """
    expected = float(np.linalg.norm(designated - view.left_camera.C))
    measured = float(np.linalg.norm(match.point - view.left_camera.C))
    baseline_m = float(np.linalg.norm(view.right_camera.C - view.left_camera.C))
    one_px_m = expected**2 / (view.left_camera.hs * baseline_m)
    sigma_m = math.sqrt(float(np.trace(match.surface_covariance)))
    # a patch that tells little is no licence: three sigma count up to the error of a pixel
    limit = DISPARITY_PX * one_px_m + min(3.0 * sigma_m, DISPARITY_PX * one_px_m) + MAP_SHARE * expected
    if abs(measured - expected) > limit:
        raise TrackerError(
            f'target "{target}": stereo ranges it at {measured:.2f} m, it was designated at '
            f"{expected:.2f} m; they may differ by {limit:.2f} m"
        )
