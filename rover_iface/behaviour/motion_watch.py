"""Visual odometry beside the wheels: what each step of a drive came to by the navigator's own pictures."""

from __future__ import annotations

import json
import math

import numpy as np

from rover_iface.frames import Pose
from rover_iface.localization.visual_odometry import StepState, VisualOdometer
from rover_iface.vision.tracker import StereoView


class MotionWatch:
    """Compares dead reckoning with pictures, step by step; the navigator's pairs serve, none is taken for it.

    It tells and does not correct: tracks and arrival are judged by where targets are seen, and what a step
    slipped is known only after it.
    """

    def __init__(self) -> None:
        self._odometer = VisualOdometer()
        self._at: Pose | None = None
        self.rows: list[dict[str, object]] = []

    def see(self, view: StereoView, believed: Pose) -> None:
        """Take the next pair, cameras in the rover frame, from where the rover believes to be."""
        here = believed.site_from_rover
        before = here if self._at is None else self._at.site_from_rover
        wheels = before.inverse() * here
        step = self._odometer.step(view, wheels)
        self._at = believed
        if step is None:
            return
        sigma = np.sqrt(np.diag(step.covariance)[3:])
        self.rows.append(
            {
                "t_s": view.t_s,
                "state": step.state.value,
                "features": step.features,
                "wheels_m": [float(v) for v in wheels.translation],
                "pictures_m": [float(v) for v in step.old_from_new.translation],
                "sigma_m": [float(v) for v in sigma],
                "slip": None if math.isnan(step.slip) else step.slip,
                "reason": step.reason,
            }
        )

    @property
    def slipped(self) -> int:
        """Return in how many steps pictures and wheels differed by more than chance."""
        return sum(row["state"] == StepState.SLIP.value for row in self.rows)

    def table(self) -> bytes:
        """Return the steps as JSON, one row each."""
        return (json.dumps(self.rows) + "\n").encode()
