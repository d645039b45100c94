"""A scene made of a `Terrain`: ground in rings of growing coarseness, its rocks, and small stones."""

from __future__ import annotations

import hashlib
import math
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from rover_iface.simulator.render.scene import Array, Material, Scene, SceneMesh
from rover_iface.streams import stream
from rover_iface.terrain.rocks import Mesh, Rock, rock_meshes
from rover_iface.terrain.terrain import Terrain


def scene_from_terrain(
    terrain: Terrain,
    centre: tuple[float, float] = (0.0, 0.0),
    *,
    radius_m: float = 16.0,
    spacing_m: float = 0.05,
    far_m: float = 120.0,
    stones_per_m2: float = 6.0,
    gravel: float = 0.55,
    seed: int = 0,
) -> Scene:
    """Return the scene round a point of a terrain.

    Parameters
    ----------
    radius_m, spacing_m
        Half side and post distance of the fine middle part; outwards the posts are 4 and 16 times as far.
    far_m
        How far the ground reaches at most.
    stones_per_m2
        Stones of 2.5 to 9 cm, too small for the terrain's rock list, strewn as bodies over the middle 12 m.
    """
    meshes: list[SceneMesh] = []
    x, y = centre
    west, south, east, north = terrain.bounds
    step, inner, sink = spacing_m, 0.0, 0.0
    outer = radius_m
    while True:
        box = (
            max(west, x - outer),
            max(south, y - outer),
            min(east, x + outer),
            min(north, y + outer),
        )
        meshes.append(_ground(terrain, box, centre, inner, step, sink, gravel))
        if outer >= far_m or (box == (west, south, east, north)):
            break
        inner, outer, step = outer, min(far_m, outer * 3.0), step * 4.0
        sink += 0.045 * step
    rocks = terrain.rocks_near(x, y, min(far_m, 60.0)) if terrain.rocks else []
    meshes += [
        SceneMesh(mesh.vertices, mesh.triangles, mesh.id, Material.ROCK, albedo=_rock_albedo(mesh.id))
        for mesh in _rock_meshes(rocks, centre)
    ]
    stones = _stones(terrain, centre, min(12.0, radius_m), stones_per_m2, seed)
    if stones is not None:
        meshes.append(stones)
    return Scene([m for m in meshes if len(m.triangles)], seed=seed)


def _rock_meshes(rocks: list[Rock], centre: tuple[float, float]) -> list[Mesh]:
    """Return meshes of the rocks, fewer triangles with distance."""
    rings: dict[int | None, list[Rock]] = {None: [], 2: [], 1: []}
    for rock in rocks:
        away = math.hypot(rock.x - centre[0], rock.y - centre[1])
        rings[None if away < 14.0 else 2 if away < 26.0 else 1].append(rock)
    return [mesh for detail, part in rings.items() for mesh in rock_meshes(part, detail=detail)]


def _rock_albedo(name: str) -> float:
    """Return the albedo of a rock, spread round 0.2 by its name."""
    share = hashlib.sha256(name.encode()).digest()[0] / 255.0
    return 0.14 + 0.16 * share


def _ground(
    terrain: Terrain,
    box: tuple[float, float, float, float],
    centre: tuple[float, float],
    inner: float,
    step: float,
    sink: float,
    gravel: float,
) -> SceneMesh:
    mesh = terrain.mesh(box, step, ground=True)
    v = mesh.vertices.astype(np.float64)
    t = mesh.triangles
    if inner > 0:
        # leave the middle out, but overlap by two posts and lie a little lower: no cracks
        away = np.maximum(np.abs(v[:, 0] - centre[0]), np.abs(v[:, 1] - centre[1])) > inner - 2 * step
        t = t[away[t].any(axis=1)]
        v[:, 2] -= sink
    albedo = _ortho_albedo(terrain, v)
    return SceneMesh(v, t, "", Material.SOIL, albedo=albedo, gravel=_gravel(v, gravel))


def _gravel(v: Array, mean: float) -> npt.NDArray[np.float32]:
    """Return how stony the ground is: patches of some metres between fines and gravel."""
    wave = (
        np.sin(0.9 * v[:, 0] + 1.3 * np.sin(0.47 * v[:, 1]))
        + np.sin(1.1 * v[:, 1] + 1.7 * np.sin(0.61 * v[:, 0]))
        + 0.7 * np.sin(2.3 * v[:, 0] - 1.9 * v[:, 1])
    )
    return np.clip(mean * (1.0 + 0.35 * wave), 0.05, 1.0).astype(np.float32)


