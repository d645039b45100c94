"""A terrain described, stored, and asked for its ground."""

from __future__ import annotations

import math
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.durable import put_in_place, removed_on_failure, seal_folder
from ground.errors import NotFoundError, OutsideTerrainError
from ground.gdr.ids import new_id
from ground.gdr.places import keep_folder
from ground.gdr.repository import Repository
from ground.resources.terrains.row import TerrainRow

if TYPE_CHECKING:
    from rover_iface.terrain import Terrain
    from rover_iface.terrain.grid import HeightLayer
from ground.gdr.geometry import Bounds, Pose
from ground.gdr.terrain_folders import _cache, load_cached
from ground.resources.terrains.value import Terrain as TerrainValue
from ground.resources.terrains.value import TerrainLayer, TerrainPoint

CAMERA_HEIGHT_M = 1.5


FOCAL_PX = 1300.0


BASELINE_M = 0.30
"""Science camera pair on the mast of the K9 rover, from which the site panorama is taken."""


SINK_M = 0.01
"""How far a point may lie under the line of sight before it counts as hidden."""


def describe(terrain: Terrain, name: str) -> Mapping[str, object]:
    """Return what is told of a terrain: `inner` is the finest layer, `outer` the next."""
    west, south, east, north = terrain.bounds
    layers = []
    for layer, layer_name in zip(terrain.layers, layer_names(terrain), strict=True):
        lw, ls, le, ln = layer.bounds
        image = ortho_file(terrain, layer_name)
        width = height = 0
        media = ""
        if image is not None:
            from PIL import Image

            with Image.open(image) as opened:
                width, height = opened.size
                media = Image.MIME.get(opened.format or "", "application/octet-stream")
        layers.append(
            asdict(
                TerrainLayer(
                    name=layer_name,
                    bounds_m=Bounds(lw, ls, le, ln),
                    rows=int(layer.heights.shape[0]),
                    columns=int(layer.heights.shape[1]),
                    spacing_m=float(layer.spacing),
                    ortho_width=width,
                    ortho_height=height,
                    ortho_media=media,
                    has_ortho=image is not None,
                )
            )
        )
    import numpy as np

    low = min(float(np.nanmin(layer.heights)) for layer in terrain.layers)
    high = max(float(np.nanmax(layer.heights)) for layer in terrain.layers)
    return {
        "name": name,
        "credits": terrain.credits,
        "bounds_m": asdict(Bounds(west, south, east, north)),
        "layers": layers,
        "start_pose": asdict(Pose(0.0, 0.0, terrain.start_heading_rad)),
        "lowest_m": low,
        "highest_m": high,
    }


def layer_names(terrain: Terrain) -> list[str]:
    """Return the names of a terrain's layers, the finest first."""
    return ["inner", "outer", *(f"outer{i}" for i in range(2, len(terrain.layers)))][: len(terrain.layers)]


def layer_of(terrain: Terrain, layer_name: str) -> HeightLayer:
    """Return a layer by its name.

    Raises
    ------
    NotFoundError
        If the terrain has none of that name.
    """
    names = layer_names(terrain)
    if layer_name not in names:
        raise NotFoundError(f"the terrain has no layer {layer_name!r}; it has {', '.join(names)}")
    return terrain.layers[names.index(layer_name)]


def ortho_file(terrain: Terrain, layer_name: str) -> Path | None:
    """Return the image file of a layer, matched by its extent."""
    import numpy as np

    layer = layer_of(terrain, layer_name)
    for ortho in terrain.orthos:
        if ortho.path is not None and np.allclose(ortho.bounds, layer.bounds, atol=layer.spacing):
            return ortho.path
    return None


def store_terrain(
    repo: Repository, session: Session, terrain: Terrain, *, name: str, author: str
) -> TerrainRow:
    """Write a terrain into the data folder and add its row; one that is there already is used again."""
    from rover_iface.terrain import write_terrain

    terrain_id = new_id("trn")
    kept = repo.folders("terrains").at(terrain_id)
    folder = kept.root
    draft = folder.with_name(f".{terrain_id}")
    write_terrain(terrain, draft)
    seal_folder(draft)
    put_in_place(draft, folder)
    loaded = load_cached(folder)
    present = session.scalars(
        select(TerrainRow).where(TerrainRow.sha256 == loaded.sha256, TerrainRow.name == name).limit(1)
    ).first()
    if present is not None and repo.terrain_dir(present.id).is_dir():
        _cache.pop(folder, None)
        shutil.rmtree(folder)
        return present
    with removed_on_failure(folder):
        keep_folder(kept)
    row = TerrainRow(
        id=terrain_id,
        author=author,
        name=name,
        credits=terrain.credits,
        sha256=loaded.sha256,
        description=describe(loaded, name),
    )
    session.add(row)
    session.flush()
    return row


