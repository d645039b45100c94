"""Terrain as binary glTF 2.0, with its ortho image as texture and its place in the `extras`.

https://registry.khronos.org/glTF/specs/2.0. Axes are glTF's: x east, y up, z south; metres, and the origin is
that of the site.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from neighbours.geodata.errors import GeodataError

Floats = NDArray[np.floating]
Bounds = tuple[float, float, float, float]
_MAGIC, _JSON, _BIN = 0x46546C67, 0x4E4F534A, 0x004E4942
_FLOAT, _UINT, _ARRAY, _ELEMENTS = 5126, 5125, 34962, 34963


@dataclass(frozen=True, slots=True)
class Texture:
    """An image, PNG or JPEG, whose outer edges are `bounds` (west, south, east, north, site metres)."""

    content: bytes
    media: str
    bounds: Bounds


@dataclass(frozen=True, slots=True)
class TerrainModel:
    """A model, and how far its triangles are from the heights that it was made of.

    `step` posts of the raster are one of the model. Errors are those of heights, metres, at all posts under
    a triangle; `left_out` counts known posts that lie under none.
    """

    content: bytes
    triangles: int
    step: int
    largest_error_m: float
    rms_error_m: float
    left_out: int


def terrain_glb(
    heights: Floats,
    west: float,
    south: float,
    spacing: float,
    *,
    most_triangles: int = 500_000,
    texture: Texture | None = None,
    extras: Mapping[str, object] | None = None,
) -> TerrainModel:
    """Return heights [rows, columns], m, row 0 in the south, as a GLB of at most `most_triangles`.

    Posts are thinned evenly, so far as it takes; the first and last rows and columns always stay. Where a
    height is not known there is a hole.

    Raises
    ------
    GeodataError
        If fewer than 2 triangles are allowed, or nothing is known.
    """
    if most_triangles < 2:
        raise GeodataError(f"{most_triangles} triangles are allowed; at least 2 are needed")
    rows, columns = heights.shape
    step = 1
    while True:
        r, c = _kept(rows, step), _kept(columns, step)
        if 2 * (len(r) - 1) * (len(c) - 1) <= most_triangles:
            break
        step += 1
    thin = np.asarray(heights, dtype=np.float64)[np.ix_(r, c)]
    faces = _faces(thin)
    if not len(faces):
        raise GeodataError("no four posts with known heights lie together: there is nothing to show")
    x, y = west + c * spacing, south + r * spacing
    normals = _normals(thin, x, y)
    used, index = np.unique(faces, return_inverse=True)
    grid_x, grid_y = (g.ravel()[used] for g in np.meshgrid(x, y))
    places = np.column_stack([grid_x, thin.ravel()[used], -grid_y]).astype("<f4")
    flat = normals.reshape(-1, 3)[used][:, [0, 2, 1]] * [1, 1, -1]
    arrays = {"POSITION": places, "NORMAL": flat.astype("<f4")}
    if texture is not None:
        w, s, e, n = texture.bounds
        arrays["TEXCOORD_0"] = np.column_stack([(grid_x - w) / (e - w), (n - grid_y) / (n - s)]).astype("<f4")
    content = _glb(arrays, index.reshape(-1).astype("<u4"), texture, extras or {})
    largest, rms, left_out = _errors(np.asarray(heights, dtype=np.float64), r, c, thin, used)
    return TerrainModel(content, len(faces), step, largest, rms, left_out)


def _kept(count: int, step: int) -> NDArray[np.int64]:
    return np.unique(np.append(np.arange(0, count, step), count - 1))


def _faces(thin: Floats) -> NDArray[np.int64]:
    """Return triangles [n, 3] of posts, counter-clockwise from above; each cell is parted from south-west."""
    rows, columns = thin.shape
    at = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]
    faces = np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)], axis=2).reshape(-1, 3)
    known = np.isfinite(thin).ravel()[faces].all(axis=1)
    return np.asarray(faces[known])


def _normals(thin: Floats, x: Floats, y: Floats) -> Floats:
    """Return unit normals [rows, columns, 3], east-north-up; upright beside holes."""
    north, east = np.gradient(thin, y, x)
    found = np.stack([-east, -north, np.ones_like(thin)], axis=-1)
    found[~np.isfinite(found).all(axis=-1)] = [0.0, 0.0, 1.0]
    return np.asarray(found / np.linalg.norm(found, axis=-1, keepdims=True))


def _errors(
    full: Floats, r: NDArray[np.int64], c: NDArray[np.int64], thin: Floats, used: NDArray[np.int64]
) -> tuple[float, float, int]:
    """Return largest and rms difference of triangles and posts, and how many posts lie under none."""
    rows, columns = np.arange(full.shape[0]), np.arange(full.shape[1])
    i = np.minimum(np.searchsorted(r, rows, "right") - 1, len(r) - 2)
    j = np.minimum(np.searchsorted(c, columns, "right") - 1, len(c) - 2)
    v = ((rows - r[i]) / (r[i + 1] - r[i]))[:, None]
    u = ((columns - c[j]) / (c[j + 1] - c[j]))[None, :]
    a, b = thin[np.ix_(i, j)], thin[np.ix_(i, j + 1)]
    far, d = thin[np.ix_(i + 1, j + 1)], thin[np.ix_(i + 1, j)]
    below = a + u * (b - a) + v * (far - b)
    above = a + v * (d - a) + u * (far - d)
    off = np.where(u >= v, below, above) - full
    corner = np.zeros(thin.size, dtype=bool)
    corner[used] = True
    kept = np.ix_(r, c)
    off[kept] = np.where(corner.reshape(thin.shape), 0.0, off[kept])  # also beside a hole
    seen = off[np.isfinite(off)]
    left_out = int((np.isfinite(full) & ~np.isfinite(off)).sum())
    if not seen.size:
        return 0.0, 0.0, left_out
    return float(np.abs(seen).max()), math.sqrt(float((seen**2).mean())), left_out


def _glb(
    arrays: Mapping[str, NDArray[Any]],
    index: NDArray[Any],
    texture: Texture | None,
    extras: Mapping[str, object],
) -> bytes:
    parts: list[bytes] = []
    views: list[dict[str, object]] = []
    accessors: list[dict[str, object]] = []

    def view(content: bytes, target: int | None) -> int:
        offset = sum(map(len, parts))
        about: dict[str, object] = {"buffer": 0, "byteOffset": offset, "byteLength": len(content)}
        views.append(about if target is None else {**about, "target": target})
        parts.append(content + bytes(-len(content) % 4))
        return len(views) - 1

    attributes = {}
    for name, values in arrays.items():
        about = {
            "bufferView": view(values.tobytes(), _ARRAY),
            "componentType": _FLOAT,
            "count": len(values),
            "type": f"VEC{values.shape[1]}",
        }
        if name == "POSITION":
            about |= {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        attributes[name] = len(accessors)
        accessors.append(about)
    faces = {"bufferView": view(index.tobytes(), _ELEMENTS), "componentType": _UINT, "count": len(index)}
    accessors.append({**faces, "type": "SCALAR"})
    rough: dict[str, object] = {"metallicFactor": 0.0, "roughnessFactor": 1.0}
    document: dict[str, object] = {
        "asset": {"version": "2.0", "generator": "Outcrop", "extras": dict(extras)},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "terrain"}],
        "meshes": [
            {"primitives": [{"attributes": attributes, "indices": len(accessors) - 1, "material": 0}]}
        ],
    }
    if texture is not None:
        document["images"] = [{"bufferView": view(texture.content, None), "mimeType": texture.media}]
        document["samplers"] = [{"wrapS": 33071, "wrapT": 33071}]  # to the edge
        document["textures"] = [{"source": 0, "sampler": 0}]
        rough["baseColorTexture"] = {"index": 0}
    document["materials"] = [{"pbrMetallicRoughness": rough, "name": "ground"}]
    content = b"".join(parts)
    document |= {"accessors": accessors, "bufferViews": views, "buffers": [{"byteLength": len(content)}]}
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    length = 12 + 8 + len(text) + 8 + len(content)
    if length >= 2**32:
        raise GeodataError(
            f"the model has {length} bytes; a GLB holds less than 4 GiB: allow fewer triangles"
        )
    head = struct.pack("<III", _MAGIC, 2, length)
    return b"".join(
        (head, struct.pack("<II", len(text), _JSON), text, struct.pack("<II", len(content), _BIN), content)
    )
