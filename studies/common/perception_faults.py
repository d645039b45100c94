"""What goes wrong in an approach, put into rendered pictures by their own geometry."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from rover_iface.frames import Transform
from studies.common.perception_worlds import Halt, Sequence, Shot
from studies.common.tracking_worlds import Array

Mask = npt.NDArray[np.bool_]
BODY = ((-0.6, -0.5, 0.2), (0.45, 0.5, 0.7))
MAST = ((0.2, -0.12, 0.7), (0.4, 0.12, 1.6))


def in_box(origins: Array, rays: Array, low: Array, high: Array) -> Array:
    """Return where rays (..., 3) enter a box, as multiples of the ray, inf where they miss it."""
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b = (low - origins) / rays, (high - origins) / rays
    first, last = np.minimum(a, b).max(axis=-1), np.maximum(a, b).min(axis=-1)
    return np.where((first <= last) & (last > 0), np.maximum(first, 0.0), np.inf)


def own_shadow(halt: Halt, rng: np.random.Generator) -> Halt:
    """Return the stop with the rover's body and mast between the scene and a sun 22 degrees high."""
    direction = np.array(halt.sun.direction)
    level = direction[:2] / np.linalg.norm(direction[:2])
    elevation = math.radians(22.0)
    to_sun = np.array([*(math.cos(elevation) * level), math.sin(elevation)])
    rover_from_site = halt.pose.site_from_rover.inverse()

    def shade(shot: Shot) -> Shot:
        points = np.asarray(rover_from_site.apply(np.nan_to_num(shot.points(), posinf=1e6, neginf=-1e6)))
        rays = np.broadcast_to(rover_from_site.rotate(to_sun), points.shape)
        dark = np.zeros(shot.image.shape, bool)
        for low, high in (BODY, MAST):
            dark |= np.isfinite(in_box(points, rays, np.array(low), np.array(high)))
        dark &= np.isfinite(shot.range_m)
        return replace(shot, image=_noisy(shot.image * np.where(dark, 0.3, 1.0), rng))

    return replace(halt, left=shade(halt.left), right=shade(halt.right))


def board(halt: Halt, target: Array, rng: np.random.Generator, *, side_m: float = 0.4) -> Halt:
    """Return the stop with a speckled board between rover and target, upright, two thirds of the way."""
    eye = halt.left.true.C
    middle = eye + 0.67 * (target - eye)
    across = np.cross(target - eye, [0.0, 0.0, 1.0])
    across /= np.linalg.norm(across)
    up = np.array([0.0, 0.0, 1.0])
    normal = np.cross(across, up)
    texture = rng.uniform(30, 200, (64, 64))

    def cover(shot: Shot) -> Shot:
        u, v = np.meshgrid(np.arange(shot.image.shape[1]), np.arange(shot.image.shape[0]))
        origins, rays = shot.true.back_project(np.stack((u, v), axis=-1).astype(float))
        reach = ((middle - origins) @ normal) / (rays @ normal)
        at = origins + reach[..., None] * rays - middle
        x, y = at @ across / side_m + 0.5, at @ up / side_m + 0.5
        hit = (x >= 0) & (x < 1) & (y >= 0) & (y < 1) & (reach > 0) & (reach < shot.range_m)
        seen = texture[(y[hit] * 64).astype(int), (x[hit] * 64).astype(int)]
        image = shot.image.astype(float)
        image[hit] = seen
        return replace(shot, image=_noisy(image, rng))

    return replace(halt, left=cover(halt.left), right=cover(halt.right))


def veil(halt: Halt, rng: np.random.Generator, *, left_over: float = 0.03) -> Halt:
    """Return the stop through blown dust: nearly all contrast is gone."""

    def dim(shot: Shot) -> Shot:
        image = 110.0 + left_over * (shot.image.astype(float) - 110.0)
        return replace(shot, image=_noisy(image, rng))

    return replace(halt, left=dim(halt.left), right=dim(halt.right))