def show_terrain(row: TerrainRow) -> TerrainValue:
    """Return the value of a terrain's row."""
    d = row.description
    return TerrainValue(
        id=row.id,
        name=d["name"],
        credits=d["credits"],
        sha256=row.sha256,
        bounds_m=Bounds(**d["bounds_m"]),
        layers=[TerrainLayer(**{**layer, "bounds_m": Bounds(**layer["bounds_m"])}) for layer in d["layers"]],
        start_pose=Pose(**d["start_pose"]),
        lowest_m=d["lowest_m"],
        highest_m=d["highest_m"],
    )


@dataclass(frozen=True, slots=True)
class Surface:
    """The ground at a point, and how well it is known from a stereo pair."""

    east_m: float
    north_m: float
    up_m: float
    normal: list[float]
    slope_rad: float
    covariance_m2: list[list[float]]
    observed: bool


def ground_at(terrain: Terrain, east_m: float, north_m: float, eye: Pose) -> TerrainPoint:
    """Return the ground at a point and how well it is known from a stereo pair over the pose `eye`.

    Raises
    ------
    OutsideTerrainError
        If the terrain has no height there.
    """
    (found,) = surfaces_at(terrain, [(east_m, north_m)], eye)
    if isinstance(found, OutsideTerrainError):
        raise found
    camera, point = camera_over(terrain, eye), (east_m, north_m, found.up_m)
    names = zip(("inner", "outer"), terrain.layers, strict=False)
    layer = next((n for n, item in names if _covers(item.bounds, east_m, north_m)), "outer")
    return TerrainPoint(
        **asdict(found),
        range_m=math.dist(camera, point),
        in_view=bool(terrain.line_of_sight(camera, point, clearance_m=SINK_M, end_gap_m=0.05)),
        layer=layer,
    )


def surfaces_at(
    terrain: Terrain, points: Sequence[tuple[float, float]], eye: Pose
) -> list[Surface | OutsideTerrainError]:
    """Return the ground at points (east, north), m, and how well each is known from a stereo pair over the
    pose `eye`; the error where the terrain has no height.
    """
    import numpy as np

    from rover_iface.errors import OutsideTerrainError as Outside
    from rover_iface.terrain import stereo_covariance

    east, north = np.array(points, dtype=float).reshape(-1, 2).T
    up, normal = terrain.height(east, north), terrain.normal(east, north, 0.2)
    slope, observed = terrain.slope(east, north), terrain.observed(east, north)
    camera = camera_over(terrain, eye)
    found: list[Surface | OutsideTerrainError] = []
    for k, (x, y) in enumerate(points):
        if math.isnan(up[k]):
            try:
                terrain.require_inside(x, y)
            except Outside as err:
                found.append(OutsideTerrainError(str(err), pointer="/east_m"))
                continue
        here = (x, y, float(up[k]))
        known = stereo_covariance(camera, here, focal_px=FOCAL_PX, baseline_m=BASELINE_M)
        tilt, seen = float(slope[k]), bool(observed[k])
        found.append(Surface(x, y, round(here[2], 4), normal[k].tolist(), tilt, known.tolist(), seen))
    return found


def camera_over(terrain: Terrain, eye: Pose) -> tuple[float, float, float]:
    """Return where the mast's cameras are, site frame, m, when the rover stands at a pose."""
    base = float(terrain.height(eye.east_m, eye.north_m))
    return eye.east_m, eye.north_m, (0.0 if math.isnan(base) else base) + CAMERA_HEIGHT_M


def _covers(bounds: tuple[float, float, float, float], east_m: float, north_m: float) -> bool:
    west, south, east, north = bounds
    return west <= east_m <= east and south <= north_m <= north
