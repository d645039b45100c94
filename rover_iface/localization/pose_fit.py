"""A stop's cells fitted to a map from a pose near by: heights and brightness in one robust least squares.

At every step the map is read under the stop's cells and goes through the same filter as they did, with the
same gaps; only then both are compared. Four numbers are fitted: shift (2), turn, and the disparity by which
all ranges are off, held by what is known of it. The height follows from the pose.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_iface.errors import LocalizationError
from rover_iface.localization.pose_search import fine_structure
from rover_iface.localization.relief_map import ReliefMap
from rover_iface.localization.stop_relief import StopCells

Array = npt.NDArray[np.float64]
F32 = npt.NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class FitOptions:
    """How a pose is fitted.

    Attributes
    ----------
    disparity_sigma_px
        Of the bias that all ranges share: measured on rendered pairs 0.1, and half of it more.
    tail_sigmas
        Residuals beyond this many deviations weigh less (Cauchy): faces of rocks, shadows of one map alone.
    block_m
        Residuals may hang together within squares of this side and not beyond; twice the widest filter.
    rounds
        Of reweighted steps; more than 10 were never needed.
    scene_sigma_m, scene_sigma_rad
        What no residual shows, per axis and of the turn: the bright side of a rock moves with the sun by
        about its radius, an ortho image is bent over tens of metres, ranges of an earlier stop have a bias of
        their own. Set on the places of seeds 11 and 12 of `studies/relocalisation.py`, with room.
    """

    disparity_sigma_px: float = 0.15
    tail_sigmas: float = 2.5
    block_m: float = 4.0
    rounds: int = 15
    scene_sigma_m: float = 0.1
    scene_sigma_rad: float = math.radians(0.35)

    def __post_init__(self) -> None:
        for name in ("disparity_sigma_px", "tail_sigmas", "block_m"):
            if not getattr(self, name) > 0:
                raise LocalizationError(f"{name} is {getattr(self, name)}; it must be positive")
        if self.rounds < 1:
            raise LocalizationError(f"rounds of a fit are {self.rounds}; at least 1 is needed")


@dataclass(frozen=True, eq=False, slots=True)
class Layer:
    """One kind of evidence.

    Attributes
    ----------
    values
        The map's, on its posts, NaN where unknown.
    own
        The stop's cells (n,), of the same unit, NaN where unknown.
    sigma
        Deviations of the cells (n,) that are known beforehand.
    over_m
        What varies slower than this is taken out of both.
    """

    values: F32
    own: Array
    sigma: Array
    over_m: float


@dataclass(frozen=True, eq=False, slots=True)
class PoseFit:
    """A fitted pose: (east, north, turn, disparity), m, rad, px, and its covariance (4, 4)."""

    pose: Array
    covariance: Array


@dataclass(frozen=True, eq=False, slots=True)
class _Terms:
    """Residuals (n,), their derivative by the pose (n, 4), weights (n,), which cells they are of (n,)."""

    residuals: Array
    jacobian: Array
    weights: Array
    which: npt.NDArray[np.int64]


def fit_pose(
    grid: ReliefMap, cells: StopCells, layers: Sequence[Layer], start: Array, options: FitOptions
) -> PoseFit | None:
    """Return the pose near `start` (3,), (east, north, turn) in m and rad, or None if nothing holds it there.

    Notes
    -----
    Iteratively reweighted least squares. The covariance is the sandwich of the normal matrix and the scores
    summed over blocks (Cameron and Miller 2015, eq. 11), as neighbouring residuals hang together; a kind of
    evidence whose residuals do so counts less by as much.
    """
    pose = np.append(np.asarray(start, dtype=float), 0.0)
    held = np.diag([0.0, 0.0, 0.0, options.disparity_sigma_px**-2])
    block = _blocks(cells, options.block_m)
    least = 1e-3  # m: a tenth of what the best map tells
    for _ in range(options.rounds):
        terms = [t for layer in layers if (t := _terms(grid, cells, layer, pose, block, options)) is not None]
        if not terms:
            return None
        normal = held + sum((t.jacobian * t.weights[:, None]).T @ t.jacobian for t in terms)
        right = sum((t.jacobian * t.weights[:, None]).T @ t.residuals for t in terms) - held @ pose
        if np.linalg.cond(normal) > 1e14:
            return None
        step = np.linalg.solve(normal, right)
        # half a metre is as far as the slope of fine structure says anything
        step *= min(1.0, 0.5 / max(float(np.hypot(*step[:2])), 1e-9))
        pose = pose + step
        if float(np.hypot(*step[:2])) < least:
            break
    meat = held.copy()
    count = int(block.max()) + 1
    for t in terms:
        score = t.jacobian * (t.weights * t.residuals)[:, None]
        summed = np.column_stack(
            [np.bincount(block[t.which], weights=score[:, p], minlength=count) for p in range(4)]
        )
        meat += summed.T @ summed * (count / max(1, count - 4))
    bread = np.linalg.inv(normal)
    covariance = bread @ meat @ bread
    plain = bread  # if the weights were right
    larger = covariance if np.trace(covariance[:2, :2]) > np.trace(plain[:2, :2]) else plain
    scene = [options.scene_sigma_m, options.scene_sigma_m, options.scene_sigma_rad, 0.0]
    larger = larger + np.diag(scene) ** 2
    return PoseFit(pose, np.asarray(0.5 * (larger + larger.T)))


def _blocks(cells: StopCells, side_m: float) -> npt.NDArray[np.int64]:
    """Return the number of the square each cell lies in (n,)."""
    corner = np.floor(cells.places[:, :2] / side_m).astype(np.int64)
    corner -= corner.min(axis=0)
    _, number = np.unique(corner[:, 0] * (int(corner[:, 1].max()) + 1) + corner[:, 1], return_inverse=True)
    return np.asarray(number, dtype=np.int64)


def _terms(
    grid: ReliefMap,
    cells: StopCells,
    layer: Layer,
    pose: Array,
    block: npt.NDArray[np.int64],
    options: FitOptions,
) -> _Terms | None:
    """Return what one kind of evidence leaves, stop less gain times map, or None if too little is known."""
    from rover_iface.localization.relocalisation_kernels import read_map

    count = len(cells.places)
    seen, slopes = np.empty(count), np.empty((count, 4))
    place = grid.west_m, grid.south_m, grid.spacing_m
    read_map(layer.values, *place, cells.places, cells.stretch, pose, seen, slopes)
    known = np.isfinite(seen) & np.isfinite(layer.own)
    if known.sum() < 100:
        return None
    rows, columns, shape = cells.raster()
    over = layer.over_m / cells.cell_m

    def filtered(values: Array) -> Array:
        raster = np.full(shape, np.nan, np.float32)
        raster[rows[known], columns[known]] = values[known]
        return fine_structure(raster, over)[rows[known], columns[known]].astype(float)

    own, map_ = filtered(layer.own), filtered(seen)
    jacobian = np.column_stack([filtered(slopes[:, p]) for p in range(4)])
    sigma = layer.sigma[known]
    weights = np.ones(len(own))
    residuals, gain = own, 1.0
    for _ in range(3):  # gain and spread settle at once
        gain = float((weights * map_ * own).sum() / max(float((weights * map_ * map_).sum()), 1e-12))
        residuals = own - gain * map_
        spread = (1.4826 * float(np.median(np.abs(residuals)))) ** 2 + sigma**2
        weights = 1.0 / (spread * (1.0 + residuals**2 / (options.tail_sigmas**2 * spread)))
    if gain <= 0.0:
        return None
    # what hangs together tells less: of the slopes' scores, the sum over blocks against that of each
    score = jacobian[:, :2] * (weights * residuals)[:, None]
    together = [np.bincount(block[known], weights=score[:, p]) for p in range(2)]
    effect = sum(float((t * t).sum()) for t in together) / max(float((score * score).sum()), 1e-30)
    return _Terms(residuals, gain * jacobian, weights / max(1.0, effect), np.flatnonzero(known))
