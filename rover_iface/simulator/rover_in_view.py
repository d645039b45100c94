"""The rover in its own pictures: deck with panels, mast, body, wheels, and the shadow that they throw.

Sizes are the profile's; parts are boxes and cleated drums, as `own_shadow` has them for the shadow alone.
The simulated rovers do not see themselves: nothing in them masks their body out of hazard maps yet. A picture
with the rover in view is asked for by name (`outcrop sim render --rover-in-view`).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from rover_iface.frames import Transform
from rover_iface.placement.arm_motion import rover_boxes
from rover_iface.profile import RoverProfile
from rover_iface.simulator.own_shadow import BOX_SIDES, OwnShadow, ShadowedScene, box_corners, deck_box
from rover_iface.simulator.render.scene import Hits, Material, Scene, SceneMesh

Array = npt.NDArray[np.float64]

CELL_M, SEAM_M = 0.12, 0.008
"""Solar cells of the deck: length of a side and width of the seam between; by eye, Spirit's Navcam frames."""

CELL_ALBEDO, SEAM_ALBEDO = 0.28, 0.50
"""Cells under dust, and bright seams; by eye, the same frames: the deck is brighter than the soil."""

METAL_ALBEDO = 0.35
WHEEL_ALBEDO = 0.12
"""Black anodised wheels, dusty."""

CLEATS, CLEAT = 24, 0.05
"""Cleats round a wheel and their height, in radii of the wheel."""

NEAR_M = 0.06
"""Parts this near to a camera's lens are its own mount, and not in its picture."""


class RoverInView(ShadowedScene):
    """A scene with the rover of a profile in it: seen, named in the truth, and throwing its shadow.

    `site_from_rover` is where it stands; another stand is another scene, which shares the ground's structure.
    Rays of one call start at one camera: parts within `NEAR_M` of the first are left out.
    """

    def __init__(self, scene: Scene, profile: RoverProfile, site_from_rover: Transform) -> None:
        self._parts = rover_parts(profile)
        super().__init__(scene, OwnShadow(profile, lambda: site_from_rover, bodies=self._parts))
        self._stand = site_from_rover
        self._boxes = np.array([(p.vertices.min(axis=0), p.vertices.max(axis=0)) for p in self._parts])
        self._rover = Scene(self._parts)
        self._without: dict[bytes, tuple[Scene, npt.NDArray[np.int32]]] = {}
        own = self._rover
        self._first = len(scene.triangles)
        vertices = site_from_rover.apply(own.vertices + own.origin) - scene.origin
        self.ids = (*scene.ids, *own.ids)
        self.vertices = np.concatenate((scene.vertices, vertices.astype(np.float32)))
        self.triangles = np.concatenate((scene.triangles, own.triangles + np.int32(len(scene.vertices))))
        self.objects = np.concatenate((scene.objects, own.objects + np.int32(len(scene.materials))))
        turned = site_from_rover.rotate(own.normals.astype(np.float64)).astype(np.float32)
        self.normals = np.concatenate((scene.normals, turned))
        self.albedo = np.concatenate((scene.albedo, own.albedo))
        self.gravel = np.concatenate((scene.gravel, own.gravel))
        self.materials = np.concatenate((scene.materials, own.materials))

    def cast(self, origins: npt.ArrayLike, directions: npt.ArrayLike) -> Hits:
        """See `Scene`."""
        o = np.ascontiguousarray(np.asarray(origins, dtype=np.float64) - self.origin, dtype=np.float32)
        return self.cast_local(o, np.ascontiguousarray(directions, dtype=np.float32))

    def cast_local(self, origins: npt.NDArray[np.float32], directions: npt.NDArray[np.float32]) -> Hits:
        """See `Scene`; the nearer of ground and rover."""
        hits = super().cast_local(origins, directions)
        if not len(origins):
            return hits
        inverse = self._stand.inverse()
        starts = inverse.apply(origins.astype(np.float64) + self.origin)
        rover, triangle = self._seen_from(starts[0])
        own = rover.cast_local(
            np.ascontiguousarray(starts - rover.origin, dtype=np.float32),
            np.ascontiguousarray(inverse.rotate(directions.astype(np.float64)), dtype=np.float32),
        )
        nearer = own["tfar"] < hits["tfar"]
        for name in ("tfar", "u", "v"):
            hits[name][nearer] = own[name][nearer]
        hits["primID"][nearer] = self._first + triangle[own["primID"][nearer]]
        hits["Ng"][nearer] = self._stand.rotate(own["Ng"][nearer].astype(np.float64)).astype(np.float32)
        return hits

    def _seen_from(self, eye: Array) -> tuple[Scene, npt.NDArray[np.int32]]:
        """Return the parts that a camera at `eye` (3,), rover frame, sees, and their triangles' numbers."""
        away = np.maximum(self._boxes[:, 0] - eye, eye - self._boxes[:, 1]).max(axis=1)
        kept = away > NEAR_M
        key = kept.tobytes()
        if key not in self._without:
            shown = [part for part, keep in zip(self._parts, kept, strict=True) if keep]
            self._without[key] = Scene(shown), np.flatnonzero(kept[self._rover.objects]).astype(np.int32)
        return self._without[key]


