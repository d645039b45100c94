"""A rock as it is seen from one stop."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from rover_iface.localization.rock_models import RockModel

Array = npt.NDArray[np.float64]
Cells = npt.NDArray[np.int64]

OUTLINED_SIGMA = 0.65
"""What a place errs by where the picture says where the rock ends, of what it errs by without: 0.58 to 0.60
along and across the sight, measured on the same legs."""


@dataclass(frozen=True, eq=False, slots=True)
class SeenRock:
    """A rock seen from one stop, site frame of the cloud.

    Attributes
    ----------
    peak
        [3], its highest point.
    position, covariance
        [3], [3, 3]: middle of its foot, and how far that may be off.
    height_m, width_m
        Over the plane round it; across the line of sight.
    range_m
        From the eye.
    surface
        [n, 3], points above the plane.
    model
        The best of the four solids, None when there are too few points for one.
    cells
        Which cells of the direction raster show it.
    rise
        Its face recedes as that of a rise of the ground does: a rock seen from a flat side, or no rock.
    probability
        That it is a rock (`rock_probability`, `weighed_by_outlines`).
    outlined
        The picture shows where it ends (`rock_outlines`); None without a picture.
    """

    peak: Array
    position: Array
    covariance: Array
    height_m: float
    width_m: float
    range_m: float
    surface: Array
    model: RockModel | None
    cells: Cells
    rise: bool = False
    probability: float = 1.0
    outlined: bool | None = None

    @property
    def radius_m(self) -> float:
        """Return the radius of its model, or half its width."""
        return self.model.radius_m if self.model is not None else 0.5 * self.width_m

    @property
    def area_m2(self) -> float:
        """Return the surface, m2, of its model, or that of a hemispheroid of its size."""
        if self.model is not None:
            return self.model.area_m2
        return 2.0 * math.pi * 0.5 * self.width_m * max(self.height_m, 0.5 * self.width_m)

    def with_outline(self, outlined: bool) -> SeenRock:
        """Return the rock as the picture bears it out; one whose outline it shows is placed better."""
        factor = OUTLINED_SIGMA**2 if outlined else 1.0
        return replace(self, outlined=outlined, covariance=factor * self.covariance)
