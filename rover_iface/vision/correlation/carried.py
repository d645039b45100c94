"""A target that is not found, carried along by what lies round it.

That is often seen where the target is not: behind a board, or in its own shadow. Then its features say how
the rover has moved, and the target goes with them from stop to stop, as those of the feature tracker do. Dead
reckoning is asked only for the steps between which nothing is recognised.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rover_iface.cameras.model import Array
from rover_iface.vision.reacquisition import KnownPair, sharpened
from rover_iface.vision.tracker import StereoView

TURNED_RAD = 0.005
"""Error of the line of sight after a step that only dead reckoning tells: 0.24 degrees of heading over a
metre, 0.07 of the mast (Kim et al. 2009, section 7.2; docs/results/tracking.md, the flight runs), and as much
again of roll and pitch."""


@dataclass(frozen=True, slots=True, eq=False)
class Carried:
    """A target that is not found, as its surroundings have it.

    Attributes
    ----------
    pair
        The last pair, in which the surroundings are known.
    point, covariance
        (3,), m, and (3, 3), m^2, in the frame of that pair.
    unbroken
        Whether they have been recognised in every pair since the target was seen.
    """

    pair: KnownPair
    point: Array
    covariance: Array
    unbroken: bool

    def to(self, pair: KnownPair, view: StereoView, moved_m: float, share: float) -> Carried:
        """Return the target in the next pair; `share` is the error of dead reckoning over `moved_m`."""
        rough = self.pair.pose(view)
        sharp = rough if isinstance(rough, str) else sharpened(self.pair, self.point, view, rough)
        if isinstance(sharp, str):
            away = float(np.linalg.norm(self.point - view.left_camera.C))
            drift2_m2 = (share * moved_m) ** 2 + (TURNED_RAD * away) ** 2
            return Carried(pair, self.point, self.covariance + drift2_m2 * np.eye(3), unbroken=False)
        point, covariance = sharp[0].at(self.point, self.covariance)
        return Carried(pair, point, covariance, self.unbroken)
