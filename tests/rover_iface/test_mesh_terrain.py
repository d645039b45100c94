"""Terrain from meshes."""

from __future__ import annotations

import json
import struct
from base64 import b64encode
from pathlib import Path

import numpy as np
import pytest

from rover_iface.errors import TerrainFormatError
from rover_iface.terrain import load_terrain
from rover_iface.terrain.mesh import load_mesh_terrain, read_mesh
from tests.shared import shared


def sheet(n: int = 9) -> tuple[np.ndarray, np.ndarray]:
    """A tilted square sheet, z up: z = 0.5 x."""
    axis = np.linspace(-2, 2, n)
    x, y = np.meshgrid(axis, axis)
    v = np.column_stack([x.ravel(), y.ravel(), 0.5 * x.ravel()])
    i = np.arange(n * n).reshape(n, n)
    a, b, c, d = i[:-1, :-1], i[:-1, 1:], i[1:, :-1], i[1:, 1:]
    t = np.concatenate([np.stack([a, b, d], -1).reshape(-1, 3), np.stack([a, d, c], -1).reshape(-1, 3)])
    return v, t


def write_obj(path: Path, v: np.ndarray, t: np.ndarray) -> Path:
    lines = [f"v {a} {b} {c}" for a, b, c in v] + [f"f {a}/1 {b}/1 {c}/1" for a, b, c in t + 1]
    path.write_text("\n".join(lines))
    return path


def write_ply(path: Path, v: np.ndarray, t: np.ndarray, *, binary: bool) -> Path:
    form = "binary_little_endian" if binary else "ascii"
    header = (
        f"ply\nformat {form} 1.0\nelement vertex {len(v)}\n"
        "property float x\nproperty float y\nproperty float z\n"
        f"property uchar red\nelement face {len(t)}\nproperty list uchar int vertex_indices\nend_header\n"
    ).encode()
    if binary:
        body = b"".join(struct.pack("<fffB", *p, 7) for p in v)
        body += b"".join(struct.pack("<Biii", 3, *f) for f in t)
    else:
        rows = [f"{a} {b} {c} 7" for a, b, c in v] + [f"3 {a} {b} {c}" for a, b, c in t]
        body = ("\n".join(rows) + "\n").encode()
    path.write_bytes(header + body)
    return path


def write_glb(path: Path, v: np.ndarray, t: np.ndarray, **node: object) -> Path:
    points, faces = v.astype("<f4").tobytes(), t.astype("<u2").tobytes()
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "root", "children": [1], **node}, {"name": "ground", "mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": len(v), "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": t.size, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": len(points)},
            {"buffer": 0, "byteOffset": len(points), "byteLength": len(faces)},
        ],
        "buffers": [{"byteLength": len(points) + len(faces)}],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    body = points + faces
    body += b"\0" * (-len(body) % 4)
    size = 12 + 8 + len(text) + 8 + len(body)
    path.write_bytes(
        struct.pack("<4sII", b"glTF", 2, size)
        + struct.pack("<I4s", len(text), b"JSON")
        + text
        + struct.pack("<I4s", len(body), b"BIN\0")
        + body
    )
    return path


def test_obj_and_both_kinds_of_ply_become_the_same_ground(tmp_path: Path) -> None:
    v, t = sheet()
    paths = [
        write_obj(tmp_path / "a.obj", v, t),
        write_ply(tmp_path / "b.ply", v, t, binary=False),
        write_ply(tmp_path / "c.ply", v, t, binary=True),
    ]
    for path in paths:
        ground = load_terrain(path)
        assert ground.spacing == pytest.approx(0.5)
        assert float(ground.height(1.0, 0.3)) == pytest.approx(0.5, abs=1e-3)


def test_gltf_is_y_up_and_its_node_transforms_count(tmp_path: Path) -> None:
    v, t = sheet()
    y_up = v[:, [0, 2, 1]] * [1, 1, -1]
    ground = load_terrain(write_glb(tmp_path / "a.glb", y_up, t, scale=[2, 2, 2], translation=[0, 1, 0]))
    assert float(ground.height(2.0, 0.6)) == pytest.approx(2.0, abs=1e-3)


