"""What the navigator sees the ground with: the platform's ranges, or dense stereo of navcam pairs."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Protocol

import numpy as np

from rover_iface.behaviour.hardware import Cloud, Hardware
from rover_iface.behaviour.mast_cameras import MastCameras
from rover_iface.cameras.stereo import dense_stereo
from rover_iface.errors import CameraError, RenderError
from rover_iface.navigation.sensor import StereoSensor
from rover_iface.vision.tracker import StereoView

SCALE = 0.3125
"""Of the navcam's resolution; 320 x 240 for K9's. Stereo is off by 2 to 3 cm (95 %) within 3 m."""

AHEAD = 2
"""Which of the navigator's pointings visual odometry uses: the one of least pan to the left."""

STEP = 3
NEAREST_M = 0.9
FARTHEST_M = 6.0


class Sight(Protocol):
    """What the navigator sees the ground with.

    Attributes
    ----------
    eye
        (3,), from where it looks, rover frame.
    """

    @property
    def eye(self) -> Cloud: ...

    def cost(self, *, around: bool) -> float:
        """Return how many ordinary looks of four stereo pairs a look is worth in time and energy."""

    def look(self, *, around: bool) -> list[Cloud]:
        """Return a cloud (n, 3) per stereo pair, rover frame; `around`: to all sides and near the wheels."""

    def ahead(self) -> StereoView | None:
        """Return the pair of the last look that shows the way ahead, cameras in the rover frame, if any."""


class ScannedSight:
    """A `Sight`: the ranges that the platform's own sensor gives."""

    def __init__(self, hardware: Hardware) -> None:
        self.hardware = hardware
        self._angles = StereoSensor(hardware.profile)

    @property
    def eye(self) -> Cloud:
        """See `Sight`."""
        return self._angles.eye

    def cost(self, *, around: bool) -> float:
        """See `Sight`."""
        return self._angles.pairs_around / len(self._angles.pans) if around else 1.0

    def look(self, *, around: bool) -> list[Cloud]:
        """See `Sight`."""
        return self.hardware.scan(around=around)

    def ahead(self) -> StereoView | None:
        """See `Sight`: ranges are not a picture."""
        return None


class StereoSight(ScannedSight):
    """A `Sight`: at each stop pairs are taken at set pan and tilt, and matched densely.

    The rover knows the mast angles as read; where the mast truly points differs by bias and noise.
    """

    def __init__(self, hardware: Hardware, cameras: MastCameras) -> None:
        super().__init__(hardware)
        self.cameras = cameras
        self._ahead: StereoView | None = None

    def ahead(self) -> StereoView | None:
        """See `Sight`."""
        return self._ahead

    def look(self, *, around: bool) -> list[Cloud]:
        """See `Sight`. A pair that cannot be taken or matched gives no cloud.

        One pair is matched while the next is taken.
        """
        self._ahead = None
        with ThreadPoolExecutor(1) as hands:
            matched = []
            for number, (pan, tilt) in enumerate(self._angles.pointings(around=around)):
                try:
                    pair = self.cameras.pair(pan, tilt, scale=SCALE)
                except (CameraError, RenderError):
                    continue
                if number == AHEAD:
                    self._ahead = pair
                matched.append(hands.submit(self._cloud, pair))
            clouds = [one.result() for one in matched]
        return [cloud for cloud in clouds if cloud is not None]

    def _cloud(self, pair: StereoView) -> Cloud | None:
        """Return what a pair ranges (n, 3), rover frame; None where it cannot be matched."""
        cameras = pair.left_camera, pair.right_camera
        try:
            cloud = dense_stereo(pair.left, pair.right, *cameras, nearest_m=NEAREST_M, step=STEP)
        except CameraError:
            return None
        return cloud.points[np.linalg.norm(cloud.points - self.eye, axis=1) < FARTHEST_M]
