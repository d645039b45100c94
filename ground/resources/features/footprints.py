"""The ground that an image shows: from its camera model over the terrain, else from what its label tells."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import orjson
from numpy.typing import NDArray

from ground.gdr.terrain_folders import load_cached
from ground.geo.site_frame import FAR_M

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    from rover_iface.cameras.model import CameraModel
    from rover_iface.terrain import Terrain

Array = NDArray[np.float64]
REACH_M = 100.0
"""Ground beyond is left out: a post of a mast camera's pixel there covers metres."""
CELLS = 32
"""Cells along each side of an image: one of a 45 degree camera is 1.4 degrees wide, 0.25 m at 10 m."""
JUMP = 0.25
"""Corners of a cell whose ranges differ by more than this share may lie on both sides of a ridge."""
BETWEEN = np.array([0.25, 0.5, 0.75])
"""Where between two such corners the ground is looked at; none of it is hidden where no ridge stands."""
HIDDEN = 0.05
COARSENING = 0.01
"""Steps along a ray grow by this share of its length: 30 cm at 30 m, less than a cell of an image covers."""
"""Ground is hidden when its ray ends this share of its range before it."""


def footprint(label: Mapping[str, object], terrain: Path) -> BaseGeometry | None:
    """Return the ground in an image by its label, site metres; a label may come from any rover.

    With a `camera_model`: what the camera sees of the terrain in that folder, within `REACH_M`. Else a square
    where the label tells its size, else the point that it shows, else the point from which it was taken.

    Raises
    ------
    TerrainFileError
        If the terrain is asked and cannot be read.
    """
    model = label.get("camera_model")
    shape = None
    if isinstance(model, Mapping):
        shape = _seen(orjson.dumps(model, option=orjson.OPT_SORT_KEYS), terrain)
    return _told(label) if shape is None else shape


@lru_cache(maxsize=2048)
def _seen(model: bytes, folder: Path) -> BaseGeometry | None:
    from rover_iface.cameras.panorama import camera_from_document
    from rover_iface.errors import RoverError

    try:
        camera = camera_from_document(orjson.loads(model))
    except RoverError:
        return None
    return seen_ground(camera, load_cached(folder))


def seen_ground(camera: CameraModel, terrain: Terrain, reach_m: float = REACH_M) -> BaseGeometry | None:
    """Return the ground that a camera, in the site frame, sees within `reach_m`; None if it sees none.

    The image is cut into cells; the corners of each are followed to the ground. Ground behind a ridge is not
    in it, to within a cell.
    """
    import shapely

    samples = np.linspace(-0.5, camera.width - 0.5, CELLS + 1)
    lines = np.linspace(-0.5, camera.height - 0.5, CELLS + 1)
    eyes, ways = camera.back_project(np.stack(np.meshgrid(samples, lines), axis=-1))
    hits = terrain.intersect_rays(eyes, ways, reach_m, coarsening=COARSENING)
    corners = [np.s_[:-1, :-1], np.s_[:-1, 1:], np.s_[1:, 1:], np.s_[1:, :-1]]
    rings: Array = np.stack([hits[corner].reshape(-1, 3) for corner in corners], axis=1)
    starts = eyes[:-1, :-1].reshape(-1, 3)
    on_ground = np.isfinite(rings).all(axis=(1, 2))
    rings, starts = rings[on_ground], starts[on_ground]
    rings = rings[_unbroken(rings, starts, terrain)]
    if not len(rings):
        return None
    outline: BaseGeometry = shapely.union_all(shapely.make_valid(shapely.polygons(rings[:, :, :2])))
    return outline if outline.area > 0 else None


def _unbroken(rings: Array, eyes: Array, terrain: Terrain) -> NDArray[np.bool_]:
    """Return which cells, corners (n, 4, 3) seen from eyes (n, 3), m, span no edge of the ground, (n,)."""
    ranges = np.linalg.norm(rings - eyes[:, None], axis=2)
    near, far = ranges.min(axis=1), ranges.max(axis=1)
    unbroken: NDArray[np.bool_] = far - near <= JUMP * far
    asked = np.flatnonzero(~unbroken)
    first, last = rings[asked, ranges[asked].argmin(axis=1)], rings[asked, ranges[asked].argmax(axis=1)]
    between = first[:, None] + BETWEEN[:, None] * (last - first)[:, None]
    between[..., 2] = terrain.height(between[..., 0], between[..., 1])
    start = eyes[asked][:, None]
    found = terrain.intersect_rays(start, between - start, REACH_M, coarsening=COARSENING)
    short = np.linalg.norm(between - found, axis=2) > HIDDEN * np.linalg.norm(between - start, axis=2)
    unbroken[asked] = ~short.any(axis=1)
    return unbroken


def _told(label: Mapping[str, object]) -> BaseGeometry | None:
    import shapely

    for place in (label, label.get("point_m"), label.get("pose")):
        found = _numbers(_point(place))
        if len(found) < 2:
            continue
        east, north = found[:2]
        (size,) = _numbers([label.get("size_m")]) or (0.0,)
        if place is label and size > 0.0:
            half = size / 2
            return shapely.box(east - half, north - half, east + half, north + half)
        return shapely.Point(east, north)
    return None


def _point(place: object) -> Sequence[object]:
    if isinstance(place, Mapping):
        return [place.get("east_m"), place.get("north_m")]
    return place[:2] if isinstance(place, list) else []


def _numbers(values: Sequence[object]) -> list[float]:
    """Return metres within a site, nothing if one is none; labels may have been written by anybody."""
    numbers = [v for v in values if isinstance(v, int | float) and abs(v) <= FAR_M]
    return [float(v) for v in numbers] if len(numbers) == len(values) else []
