"""Pairs in which a target is known, and which of them shows it as it is seen now.

The first narrow picture tells which spot was meant. A rock that is come to from another side shows another
face: dozens of patches are found again up to some 45 degrees round a target, hardly any beyond 50. So as the
line of sight turns, more narrow pairs are kept, each tied to one before it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from rover_iface.cameras.model import Array
from rover_iface.vision.handoff import Side


@dataclass(frozen=True, slots=True, eq=False)
class Kept:
    """A pair, the target's pixel in it, where it was believed then (3,), m, and how well that is known."""

    side: Side
    pixel: Array
    point: Array
    sigma_m: float

    def turned_rad(self, eye: Array, place: Array) -> float:
        """Return the angle between its line of sight and that from an eye (3,) to a place (3,), m.

        Its own is that of its time: headings drift by far less than what matters here.
        """
        return angle_rad(self.point - self.side.view.left_camera.C, place - eye)


@dataclass(slots=True, eq=False)
class References:
    """The narrow pairs that are kept of a target, the first one first, and the last wide one."""

    narrow: list[Kept]
    near: Kept | None = None
    tried: list[Array] = field(default_factory=list)
    """Lines of sight (3,), m, along which another narrow pair was taken since the last that is kept."""

    def likeliest(self, eye: Array, place: Array, most: int = 2) -> list[Kept]:
        """Return the narrow pairs taken from nearest to the line from an eye (3,) to a place (3,), m."""
        return sorted(self.narrow, key=lambda kept: kept.turned_rad(eye, place))[:most]

    def turned(self, eye: Array, place: Array, by_rad: float, again_rad: float) -> bool:
        """Return whether the line of sight has turned by an angle from all that are kept, and by another from
        all that were tried since.
        """
        ray = place - eye
        return all(kept.turned_rad(eye, place) >= by_rad for kept in self.narrow) and all(
            angle_rad(before, ray) >= again_rad for before in self.tried
        )

    def keep(self, kept: Kept) -> None:
        """Keep another narrow pair."""
        self.narrow.append(kept)
        self.tried.clear()


def angle_rad(one: Array, other: Array) -> float:
    """Return the angle between two vectors (3,)."""
    cosine = float(one @ other) / float(np.linalg.norm(one) * np.linalg.norm(other))
    return math.acos(min(1.0, max(-1.0, cosine)))
