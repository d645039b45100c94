"""Pairs in which a target is known, and which of them shows it as it is seen now.

The first narrow picture tells which spot was meant. A rock that is come to from another side shows another
face, and hours later other shadows: dozens of patches are found again up to some 45 degrees round a target,
hardly any beyond 50, and in the light of three hours later often none. So as the line of sight turns and the
sun goes on, more narrow pairs are kept, each tied to one before it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rover_iface.cameras.model import Array
from rover_iface.vision.handoff import Side

SUN_RAD_S = math.tau / 86_400.0
"""How fast the sun goes round, near enough on Earth and Mars."""
SCALE_RAD = 0.3
"""Angle that counts as much as a range that is e times another. By hand."""


@dataclass(frozen=True, slots=True, eq=False)
class Kept:
    """A pair, the target's pixel in it, where it was believed then (3,), m, and what the pixel is off.

    `sigma_m` is one standard deviation across the line of sight, m. It holds what the pair that it was tied
    to left open, so in a chain of pairs it grows.
    """

    side: Side
    pixel: Array
    point: Array
    sigma_m: float

    def turned_rad(self, eye: Array, place: Array) -> float:
        """Return the angle between its line of sight and that from an eye (3,) to a place (3,), m.

        Its own is that of its time: headings drift by far less than what matters here.
        """
        return angle_rad(self.point - self.side.view.left_camera.C, place - eye)

    def sun_rad(self, t_s: float) -> float:
        """Return how far the sun has gone round since it was taken."""
        return SUN_RAD_S * abs(t_s - self.side.view.t_s)

    def unlike_rad(self, eye: Array, place: Array, t_s: float) -> float:
        """Return how differently it shows the target: by line of sight, light and scale."""
        was_m = float(np.linalg.norm(self.point - self.side.view.left_camera.C))
        scale_rad = SCALE_RAD * math.log(was_m / float(np.linalg.norm(place - eye)))
        return math.hypot(self.turned_rad(eye, place), self.sun_rad(t_s), scale_rad)


@dataclass(slots=True, eq=False)
class References:
    """The narrow pairs that are kept of a target, the first one first, and the last wide one."""

    narrow: list[Kept]
    near: Kept | None = None
    tried: tuple[Array, float] | None = None
    """The line of sight (3,), m, along which another narrow pair was taken last in vain, and when, s."""

    def likeliest(self, eye: Array, place: Array, t_s: float, most: int = 2) -> list[Kept]:
        """Return the narrow pairs that show a place (3,), m, most as an eye (3,), m, sees it at a time."""
        return sorted(self.narrow, key=lambda kept: kept.unlike_rad(eye, place, t_s))[:most]

    def outdated(self, eye: Array, place: Array, t_s: float, by_rad: float, again_rad: float) -> bool:
        """Return whether the line of sight from an eye (3,) to a place (3,), m, or the sun have turned by an
        angle from each pair that is kept, and by another since one was taken in vain.
        """
        if min(max(k.turned_rad(eye, place), k.sun_rad(t_s)) for k in self.narrow) < by_rad:
            return False
        if self.tried is None:
            return True
        ray, when_s = self.tried
        return max(angle_rad(ray, place - eye), SUN_RAD_S * (t_s - when_s)) >= again_rad

    def keep(self, kept: Kept) -> None:
        """Keep another narrow pair."""
        self.narrow.append(kept)
        self.tried = None


def angle_rad(one: Array, other: Array) -> float:
    """Return the angle between two vectors (3,)."""
    cosine = float(one @ other) / float(np.linalg.norm(one) * np.linalg.norm(other))
    return math.acos(min(1.0, max(-1.0, cosine)))
