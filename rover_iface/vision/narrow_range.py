"""A far target as the narrow pair of the same mast sees it: its range, and its pixel there.

At ten metres the navcams' 20 cm and 1,124 px leave decimetres along the line of sight; the pancams, three
times as fine and half as far again apart, leave centimetres. The pixel designated in the wide picture is
found in the narrow one by the scaled window (`handoff.scaled_window`), turned round: the narrow pixel is
moved until its window is found on the wide one. Mast angles that are off between the two looks do not matter.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rover_iface.cameras.model import Array
from rover_iface.cameras.stereo import PointStereo, point_stereo, triangulate
from rover_iface.vision.tracker import StereoView

SEARCH_PX, LEAST_SCORE, SETTLED_PX, TURNS = 12, 0.7, 0.05, 5
RANGE_PX, BIAS_PX = 0.15, 0.09
"""Error of a patch's disparity, and what those of a scene share: as the feature tracker has them."""
PLACE_PX = 0.3
"""Error of the place in the wide picture; over a slanted face it is one of range."""


PairFor = Callable[[str, Array], StereoView]
"""Takes a pair round a believed point (3,) for the track of a target."""


@dataclass(frozen=True, slots=True)
class KnownRange:
    """Distance of a surface point from a left camera and its standard deviation, metres."""

    range_m: float
    sigma_m: float


@dataclass(frozen=True, eq=False)
class NarrowSight:
    """A designated point in the narrow pair: its pixel (2,) there in the left picture, and its range."""

    view: StereoView
    pixel: Array
    known: KnownRange


def narrow_sight(wide: StereoView, pixel: Array, narrow: StereoView, expected_m: float) -> NarrowSight | None:
    """Return where the narrow pair has what a pixel (2,) of the wide left picture shows.

    `expected_m` is what the wide pair or a map has. None where the narrow picture does not show it, or either
    match is doubtful.
    """
    from rover_iface.vision.handoff import scaled_window

    origin, ray = wide.left_camera.back_project(pixel)
    point = np.asarray(origin + expected_m * ray)
    at = np.asarray(narrow.left_camera.project(point), dtype=np.float64)
    scale = narrow.left_camera.hs / wide.left_camera.hs
    for _ in range(TURNS):
        if not np.isfinite(at).all():
            return None
        found = scaled_window(
            narrow.left, narrow.left_camera, at, wide.left, wide.left_camera, point, search_px=SEARCH_PX
        )
        if found is None or found.score < LEAST_SCORE:
            return None
        off = pixel - found.pixel
        at = at + scale * off
        if float(np.hypot(*off)) < SETTLED_PX:
            break
    else:
        return None
    match = point_stereo(
        narrow.left,
        narrow.right,
        narrow.left_camera,
        narrow.right_camera,
        at,
        options=PointStereo(sigma_px=RANGE_PX / math.sqrt(2.0)),
        expected_range_m=expected_m,
        range_spread=0.3,
    )
    if match is None or match.score < LEAST_SCORE:
        return None
    return NarrowSight(narrow, at, _known(wide, narrow, match.point, match.right_px, at, match.normal))


def _known(
    wide: StereoView, narrow: StereoView, point: Array, right_px: Array, left_px: Array, normal: Array
) -> KnownRange:
    """Return the range of a point (3,) from the wide left camera, with what stereo and place may be off."""
    sigma_px = math.hypot(RANGE_PX / math.sqrt(2.0), BIAS_PX)
    cameras = narrow.left_camera, narrow.right_camera
    covariance = triangulate(*cameras, left_px[None], right_px[None], sigma_px=sigma_px)[1][0]
    ray = point - wide.left_camera.C
    away = float(np.linalg.norm(ray))
    ray = ray / away
    facing = max(0.2, abs(float(normal @ ray)))
    slanted = math.sqrt(1.0 - min(1.0, facing) ** 2) / facing
    place_m = PLACE_PX * away / wide.left_camera.hs * slanted
    return KnownRange(away, math.sqrt(float(ray @ covariance @ ray) + place_m**2))
