"""Pictures whose geometry is the scene's and whose grain, albedo and blur are those of real frames."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import numpy.typing as npt
from numba import njit

from rover_iface.cameras.labels import read_product
from rover_iface.cameras.model import CameraModel
from rover_iface.simulator.render.picture import Truth
from rover_iface.simulator.render.renderer import Renderer, Sun
from studies.common.tracking_worlds import Array

Grey = npt.NDArray[np.float32]


COARSEST = 64
"""Texels of the frame to one of the coarsest level: 13 cm on the surface at least, a pixel 100 m away."""


def halved(grain: Grey) -> list[Grey]:
    """Return a texture (rows, columns) and coarser levels of it, each exactly half of the one before.

    Cut so that the edge texels of all levels coincide: textures are reflected at their edges, and where those
    lie apart a coarse level slides along the surface as it is seen from nearer by.
    """
    import cv2

    levels = [grain[tuple(slice((n - 1) // COARSEST * COARSEST + 1) for n in grain.shape)]]
    for _ in range(round(math.log2(COARSEST))):
        levels.append(cv2.pyrDown(levels[-1]))
    return levels


class Drape:
    """Brightness of surfaces by the ground of one real frame, as fine as wanted.

    The frame's slow changes (light, slope, vignetting) are divided out; what is left, in multiples of the
    mean, is laid over the three planes of the site frame and blended by the normal. A second copy, finer by
    an irrational factor, gives what the camera resolved no more.
    """

    def __init__(self, path: Path, rng: np.random.Generator) -> None:
        import cv2

        product = read_product(path)
        if product.image is None:
            raise ValueError(f"{path.name} holds no image")
        whole = np.asarray(product.image, dtype=np.float32)
        rows = whole.shape[0]
        ground = whole[round(0.55 * rows) : round(0.97 * rows), round(0.05 * rows) : round(0.95 * rows)]
        slow = cv2.GaussianBlur(ground, (0, 0), 60.0)
        grain = np.clip(ground / np.maximum(slow, 1e-3), 0.3, 2.2).astype(np.float32)
        self.levels = halved(grain)
        self.pixel_m = float(rng.uniform(0.002, 0.005))
        """Size of a texel on the surface: a navcam's pixel at 2.5 to 6 m, from where the ground was taken."""
        self.shift = rng.uniform(0, 1000, (4, 2))
        self.albedo = rng.uniform(0.14, 0.30, 64)

    def at(
        self, points: Array, normals: Array, objects: npt.NDArray[np.int32], footprint: Array, along: Array
    ) -> Grey:
        """Return the albedo of surface points (n, 3) of bodies (n,).

        Averaged over a pixel's footprint: `footprint` (n,) metres wide, from `-along` to `+along` (n, 3)
        long.
        """
        out = np.empty(len(points), np.float32)
        sizes = np.array([level.shape for level in self.levels], np.int64)
        packed = np.concatenate([level.ravel() for level in self.levels])
        _albedo(
            packed,
            sizes,
            points / self.pixel_m,
            np.abs(normals) ** 4,
            footprint / self.pixel_m,
            along / self.pixel_m,
            self.shift,
            out,
        )
        return np.asarray(out * self.albedo[objects % 64], dtype=np.float32)


TAPS = 7
"""Samples along the long side of a footprint: ground seen at 8 degrees is seven times as long as wide."""
FINER = 4.83
FINER_SHARE = 0.7


@njit(cache=True, nogil=True)
def _bilinear(packed: Grey, start: int, rows: int, columns: int, x: float, y: float) -> float:
    """Return a level of the pyramid between texels, reflected beyond its edges."""
    wide, high = 2.0 * (columns - 1), 2.0 * (rows - 1)
    x, y = abs(x) % wide, abs(y) % high
    x, y = min(x, wide - x), min(y, high - y)
    i, j = min(int(x), columns - 2), min(int(y), rows - 2)
    fx, fy = x - i, y - j
    at = start + j * columns + i
    top = packed[at] * (1.0 - fx) + packed[at + 1] * fx
    low = packed[at + columns] * (1.0 - fx) + packed[at + columns + 1] * fx
    return top * (1.0 - fy) + low * fy


