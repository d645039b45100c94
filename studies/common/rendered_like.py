"""Rendered pictures with the camera, the place over the ground and, where known, the sun of a real frame."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_iface.frames import Transform
from rover_iface.simulator.render.from_terrain import scene_from_terrain
from rover_iface.simulator.render.look import Look
from rover_iface.simulator.render.renderer import Renderer, Sun
from rover_iface.simulator.render.scene import Scene
from rover_iface.terrain.generate import generate_terrain
from rover_iface.terrain.geology import GEOLOGIES
from studies.common.product_chain import FULL_SCALE, jpeg_coded
from studies.common.real_frames import View

Grey = npt.NDArray[np.float32]
Mask = npt.NDArray[np.bool_]
SIZE_M, INNER_M = 36.0, 18.0
"""Extent of the ground, whose posts are 25 cm apart, and of its middle, where they are 5 cm apart."""

FAR_M = 16.0
"""Ground beyond is not measured: little of it is left before the terrain ends."""

ROCK_COVERS = 0.03, 0.12
"""Range that the share of rock is drawn from (Golombek and Rapp's sites have 3 to 20 %)."""

AFTER: Mapping[str, str] = {
    "Spirit": "gusev",
    "Opportunity": "meridiani",
    "Curiosity": "gale",
    "Perseverance": "jezero",
    "Devon Island": "gale",
    "Apollo 17": "gusev",
}
"""The geology that stands beside each mission's frames; the last two have none of their own."""


@dataclass(frozen=True, eq=False)
class Rendered:
    """A rendered picture, its ground where the real frame's ground is, and the seed of its terrain."""

    image: Grey
    ground: Mask
    seed: int


def rendered_like(view: View, seed: int, looks: Mapping[str, Look | None]) -> dict[str, Rendered]:
    """Return pictures of a generated ground from where the real frame was taken, one for each look.

    A look of None is the ground of the geology after the frame's mission, in that geology's own look; the
    others are looks at the ground without one. The terrain, its share of rock, the rover's heading and what
    is not known of the sun follow from `seed`. The picture becomes a product as the real frame did; grey is
    linear, or coded by a square root in 8 bits (and as JPEG where there were colours).
    """
    rng = np.random.default_rng([seed, 0x91C7])
    cover = float(rng.uniform(*ROCK_COVERS))
    heading = float(rng.uniform(0.0, math.tau))
    behind = float(rng.uniform(-0.75, 0.75)) * math.pi
    stand = Transform.from_rpy(0.0, 0.0, heading)
    sun = view.sun or _drawn_sun(view, behind)
    east, north, up = (float(v) for v in stand.rotate(np.array(sun.direction)))
    site_sun = Sun((east, north, up), sun.opacity)
    scenes: dict[str, tuple[Scene, Transform]] = {}
    found = {}
    for name, look in looks.items():
        kind = AFTER[view.frame.mission] if look is None else ""
        if kind not in scenes:
            geology = GEOLOGIES[kind] if kind else None
            terrain = generate_terrain(seed, SIZE_M, inner_m=INNER_M, rock_cover=cover, geology=geology)
            place = Transform(stand.rotation, np.array([0.0, 0.0, terrain.height_at(0.0, 0.0)]))
            # as the simulated rovers see it, with the far ground left out
            scenes[kind] = scene_from_terrain(terrain, radius_m=12.0, far_m=40.0, seed=seed), place
        scene, place = scenes[kind]
        camera = view.product.camera(view.camera)
        negative = Renderer(scene, look=look).gather(camera, place, site_sun)
        image = view.product.develop(negative, view.camera, seed)
        seen = (negative.truth.object_index >= 0) & (negative.truth.range_m < FAR_M)
        found[name] = Rendered(
            image if view.linear else _coded(image, view), view.ground & view.product.mask(seen), seed
        )
    return found


def _coded(linear: Grey, view: View) -> Grey:
    """Return light of 12 bits (rows, columns) in 8 by a square root, as MER's tables do."""
    grey = np.round(255.0 * np.sqrt(np.clip(linear / FULL_SCALE, 0.0, 1.0))).astype(np.uint8)
    return (jpeg_coded(grey) if view.product.mosaic else grey).astype(np.float32)


def _drawn_sun(view: View, azimuth_rad: float) -> Sun:
    """Return a sun in rover axes, `azimuth_rad` from straight behind the camera."""
    guess = view.frame.guess
    # early afternoon of the label of Perseverance's frame
    height, opacity = (
        (math.radians(60.0), 0.45) if guess is None else (guess.sun_elevation_rad, guess.opacity)
    )
    level = -math.cos(height)
    return Sun((level * math.cos(azimuth_rad), level * math.sin(azimuth_rad), math.sin(height)), opacity)
