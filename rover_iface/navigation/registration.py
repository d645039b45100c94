"""Where the rover is on its own map: fresh heights registered to what was mapped earlier.

Dead reckoning is off by some per cent of the way; a rock seen eight steps ago lies decimetres from where the
map has it when the rover comes beside it. So before a new look is merged its heights are shifted, turned,
raised and tilted until they fit those of the map, as visual odometry would do with features. What dead
reckoning says is kept as a prior: flat ground, which tells nothing about the shift, leaves the pose alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numba import njit
from numpy.typing import NDArray

from rover_iface.errors import RoverError

Array = NDArray[np.floating]

SHARE = 0.25
"""What a cell counts for: neighbours share their errors."""

NOISY_SLOPE = 0.08
"""Slope between neighbouring cells that the noise of stereo alone can make."""


@dataclass(frozen=True, slots=True)
class RegistrationParameters:
    """How far a look may be moved to fit the map.

    `turn_rad`, `rise_m`, `tilt_rad` are standard deviations of dead reckoning's heading, height and attitude
    since the last look. A residual beyond `outlier_m` counts no longer: the other side of a rock, or the
    shade behind it. Where the place is less sure than 0.6 `starts_m`, the search starts from nine places so
    far apart.
    """

    turn_rad: float = math.radians(0.5)
    rise_m: float = 0.03
    tilt_rad: float = math.radians(0.3)
    noise_m: float = 0.02
    outlier_m: float = 0.08
    least_cells: int = 150
    iterations: int = 8
    starts_m: float = 0.10

    def __post_init__(self) -> None:
        if not 0 < self.noise_m < self.outlier_m:
            raise RoverError(
                f"registration takes residuals of {self.noise_m} m for noise and of {self.outlier_m} m for "
                "outliers; the first must be positive and the smaller"
            )


@dataclass(frozen=True, slots=True, eq=False)
class Correction:
    """By how much a look was moved about the rover to fit the map; nothing if too little of it overlaps.

    `east_m`, `north_m`, `turn_rad`, `rise_m` are added to the pose. `sigma_m` is the larger standard
    deviation of the place, `cells` how many cells both knew, `residual_m` the median misfit that is left.
    `alone` [4] is what the heights make of east, north, rise and turn without what dead reckoning says of
    them, `alone_covariance` [4, 4] what that errs: a metre and a radian where the ground tells nothing.
    """

    east_m: float = 0.0
    north_m: float = 0.0
    turn_rad: float = 0.0
    rise_m: float = 0.0
    tilt_east_rad: float = 0.0
    tilt_north_rad: float = 0.0
    sigma_m: float = math.inf
    cells: int = 0
    residual_m: float = math.nan
    alone: Array = field(default_factory=lambda: np.zeros(4))
    alone_covariance: Array = field(default_factory=lambda: np.eye(4))

    @property
    def made(self) -> bool:
        """Return whether there was enough overlap."""
        return self.cells > 0


def register(
    heights: Array,
    known: NDArray[np.bool_],
    cell_m: float,
    fresh: Array,
    pivot: tuple[float, float],
    sigma_m: float,
    parameters: RegistrationParameters | None = None,
) -> Correction:
    """Return how fresh heights must be moved to fit the map.

    Parameters
    ----------
    heights, known
        Map heights [rows, columns], m, row 0 south, and where they count.
    fresh
        [n, 4]: column, row (fractions of cells), height and weight of the cells of the new look, at the pose
        that dead reckoning gives.
    pivot
        Column and row of the rover, about which turns and tilts are taken.
    sigma_m
        One standard deviation of the place that dead reckoning gives.
    """
    p = parameters or RegistrationParameters()
    place = max(sigma_m, 1e-3)
    prior = np.array(
        [1 / place**2, 1 / place**2, 1 / p.turn_rad**2, 1 / p.rise_m**2, 1 / p.tilt_rad**2, 1 / p.tilt_rad**2]
    )
    best: tuple[float, Array, Array, int, float] | None = None
    of_cells = SHARE * (p.outlier_m / p.noise_m) ** 2 / 6.0 * len(fresh)
    grid = p.starts_m
    starts = [(0.0, 0.0)]
    if place > 0.6 * grid:
        starts += [(dx * grid, dy * grid) for dx in (-1, 0, 1) for dy in (-1, 0, 1) if dx or dy]
    for dx, dy in starts:
        guess = np.array([dx, dy, 0.0, 0.0, 0.0, 0.0])
        cost, matrix, cells, residual = _fit(
            heights,
            known,
            cell_m,
            fresh,
            pivot[0],
            pivot[1],
            prior,
            guess,
            p.noise_m,
            p.outlier_m,
            p.iterations if (dx, dy) == (0.0, 0.0) else 3,
        )
        whole = of_cells * cost + 0.5 * float(prior @ guess**2)
        if cells >= p.least_cells and (best is None or whole < best[0]):
            best = (whole, guess, matrix, cells, residual)
    if best is None:
        return Correction()
    _, guess, matrix, cells, residual = best
    if len(starts) > 1:
        _, matrix, cells, residual = _fit(
            heights,
            known,
            cell_m,
            fresh,
            pivot[0],
            pivot[1],
            prior,
            guess,
            p.noise_m,
            p.outlier_m,
            p.iterations,
        )
    covariance = np.linalg.inv(matrix)
    spread = math.sqrt(float(np.linalg.eigvalsh(covariance[:2, :2])[-1]))
    east, north, turn, rise, tilt_east, tilt_north = (float(v) for v in guess)
    of_heights = matrix - np.diag(prior * (1, 1, 1, 1, 0, 0)) + np.eye(6)
    order = [0, 1, 3, 2]
    alone = np.linalg.solve(of_heights, matrix @ guess)[order]
    alone_covariance = np.linalg.inv(of_heights)[np.ix_(order, order)]
    return Correction(
        east, north, turn, rise, tilt_east, tilt_north, spread, cells, residual, alone, alone_covariance
    )


@njit(cache=True, nogil=True)
def _fit(
    heights: Array,
    known: NDArray[np.bool_],
    cell: float,
    fresh: Array,
    pivot_c: float,
    pivot_r: float,
    prior: Array,
    guess: Array,
    noise: float,
    outlier: float,
    iterations: int,
) -> tuple[float, Array, int, float]:
    """Refine `guess` in place; return mean robust cost, normal matrix, cells used, mean misfit of inliers.

    The residual is the height of a fresh cell moved by (east, north, turn) about the pivot and lifted by rise
    and tilts, less the map's there; weights are Tukey's.
    """
    rows, columns = heights.shape
    matrix = np.zeros((6, 6))
    cost, cells, misfit = 0.0, 0, 0.0
    for iteration in range(iterations + 1):
        matrix[:] = 0.0
        right = np.zeros(6)
        for a in range(6):
            matrix[a, a] = prior[a]
            right[a] = -prior[a] * guess[a]
        cells, cost, misfit, inliers = 0, 0.0, 0.0, 0.0
        ct, st = math.cos(guess[2]), math.sin(guess[2])
        for k in range(fresh.shape[0]):
            x = (fresh[k, 0] - pivot_c) * cell
            y = (fresh[k, 1] - pivot_r) * cell
            tx, ty = ct * x - st * y, st * x + ct * y
            c = pivot_c + (tx + guess[0]) / cell
            r = pivot_r + (ty + guess[1]) / cell
            j, i = math.floor(c), math.floor(r)
            if i < 0 or j < 0 or i >= rows - 1 or j >= columns - 1:
                continue
            if not (known[i, j] and known[i, j + 1] and known[i + 1, j] and known[i + 1, j + 1]):
                continue
            u, v = c - j, r - i
            h00, h01, h10, h11 = heights[i, j], heights[i, j + 1], heights[i + 1, j], heights[i + 1, j + 1]
            h = (h00 * (1 - u) + h01 * u) * (1 - v) + (h10 * (1 - u) + h11 * u) * v
            gx = ((h01 - h00) * (1 - v) + (h11 - h10) * v) / cell
            gy = ((h10 - h00) * (1 - u) + (h11 - h01) * u) / cell
            # Slopes no steeper than noise between neighbouring cells would pass for knowledge of the shift.
            steep = gx * gx + gy * gy
            real = max(0.0, 1.0 - NOISY_SLOPE**2 / steep) if steep > 0.0 else 0.0
            gx, gy = gx * real, gy * real
            e = fresh[k, 2] + guess[3] + guess[4] * x + guess[5] * y - h
            cells += 1
            q = e / outlier
            if abs(q) >= 1.0:
                cost += 1.0
                continue
            cost += 1.0 - (1.0 - q * q) ** 3
            misfit += abs(e)
            inliers += 1.0
            w = SHARE * (1.0 - q * q) ** 2 * min(1.0, fresh[k, 3]) / (noise * noise)
            d0, d1, d2, d3, d4, d5 = -gx, -gy, gx * ty - gy * tx, 1.0, x, y
            d = (d0, d1, d2, d3, d4, d5)
            for a in range(6):
                right[a] -= w * d[a] * e
                for b in range(a, 6):
                    matrix[a, b] += w * d[a] * d[b]
        for a in range(6):
            for b in range(a):
                matrix[a, b] = matrix[b, a]
        misfit = misfit / max(1.0, inliers)
        cost = cost / max(1, cells)
        if iteration == iterations or cells < 20:
            break
        step = np.linalg.solve(matrix, right)
        for a in range(6):
            guess[a] += step[a]
        if abs(step[0]) + abs(step[1]) < 5e-4 and abs(step[2]) < 2e-4:
            break
    return cost, matrix, cells, misfit
