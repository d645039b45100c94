"""The cumulative hazard map: clouds of points in, per cell a plane, a hazard and a confidence out."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rover_iface.errors import RoverError
from rover_iface.navigation.footing import filled
from rover_iface.navigation.kernels import assess, gather
from rover_iface.navigation.registration import Correction, RegistrationParameters, register
from rover_iface.navigation.sensor import GroundRaster
from rover_iface.profile import RoverProfile

Array = NDArray[np.floating]

TOPS = 1.5
"""Standard deviations above the mean of a cell: the edge of a stone that half fills it is one."""
HOLE_CELLS = 2
"""Passes that close holes from their rim; what a rock hides is wider and stays unknown."""


@dataclass(frozen=True, slots=True)
class MapParameters:
    """How clouds become hazards.

    `patch_m` is the half width of the square a plane is fitted to, `discount` what is left of the weight of
    old points at each new cloud (they have drifted), `least` the weight from which a cell counts. Limits of
    residual, tilt and step are shares of the rover's own.
    """

    cell_m: float = 0.10
    patch_m: float = 0.40
    discount: float = 0.5
    fading: float = 0.98
    least: float = 0.6
    residual_m: float = 0.085
    tilt_share: float = 0.9
    step_share: float = 0.7
    reach_m: float = 5.5

    def __post_init__(self) -> None:
        if not 0.02 <= self.cell_m <= 1:
            raise RoverError(f"cell of the hazard map is {self.cell_m} m; 0.02 to 1 m are possible")
        if not 0 < self.discount <= 1:
            raise RoverError(f"discount of the hazard map is {self.discount}; it must lie in (0, 1]")


class HazardMap:
    """Hazards round a drive, in a frame of the map's own: that of the first look, kept by registration.

    `hazard` [rows, columns] is 0 for flat ground, 1 and more for an obstacle, NaN where nothing is known;
    `confidence` runs from 0 to 1 with the number of points. Row 0 lies in the south.
    """

    def __init__(
        self,
        profile: RoverProfile,
        centre: tuple[float, float],
        size_m: float = 40.0,
        parameters: MapParameters | None = None,
    ) -> None:
        self.parameters = parameters or MapParameters()
        self.profile = profile
        cell = self.parameters.cell_m
        count = max(4, round(size_m / cell))
        self.west = centre[0] - (count - 1) / 2 * cell
        self.south = centre[1] - (count - 1) / 2 * cell
        self.cell = cell
        shape = (count, count)
        self._weight = np.zeros(shape)
        self._total = np.zeros(shape)
        self._square = np.zeros(shape)
        self._age = np.zeros(shape)
        self.hazard = np.full(shape, np.nan)
        self.confidence = np.zeros(shape)
        self.updates = 0

    def update(self, clouds: list[Array], eye: ArrayLike) -> int:
        """Merge point clouds [n, 3] seen from `eye` [3], all in the map's frame, m; return the points used.

        Notes
        -----
        Weight falls with the square of the range beyond 2 m, as stereo's own error does.
        """
        p = self.parameters
        fresh, (r0, r1, c0, c1), used = self._gathered(clouds, np.asarray(eye, dtype=float))
        view = (slice(r0, r1), slice(c0, c1))
        # Old points have drifted: where there are new ones they count for less, elsewhere they are all there
        # is.
        keep = np.where(fresh[0] > 0, p.discount, 1.0)
        for sums, new in zip((self._weight, self._total, self._square), fresh, strict=True):
            sums[view] = sums[view] * keep + new
        self._age[view] = np.where(fresh[0] > 0, 0.0, self._age[view] + 1.0)
        mobility = self.profile.mobility
        assess(
            self._weight,
            self._total,
            self._square,
            p.cell_m,
            r0,
            r1,
            c0,
            c1,
            max(1, round(p.patch_m / p.cell_m)),
            p.least,
            p.residual_m,
            p.tilt_share * mobility.max_slope_rad,
            p.step_share * mobility.max_step_m,
            self.hazard,
            self.confidence,
        )
        self.confidence[view] *= p.fading ** self._age[view]
        self.updates += 1
        return used

    def fit(
        self,
        clouds: list[Array],
        eye: ArrayLike,
        pivot: tuple[float, float],
        sigma_m: float,
        parameters: RegistrationParameters | None = None,
    ) -> Correction:
        """Return how clouds [n, 3], seen from `eye` [3], must be moved about `pivot` (x, y) to fit what is
        mapped; the map stays as it is.

        All are in the map's frame, m; `sigma_m` is one standard deviation of the rover's place on the map
        before.
        """
        p = self.parameters
        if not self.updates:
            return Correction()
        fresh, (r0, r1, c0, c1), _ = self._gathered(clouds, np.asarray(eye, dtype=float))
        view = (slice(r0, r1), slice(c0, c1))
        known = self._weight[view] >= p.least
        heights = np.where(known, self._total[view] / np.where(known, self._weight[view], 1.0), 0.0)
        rows, columns = np.nonzero(fresh[0] >= p.least)
        weight = fresh[0][rows, columns]
        cells = np.column_stack((columns, rows, fresh[1][rows, columns] / weight, weight)).astype(float)
        middle = ((pivot[0] - self.west) / self.cell - c0, (pivot[1] - self.south) / self.cell - r0)
        return register(heights, known, self.cell, cells, middle, sigma_m, parameters)

    def _gathered(self, clouds: list[Array], eye: Array) -> tuple[Array, tuple[int, int, int, int], int]:
        """Return sums of weight, z and z^2 [3, rows, columns] of clouds, their window, the points used."""
        p = self.parameters
        window = self._window(eye[0], eye[1], p.reach_m + p.patch_m + 0.3)
        r0, r1, c0, c1 = window
        fresh = np.zeros((3, r1 - r0, c1 - c0))
        used = 0
        for cloud in clouds:
            if not len(cloud):
                continue
            distance = np.linalg.norm(cloud - eye, axis=1)
            near = distance < p.reach_m
            gains = 1.0 / np.maximum(1.0, distance[near] / 2.0) ** 2
            used += gather(
                fresh[0],
                fresh[1],
                fresh[2],
                self.west + c0 * p.cell_m,
                self.south + r0 * p.cell_m,
                p.cell_m,
                cloud[near],
                gains,
            )
        return fresh, window, used

    def _window(self, x: float, y: float, half: float) -> tuple[int, int, int, int]:
        rows, columns = self.hazard.shape
        r = (y - self.south) / self.cell
        c = (x - self.west) / self.cell
        h = half / self.cell
        return (
            max(0, math.floor(r - h)),
            min(rows, math.ceil(r + h) + 1),
            max(0, math.floor(c - h)),
            min(columns, math.ceil(c + h) + 1),
        )

    def ground(self, x: float, y: float, half_m: float) -> GroundRaster:
        """Return the heights round a place of the map, m, as high as the points of a cell mostly reach.

        The mean of a cell hides the stone in its corner. Holes of a cell or two are as high as the highest
        beside them.
        """
        r0, r1, c0, c1 = self._window(x, y, half_m)
        weight, total, square = (sums[r0:r1, c0:c1] for sums in (self._weight, self._total, self._square))
        known = weight >= self.parameters.least
        mean = np.where(known, total / np.where(known, weight, 1.0), np.nan)
        spread = np.sqrt(
            np.maximum(0.0, np.where(known, square / np.where(known, weight, 1.0), 0.0) - mean**2)
        )
        heights = mean + TOPS * spread
        for _ in range(HOLE_CELLS):
            heights = filled(heights)
        if min(heights.shape) < 2:  # off the map
            heights = np.full((2, 2), np.nan)
        return GroundRaster(heights, self.west + c0 * self.cell, self.south + r0 * self.cell, self.cell)

    def away(self, x: float, y: float) -> Array:
        """Return how far the middle of each cell [rows, columns] is from a point of the map, m."""
        rows, columns = self.hazard.shape
        east, north = self.west + self.cell * np.arange(columns), self.south + self.cell * np.arange(rows)
        return np.asarray(np.hypot(east[None, :] - x, north[:, None] - y))

    def at(self, x: float, y: float) -> float:
        """Return the hazard of the cell that holds a point, NaN outside or unknown."""
        c = math.floor((x - self.west) / self.cell + 0.5)
        r = math.floor((y - self.south) / self.cell + 0.5)
        rows, columns = self.hazard.shape
        return float(self.hazard[r, c]) if 0 <= r < rows and 0 <= c < columns else math.nan

    def picture(
        self, size_m: float | None = None, centre: tuple[float, float] | None = None
    ) -> NDArray[np.uint8]:
        """Return the map as a picture [rows, columns, 3], north up: green harmless, red obstacle, grey
        unknown.
        """
        hazard, confidence = self.hazard, self.confidence
        if size_m is not None and centre is not None:
            r0, r1, c0, c1 = self._window(centre[0], centre[1], size_m / 2)
            hazard, confidence = hazard[r0:r1, c0:c1], confidence[r0:r1, c0:c1]
        level = np.clip(np.nan_to_num(hazard, nan=0.0), 0, 1)
        colour = np.stack([60 + 180 * level, 170 - 130 * level, 70 - 30 * level], axis=-1)
        colour = np.where((hazard >= 1)[..., None], np.array([200.0, 30.0, 30.0]), colour)
        faint = (0.35 + 0.65 * confidence)[..., None]
        colour = colour * faint + 120.0 * (1 - faint)
        colour = np.where(np.isnan(hazard)[..., None], 120.0, colour)
        return np.clip(colour, 0, 255).astype(np.uint8)[::-1].copy()