def rover_parts(profile: RoverProfile) -> list[SceneMesh]:
    """Return body, mast, wheels and deck of a profile as meshes, rover frame, m, each with its name."""
    boxes, names = rover_boxes(profile)
    parts = []
    for box, name in zip(boxes, names, strict=True):
        if name == "wheel":
            parts.append(_wheel(box))
        else:
            parts.append(
                SceneMesh(
                    box_corners(box), BOX_SIDES, f"rover {name}", Material.PLAIN, METAL_ALBEDO, smooth=False
                )
            )
    return [*parts, _deck(deck_box(profile))]


def _wheel(box: Array) -> SceneMesh:
    """Return a drum with cleats that fills a box (2, 3), its axle along y."""
    middle, half = box.mean(axis=0), 0.5 * (box[1] - box[0])
    angle = np.linspace(0.0, math.tau, 4 * CLEATS, endpoint=False)
    radius = half[0] * np.where(np.arange(4 * CLEATS) % 4 < 1, 1.0, 1.0 - CLEAT)
    ring = np.column_stack((radius * np.cos(angle), np.zeros_like(angle), radius * np.sin(angle)))
    side = np.array([0.0, half[1], 0.0])
    count = len(ring)
    vertices = np.concatenate((ring - side, ring + side, [-side, side])) + middle
    k, n = np.arange(count), np.roll(np.arange(count), -1)
    first, second = np.full(count, 2 * count), np.full(count, 2 * count + 1)
    triangles = np.concatenate(
        (
            np.column_stack((k, k + count, n)),
            np.column_stack((n, k + count, n + count)),
            np.column_stack((first, k, n)),
            np.column_stack((second, n + count, k + count)),
        )
    )
    return SceneMesh(vertices, triangles, "rover wheel", Material.PLAIN, WHEEL_ALBEDO, smooth=False)


def _deck(box: Array) -> SceneMesh:
    """Return a plate (2, 3) whose top is cells of `CELL_M` with seams between."""
    low, high = box
    vertices, triangles = [box_corners(box)], [BOX_SIDES]
    albedo = [np.full(8, SEAM_ALBEDO)]
    edges = []
    for axis in range(2):
        count = max(1, round(float(high[axis] - low[axis]) / CELL_M))
        lines = np.linspace(low[axis], high[axis], count + 1)
        edges.append(np.sort(np.concatenate((lines[:-1] + SEAM_M, lines[1:]))))
    # a hair above the plate, so that cells are met first
    start, up = 8, float(high[2]) + 1e-3
    for i in range(0, len(edges[0]), 2):
        for j in range(0, len(edges[1]), 2):
            (a, b), (c, d) = edges[0][i : i + 2], edges[1][j : j + 2]
            vertices.append(np.array([(a, c, up), (b, c, up), (b, d, up), (a, d, up)]))
            triangles.append(np.array([(0, 1, 2), (0, 2, 3)]) + start)
            albedo.append(np.full(4, CELL_ALBEDO))
            start += 4
    return SceneMesh(
        np.concatenate(vertices),
        np.concatenate(triangles),
        "rover deck",
        Material.PLAIN,
        np.concatenate(albedo),
        smooth=False,
    )
