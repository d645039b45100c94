"""Rocks as two stops would see them, made without images."""

from __future__ import annotations

import math

import numpy as np

from rover_iface.localization.rock_matching import LegPrior
from rover_iface.localization.seen_rock import SeenRock


def seen_rock(position, height, width, *, sigma_along=0.15, sigma_across=0.05):
    """A rock at a place of the stop's own frame (eye at the origin, 1.5 m over the ground)."""
    where = np.asarray(position, dtype=float)
    away = float(np.linalg.norm(where))
    sight = np.array([where[0], where[1], 0.0]) / math.hypot(where[0], where[1])
    across = np.array([-sight[1], sight[0], 0.0])
    covariance = (
        sigma_along**2 * np.outer(sight, sight)
        + sigma_across**2 * np.outer(across, across)
        + 0.05**2 * np.diag([0.0, 0.0, 1.0])
    )
    peak = where + np.array([0.0, 0.0, height])
    return SeenRock(peak, where, covariance, height, width, away, np.empty((0, 3)), None, np.arange(30))


def two_ends(seed, *, common=10, alone=6, length=26.0, heading=0.03, noise=1.0):
    """Rocks of both ends of a leg along x, the truth (x, y, z, heading), and which pairs are one rock."""
    rng = np.random.default_rng(seed)
    truth = np.array([length, 0.4, 0.1, heading])
    c, s = math.cos(heading), math.sin(heading)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])

    def places(count):
        return np.column_stack(
            (rng.uniform(5, length - 5, count), rng.uniform(-9, 9, count), np.full(count, -1.5))
        )

    first, second, shared = [], [], places(common)
    sizes = rng.uniform(0.15, 0.5, common), rng.uniform(0.3, 0.9, common)
    for place, h, w in zip(shared, *sizes, strict=True):
        for end in (0, 1):
            local = place if end == 0 else turn.T @ (place - truth[:3])
            rock = seen_rock(local, h, w)
            off = np.linalg.cholesky(rock.covariance + 1e-12 * np.eye(3)) @ rng.normal(size=3)
            grown = math.exp(rng.normal(0, 0.15)), math.exp(rng.normal(0, 0.2))
            (first, second)[end].append(seen_rock(local + noise * off, h * grown[0], w * grown[1]))
    for place in places(alone):
        first.append(seen_rock(place, rng.uniform(0.13, 0.4), rng.uniform(0.2, 0.8)))
    for place in places(alone):
        second.append(seen_rock(turn.T @ (place - truth[:3]), rng.uniform(0.13, 0.4), rng.uniform(0.2, 0.8)))
    return first, second, truth, {(k, k) for k in range(common)}


def prior_of(truth, off=(0.9, -0.7, 0.2, 0.05)):
    """Odometry that is off by so much, with the deviations of wheels on 26 m."""
    x, y, z, heading = np.asarray(truth) + np.asarray(off)
    return LegPrior(x, y, z, heading, sigma_m=1.3, sigma_z_m=0.5, sigma_heading_rad=math.radians(3.0))
