"""The rover's own shadow: boxes for its body, deck, mast, camera bar and wheels, moved with it."""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence

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
BOX_SIDES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
     [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
)  # fmt: skip


class OwnShadow:
    """What the rover of a profile keeps the sun off, wherever `site_from_rover` says it is.

    `bodies` are its parts, rover frame, m; boxes round them if absent.
    """

    def __init__(
        self,
        profile: RoverProfile,
        site_from_rover: Callable[[], Transform],
        *,
        bodies: Sequence[SceneMesh] | None = None,
    ) -> None:
        self._where = site_from_rover
        boxes = [*rover_boxes(profile)[0], *_upper_parts(profile)]
        self._scene = Scene(
            [SceneMesh(box_corners(box), BOX_SIDES, material=Material.PLAIN) for box in boxes]
            if bodies is None
            else bodies
        )
        corners = np.concatenate([np.asarray(box) for box in boxes])
        self._centre: Array = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
        self._radius = float(np.linalg.norm(corners - self._centre, axis=1).max())

    def standing(self, site_from_rover: Transform) -> OwnShadow:
        """Return the shadow of the rover where it stands now."""
        still = copy.copy(self)
        still._where = lambda: site_from_rover
        return still

    def hides(self, points: npt.NDArray[np.float32], origin: Array, to_sun: Array) -> npt.NDArray[np.bool_]:
        """Return which points (n, 3) lie in its shadow for light from `to_sun` (3,), site frame.

        The points, m, are counted from `origin` (3,). Only rays that pass the ball round the rover are cast.
        """
        from rover_iface.simulator.shadow_kernels import rays_past_ball

        site_from_rover = self._where()
        rover_from_site = site_from_rover.inverse()
        near = np.empty(len(points), np.bool_)
        middle = np.asarray(site_from_rover.apply(self._centre), dtype=np.float64) - origin
        rays_past_ball(points, np.asarray(to_sun, dtype=np.float64), middle, self._radius, near)
        if near.any():
            own = rover_from_site.apply(points[near] + origin)
            starts = np.ascontiguousarray(own - self._scene.origin, dtype=np.float32)
            sun = np.asarray(rover_from_site.rotate(to_sun), dtype=np.float32)
            rays = np.ascontiguousarray(np.broadcast_to(sun, starts.shape))
            near[near] = self._scene.occluded_local(starts, rays)
        return near


class ShadowedScene(Scene):
    """A scene in which the rover throws a shadow but is not seen itself."""

    def __init__(self, scene: Scene, shadow: OwnShadow) -> None:
        self.__dict__.update(scene.__dict__)
        self._shadow = shadow

    def cast_from(self, site_from_rover: Transform) -> ShadowedScene:
        """Return the scene with the shadow of a rover that stands still."""
        return ShadowedScene(self, self._shadow.standing(site_from_rover))

    def occluded_local(
        self, origins: npt.NDArray[np.float32], directions: npt.NDArray[np.float32]
    ) -> npt.NDArray[np.bool_]:
        """See `Scene`; the rays are parallel, as those to the sun are."""
        dark = super().occluded_local(origins, directions)
        if len(origins):
            dark |= self._shadow.hides(origins, self.origin, np.asarray(directions[0], dtype=np.float64))
        return dark


def box_corners(box: Array) -> Array:
    """Return the corners (8, 3) of a box by its least and largest (2, 3), in the order of `BOX_SIDES`."""
    return np.asarray(box[0] + _CORNERS * (box[1] - box[0]))


def deck_box(profile: RoverProfile) -> Array:
    """Return the box (2, 3), rover frame, m, of the deck, as long and wide as the rover."""
    half, top = (profile.body.length_m / 2, profile.body.width_m / 2), profile.mast.base_m[2]
    return np.array([[-half[0], -half[1], top - DECK_M], [half[0], half[1], top]])


def _upper_parts(profile: RoverProfile) -> list[Array]:
    """Return boxes (2, 3) of the deck and of the bar with the cameras."""
    mast = profile.mast
    middle = np.array([mast.base_m[0], mast.base_m[1], mast.height_m])
    bar = np.stack((middle - 0.5 * np.array(BAR_M), middle + 0.5 * np.array(BAR_M)))
    return [deck_box(profile), bar]
