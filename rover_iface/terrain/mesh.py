"""Terrain from triangles: glTF/GLB (Draco compressed or plain), OBJ, PLY.

Triangles are looked at from above and become one height layer; where several lie over each other the highest
counts. `axes` names which mesh axis points east, north and up: glTF is y up with z towards the viewer, so its
default is `x-zy`; OBJ and PLY are taken as they are, `xyz`. A left-handed mesh (`xzy`) will do as well.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from mission.codec import read_object
from rover_iface.errors import TerrainFormatError
from rover_iface.terrain.grid import HeightLayer
from rover_iface.terrain.outside import inside
from rover_iface.terrain.rocks import Mesh
from rover_iface.terrain.terrain import Terrain

Array = NDArray[np.floating]

MESHES = (".glb", ".gltf", ".obj", ".ply")
"""Endings of the files that are read."""

MAX_REACH_M = 100_000.0
"""From the origin of the site: as for maps of sites. Heights in single precision are good to 8 mm there."""

HOLE_LIMIT = 0.01
"""Share of posts inside the outline that may be unknown."""


def load_mesh_terrain(
    path: Path | str,
    *,
    axes: str | None = None,
    scale: float = 1.0,
    spacing_m: float | None = None,
    skip: Sequence[str] = (),
    radius_m: float | None = None,
    allow_holes: bool = False,
) -> Terrain:
    """Return a terrain made from a mesh file.

    Parameters
    ----------
    axes
        Mesh axes that point east, north, up, each with an optional minus.
    scale
        Metres per mesh unit, after the transforms of the file.
    spacing_m
        Posts of the grid; by default the median of the triangles' shortest sides.
    skip
        Names of nodes to leave out (a far background, a collision shape).
    radius_m
        Half width of the square round the origin that is kept.
    allow_holes
        Take the mesh although more than 1 % of the posts inside its outline are unknown.

    Raises
    ------
    TerrainFormatError
        If the file is malformed, holds no triangles, or has holes.
    """
    path = Path(path)
    mesh = read_mesh(path, skip=skip)
    suffix = path.suffix.lower()
    order = _axes(axes or ("x-zy" if suffix in (".glb", ".gltf") else "xyz"))
    vertices = mesh.vertices.astype(np.float64) @ order.T * scale
    triangles = mesh.triangles
    if radius_m is not None:
        near = np.abs(vertices[:, :2]).max(axis=1) <= radius_m
        triangles = triangles[near[triangles].any(axis=1)]
        if not len(triangles):
            raise TerrainFormatError(f"mesh {path} has no triangle within {radius_m} m of its origin")
    used = vertices[np.unique(triangles)]
    low, high = used.min(axis=0), used.max(axis=0)
    if radius_m is not None:
        low, high = np.maximum(low, -radius_m), np.minimum(high, radius_m)
    corners = vertices[triangles]
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).min(axis=1)
    step = spacing_m if spacing_m is not None else float(np.median(sides))
    if not step > 0:
        raise TerrainFormatError(f"mesh {path} gives a post spacing of {step} m; it must be positive")
    reach = float(np.abs(used).max())
    if not reach <= MAX_REACH_M:
        raise TerrainFormatError(f"mesh {path} reaches {reach:g} m far; at most {MAX_REACH_M:g} m are read")
    columns, rows = (max(2, math.floor((high[k] - low[k]) / step) + 1) for k in (0, 1))
    if columns * rows > 64_000_000:
        raise TerrainFormatError(
            f"mesh {path} would make {columns} x {rows} posts at {step:g} m; give a spacing"
        )
    from rover_iface.terrain.raster import drape_triangles

    heights = np.full((rows, columns), np.nan)
    # Winding is not to be trusted after a change of axes: every triangle is turned to face up.
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    facing = np.where((area < 0)[:, None], triangles[:, ::-1], triangles).astype(np.int32)
    drape_triangles(heights, float(low[0]), float(low[1]), step, vertices[None], facing)
    share = _hole_share(heights)
    if share > HOLE_LIMIT and not allow_holes:
        raise TerrainFormatError(
            f"mesh {path} has holes: {100 * share:.1f} % of the posts inside its outline are unknown; "
            f"the limit is {100 * HOLE_LIMIT:g} %"
        )
    layer = HeightLayer(
        np.round(heights, 3).astype(np.float32), float(low[0]), float(low[1]), step, name=path.stem
    )
    return Terrain(path.stem, (layer,), sha256=hashlib.sha256(path.read_bytes()).hexdigest())


def _hole_share(heights: Array) -> float:
    """Return the share of unknown posts that are shut in by known ones."""
    from scipy import ndimage

    unknown = np.isnan(heights)
    if not unknown.any():
        return 0.0
    labels, _ = ndimage.label(unknown)
    rim = np.unique(np.concatenate([labels[0], labels[-1], labels[:, 0], labels[:, -1]]))
    inside = unknown & ~np.isin(labels, rim)
    return float(inside.sum() / max(1, inside.sum() + (~unknown).sum()))


def _axes(text: str) -> Array:
    parts = re.findall(r"-?[xyz]", text.lower())
    if "".join(parts) != text.lower() or sorted(p[-1] for p in parts) != ["x", "y", "z"]:
        raise TerrainFormatError(
            f'axes "{text}": three of x, y, z with optional minus are needed, as in "x-zy"'
        )
    matrix = np.zeros((3, 3))
    for row, part in enumerate(parts):
        matrix[row, "xyz".index(part[-1])] = -1.0 if part.startswith("-") else 1.0
    return matrix


def read_mesh(path: Path, *, skip: Sequence[str] = ()) -> Mesh:
    """Return all triangles of a mesh file in its own axes and units.

    Nodes and meshes of the names in `skip` are left out, with what hangs on them. Where a glTF file gives
    several nodes one name, the second is known as `name_1`.

    Raises
    ------
    TerrainFormatError
        If the file is malformed or holds no triangles.
    """
    import trimesh

    suffix = path.suffix.lower()
    if suffix not in MESHES:
        raise TerrainFormatError(f'mesh {path}: "{suffix}" is not among {", ".join(s[1:] for s in MESHES)}')
    if suffix == ".gltf":
        _require_inside(path)
    try:
        scene = trimesh.load_scene(path, process=False, skip_materials=True)
        parts = [
            (
                trimesh.transform_points(scene.geometry[geometry].vertices, matrix),
                np.asarray(scene.geometry[geometry].faces),
            )
            for node in scene.graph.nodes_geometry
            for matrix, geometry in (scene.graph[node],)
            if isinstance(scene.geometry[geometry], trimesh.Trimesh) and not _skipped(scene, node, skip)
        ]
    except Exception as err:  # a malformed file fails anywhere in the reader
        raise TerrainFormatError(f"mesh {path}: {err}") from err
    parts = [p for p in parts if len(p[1])]
    if not parts:
        raise TerrainFormatError(f"mesh {path} holds no triangles")
    offsets = np.cumsum([0, *(len(v) for v, _ in parts[:-1])])
    vertices = np.concatenate([v for v, _ in parts]).astype(np.float32)
    triangles = np.concatenate([t + o for (_, t), o in zip(parts, offsets, strict=True)]).astype(np.int32)
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        raise TerrainFormatError(f"mesh {path} refers to vertex {triangles.max()} of {len(vertices)}")
    if not np.isfinite(vertices).all():
        raise TerrainFormatError(f"mesh {path} has vertices that are not numbers")
    return Mesh(vertices, triangles, path.stem)


def _require_inside(path: Path) -> None:
    """Raise if a glTF file takes its buffers from outside its folder."""
    buffers = read_object(path, TerrainFormatError).get("buffers")
    for buffer in buffers if isinstance(buffers, list) else ():
        uri = buffer.get("uri") if isinstance(buffer, dict) else None
        if isinstance(uri, str) and not uri.startswith("data:"):
            inside(path.parent, unquote(uri))


def _skipped(scene: Any, node: str, skip: Sequence[str]) -> bool:
    """Return whether a node of a trimesh scene, its mesh or a node that it hangs on is left out."""
    mesh = scene.graph[node][1]
    if scene.geometry[mesh].metadata.get("from_gltf_primitive"):
        mesh = re.sub(r"_\d+$", "", mesh)  # the primitives of one mesh are numbered
    above = scene.graph.transforms.shortest_path(scene.graph.base_frame, node)
    return not {mesh, *above}.isdisjoint(skip)
