"""The ground under a cloud: local planes through its low points, rocks left out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_iface.errors import LocalizationError

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Ground:
    """Height of the ground under a cloud, on a raster of 1 m posts [rows, columns], row 0 south."""

    heights: Array
    west: float
    south: float
    side: float

    def at(self, xy: Array) -> Array:
        """Return ground heights [...], m, at points [..., 2], m, bilinear, the border's beyond it."""
        from scipy.ndimage import map_coordinates

        where = (
            np.moveaxis(xy, -1, 0)[::-1] - np.array([self.south, self.west]).reshape(2, *[1] * (xy.ndim - 1))
        ) / self.side
        return np.asarray(map_coordinates(self.heights, where, order=1, mode="nearest"))


@dataclass(frozen=True, slots=True)
class GroundOptions:
    """Parameters of the ground under a cloud.

    None is published: Li et al. fit one plane a peak. They were chosen by hand for the generated terrains of
    `studies.localization`, for the reasons given.

    Attributes
    ----------
    low_share
        Each cell stands with the point of this share from below: the lowest ones are errors of stereo.
    full_count
        Points from which on a cell weighs fully: a few may all be noise.
    passes
        How often what lies over the plane is weighed anew: a rock pulls up the plane that it is judged by.
    stiffness_m2
        Added to the variance of places round a post: points in a line or spot tell no slope across it.
    over_m, fade_m
        What lies over the plane by `over_m` is ground all the same: ripples, errors of stereo. Beyond, its
        weight falls off as a Gaussian of `fade_m`, half the height of the lowest rock that is looked for.
    reach_sigmas
        Where the weight of a cell ends, in reaches; at five it is 4e-6.
    least_weight
        Posts that cells of less than this tell have the median height.
    """

    low_share: float = 0.3
    full_count: int = 10
    passes: int = 4
    stiffness_m2: float = 0.05
    over_m: float = 0.04
    fade_m: float = 0.06
    reach_sigmas: float = 5.0
    least_weight: float = 1e-9

    def __post_init__(self) -> None:
        if not (0 <= self.low_share <= 1 and self.full_count >= 1 and self.passes >= 1):
            raise LocalizationError(
                f"ground by the share {self.low_share} of {self.full_count} points in {self.passes} passes; "
                "0 to 1, and at least 1 each are needed"
            )
        if not (self.stiffness_m2 > 0 and self.fade_m > 0 and self.over_m >= 0):
            raise LocalizationError(
                f"ground with stiffness {self.stiffness_m2} m2, {self.over_m} m over it and a fall-off of "
                f"{self.fade_m} m; the first and the last must be positive"
            )


def fit_ground(
    points: Array, *, side: float = 1.0, reach_m: float = 1.5, options: GroundOptions | None = None
) -> Ground:
    """Return the ground under points [n, 3], m, z up: planes through low points, weighted by distance, rocks
    left out.

    Each cell of `side` metres stands with its lower points; a Gaussian of `reach_m` weighs the cells round a
    post, and cells above the plane lose weight.
    """
    options = options or GroundOptions()
    # two cells of border: the planes there lean on those inside
    low = points[:, :2].min(axis=0) - 2 * side
    at = np.floor((points[:, :2] - low) / side).astype(np.int64)
    columns, rows = (int(v) + 4 for v in at.max(axis=0))
    cell = at[:, 1] * columns + at[:, 0]
    order = np.lexsort((points[:, 2], cell))
    cells, first, count = np.unique(cell[order], return_index=True, return_counts=True)
    lows = points[order[first + (options.low_share * (count - 1)).astype(np.int64)]]
    weight = np.minimum(count, options.full_count) / float(options.full_count)
    x, y, z = (lows - (low[0], low[1], 0.0)).T
    trust = np.ones(len(cells))
    for _ in range(options.passes):
        fields = np.zeros((9, rows * columns))
        for total, moment in zip(fields, (1.0, x, y, z, x * x, x * y, y * y, x * z, y * z), strict=True):
            total[cells] = weight * trust * moment
        height = _planes(fields.reshape(-1, rows, columns), side, reach_m, float(np.median(z)), options)
        ground = Ground(height, float(low[0]), float(low[1]), side)
        over = lows[:, 2] - ground.at(lows[:, :2]) - options.over_m
        trust = np.where(over > 0.0, np.exp(-((over / options.fade_m) ** 2)), 1.0)
    return ground


def _planes(fields: Array, side: float, reach_m: float, else_m: float, options: GroundOptions) -> Array:
    """Return heights [rows, columns] of the local planes: Gaussian sums round each post, normal equations.

    `fields` [9, rows, columns] are weighted sums over the cells of 1, x, y, z, xx, xy, yy, xz, yz.
    """
    from scipy.ndimage import gaussian_filter

    sums = [
        gaussian_filter(field, reach_m / side, mode="constant", truncate=options.reach_sigmas)
        for field in fields
    ]
    total = np.maximum(sums[0], 1e-12)
    mx, my, mz, mxx, mxy, myy, mxz, myz = (moment / total for moment in sums[1:])
    xx = mxx - mx * mx + options.stiffness_m2
    yy = myy - my * my + options.stiffness_m2
    xy = mxy - mx * my
    xz, yz = mxz - mx * mz, myz - my * mz
    det = xx * yy - xy * xy
    a, b = (xz * yy - yz * xy) / det, (yz * xx - xz * xy) / det
    posts_y, posts_x = np.mgrid[0 : fields.shape[1], 0 : fields.shape[2]] * side
    height = mz + a * (posts_x - mx) + b * (posts_y - my)
    return np.where(sums[0] > options.least_weight, height, else_m)
