"""Rasters of points on a plane with domes: ground and rocks whose truth is known in closed form."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

EYE = np.array([0.5, 0.06, 0.55])
"""Of the hazard cameras."""

MAST = np.array([0.17, 0.1, 1.45])
"""Of the mast's."""

ROCKS = ((0.95, 0.0, 0.15, 0.16), (1.35, -0.5, 0.15, 0.12), (1.3, 0.5, 0.12, 0.15))
"""x, y, half width and height of the dome-shaped rocks."""


def raster(
    bump: float = 0.0, tilt: float = 0.0, noise: float = 0.002, *, mast: bool = False, seed: int = 5
) -> tuple[Array, npt.NDArray[np.int64]]:
    """Return a raster of points on a plane with domes, seen by the hazard cameras or the mast's, and which
    dome each is on. `bump` stands on top of the first."""
    eye = MAST if mast else EYE
    wide, high = ((0.35, -0.35), (-0.75, -1.25)) if mast else ((0.62, -0.62), (-0.25, -1.05))
    azimuth, elevation = np.meshgrid(np.linspace(*wide, 260), np.linspace(*high, 170))
    ray = np.stack(
        (
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ),
        axis=-1,
    )
    far = -eye[2] / (ray[..., 2] - tilt * ray[..., 0])
    body = np.full(far.shape, -1)
    for number, (x, y, half, height) in enumerate(ROCKS):
        middle, scale = np.array([x, y, tilt * x]), np.array([half, half, height])
        distance = _dome(eye, ray, middle, scale)
        if number == 0 and bump:
            top = np.array([x - 0.07, y, height * 0.82])
            distance = np.minimum(distance, _dome(eye, ray, top, np.array([0.02, 0.02, bump + 0.02])))
        body = np.where(distance < far, number, body)
        far = np.minimum(far, distance)
    rng = np.random.default_rng(seed)
    points = eye + ray * (far + rng.normal(0.0, noise, far.shape))[..., None]
    return points, body.astype(np.int64)


def _dome(eye: Array, ray: Array, middle: Array, scale: Array) -> Array:
    start, way = (eye - middle) / scale, ray / scale
    a, b = (way**2).sum(axis=-1), (way * start).sum(axis=-1)
    root = b * b - a * ((start**2).sum() - 1.0)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.where(root > 0, (-b - np.sqrt(root)) / a, np.inf))
