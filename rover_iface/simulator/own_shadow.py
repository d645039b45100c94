"""The rover's own shadow: boxes for its body, deck, mast, camera bar and wheels, moved with it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from rover_iface.frames import Transform
from rover_iface.placement.arm_motion import rover_boxes
from rover_iface.profile import RoverProfile
from rover_iface.simulator.render.scene import Material, Scene, SceneMesh

Array = npt.NDArray[np.float64]

DECK_M = 0.06
BAR_M = (0.10, 0.36, 0.10)

_CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
_SIDES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
     [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
)  # fmt: skip


class OwnShadow:
    """An `Occluder`: the rover of a profile, wherever `site_from_rover` says it is."""

    def __init__(self, profile: RoverProfile, site_from_rover: Callable[[], Transform]) -> None:
        self._where = site_from_rover
        boxes = [*rover_boxes(profile)[0], *_upper_parts(profile)]
        self._scene = Scene(
            [SceneMesh(low + _CORNERS * (high - low), _SIDES, material=Material.PLAIN) for low, high in boxes]
        )
        corners = np.concatenate([np.asarray(box) for box in boxes])
        self._centre: Array = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
        self._radius = float(np.linalg.norm(corners - self._centre, axis=1).max())

    def hides(self, points_site: Array, to_sun: Array) -> npt.NDArray[np.bool_]:
        """See `Occluder`. Only rays that pass the ball round the rover are cast."""
        rover_from_site = self._where().inverse()
        sun = np.asarray(rover_from_site.rotate(to_sun), dtype=np.float64)
        points = np.asarray(rover_from_site.apply(points_site), dtype=np.float64)
        gap = self._centre - points
        along = gap @ sun
        near = (np.einsum("ij,ij->i", gap, gap) - along**2 < self._radius**2) & (along > -self._radius)
        hidden = np.zeros(len(points), dtype=bool)
        if near.any():
            starts = np.ascontiguousarray(points[near] - self._scene.origin, dtype=np.float32)
            rays = np.broadcast_to(sun.astype(np.float32), starts.shape)
            hidden[near] = self._scene.occluded_local(starts, np.ascontiguousarray(rays))
        return hidden


def _upper_parts(profile: RoverProfile) -> list[Array]:
    """Return boxes (2, 3) of the deck, as long and wide as the rover, and of the bar with the cameras."""
    body, mast = profile.body, profile.mast
    half, top = (body.length_m / 2, body.width_m / 2), mast.base_m[2]
    deck = np.array([[-half[0], -half[1], top - DECK_M], [half[0], half[1], top]])
    middle = np.array([mast.base_m[0], mast.base_m[1], mast.height_m])
    bar = np.stack((middle - 0.5 * np.array(BAR_M), middle + 0.5 * np.array(BAR_M)))
    return [deck, bar]
