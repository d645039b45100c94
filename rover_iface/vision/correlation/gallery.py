"""Earlier views of a target, kept by where they were taken from: what a track is measured against.

A chain of matches adds an error with each of its links. A rover that comes round a rock and back sees what
it has seen before: a match with that view is off by what that view was off by and by one match, however
long the way between. So views from different sides and ranges are kept, and of those the one is compared
that tells the place best from where the rover is now.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rover_iface.cameras.model import Array, CameraModel
from rover_iface.vision.template import Template, grown_drift

MOST_VIEWS = 16
"""Views kept of a target; 161 px and its partner are 0.3 MB."""
OTHER_SCALE, OTHER_TURN_RAD = 1.3, 0.17
"""Ratio of ranges, and angle between lines of sight, from which on a view is another one. By hand: half of
what a plane still warps well (1.7 and 0.35): one such view lies near wherever the rover has been."""
MOST_SCALE, MOST_TURN_RAD = 2.5, 0.9
"""Beyond these two views of a rock share too little. On a textured plane the told 95 % region of a match held
96 % at a scale of 2.5 and 77 % at 3.9, where a patch is 5 px of the old one."""
MATCH_PX = 0.15
"""What a match is off by, in pixels of the coarser view, when views are ranked: any value does that lies
between interpolation (0.05) and grain (0.3), as it is the same for all."""


@dataclass(frozen=True, slots=True, eq=False)
class Kept:
    """A view, and the way that the rover had come when it was taken."""

    template: Template
    travelled_m: float


class Gallery:
    """The views of one target."""

    def __init__(self, first: Template, travelled_m: float) -> None:
        self.views: list[Kept] = [Kept(first, travelled_m)]

    def add(self, template: Template, travelled_m: float) -> None:
        """Keep a view if it is a new one, or tells the place better than the one of its kind.

        The first view stays: it says which spot is meant.
        """
        alike = [k for k in self.views if _alike(k.template, template)]
        if any(_astray_m2(k.template) <= _astray_m2(template) for k in alike):
            return
        self.views = [k for k in self.views if k is self.views[0] or k not in alike]
        self.views.append(Kept(template, travelled_m))
        if len(self.views) > MOST_VIEWS:
            worst = max(self.views[1:], key=lambda k: _astray_m2(k.template))
            self.views.remove(worst)

    def best(self, camera: CameraModel, point: Array, normal: Array) -> list[Kept]:
        """Return the views that a camera's picture of a point (3,) can be compared with, the best first.

        The point, m, and its outward unit `normal` (3,) are in the frame of the cameras. The best view is the
        one whose match would leave the least variance of the point.
        """
        ranked: list[tuple[float, int, Kept]] = []
        away = float(np.linalg.norm(camera.C - point))
        for kept in self.views:
            view = kept.template
            scale = view.range_m / away
            if not 1.0 / MOST_SCALE <= scale <= MOST_SCALE or turned(view, camera.C, point) > MOST_TURN_RAD:
                continue
            noise = (MATCH_PX * max(1.0, scale)) ** 2 * np.eye(2)
            drift, parallax = grown_drift(view, camera, point, normal, noise)
            ranked.append((float(np.trace(drift + parallax @ parallax.T)), len(ranked), kept))
        return [kept for _, _, kept in sorted(ranked, key=lambda r: r[:2])]


def turned(view: Template, eye: Array, point: Array) -> float:
    """Return the angle, radians, between a view's line of sight and that from `eye` (3,) to `point` (3,)."""
    one = (view.camera.C - view.point) / view.range_m
    two = (eye - point) / np.linalg.norm(eye - point)
    return math.acos(max(-1.0, min(1.0, float(one @ two))))


def _alike(a: Template, b: Template) -> bool:
    ratio = max(a.range_m / b.range_m, b.range_m / a.range_m)
    return ratio < OTHER_SCALE and turned(a, b.camera.C, b.point) < OTHER_TURN_RAD


def _astray_m2(view: Template) -> float:
    return float(np.trace(view.uncertainty))
