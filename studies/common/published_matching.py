"""Rock matching as published, the baseline beside `rock_matching`.

Li et al. 2007, section II.C. Pattern matching: one 3D shift for all peaks, the one that brings most of them
together; rotation is left out (`turns_rad` adds a search over headings). Model matching: for each significant
rock the one at the other stop with the least Z = 1/2 dH + 1/3 dr + 1/6 dS, relative differences of height,
radius and surface. Of several matches of one rock the best is kept; a pair must pass both.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_iface.localization.rock_matching import LegPrior, overlapping
from rover_iface.localization.seen_rock import SeenRock

Array = npt.NDArray[np.float64]
WEIGHTS = 1 / 2, 1 / 3, 1 / 6
"""Of height, radius and surface area in Z (eq. 2)."""


@dataclass(frozen=True, slots=True)
class PublishedOptions:
    """Parameters; the paper gives the weights and leaves the rest open.

    Attributes
    ----------
    tolerance_m
        How far two peaks may be apart after the shift.
    reach_sigma
        Shifts within so many deviations of the prior are looked at.
    significant_height_m
        Rocks of the first stop from this height on are matched by model.
    turns_rad
        Headings tried besides the prior's; (0,) as published.
    """

    tolerance_m: float = 0.7
    reach_sigma: float = 3.0
    significant_height_m: float = 0.15
    farthest_m: float = 24.0
    turns_rad: tuple[float, ...] = (0.0,)


def size_difference(one: SeenRock, two: SeenRock) -> float:
    """Return Z of two rocks (eq. 2), 0 for equal sizes, below 1."""
    sizes = (
        (one.height_m, two.height_m),
        (one.radius_m, two.radius_m),
        (one.area_m2, two.area_m2),
    )
    return sum(w * abs(a - b) / max(a, b, 1e-9) for w, (a, b) in zip(WEIGHTS, sizes, strict=True))


def match_as_published(
    first: Sequence[SeenRock],
    second: Sequence[SeenRock],
    prior: LegPrior,
    options: PublishedOptions | None = None,
) -> list[tuple[int, int]]:
    """Return index pairs of rocks that pass pattern and model matching; frames as in `match_rocks`."""
    options = options or PublishedOptions()
    there = np.array([prior.x_m, prior.y_m, prior.z_m])
    c, s = math.cos(prior.heading_rad), math.sin(prior.heading_rad)
    back = np.array([-c * there[0] - s * there[1], s * there[0] - c * there[1], 0.0])
    a = overlapping(first, there, options.farthest_m)
    b = overlapping(second, back, options.farthest_m)
    if not len(a) or not len(b):
        return []
    peaks_a = np.array([first[k].peak for k in a])
    peaks_b = np.array([second[k].peak for k in b])
    pattern = _by_pattern(peaks_a, peaks_b, prior, there, options)
    model = _by_model([first[k] for k in a], [second[k] for k in b], peaks_a, peaks_b, prior, there, options)
    return [(int(a[i]), int(b[j])) for i, j in sorted(pattern & model)]


def _turned(points: Array, angle: float) -> Array:
    c, s = math.cos(angle), math.sin(angle)
    return points @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


def _by_pattern(
    peaks_a: Array, peaks_b: Array, prior: LegPrior, there: Array, options: PublishedOptions
) -> set[tuple[int, int]]:
    best: set[tuple[int, int]] = set()
    reach = options.reach_sigma * np.array([prior.sigma_m, prior.sigma_m, prior.sigma_z_m])
    for turn in options.turns_rad:
        offsets = peaks_a[:, None] - (_turned(peaks_b, prior.heading_rad + turn) + there)[None]
        flat = offsets.reshape(-1, 3)
        possible = flat[(np.abs(flat) <= reach).all(axis=1)]
        for shift in possible:
            apart = np.linalg.norm(offsets - shift, axis=2)
            if int((apart.min(axis=1) < options.tolerance_m).sum()) <= len(best):
                continue
            pairs = {
                (i, int(apart[i].argmin()))
                for i in range(len(peaks_a))
                if apart[i].min() < options.tolerance_m and apart[:, apart[i].argmin()].argmin() == i
            }
            if len(pairs) > len(best):
                best = pairs
    return best


def _by_model(
    first: list[SeenRock],
    second: list[SeenRock],
    peaks_a: Array,
    peaks_b: Array,
    prior: LegPrior,
    there: Array,
    options: PublishedOptions,
) -> set[tuple[int, int]]:
    moved = _turned(peaks_b, prior.heading_rad) + there
    reach = options.reach_sigma * prior.sigma_m
    chosen: dict[int, tuple[float, int]] = {}
    for i, rock in enumerate(first):
        if rock.height_m < options.significant_height_m:
            continue
        near = np.flatnonzero(np.hypot(*(moved - peaks_a[i])[:, :2].T) <= reach)
        if not len(near):
            continue
        score, j = min((size_difference(rock, second[k]), int(k)) for k in near)
        if j not in chosen or score < chosen[j][0]:
            chosen[j] = score, i
    return {(i, j) for j, (_, i) in chosen.items()}
