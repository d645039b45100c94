"""The scale of visual odometry, from the legs whose rocks say how long they are.

Stereo with a base or focal length a little off measures every way too long or too short by one share. A leg
with rocks seen from both ends has a length of its own; from all such legs together comes the scale, and with
it the legs that were refused lose most of their error along the way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rover_iface.errors import LocalizationError
from rover_iface.frames import Transform


@dataclass(frozen=True, slots=True)
class DriveScale:
    """True length over measured, and its standard deviation."""

    scale: float
    sigma: float

    def corrected(self, motion: Transform) -> Transform:
        """Return a motion with its shift at the true scale."""
        return Transform(motion.rotation, self.scale * motion.translation)


@dataclass(frozen=True, slots=True)
class MeasuredLeg:
    """Length of a leg by the pictures on the way and by its rocks, metres, each with its deviation.

    `sigma_m` is of what is left of the pictures' error without the scale.
    """

    length_m: float
    sigma_m: float
    rocks_m: float
    rocks_sigma_m: float


def drive_scale(legs: Sequence[MeasuredLeg], prior_sigma: float) -> DriveScale:
    """Return the scale by weighted least squares, held to 1 with `prior_sigma`.

    Raises
    ------
    LocalizationError
        If a deviation or the prior's is not positive.
    """
    if not prior_sigma > 0:
        raise LocalizationError(f"the scale is held with a deviation of {prior_sigma}; it must be positive")
    weight, moment = prior_sigma**-2, 0.0
    for leg in legs:
        if not (leg.sigma_m >= 0 and leg.rocks_sigma_m > 0 and leg.length_m > 0):
            raise LocalizationError(
                f"a leg of {leg.length_m} m has deviations {leg.sigma_m} and {leg.rocks_sigma_m} m; "
                "all must be positive"
            )
        information = leg.length_m**2 / (leg.sigma_m**2 + leg.rocks_sigma_m**2)
        weight += information
        moment += information * (leg.rocks_m / leg.length_m - 1.0)
    return DriveScale(1.0 + moment / weight, float(np.sqrt(1.0 / weight)))
