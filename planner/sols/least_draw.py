"""What a success of an action costs the battery at least, in the mean."""

from __future__ import annotations

import math

import numpy as np
from scipy.special import ndtr, ndtri

from planner.contingency.flow_bound import least_energy
from planner.evaluate.model import Floats

CELLS, TAILS = 64, 12
"""Cells of the duration of equal chance, and halvings of the last one. By hand: the cost of a drive comes out
within 1e-4 of its mean, which it cannot exceed."""

BELOW, NEAR, BEYOND = 40, 160, 40
"""Nodes of what is left up to one standard deviation above the mean, from there to five, and beyond. By hand:
the least ratio lies there, and is rounded down between two nodes."""

FALLBACK = (64, 129)
"""Cells and nodes where time or energy is a constant: neither is used there."""

FAR = 8.0
"""Standard deviations to which nodes reach; beyond it nothing is left to gain."""


def least_draw(amounts: Floats, ln: Floats, hotel_w: float) -> float:
    """Return inf over R of E[min(E, R)] / P(E <= R), J, for E = G + hotel_w X, rounded down.

    `amounts` (4,) holds (mean X, sd X, mean G, sd G), s and J; `ln` (4,) mean and standard deviation of their
    logarithms in the same order.

    Notes
    -----
    min(E, R), averaged over G, is concave in X: within a cell of X its mean is at least that of the chord
    at the cell's mean. `flow_bound.least_energy` takes the cell's upper edge for that, which comes out 1 %
    lower.
    """
    mean_x, mean_g = float(amounts[0]) * hotel_w, float(amounts[2])
    if mean_x <= 0.0 or mean_g <= 0.0 or ln[1] <= 0.0 or ln[3] <= 0.0:
        return least_energy(amounts, ln, hotel_w, *FALLBACK)
    mu, sigma = math.log(hotel_w) + float(ln[0]), float(ln[1])
    chances = np.linspace(0.0, 1.0, CELLS + 1)[:-1]
    chances = np.concatenate([chances, 1.0 - 0.5 ** np.arange(1, TAILS) / CELLS])
    edges = np.exp(mu + sigma * ndtri(chances))
    share = np.diff(np.append(chances, 1.0))
    whole = mean_x * ndtr(np.append(ndtri(chances), np.inf) - sigma)
    chord = np.clip((np.diff(whole)[:-1] / share[:-1] - edges[:-1]) / np.diff(edges), 0.0, 1.0)
    chord = np.append(chord, 0.0)  # in the last cell at least what its lower edge gives
    spread = math.sqrt(math.log1p((math.hypot(amounts[1] * hotel_w, amounts[3]) / (mean_x + mean_g)) ** 2))
    at = np.concatenate(
        [np.linspace(-FAR, 1.0, BELOW), np.linspace(1.0, 5.0, NEAR)[1:], np.linspace(5.0, FAR, BEYOND)[1:]]
    )
    left = (mean_x + mean_g) * np.exp(spread * at)
    rest = np.maximum(left[:, None] - edges, 0.0)
    with np.errstate(divide="ignore"):
        z = (np.log(rest) - ln[2]) / ln[3]
    more = ndtr(-z)
    used = np.minimum(edges, left[:, None]) + mean_g * ndtr(z - ln[3]) + rest * more
    following = np.append(used[:, 1:], used[:, -1:], axis=1)
    mean = ((1.0 - chord) * used + chord * following) @ share
    chance = (1.0 - more) @ share
    # between two nodes the use is at least that at the lower one, the chance at most that at the upper one
    ratios = mean[:-1] / np.maximum(chance[1:], 1e-300)
    return float(min(ratios.min(), mean[-1]))
