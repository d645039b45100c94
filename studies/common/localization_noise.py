"""How far off the disparities of rendered panoramas are: the source of the modelled stereo's noise."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.ndimage import maximum_filter, minimum_filter

from rover_iface.cameras.panorama import Panorama, StereoWedge
from rover_iface.localization.ground_points import CELL_RAD, points_of_panorama
from studies.common.localization_legs import Leg, make_leg, rendered_panorama

Array = npt.NDArray[np.float64]
NEAR_M, FAR_M = 15.0, 24.0
"""Bounds of the ground near by, and of all that rocks are extracted from."""
GROSS_PX = 2.0
"""Errors beyond count as false matches: ten times the scatter."""
LAGS = (1, 2, 3, 4)
FEWEST = 200
"""Cells of one kind below which a pair tells no bias."""


def wedge_errors(leg: Leg, wedge: StereoWedge, eye: Array) -> dict[str, Array]:
    """Return one pair's errors of disparity on a raster of directions [rows, columns] seen from `eye` [3], m.

    `error` is seen less true, px, each ray against its own cast range, NaN where nothing was seen; `range`
    the true range of the cell, m; `rock` where the cell and those beside it show one rock, `ground` one
    ground; `grown` where the cell beside is nearer by more than 1 px of disparity: how far, of the way to
    that disparity, the one seen has gone.
    """
    seen = points_of_panorama(Panorama((wedge,)))
    rays = seen.points - eye
    away = np.linalg.norm(rays, axis=1)
    rays = rays / away[:, None]
    true = leg.scene.cast(np.broadcast_to(eye, rays.shape), rays)["tfar"].astype(np.float64)
    azimuth, elevation = np.arctan2(rays[:, 1], rays[:, 0]), np.arcsin(rays[:, 2])
    middle = math.atan2(np.sin(azimuth).mean(), np.cos(azimuth).mean())
    across = (azimuth - middle + math.pi) % math.tau - math.pi
    left, top = across.min(), elevation.max()
    column = np.rint((across - left) / CELL_RAD).astype(np.int64)
    row = np.rint((top - elevation) / CELL_RAD).astype(np.int64)
    shape = int(row.max()) + 1, int(column.max()) + 1
    at, good = row * shape[1] + column, true < 1e30
    disparity = seen.range_factor / away

    def on_cells(values: Array) -> Array:
        count = np.bincount(at[good], minlength=shape[0] * shape[1])
        total = np.bincount(at[good], weights=values[good], minlength=len(count))
        return np.where(count > 0, total / np.maximum(count, 1), np.nan).reshape(shape)

    error, measured = on_cells(disparity - seen.range_factor / true), on_cells(disparity)
    columns = middle + left + CELL_RAD * np.arange(shape[1])
    rows = np.broadcast_to((top - CELL_RAD * np.arange(shape[0]))[:, None], shape)
    level = np.cos(rows)
    cells = np.stack((level * np.cos(columns), level * np.sin(columns), np.sin(rows)), axis=-1).reshape(-1, 3)
    hit = leg.scene.cast(np.broadcast_to(eye, cells.shape), cells)
    far = hit["tfar"].astype(np.float64).reshape(shape)
    on = leg.scene.objects[np.clip(hit["primID"].astype(np.int64), 0, len(leg.scene.objects) - 1)]
    on = np.where(far < 1e30, on.reshape(shape), -1)
    inside = (maximum_filter(on, size=3) == minimum_filter(on, size=3)) & (on >= 0)
    rock = np.array([bool(name) for name in leg.scene.ids])[on] & inside
    cell_px = np.where(far < 1e30, seen.range_factor / far, 0.0)
    jump = maximum_filter(cell_px, size=3) - cell_px
    grown = np.where(jump > 1.0, (measured - cell_px) / np.maximum(jump, 1.0), np.nan)
    return {"error": error, "range": far, "rock": rock, "ground": inside & ~rock, "grown": grown}


def lagged(error: Array, chosen: npt.NDArray[np.bool_]) -> dict[int, Array]:
    """Return products of the errors of chosen cells [rows, columns] so many cells apart, along both axes."""
    values = np.where(chosen, error, np.nan)
    out = {}
    for lag in LAGS:
        products = (values[:, lag:] * values[:, :-lag], values[lag:] * values[:-lag])
        out[lag] = np.concatenate([p[np.isfinite(p)] for p in products])
    return out


def parted(correlations: Sequence[dict[int, float]]) -> tuple[float, list[float]]:
    """Return what errors hang together over, cells, and the share of the variance of each kind that does.

    White noise smoothed by a Gauss filter of width L correlates by exp(-k^2 / 4 L^2) over k cells; the rest
    is each cell's own. L is one for all kinds, by least squares over `LAGS`.
    """
    best = (math.inf, 0.0, [0.0])
    lags = np.array(LAGS, dtype=float)
    told = [np.array([one[lag] for lag in LAGS]) for one in correlations]
    for width in np.arange(0.4, 5.0, 0.05):
        shape = np.exp(-(lags**2) / (4.0 * width**2))
        shares = [float(np.clip(one @ shape / (shape @ shape), 0.0, 1.0)) for one in told]
        rest = sum(float(((one - f * shape) ** 2).sum()) for one, f in zip(told, shares, strict=True))
        best = min(best, (rest, float(width), shares))
    return best[1], best[2]


class Kind:
    """Errors of one kind of cells, pair by pair."""

    def __init__(self, on: str, near_m: float, far_m: float) -> None:
        self.on, self.near_m, self.far_m = on, near_m, far_m
        self.biases: list[float] = []
        self.errors: list[Array] = []
        self.products: dict[int, list[Array]] = {lag: [] for lag in LAGS}

    def add(self, found: dict[str, Array]) -> None:
        """Take the cells of one pair (`wedge_errors`), if it shows `FEWEST` of this kind."""
        error = found["error"]
        fine = np.isfinite(error) & (np.abs(error) < GROSS_PX) & found[self.on].astype(bool)
        chosen = fine & (found["range"] >= self.near_m) & (found["range"] < self.far_m)
        if chosen.sum() >= FEWEST:
            self.biases.append(float(np.median(error[chosen])))
            self.errors.append(error[chosen] - self.biases[-1])
            for lag, products in lagged(error - self.biases[-1], chosen).items():
                self.products[lag].append(products)

    def figures(self) -> dict[str, Any]:
        """Return bias of the pairs, scatter and correlation of the cells, px."""
        off = np.concatenate(self.errors)
        variance = float((off**2).mean())
        return {
            "cells": len(off),
            "pairs": len(self.biases),
            "bias_mean": float(np.mean(self.biases)),
            "bias_rms": float(np.sqrt(np.mean(np.square(self.biases)))),
            "rms": math.sqrt(variance),
            "robust": 1.4826 * float(np.median(np.abs(off))),
            "correlation": {
                lag: float(np.concatenate(some).mean()) / variance for lag, some in self.products.items()
            },
        }


def noise_figures(seeds: Sequence[int]) -> dict[str, Any]:
    """Return bias and scatter of disparities at one end of each leg `seeds`, rendered, px.

    `bias` is the median error of a pair: mean and rms over the pairs. `rms` is of errors less their pair's
    median, up to `GROSS_PX`; `robust` 1.48 times their median size; `together` and `white` the parts of the
    rms that hang together over `width` cells and that do not.
    """
    kinds = {
        "rocks": Kind("rock", 0.0, NEAR_M),
        "far rocks": Kind("rock", NEAR_M, FAR_M),
        "ground": Kind("ground", 0.0, NEAR_M),
        "far ground": Kind("ground", NEAR_M, FAR_M),
    }
    grown: list[Array] = []
    for seed in seeds:
        leg = make_leg(seed)
        panorama = rendered_panorama(leg, 0, seed=seed)
        for wedge in panorama.wedges:
            found = wedge_errors(leg, wedge, np.asarray(panorama.eye))
            grown.append(found["grown"][np.isfinite(found["grown"])])
            for kind in kinds.values():
                kind.add(found)
        print(f"stop of leg {seed} measured", flush=True)
    told = {name: kind.figures() for name, kind in kinds.items() if kind.errors}
    width, shares = parted([one["correlation"] for one in told.values()])
    for one, share in zip(told.values(), shares, strict=True):
        one["together"] = one["rms"] * math.sqrt(share)
        one["white"] = one["rms"] * math.sqrt(1.0 - share)
    grown_share = float((np.concatenate(grown) > 0.5).mean())
    return {"seeds": list(seeds), "kinds": told, "width": width, "grown": grown_share}
