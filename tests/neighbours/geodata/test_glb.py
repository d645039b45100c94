"""Terrain as GLB, read back by trimesh and, chunk by chunk, by the definition of the format."""

from __future__ import annotations

import io
import json
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image
from typer.testing import CliRunner

from ground.cli.main import app, register_all
from neighbours.geodata.errors import GeodataError
from neighbours.geodata.glb import Texture, terrain_glb


def hills(rows: int, columns: int) -> np.ndarray:
    y, x = np.mgrid[:rows, :columns] * 0.5
    return (2.0 * np.sin(0.3 * x) * np.cos(0.2 * y) + 0.1 * x).astype(np.float32)


def picture(pixels: np.ndarray) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "PNG")
    return stream.getvalue()


def test_trimesh_finds_every_height_at_its_place_and_the_pixel_that_lies_there() -> None:
    heights = hills(30, 40)
    heights[4, 6] = np.nan
    pixels = np.random.default_rng(1).integers(0, 255, (30, 40, 3), dtype=np.uint8)
    bounds = (-10.25, 4.75, 9.75, 19.75)  # the cells of posts half a metre apart
    texture = Texture(picture(pixels), "image/png", bounds)
    made = terrain_glb(heights, -10.0, 5.0, 0.5, texture=texture, extras={"outcrop": {"crs": "EPSG:32612"}})
    assert (made.step, made.largest_error_m, made.left_out) == (1, 0.0, 0)
    scene = trimesh.load_scene(io.BytesIO(made.content), file_type="glb")
    (mesh,) = scene.geometry.values()
    assert len(mesh.faces) == made.triangles == 2 * 29 * 39 - 6
    # glTF is y up and z towards the viewer: back to east, north, up
    east, up, north = mesh.vertices[:, 0], mesh.vertices[:, 1], -mesh.vertices[:, 2]
    column, row = np.rint((east + 10) / 0.5).astype(int), np.rint((north - 5) / 0.5).astype(int)
    assert len(east) == 30 * 40 - 1
    assert np.array_equal(up.astype(np.float32), heights[row, column])
    assert (mesh.face_normals[:, 1] > 0).all()
    image = np.asarray(mesh.visual.material.baseColorTexture.convert("RGB"))
    u, v = mesh.visual.uv.T  # trimesh counts v from below
    seen = image[((1 - v) * 30).astype(int), (u * 40).astype(int)]
    assert np.array_equal(seen, pixels[29 - row, column])


def test_the_chunks_are_those_of_the_format_and_the_extras_say_where_it_is() -> None:
    content = terrain_glb(hills(5, 7), 0.0, 0.0, 0.5, extras={"outcrop": {"crs": "EPSG:32612"}}).content
    magic, version, length = struct.unpack_from("<4sII", content)
    assert (magic, version, length) == (b"glTF", 2, len(content))
    size, kind = struct.unpack_from("<I4s", content, 12)
    assert kind == b"JSON"
    assert size % 4 == 0
    document = json.loads(content[20 : 20 + size])
    more, kind = struct.unpack_from("<I4s", content, 20 + size)
    assert kind == b"BIN\0"
    assert 28 + size + more == len(content)
    assert document["buffers"] == [{"byteLength": more}]
    assert document["asset"]["extras"]["outcrop"]["crs"] == "EPSG:32612"
    for accessor in document["accessors"]:
        view = document["bufferViews"][accessor["bufferView"]]
        width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}[accessor["type"]]
        assert accessor["count"] * width * 4 == view["byteLength"]
        assert view["byteOffset"] % 4 == 0


def test_the_stated_error_is_the_largest_distance_of_a_ray_from_above() -> None:
    heights = hills(41, 53)
    made = terrain_glb(heights, 0.0, 0.0, 0.5, most_triangles=300)
    assert made.triangles <= 300
    assert made.step > 1
    (mesh,) = trimesh.load_scene(io.BytesIO(made.content), file_type="glb").geometry.values()
    row, column = (g.ravel() for g in np.mgrid[:41, :53])
    origins = np.column_stack([column * 0.5, np.full(row.size, 100.0), -row * 0.5])
    # rim posts lie on the edge of the model, where a ray may pass by
    inner = (row > 0) & (row < 40) & (column > 0) & (column < 52)
    down = np.tile([0.0, -1.0, 0.0], (int(inner.sum()), 1))
    hits, rays, _ = mesh.ray.intersects_location(origins[inner] + [1e-6, 0, 2e-6], down, multiple_hits=False)
    assert len(rays) == inner.sum()
    off = hits[:, 1] - heights[row, column][inner][rays]
    assert np.abs(off).max() == pytest.approx(made.largest_error_m, abs=1e-4)
    assert made.rms_error_m < made.largest_error_m < 2.0


def test_what_cannot_be_shown_is_refused() -> None:
    with pytest.raises(GeodataError, match="1 triangles"):
        terrain_glb(hills(5, 5), 0.0, 0.0, 1.0, most_triangles=1)
    with pytest.raises(GeodataError, match="nothing to show"):
        terrain_glb(np.full((5, 5), np.nan), 0.0, 0.0, 1.0)


def test_the_command_writes_a_model_with_texture_and_says_its_error(tmp_path: Path) -> None:
    from rover_iface.terrain import HeightLayer, Ortho, Terrain, write_terrain

    layer = HeightLayer(hills(60, 60), -15.0, -15.0, 0.5)
    ortho = Ortho(layer.bounds, pixels=np.full((60, 60, 3), 90, np.uint8))
    write_terrain(Terrain("hills", (layer,), (ortho,)), tmp_path / "hills")
    register_all()
    files = [str(tmp_path / "hills"), str(tmp_path / "hills.glb")]
    result = CliRunner().invoke(app, ["terrain", "glb", *files, "--most-triangles", "2000"])
    assert result.exit_code == 0, result.output
    assert "every 2. post; heights are off by at most" in result.output
    (mesh,) = trimesh.load_scene(tmp_path / "hills.glb").geometry.values()
    assert mesh.visual.material.baseColorTexture.size == (60, 60)
    wrong = CliRunner().invoke(app, ["terrain", "glb", *files, "--layer", "3"])
    assert (wrong.exit_code, "the terrain has 1" in wrong.output) == (2, True)
