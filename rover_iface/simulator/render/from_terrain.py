"""A scene made of a `Terrain`: ground in rings of growing coarseness, its rocks, and small stones."""

from __future__ import annotations

import hashlib
import math
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from rover_iface.simulator.render.look import Look
from rover_iface.simulator.render.scene import Array, Material, Scene, SceneMesh
from rover_iface.streams import stream
from rover_iface.terrain.banks import bank_depth, sandy
from rover_iface.terrain.fractal import smooth_step
from rover_iface.terrain.rock_shapes import CREASE_RAD, SHARP
from rover_iface.terrain.rocks import Mesh, Rock, natural_detail, rock_meshes
from rover_iface.terrain.surface import Surface
from rover_iface.terrain.terrain import Terrain

DUST_ALBEDO = 0.27
"""Albedo of settled dust, of the bright regions of Mars (0.25 to 0.30 in Viking's and TES's maps)."""


def scene_from_terrain(
    terrain: Terrain,
    centre: tuple[float, float] = (0.0, 0.0),
    *,
    radius_m: float = 16.0,
    spacing_m: float = 0.05,
    far_m: float = 120.0,
    stones_per_m2: float | None = None,
    gravel: float | None = None,
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
        Stones of 2.5 to 9 cm, too small for the terrain's rock list, strewn as bodies over the middle 12 m;
        as many as the terrain's surface has if absent, and so for `gravel`.
    """
    surface = terrain.surface or Surface()
    stones_per_m2 = surface.stones_per_m2 if stones_per_m2 is None else stones_per_m2
    gravel = surface.gravel if gravel is None else gravel
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
    named = {rock.id: rock for rock in rocks}
    meshes += [_rock_body(mesh, named[mesh.id]) for mesh in _rock_meshes(rocks, centre)]
    stones = _stones(terrain, centre, min(12.0, radius_m), stones_per_m2, seed)
    if stones is not None:
        meshes.append(stones)
    look = None if terrain.surface is None else _look(terrain.surface)
    return Scene([m for m in meshes if len(m.triangles)], seed=seed, look=look)


def _look(surface: Surface) -> Look:
    """Return how the ground of a surface is textured."""
    return Look(
        soil_slope=surface.soil_slope,
        soil_mottle=surface.soil_mottle,
        sand=surface.sand,
        grain=surface.grain,
        ripples=surface.ripples,
        wind_rad=surface.wind_rad,
        gravel_mottle=surface.gravel_mottle,
        stone_slope=surface.stone_slope,
        mottle=surface.mottle,
        close_up=1.0,
    )


def _rock_body(mesh: Mesh, rock: Rock) -> SceneMesh:
    """Return a rock as it is rendered: its edges, its colour, and dust on what faces up."""
    if rock.family == "boulder":
        return SceneMesh(
            mesh.vertices, mesh.triangles, mesh.id, Material.ROCK, albedo=rock.albedo or _rock_albedo(mesh.id)
        )
    v, t = mesh.vertices.astype(np.float64), mesh.triangles
    face = np.cross(v[t[:, 1]] - v[t[:, 0]], v[t[:, 2]] - v[t[:, 0]])
    up = np.bincount(t.ravel(), weights=np.repeat(face[:, 2], 3), minlength=len(v))
    size = np.bincount(t.ravel(), weights=np.repeat(np.linalg.norm(face, axis=1), 3), minlength=len(v))
    # dust slides off faces steeper than some 45 degrees, and lies in patches of 10 to 40 cm
    x, y = v[:, 0], v[:, 1]
    patchy = np.sin(15.0 * x + 2.0 * np.sin(23.0 * y)) + np.sin(17.0 * y + 2.0 * np.sin(21.0 * x))
    settled = smooth_step(rock.dust + 0.3 * patchy) * smooth_step((up / np.maximum(size, 1e-12) - 0.7) / 0.25)
    stone = rock.albedo or _rock_albedo(mesh.id)
    return SceneMesh(
        mesh.vertices,
        mesh.triangles,
        mesh.id,
        Material.ROCK,
        albedo=stone + (DUST_ALBEDO - stone) * settled,
        crease_rad=CREASE_RAD if rock.family in SHARP else math.pi,
    )


def _rock_meshes(rocks: list[Rock], centre: tuple[float, float]) -> list[Mesh]:
    """Return meshes of the rocks, fewer triangles with distance."""
    rings: dict[int | None, list[Rock]] = {None: [], 4: [], 3: [], 2: [], 1: []}
    for rock in rocks:
        away = math.hypot(rock.x - centre[0], rock.y - centre[1])
        detail = None if away < 14.0 else 2 if away < 26.0 else 1
        if detail is None and rock.family in SHARP and away >= 7.0:
            detail = natural_detail(rock.diameter, rock.family) - 1
        rings[detail].append(rock)
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
    stony = _gravel(v, gravel)
    if terrain.surface is not None and terrain.surface.banks > 0:
        # `Terrain.mesh` gives a whole raster
        xs, ys = np.unique(mesh.vertices[:, 0]), np.unique(mesh.vertices[:, 1])
        wind = terrain.surface.wind_rad
        depth = bank_depth(xs.astype(float), ys.astype(float), terrain.rocks, terrain.surface.banks, wind)
        stony = (stony * (1.0 - sandy(depth).ravel())).astype(np.float32)
    return SceneMesh(v, t, "", Material.SOIL, albedo=albedo, gravel=stony)


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
    natural = terrain.surface is not None
    power = (terrain.surface or Surface()).stone_power
    # broken off the rocks around, so of their colours under dust; without a geology of any
    stones = np.array([r.albedo for r in terrain.rocks if natural and r.family != "plate"] or [0.13, 0.30])
    colours = np.sort(stones + 0.4 * (DUST_ALBEDO - stones))
    ranks = np.linspace(0.0, 1.0, len(colours))
    # fragments lie on their flat side, half in the soil
    low, spread, foot = (0.22, 0.3, 0.04) if natural else (0.45, 0.4, 0.12)
    table = table[terrain.inside(table[:, 0], table[:, 1])]
    height = terrain.height(table[:, 0], table[:, 1], ground=True)
    vertices, triangles, albedo, start = [], [], [], 0
    for row, z in zip(table, height, strict=True):
        if not math.isfinite(z):
            continue
        points, faces = shapes[int(row[7] * len(shapes))]
        size = 0.02 + 0.075 * row[2] ** power
        squeezed = points * (size, size * (0.55 + 0.45 * row[3]), size * (low + spread * row[4]))
        c, s = math.cos(math.tau * row[5]), math.sin(math.tau * row[5])
        turned = squeezed @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        vertices.append(turned + np.array([row[0], row[1], z + foot * size]))
        triangles.append(faces + start)
        colour = np.interp(row[6], ranks, colours) if natural else 0.13 + 0.17 * row[6]
        albedo.append(np.full(len(points), colour))
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
