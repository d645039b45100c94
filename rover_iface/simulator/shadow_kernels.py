"""Compiled kernel of the rover's own shadow."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit


@njit(cache=True, nogil=True)
def rays_past_ball(
    starts: npt.NDArray[np.float32],
    way: npt.NDArray[np.float64],
    middle: npt.NDArray[np.float64],
    radius: float,
    near: npt.NDArray[np.bool_],
) -> None:
    """Fill which rays from starts (n, 3) along a unit vector `way` come within `radius` of `middle` (3,)
    ahead; one frame, m.
    """
    for n in range(len(starts)):
        x, y, z = middle[0] - starts[n, 0], middle[1] - starts[n, 1], middle[2] - starts[n, 2]
        along = x * way[0] + y * way[1] + z * way[2]
        near[n] = along > -radius and x * x + y * y + z * z - along * along < radius * radius
