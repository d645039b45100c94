"""Terrain from triangles: glTF/GLB (Draco compressed or plain), OBJ, PLY.

Triangles are looked at from above and become one height layer; where several lie over each other the highest
counts. `axes` names which mesh axis points east, north and up: glTF is y up with z towards the viewer, so its
default is `x-zy`; OBJ and PLY are taken as they are, `xyz`. A left-handed mesh (`xzy`) will do as well.
"""

from __future__ import annotations

import hashlib
import math
import re
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_iface.errors import TerrainFormatError
from rover_iface.terrain.gltf import Part, read_gltf
from rover_iface.terrain.grid import HeightLayer
from rover_iface.terrain.rocks import Mesh
from rover_iface.terrain.terrain import Terrain

Array = NDArray[np.floating]

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

    Raises
    ------
    TerrainFormatError
        If the file is malformed or holds no triangles.
    """
    suffix = path.suffix.lower()
    try:
        if suffix in (".glb", ".gltf"):
            parts = list(read_gltf(path, skip))
        elif suffix == ".obj":
            parts = [_read_obj(path)]
        elif suffix == ".ply":
            parts = [_read_ply(path)]
        else:
            raise TerrainFormatError(f'mesh {path}: "{suffix}" is not among glb, gltf, obj, ply')
    except (OSError, ValueError, KeyError, IndexError, TypeError, struct.error) as err:
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
        raise TerrainFormatError(f"mesh {path} has vertices that are no numbers")
    return Mesh(vertices, triangles, path.stem)


def _read_obj(path: Path) -> Part:
    points: list[list[float]] = []
    faces: list[tuple[int, int, int]] = []
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        words = line.split()
        if not words:
            continue
        if words[0] == "v":
            points.append([float(w) for w in words[1:4]])
        elif words[0] == "f":
            ids = [int(w.split("/")[0]) for w in words[1:]]
            ids = [i - 1 if i > 0 else len(points) + i for i in ids]
            faces += [(ids[0], ids[k], ids[k + 1]) for k in range(1, len(ids) - 1)]
    return np.array(points, dtype=float).reshape(-1, 3), np.array(faces, dtype=np.int64).reshape(-1, 3)


_PLY_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip


def _read_ply(path: Path) -> Part:
    raw = path.read_bytes()
    end = raw.find(b"end_header")
    if not raw.startswith(b"ply") or end < 0:
        raise TerrainFormatError(f"mesh {path} is no PLY file")
    header = raw[:end].decode("ascii", errors="replace").split("\n")
    body = raw[raw.index(b"\n", end) + 1 :]
    form = "ascii"
    elements: list[tuple[str, int, list[list[str]]]] = []
    for line in header:
        words = line.split()
        if words[:1] == ["format"]:
            form = words[1]
        elif words[:1] == ["element"]:
            elements.append((words[1], int(words[2]), []))
        elif words[:1] == ["property"]:
            elements[-1][2].append(words[1:])
    read = _ply_ascii if form == "ascii" else _ply_binary
    tables = read(body, elements, "<" if "little" in form else ">")
    points = tables.get("vertex", np.zeros((0, 3)))
    faces = tables.get("face", np.zeros((0, 3)))
    return np.asarray(points, dtype=float), np.asarray(faces, dtype=np.int64)


def _fan(ids: Sequence[int]) -> list[tuple[int, int, int]]:
    return [(ids[0], ids[k], ids[k + 1]) for k in range(1, len(ids) - 1)]


def _ply_ascii(body: bytes, elements: list[tuple[str, int, list[list[str]]]], _: str) -> dict[str, Any]:
    lines = iter(body.decode("ascii", errors="replace").splitlines())
    tables: dict[str, Any] = {}
    for name, count, properties in elements:
        rows = [next(lines, "").split() for _ in range(count)]
        if name == "vertex":
            at = [next(k for k, p in enumerate(properties) if p[-1] == axis) for axis in "xyz"]
            tables[name] = np.array([[float(row[k]) for k in at] for row in rows]).reshape(-1, 3)
        elif name == "face":
            faces = [f for row in rows for f in _fan([int(w) for w in row[1 : 1 + int(row[0])]])]
            tables[name] = np.array(faces, dtype=np.int64).reshape(-1, 3)
    return tables


def _ply_binary(body: bytes, elements: list[tuple[str, int, list[list[str]]]], order: str) -> dict[str, Any]:
    tables: dict[str, Any] = {}
    position = 0
    for name, count, properties in elements:
        if all(p[0] != "list" for p in properties):
            kind = np.dtype([(p[-1], order + _PLY_TYPES[p[0]]) for p in properties])
            table = np.frombuffer(body, dtype=kind, count=count, offset=position)
            position += kind.itemsize * count
            if name == "vertex":
                tables[name] = np.column_stack([table[axis].astype(float) for axis in "xyz"])
            continue
        faces: list[tuple[int, int, int]] = []
        for _ in range(count):
            for p in properties:
                if p[0] != "list":
                    position += np.dtype(_PLY_TYPES[p[0]]).itemsize
                    continue
                size, item = np.dtype(order + _PLY_TYPES[p[1]]), np.dtype(order + _PLY_TYPES[p[2]])
                length = int(np.frombuffer(body, size, 1, position)[0])
                position += size.itemsize
                if name == "face":
                    faces += _fan(np.frombuffer(body, item, length, position).tolist())
                position += item.itemsize * length
        if name == "face":
            tables[name] = np.array(faces, dtype=np.int64).reshape(-1, 3)
    return tables