@njit(cache=True, nogil=True)
def _level(packed: Grey, sizes: Array, size: float, u: float, v: float) -> float:
    """Return the texture averaged over about `size` texels."""
    level = min(max(math.log2(max(size, 1e-3)), 0.0), len(sizes) - 1.001)
    low = int(level)
    total = 0.0
    for n in range(2):
        start = 0
        for m in range(low + n):
            start += sizes[m, 0] * sizes[m, 1]
        share = 1.0 - (level - low) if n == 0 else level - low
        scale = 0.5 ** (low + n)
        if share > 0.0:
            total += share * _bilinear(
                packed, start, sizes[low + n, 0], sizes[low + n, 1], u * scale, v * scale
            )
    return total


@njit(cache=True, nogil=True)
def _albedo(
    packed: Grey,
    sizes: Array,
    points: Array,
    weights: Array,
    footprint: Array,
    along: Array,
    shift: Array,
    out: Grey,
) -> None:
    for n in range(len(points)):
        whole = max(1e-9, weights[n, 0] + weights[n, 1] + weights[n, 2])
        total = 0.0
        for axis in range(3):
            share = weights[n, axis] / whole
            if share < 0.02:
                continue
            a, b = (1, 2) if axis == 0 else (0, 2) if axis == 1 else (0, 1)
            for tap in range(TAPS):
                part = (2.0 * tap + 1.0) / TAPS - 1.0
                u = points[n, a] + part * along[n, a]
                v = points[n, b] + part * along[n, b]
                size = footprint[n]
                coarse = _level(packed, sizes, size, u + shift[axis, 0], v + shift[axis, 1])
                fine = _level(packed, sizes, FINER * size, FINER * u + shift[3, 0], FINER * v + shift[3, 1])
                total += share / TAPS * coarse * (1.0 + FINER_SHARE * (fine - 1.0))
        out[n] = total


def draped_light(
    renderer: Renderer,
    drape: Drape,
    camera: CameraModel,
    window: tuple[int, int, int, int],
    sun: Sun,
    blur_px: float,
) -> tuple[Grey, Truth]:
    """Return the light (height, width) of a window of a camera (site frame), and its truth."""
    import cv2

    truth = renderer.gather(camera, None, sun, window=window).truth
    hit = np.isfinite(truth.range_m)
    light = np.full(truth.range_m.shape, 0.5 * sun.diffuse + 0.12, np.float32)
    points, normals = truth.point_site[hit], truth.normal_site[hit].astype(np.float64)
    toward = camera.C - points
    slant = np.abs((normals * toward).sum(axis=1)) / np.linalg.norm(toward, axis=1)
    footprint = (truth.range_m[hit] / camera.hs).astype(np.float64)
    away = toward / np.linalg.norm(toward, axis=1, keepdims=True)
    flat = away - normals * (away * normals).sum(axis=1, keepdims=True)
    flat /= np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-9)
    along = flat * (0.5 * footprint * (1.0 / np.maximum(slant, 0.12) - 1.0))[:, None]
    albedo = drape.at(points, normals, truth.object_index[hit], footprint, along)
    incidence = np.maximum(normals @ np.array(sun.direction), 0.0) * truth.lit[hit]
    light[hit] = albedo * (sun.direct * incidence + sun.diffuse * (0.5 + 0.5 * normals[:, 2]))
    return cv2.GaussianBlur(light, (0, 0), blur_px), truth


def digitised(light: Grey, gain: float, rng: np.random.Generator) -> npt.NDArray[np.uint8]:
    """Return the picture in 8 bits, with the noise of a 40,000 electron well."""
    full = 40_000.0
    electrons = np.clip(light * gain, 0.0, 1.0) * full
    noisy = electrons + rng.normal(0.0, 1.0, light.shape) * np.sqrt(electrons + 30.0**2)
    return np.clip(np.round(255.0 * noisy / full), 0, 255).astype(np.uint8)


def gain_for(light: Grey) -> float:
    """Return the gain that puts five per cent of the pixels above 62 % of full scale."""
    return (
        0.62 / max(float(np.quantile(light[::2, ::2], 0.95)), 1e-4)
        if math.isfinite(float(light.max()))
        else 1.0
    )
