"""Triangles of glTF 2.0 files, text or binary, plain or compressed by Draco."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_iface.errors import TerrainFormatError

Array = NDArray[np.floating]
Part = tuple[Array, NDArray[np.integer]]
_COMPONENT = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTH = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_TRIANGLES = 4
"""Mode of a primitive (glTF 2.0, 3.7.2.1), and the one that is meant where none is given."""


def read_gltf(path: Path, skip: Sequence[str]) -> Iterator[Part]:
    """Yield points [n, 3] and triangles [m, 3] of each primitive of the scene, in the file's axes.

    Nodes and meshes whose names are in `skip` are left out, with what hangs on them.

    Raises
    ------
    TerrainFormatError
        If a binary file is no glTF 2.
    """
    file = _Gltf(path)
    scene = file.document.get("scenes", [{}])[file.document.get("scene", 0)]
    for root in scene.get("nodes", range(len(file.document.get("nodes", ())))):
        yield from file.parts(root, np.eye(4), skip)


class _Gltf:
    """A file: its document, and the chunk of bytes beside it if it is binary."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.binary = b""
        raw = path.read_bytes()
        self.document: dict[str, Any] = (
            self._chunks(raw) if path.suffix.lower() == ".glb" else json.loads(raw)
        )

    def _chunks(self, raw: bytes) -> dict[str, Any]:
        magic, version, _ = struct.unpack_from("<4sII", raw, 0)
        if magic != b"glTF" or version != 2:
            raise TerrainFormatError(f"mesh {self.path} is no binary glTF 2")
        position = 12
        document: dict[str, Any] = {}
        while position + 8 <= len(raw):
            length, kind = struct.unpack_from("<I4s", raw, position)
            chunk = raw[position + 8 : position + 8 + length]
            if kind == b"JSON":
                document = json.loads(chunk)
            elif kind == b"BIN\0":
                self.binary = chunk
            position += 8 + length
        return document

    def _buffer(self, k: int) -> bytes:
        uri = self.document["buffers"][k].get("uri")
        if uri is None:
            return self.binary
        if uri.startswith("data:"):
            import base64

            return base64.b64decode(uri.split(",", 1)[1])
        return (self.path.parent / uri).read_bytes()

    def _view(self, k: int) -> tuple[bytes, int]:
        """Return the bytes of a view and their stride; 0 if they are packed."""
        entry = self.document["bufferViews"][k]
        start = entry.get("byteOffset", 0)
        data = self._buffer(entry["buffer"])[start : start + entry["byteLength"]]
        return data, entry.get("byteStride", 0)

    def _accessor(self, k: int) -> Array:
        entry = self.document["accessors"][k]
        data, stride = self._view(entry["bufferView"])
        kind = np.dtype(_COMPONENT[entry["componentType"]])
        width = _WIDTH[entry["type"]]
        step = stride or kind.itemsize * width
        values: Array = np.ndarray(
            (entry["count"], width),
            dtype=kind,
            buffer=data,
            offset=entry.get("byteOffset", 0),
            strides=(step, kind.itemsize),
        )
        return values

    def _primitive(self, entry: dict[str, Any]) -> Part | None:
        """Return the triangles of a primitive; None if it has lines or points."""
        if entry.get("mode", _TRIANGLES) != _TRIANGLES:
            return None
        packed = entry.get("extensions", {}).get("KHR_draco_mesh_compression")
        if packed is not None:
            import DracoPy

            decoded = DracoPy.decode(self._view(packed["bufferView"])[0])
            points = np.asarray(decoded.points, dtype=float).reshape(-1, 3)
            return points, np.asarray(decoded.faces).reshape(-1, 3)
        points = np.asarray(self._accessor(entry["attributes"]["POSITION"]), dtype=float)
        if "indices" in entry:
            faces = np.asarray(self._accessor(entry["indices"]), dtype=np.int64).reshape(-1, 3)
        else:
            faces = np.arange(len(points) // 3 * 3).reshape(-1, 3)
        return points, faces

    def parts(self, index: int, parent: Array, skip: Sequence[str]) -> Iterator[Part]:
        """Yield the triangles of a node and of those below it, moved by their transforms."""
        node = self.document["nodes"][index]
        if node.get("name", "") in skip:
            return
        here = parent @ _node_matrix(node)
        mesh = self.document["meshes"][node["mesh"]] if "mesh" in node else {"primitives": ()}
        if mesh.get("name", "") not in skip:
            for entry in mesh["primitives"]:
                part = self._primitive(entry)
                if part is not None:
                    yield part[0] @ here[:3, :3].T + here[:3, 3], part[1]
        for child in node.get("children", ()):
            yield from self.parts(child, here, skip)


def _node_matrix(node: dict[str, Any]) -> Array:
    if "matrix" in node:
        matrix: Array = np.array(node["matrix"], dtype=float).reshape(4, 4).T
        return matrix
    from rover_iface.frames import rotation_from_quaternion

    x, y, z, w = node.get("rotation", (0.0, 0.0, 0.0, 1.0))
    matrix = np.eye(4)
    matrix[:3, :3] = rotation_from_quaternion(w, x, y, z) * np.array(node.get("scale", (1.0, 1.0, 1.0)))
    matrix[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return matrix
