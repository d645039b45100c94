"""Room to stand: whether the navigator would let the rover onto a pose, by the ground round its outline."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from rover_iface.mobility import Standing
from rover_iface.profile import RoverProfile
from rover_iface.terrain.terrain import Terrain

Array = NDArray[np.floating]

MARGIN_M = 0.10
"""Beyond the outline; between the navigator's least margin and its usual one."""

OWN_ROCK_M = 0.45
"""Round the target, within which its own rock is not an obstacle to the navigator."""

_SPACING_M = 0.10


def room_to_stand(
    terrain: Terrain,
    profile: RoverProfile,
    point: Array,
    x: Array,
    y: Array,
    heading: Array,
    standing: Standing,
) -> Array:
    """Return 1 where the ground within the outline lies flat, down to 0 where it bears what is an obstacle.

    A body may straddle a stone that its wheels and belly do not touch, but by dead reckoning no navigator
    drives onto such a place.

    Parameters
    ----------
    point
        Target (3,), site metres.
    x, y, heading, standing
        Poses (n,), site metres and rad, and how the rover stands on them.
    """
    body = profile.body
    u, v = _outline(body.length_m, body.width_m)
    u, v = u[:, None], v[:, None]
    c, s = np.cos(heading), np.sin(heading)
    px, py = x + u * c - v * s, y + u * s + v * c
    # The plane of the wheels: pitch is positive nose down, roll left side up.
    plane = standing.z - u * np.tan(standing.pitch) + v * np.tan(standing.roll)
    rise = terrain.height(px, py) - plane
    rise[np.hypot(px - point[0], py - point[1]) < OWN_ROCK_M] = 0.0
    obstacle = 0.7 * profile.mobility.max_step_m
    rise[np.isnan(rise)] = obstacle
    highest = rise.max(axis=0)
    room: Array = np.clip((obstacle - highest) / (0.5 * obstacle), 0.0, 1.0)
    return room


@lru_cache(maxsize=16)
def _outline(length_m: float, width_m: float) -> tuple[Array, Array]:
    """Return points within the outline, x and y [n] in the rover's frame, m."""
    along = np.arange(-length_m / 2 - MARGIN_M, length_m / 2 + MARGIN_M + 1e-6, _SPACING_M)
    aside = np.arange(-width_m / 2 - MARGIN_M, width_m / 2 + MARGIN_M + 1e-6, _SPACING_M)
    u, v = np.meshgrid(along, aside)
    return u.ravel(), v.ravel()
