"""Grounds and stops for the tests of relocalisation, made without the renderer and its light."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

from rover_iface.localization.ground_points import GroundPoints
from rover_iface.localization.relief_map import ReliefMap
from rover_iface.localization.stop_relief import StopView

SPACING = 0.25
COUNT = 480


@dataclass(frozen=True, eq=False)
class Ground:
    """Heights, m, and albedo on posts of 0.25 m over 120 m, and where its first post stands."""

    heights: np.ndarray
    albedo: np.ndarray
    first: float = -0.5 * (COUNT - 1) * SPACING

    @staticmethod
    def of(seed: int, *, relief: float = 0.12, contrast: float = 0.1) -> Ground:
        rng = np.random.default_rng(seed)

        def waves(smooth_m: float) -> np.ndarray:
            field = gaussian_filter(rng.standard_normal((COUNT, COUNT)), smooth_m / SPACING, mode="wrap")
            return np.asarray(field / field.std())

        heights = relief * waves(0.8) + 0.5 * waves(8.0)
        return Ground(heights, 0.25 * np.exp(contrast * waves(0.4)))

    def light(self, sun: tuple[float, float, float]) -> np.ndarray:
        """Return the brightness of a Lambertian ground with a quarter of the light from the sky."""
        north, east = np.gradient(self.heights, SPACING)
        facing = (-east * sun[0] - north * sun[1] + sun[2]) / np.sqrt(1.0 + east**2 + north**2)
        return np.asarray(self.albedo * (0.25 + np.maximum(facing, 0.0)))

    def map(self, sun: tuple[float, float, float], *, image: bool = True) -> ReliefMap:
        bright = self.light(sun).astype(np.float32) if image else None
        return ReliefMap(self.heights.astype(np.float32), self.first, self.first, SPACING, bright)

    def at(self, values: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        place = [(y - self.first) / SPACING, (x - self.first) / SPACING]
        return np.asarray(map_coordinates(values, place, order=1))

    def stop(
        self,
        eye: tuple[float, float],
        wrong: tuple[float, float, float],
        sun: tuple[float, float, float],
        *,
        seed: int = 0,
        image: bool = True,
        noise_m: float = 0.01,
    ) -> StopView:
        """Return what a stop at `eye` sees, believed `wrong` (east, north, turn) away from where it is."""
        rng = np.random.default_rng(seed)
        away, azimuth = 25.0 * np.sqrt(rng.uniform(0.01, 1.0, 60_000)), rng.uniform(0, math.tau, 60_000)
        x, y = away * np.cos(azimuth), away * np.sin(azimuth)
        z = self.at(self.heights, eye[0] + x, eye[1] + y) + rng.normal(0.0, noise_m, len(x))
        top = float(self.at(self.heights, np.array([eye[0]]), np.array([eye[1]]))[0]) + 1.5
        bright = self.at(self.light(sun), eye[0] + x, eye[1] + y)
        c, s = math.cos(wrong[2]), math.sin(wrong[2])
        there = np.array([eye[0] - wrong[0], eye[1] - wrong[1], top - 0.6])
        points = np.column_stack([c * x + s * y, -s * x + c * y, z - top]) + there
        return StopView(GroundPoints(points, there), bright if image else None)


MORNING = (math.cos(0.6), 0.0, math.sin(0.6))
AFTERNOON = (-0.6, -0.3, math.sqrt(1.0 - 0.45))