def _ortho_albedo(terrain: Terrain, v: Array) -> npt.NDArray[np.float32]:
    """Return per-vertex albedo from the finest ortho image over each vertex; its mean is set to 0.25."""
    values = np.full(len(v), np.nan)
    for ortho in terrain.orthos:
        grey = _grey(ortho.rgb)
        rows, columns = grey.shape
        west, south, east, north = ortho.bounds
        u = (v[:, 0] - west) / (east - west) * columns - 0.5
        w = (north - v[:, 1]) / (north - south) * rows - 0.5
        inside = (u >= 0) & (u <= columns - 1) & (w >= 0) & (w <= rows - 1) & np.isnan(values)
        values[inside] = grey[np.round(w[inside]).astype(int), np.round(u[inside]).astype(int)]
    known = np.isfinite(values)
    if not known.any():
        return np.full(len(v), 0.25, np.float32)
    values = np.where(known, values, np.nanmean(values))
    # an ortho image holds the light of its day: keep half of its contrast
    relative = (values / max(1e-6, float(values.mean()))) ** 0.5
    return np.clip(0.25 * relative, 0.08, 0.5).astype(np.float32)


def _grey(image: npt.NDArray[np.generic]) -> Array:
    pixels = np.asarray(image, dtype=np.float64)
    return pixels if pixels.ndim == 2 else pixels[..., :3].mean(axis=-1)


@lru_cache(maxsize=1)
def _stone_shapes() -> tuple[tuple[Array, npt.NDArray[np.int64]], ...]:
    """Return 32 angular stones of diameter 1: hulls of a few points, as broken rock is."""
    from scipy.spatial import ConvexHull

    shapes = []
    for number in range(32):
        rng = np.random.default_rng([0x570E, number])
        points = rng.normal(size=(int(rng.integers(9, 15)), 3))
        points /= np.linalg.norm(points, axis=1, keepdims=True)
        points *= rng.uniform(0.75, 1.0, size=(len(points), 1)) * 0.5
        hull = ConvexHull(points)
        triangles = hull.simplices.astype(np.int64)
        corners = points[triangles]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        inward = (normal * (corners[:, 0] - points[hull.vertices].mean(axis=0))).sum(axis=1) < 0
        triangles[inward] = triangles[inward][:, ::-1]
        shapes.append((points, triangles))
    return tuple(shapes)


def _stones(
    terrain: Terrain, centre: tuple[float, float], radius: float, density: float, seed: int
) -> SceneMesh | None:
    """Return the small stones; each square metre has its own stream: a moved centre leaves them in place."""
    if density <= 0:
        return None
    shapes = _stone_shapes()
    draws = []
    for i in range(math.floor(centre[0] - radius), math.ceil(centre[0] + radius)):
        for j in range(math.floor(centre[1] - radius), math.ceil(centre[1] + radius)):
            rng = stream("small stones", seed, i & 0xFFFF, j & 0xFFFF)
            block = rng.random((rng.poisson(density), 8))
            block[:, :2] += (i, j)
            draws.append(block)
    table = np.concatenate(draws)
    table = table[terrain.inside(table[:, 0], table[:, 1])]
    height = terrain.height(table[:, 0], table[:, 1], ground=True)
    vertices, triangles, albedo, start = [], [], [], 0
    for row, z in zip(table, height, strict=True):
        if not math.isfinite(z):
            continue
        points, faces = shapes[int(row[7] * len(shapes))]
        size = 0.02 + 0.075 * row[2] ** 3
        squeezed = points * (size, size * (0.55 + 0.45 * row[3]), size * (0.45 + 0.4 * row[4]))
        c, s = math.cos(math.tau * row[5]), math.sin(math.tau * row[5])
        turned = squeezed @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        vertices.append(turned + np.array([row[0], row[1], z + 0.12 * size]))
        triangles.append(faces + start)
        albedo.append(np.full(len(points), 0.13 + 0.17 * row[6]))
        start += len(points)
    if not vertices:
        return None
    return SceneMesh(
        np.concatenate(vertices),
        np.concatenate(triangles),
        "",
        Material.ROCK,
        albedo=np.concatenate(albedo),
        smooth=False,
    )