def test_a_skipped_node_takes_what_hangs_on_it_along_and_a_skipped_mesh_all_its_parts(tmp_path: Path) -> None:
    v, t = sheet()
    path = write_glb(tmp_path / "a.glb", v, t)
    raw = path.read_bytes()
    size = int.from_bytes(raw[12:16], "little")
    document = json.loads(raw[20 : 20 + size])
    uri = "data:application/octet-stream;base64," + b64encode(raw[28 + size :]).decode()
    document["buffers"][0]["uri"] = uri
    part = document["meshes"][0]["primitives"][0]
    document["meshes"] = [
        {"name": "plain", "primitives": [part]},
        {"name": "split", "primitives": [part, part]},
    ]
    document["nodes"] += [{"name": "far", "mesh": 1, "translation": [9, 0, 0]}]
    document["nodes"][0]["children"] = [1, 2]
    path = tmp_path / "a.gltf"
    path.write_text(json.dumps(document))
    assert len(read_mesh(path).triangles) == 3 * len(t)
    assert len(read_mesh(path, skip=["far"]).triangles) == len(t)
    assert len(read_mesh(path, skip=["split"]).triangles) == len(t)
    assert len(read_mesh(path, skip=["plain"]).triangles) == 2 * len(t)
    assert len(read_mesh(path, skip=["none"]).triangles) == 3 * len(t)
    with pytest.raises(TerrainFormatError, match="holds no triangles"):
        read_mesh(path, skip=["root"])


def test_axes_and_scale_are_taken_as_told(tmp_path: Path) -> None:
    v, t = sheet()
    ground = load_mesh_terrain(write_obj(tmp_path / "a.obj", v * 100, t), axes="-xyz", scale=0.01)
    assert float(ground.height(1.0, 0.0)) == pytest.approx(-0.5, abs=1e-3)
    with pytest.raises(TerrainFormatError, match="three of x, y, z"):
        load_mesh_terrain(tmp_path / "a.obj", axes="xxz")


def test_a_mesh_with_holes_is_refused_by_share_unless_allowed(tmp_path: Path) -> None:
    v, t = sheet(41)
    middle = np.abs(v[t].mean(axis=1)[:, :2]).max(axis=1) < 0.5
    path = write_obj(tmp_path / "holed.obj", v, t[~middle])
    with pytest.raises(TerrainFormatError, match=r"has holes: \d+\.\d % of the posts inside"):
        load_terrain(path)
    ground = load_mesh_terrain(path, allow_holes=True)
    assert np.isnan(ground.height(0.0, 0.0))


def test_broken_meshes_are_refused(tmp_path: Path) -> None:
    for name, text in (
        ("a.obj", "v 1 2 3\n"),
        ("b.obj", "v 1 2 3\nf 1 2 3\n"),
        ("c.ply", "plywood"),
        ("d.glb", "glTF!"),
        ("e.obj", "v 1 2 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
    ):
        path = tmp_path / name
        path.write_text(text)
        with pytest.raises(TerrainFormatError, match="mesh"):
            read_mesh(path)
    with pytest.raises(TerrainFormatError, match="is not among"):
        read_mesh(tmp_path / "x.stl")


def test_the_onsight_draco_mesh_agrees_with_its_published_raster() -> None:
    folder = shared("data/terrain/msl_onsight/landing_site")
    ground = load_mesh_terrain(
        folder / "terrain_draco_leftHanded_EUN.glb",
        axes="xzy",
        scale=100,
        skip=("BACKGROUND", "SIMPLE"),
        radius_m=8,
        spacing_m=0.2,
    )
    raster = load_terrain(folder)
    axis = np.linspace(-7, 7, 60)
    x, y = np.meshgrid(axis, axis)
    difference = np.abs(ground.height(x, y) - raster.height(x, y))
    assert float(np.median(difference)) < 0.01
