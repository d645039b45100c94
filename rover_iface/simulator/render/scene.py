"""What the renderer looks at: triangles with colour, material and identity, in one ray-casting structure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import lru_cache
from typing import TypedDict

import numpy as np
import numpy.typing as npt

from rover_iface.errors import RenderError
from rover_iface.simulator.render.look import Look

Array = npt.NDArray[np.float64]


class Material(IntEnum):
    """How a surface is textured below its triangles."""

    SOIL = 0
    ROCK = 1
    PLAIN = 2


class Hits(TypedDict):
    """First hits of n rays: distance (1e37: none), triangle, barycentric coordinates, normal (n, 3)."""

    tfar: npt.NDArray[np.float32]
    primID: npt.NDArray[np.int32]
    u: npt.NDArray[np.float32]
    v: npt.NDArray[np.float32]
    Ng: npt.NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class SceneMesh:
    """A body in the scene.

    Attributes
    ----------
    vertices
        (n, 3), site frame, metres.
    triangles
        (m, 3), counter-clockwise seen from outside.
    id
        Name told by the per-pixel truth ("" for ground).
    albedo
        One number or (n,) per vertex, 0..1.
    gravel
        Share of loose stones on soil, 0..1, one number or (n,) per vertex.
    smooth
        Whether normals are shared over triangles (ground, worn rock) or each triangle is flat.
    crease_rad
        Triangles that meet at more than this share no normal, so that edges stay sharp; pi: all share.
    """

    vertices: npt.NDArray[np.floating]
    triangles: npt.NDArray[np.integer]
    id: str = ""
    material: Material = Material.SOIL
    albedo: float | npt.NDArray[np.floating] = 0.25
    gravel: float | npt.NDArray[np.floating] = 0.5
    smooth: bool = True
    crease_rad: float = math.pi


class Scene:
    """All bodies of a scene, ready for rays. Built once, read by any number of views.

    Parameters
    ----------
    meshes
        At least one. Bodies may touch and interpenetrate.
    seed
        Of the procedural texture.
    look
        What a renderer of it takes where it is given none; none: the default.

    Raises
    ------
    RenderError
        If a mesh is empty, its indices run out of range, or a vertex is not finite.
    """

    def __init__(self, meshes: Sequence[SceneMesh], *, seed: int = 0, look: Look | None = None) -> None:
        if not meshes:
            raise RenderError("a scene needs at least one mesh")
        self.seed = seed
        self.look = look
        self.ids: tuple[str, ...] = tuple(mesh.id for mesh in meshes)
        vertices, triangles, objects, normals = [], [], [], []
        albedo: list[npt.NDArray[np.float32]] = []
        gravel: list[npt.NDArray[np.float32]] = []
        start = 0
        for number, mesh in enumerate(meshes):
            v = np.asarray(mesh.vertices, dtype=np.float64)
            t = np.asarray(mesh.triangles, dtype=np.int64)
            _check_mesh(v, t, mesh.id or f"number {number}")
            creased = mesh.smooth and mesh.crease_rad < math.pi
            parted = creased or not mesh.smooth
            shared = t
            if parted:
                v, t = v[t].reshape(-1, 3), np.arange(3 * len(t)).reshape(-1, 3)
            vertices.append(v)
            triangles.append(t + start)
            objects.append(np.full(len(t), number, np.int32))
            normals.append(_creased_normals(v, shared, mesh.crease_rad) if creased else _vertex_normals(v, t))
            for values, given in ((albedo, mesh.albedo), (gravel, mesh.gravel)):
                filled = np.asarray(given, dtype=np.float32)
                if filled.ndim == 1 and parted:
                    filled = filled[np.asarray(mesh.triangles)].reshape(-1)
                if filled.ndim and len(filled) != len(v):
                    raise RenderError(
                        f"mesh {mesh.id or number}: {len(filled)} vertex values for {len(v)} vertices"
                    )
                values.append(np.broadcast_to(filled, (len(v),)))
            start += len(v)
        points = np.concatenate(vertices)
        self.origin: Array = np.floor(0.5 * (points.min(axis=0) + points.max(axis=0)))
        self.vertices = np.ascontiguousarray(points - self.origin, dtype=np.float32)
        self.triangles = np.ascontiguousarray(np.concatenate(triangles), dtype=np.int32)
        self.objects = np.concatenate(objects)
        self.normals = np.concatenate(normals).astype(np.float32)
        self.albedo = np.ascontiguousarray(np.concatenate(albedo), dtype=np.float32)
        self.gravel = np.ascontiguousarray(np.concatenate(gravel), dtype=np.float32)
        self.materials = np.array([int(mesh.material) for mesh in meshes], dtype=np.int32)
        self._embree = self._build()

    def _build(self) -> object:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        scene = EmbreeScene()
        TriangleMesh(scene, self.vertices, self.triangles)
        scene.run(np.zeros((1, 3), np.float32), np.array([[0, 0, 1.0]], np.float32))  # builds now, not later
        return scene

    @property
    def triangle_count(self) -> int:
        """Return the number of triangles."""
        return len(self.triangles)

    def cast(self, origins: npt.ArrayLike, directions: npt.ArrayLike) -> Hits:
        """Return first hits of rays (n, 3), site frame, m: `tfar` (1e37: none), `primID`, `u`, `v`, `Ng`."""
        o = np.ascontiguousarray(np.asarray(origins, dtype=np.float64) - self.origin, dtype=np.float32)
        d = np.ascontiguousarray(directions, dtype=np.float32)
        return self._embree.run(o, d, query="INTERSECT", output=1)  # type: ignore[attr-defined]

    def cast_local(self, origins: npt.NDArray[np.float32], directions: npt.NDArray[np.float32]) -> Hits:
        """Return first hits of rays [n, 3], float32, whose origins are relative to `origin` already; site
        axes, m.
        """
        return self._embree.run(origins, directions, query="INTERSECT", output=1)  # type: ignore[attr-defined]

    def occluded_local(
        self, origins: npt.NDArray[np.float32], directions: npt.NDArray[np.float32]
    ) -> npt.NDArray[np.bool_]:
        """Return which rays [n, 3] (float32, origins relative to `origin`, site axes, m) meet anything."""
        hits = self._embree.run(origins, directions, query="OCCLUDED")  # type: ignore[attr-defined]
        return np.asarray(hits >= 0)

    def ranges(self, origins: npt.ArrayLike, directions: npt.ArrayLike) -> Array:
        """Return distances (n,), m, along unit rays (n, 3), site frame, to the first hit, inf for none."""
        d = np.asarray(directions, dtype=np.float64).reshape(-1, 3)
        o = np.broadcast_to(np.asarray(origins, dtype=np.float64), d.shape)
        far = self.cast(o, d)["tfar"].astype(np.float64)
        return np.where(far > 1e30, np.inf, far)

    def sees(
        self, eye: npt.ArrayLike, points: npt.ArrayLike, tolerance_m: float = 0.02
    ) -> npt.NDArray[np.bool_]:
        """Return which points (n, 3) nothing hides from `eye` (3,); site frame, m."""
        rays = np.asarray(points, dtype=np.float64).reshape(-1, 3) - np.asarray(eye, dtype=np.float64)
        distance = np.linalg.norm(rays, axis=1)
        return np.asarray(self.ranges(eye, rays / distance[:, None]) > distance - tolerance_m)

    def require_above_ground(self, eye: npt.ArrayLike, what: str = "camera") -> None:
        """Raise `RenderError` if a point [3], site frame, m, lies below the ground or inside a rock."""
        point = np.asarray(eye, dtype=np.float64)
        hit = self.cast(point[None], np.array([[0.0, 0.0, 1.0]]))
        if float(hit["tfar"][0]) < 1e30 and float(hit["Ng"][0, 2]) > 0:
            place = ", ".join(f"{v:.2f}" for v in point)
            raise RenderError(f"{what} at ({place}) m is {float(hit['tfar'][0]):.2f} m below the surface")


def _check_mesh(v: Array, t: npt.NDArray[np.int64], name: str) -> None:
    if v.ndim != 2 or v.shape[1] != 3 or t.ndim != 2 or t.shape[1] != 3 or not len(t):
        raise RenderError(
            f"mesh {name}: vertices {v.shape} and triangles {t.shape}; (n, 3) and (m, 3) are needed"
        )
    if not np.isfinite(v).all():
        raise RenderError(f"mesh {name}: {int((~np.isfinite(v)).any(axis=1).sum())} vertices are not finite")
    if t.min() < 0 or t.max() >= len(v):
        raise RenderError(f"mesh {name}: triangle index {int(t.max())} with {len(v)} vertices")


def _vertex_normals(v: Array, t: npt.NDArray[np.int64]) -> Array:
    """Return unit normals (n, 3), the area-weighted mean of the triangles round each vertex."""
    from rover_iface.simulator.render.normals import smooth

    normals = np.empty_like(v)
    smooth(v, t, normals)
    return normals


def _creased_normals(corners: Array, t: npt.NDArray[np.int64], crease_rad: float) -> Array:
    """Return unit normals [3 m, 3] of the corners of triangles [m, 3]: the area-weighted mean of those round
    the same vertex that lie within an angle of the corner's own.
    """
    from rover_iface.simulator.render.normals import creased

    a, b, c = corners[0::3], corners[1::3], corners[2::3]
    face = np.cross(b - a, c - a)
    normals = np.empty_like(corners)
    creased(face, t, *_round_vertices(t.tobytes()), math.cos(crease_rad), normals)
    return normals


@lru_cache(maxsize=8)
def _round_vertices(triangles: bytes) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Return where the triangles round each vertex begin, and these; bodies share few topologies."""
    vertex = np.frombuffer(triangles, np.int64)
    order = np.argsort(vertex, kind="stable")
    return np.searchsorted(vertex[order], np.arange(int(vertex.max()) + 2)), order // 3
