"""Look at a mission's terrain."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ground.errors import NotFoundError
from ground.gdr.geometry import Pose
from ground.gdr.repository import Repository
from ground.gdr.terrain_folders import load_cached
from ground.records.actor import Action, Actor
from ground.resources.missions.terrain import terrain_row
from ground.resources.terrains.terrain import ground_at, layer_of, ortho_file, show_terrain
from ground.resources.terrains.value import Terrain, TerrainPoint

if TYPE_CHECKING:
    from rover_iface.terrain.grid import HeightLayer


@dataclass(frozen=True, slots=True)
class HeightTile:
    """Heights, float32 little-endian [rows, columns], row 0 in the north; bounds of the posts themselves."""

    rows: int
    columns: int
    spacing_m: float
    bounds: tuple[float, float, float, float]
    content: bytes

    @property
    def headers(self) -> dict[str, str]:
        """Return what goes with the content over the interface."""
        return {
            "X-Outcrop-Shape": f"{self.rows},{self.columns}",
            "X-Outcrop-Bounds": ",".join(f"{b:.6f}" for b in self.bounds),
            "X-Outcrop-Spacing": f"{self.spacing_m:.6f}",
        }


def read_terrain(repo: Repository, actor: Actor, mission_id: str) -> Terrain:
    """Return the description of a mission's terrain."""
    actor.require(Action.READ, mission_id)
    with repo.database.read() as session:
        return show_terrain(terrain_row(session, mission_id))


def _folder(repo: Repository, actor: Actor, mission_id: str) -> Path:
    actor.require(Action.READ, mission_id)
    with repo.database.read() as session:
        return repo.terrain_dir(terrain_row(session, mission_id).id)


def read_point(
    repo: Repository, actor: Actor, mission_id: str, east_m: float, north_m: float
) -> TerrainPoint:
    """Return the ground at a point of the full-resolution terrain.

    Raises
    ------
    OutsideTerrainError
        If the terrain does not reach there.
    """
    folder = _folder(repo, actor, mission_id)
    with repo.database.read() as session:
        start = Pose(**terrain_row(session, mission_id).description["start_pose"])
    return ground_at(load_cached(folder), east_m, north_m, start)


def read_heights(
    repo: Repository, actor: Actor, mission_id: str, layer_name: str, max_posts: int
) -> HeightTile:
    """Return heights of a layer, thinned evenly to at most `max_posts`."""
    import numpy as np

    layer = layer_of(load_cached(_folder(repo, actor, mission_id)), layer_name)
    step = step_within(layer, max_posts)
    thin = layer.heights[::step, ::step]
    north_first = np.ascontiguousarray(thin[::-1], dtype="<f4")
    west, south = float(layer.west), float(layer.south)
    spacing = float(layer.spacing) * step
    bounds = (west, south, west + (thin.shape[1] - 1) * spacing, south + (thin.shape[0] - 1) * spacing)
    return HeightTile(thin.shape[0], thin.shape[1], spacing, bounds, north_first.tobytes())


def step_within(layer: HeightLayer, max_posts: int) -> int:
    """Return how many posts of a layer are one, so that there are at most `max_posts`."""
    rows, columns = layer.heights.shape
    step = 1
    while -(-rows // step) * -(-columns // step) > max_posts:
        step += 1
    return step


def read_ortho(
    repo: Repository, actor: Actor, mission_id: str, layer_name: str, max_px: int
) -> tuple[Path, str, str]:
    """Return file, media type and ETag of a layer's ortho image, scaled down once if it is larger than
    wanted.
    """
    from PIL import Image

    folder = _folder(repo, actor, mission_id)
    path = ortho_file(load_cached(folder), layer_name)
    if path is None:
        raise NotFoundError(f"the terrain has no ortho image for its layer {layer_name!r}")
    with Image.open(path) as image:
        media = Image.MIME.get(image.format or "", "application/octet-stream")
        longest = max(image.size)
        if longest <= max_px:
            return path, media, f'"{path.stem}-{path.stat().st_size}"'
        side = 1 << (max_px.bit_length() - 1)
        small = folder / f".{path.stem}-{side}.jpg"
        if not small.exists():
            scale = side / longest
            size = (max(1, round(image.size[0] * scale)), max(1, round(image.size[1] * scale)))
            image.draft("RGB", (2 * size[0], 2 * size[1]))  # a JPEG is read at a part of its size
            draft = small.with_suffix(".draft")
            image.convert("RGB").resize(size, Image.Resampling.LANCZOS).save(draft, "JPEG", quality=88)
            draft.replace(small)
    return small, "image/jpeg", f'"{small.stem}-{small.stat().st_size}"'