def clouds(halt: Halt, rng: np.random.Generator) -> Halt:
    """Return the stop with patches of moving shade over more than half of the scene."""
    places = rng.uniform(-2.5, 2.5, (6, 2))
    sizes = rng.uniform(0.4, 1.2, 6)

    def shade(shot: Shot) -> Shot:
        points = np.nan_to_num(shot.points(), posinf=1e6, neginf=-1e6)
        near = [np.linalg.norm(points[..., :2] - p, axis=-1) / s for p, s in zip(places, sizes, strict=True)]
        dark = 0.35 + 0.65 / (1.0 + np.exp(-12.0 * (np.minimum.reduce(near) - 1.0)).clip(0, 1e6))
        return replace(shot, image=_noisy(shot.image * dark, rng))

    return replace(halt, left=shade(halt.left), right=shade(halt.right))


def carried(halt: Halt, rng: np.random.Generator, panel: npt.NDArray[np.uint8], share: float = 0.45) -> Halt:
    """Return the stop with something that the rover carries along in the lower part of both pictures."""

    def cover(shot: Shot, shift: int) -> Shot:
        image = shot.image.astype(float)
        top = round((1.0 - share) * image.shape[0])
        image[top:] = np.roll(panel, -shift, axis=1)[: image.shape[0] - top, : image.shape[1]]
        return replace(shot, image=_noisy(image, rng))

    return replace(halt, left=cover(halt.left, 0), right=cover(halt.right, 60))


def slipped(halts: list[Halt], first: int, count: int, rng: np.random.Generator, share: float) -> list[Halt]:
    """Return the stops of a rover that slips without noticing: each of `count` moves is off by `share`."""
    out, error = list(halts), Transform.identity()
    for n in range(first, len(halts)):
        halt = halts[n]
        if n < first + count:
            moved = halt.travelled_m - halts[n - 1].travelled_m
            shift = rng.normal(0, 1, 3) * (1.0, 1.0, 0.2)
            shift *= share * moved / np.linalg.norm(shift)
            error = Transform.from_rpy(0.0, 0.0, float(rng.normal(0, 0.02)), shift) * error
        out[n] = replace(
            halt,
            left=replace(halt.left, told=halt.left.told.transformed(error)),
            right=replace(halt.right, told=halt.right.told.transformed(error)),
            told=error * halt.told,
        )
    return out


KINDS = ("occlusion", "dust", "shade", "own shadow", "carried", "hidden", "blank")


def disturbed(sequence: Sequence, kind: str, target: Array, seed: int) -> tuple[list[Halt], range]:
    """Return the stops of an approach in which something goes wrong, and at which of them it does.

    While it lasts (two to four stops) the rover slips by 10 to 40 % of its moves, so that dead reckoning
    cannot hide what the tracker misses.
    """
    rng = np.random.default_rng([sequence.seed, seed, KINDS.index(kind)])
    first = len(sequence.halts) - 6 if kind == "own shadow" else int(rng.integers(3, 12))
    count = 6 if kind == "own shadow" else int(rng.integers(2, 5))
    halts = slipped(sequence.halts, first, count, rng, float(rng.uniform(0.1, 0.4)))
    panel = rng.uniform(20, 220, (60, 70)).repeat(8, axis=0).repeat(8, axis=1).astype(np.uint8)
    apply: dict[str, Callable[[Halt], Halt]] = {
        "occlusion": lambda h: board(h, target, rng, side_m=0.14 * _distance(h, target) ** 0.9),
        "dust": lambda h: veil(h, rng),
        "shade": lambda h: clouds(h, rng),
        "own shadow": lambda h: own_shadow(h, rng),
        "carried": lambda h: carried(h, rng, panel),
        "hidden": lambda h: board(h, target, rng, side_m=1.1 * _distance(h, target)),
        "blank": lambda h: veil(h, rng, left_over=0.0),
    }
    hit = range(first, min(first + count, len(halts)))
    for n in hit:
        halts[n] = apply[kind](halts[n])
    return halts, hit


def _distance(halt: Halt, target: Array) -> float:
    return float(np.linalg.norm(target - halt.left.true.C))


def _noisy(image: Array, rng: np.random.Generator) -> npt.NDArray[np.uint8]:
    noise = rng.normal(0.0, 1.0, image.shape)
    return np.clip(np.round(image + noise), 0, 255).astype(np.uint8)
