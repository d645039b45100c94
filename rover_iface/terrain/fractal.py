"""Fractal noise that can be asked at any raster of a site."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]


def spectral_noise(rng: np.random.Generator, count: int, slope: float) -> Array:
    """Return a periodic random field [count, count] of mean 0 and deviation 1 with power ~
    frequency^-slope.
    """
    frequency = np.hypot(np.fft.fftfreq(count)[:, None], np.fft.rfftfreq(count)[None, :])
    frequency[0, 0] = 1.0
    amplitude = frequency ** (-slope / 2)
    amplitude[0, 0] = 0.0
    shape = amplitude.shape
    spectrum = amplitude * (rng.standard_normal(shape) + 1j * rng.standard_normal(shape))
    field: Array = np.fft.irfft2(spectrum, s=(count, count))
    return field / field.std()


def _cubic_weights(positions: Array, count: int) -> tuple[int, int, Array]:
    """Return the matrix of Catmull-Rom interpolation at fractional indices, over the posts it needs."""
    first = np.floor(positions).astype(np.int64)
    t = positions - first
    lo = max(0, int(first.min()) - 1)
    hi = min(count, int(first.max()) + 3)
    weights = np.zeros((len(positions), hi - lo))
    parts = (
        ((-t + 2) * t - 1) * t / 2,
        ((3 * t - 5) * t * t + 2) / 2,
        ((-3 * t + 4) * t + 1) * t / 2,
        (t - 1) * t * t / 2,
    )
    rows = np.arange(len(positions))
    for k, part in enumerate(parts):
        np.add.at(weights, (rows, np.clip(first - 1 + k, lo, hi - 1) - lo), part)
    return lo, hi, weights


def smooth_step(x: Array) -> Array:
    """Return 0 below 0, 1 above 1, and a cubic without a kink between, of each number [...]."""
    t = np.clip(x, 0.0, 1.0)
    result: Array = t * t * (3 - 2 * t)
    return result


class Field:
    """A noise field over the whole site that can be asked at any raster.

    `values` [n, n] cover a square of `size_m` round the origin of the site frame.
    """

    def __init__(self, values: Array, size_m: float) -> None:
        self.values = values
        self.size = size_m
        self._last: list[tuple[tuple[float, float, int, float, float, int], Array]] = []

    def at(self, xs: Array, ys: Array) -> Array:
        """Return values [len(ys), len(xs)] on a regular raster; the last two rasters are remembered.

        `xs` and `ys` are site coordinates, m, evenly spaced.
        """
        key = (float(xs[0]), float(xs[-1]), len(xs), float(ys[0]), float(ys[-1]), len(ys))
        for known, values in self._last:
            if known == key:
                return values
        self._last = [*self._last[-1:], (key, self._interpolate(xs, ys))]
        return self._last[-1][1]

    def _interpolate(self, xs: Array, ys: Array) -> Array:
        count = len(self.values)
        scale = (count - 1) / self.size
        c0, c1, wx = _cubic_weights((xs + self.size / 2) * scale, count)
        r0, r1, wy = _cubic_weights((ys + self.size / 2) * scale, count)
        result: Array = wy @ self.values[r0:r1, c0:c1] @ wx.T
        return result
