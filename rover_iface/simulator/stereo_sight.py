"""What the `full` rover's navigator sees the ground with: rendered navcam pairs and dense stereo."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from rover_iface.cameras.stereo import dense_stereo
from rover_iface.errors import CameraError, RenderError
from rover_iface.navigation.sensor import StereoSensor
from rover_iface.simulator.body import Body
from rover_iface.simulator.mast_cameras import MastCameras
from rover_iface.vision.tracker import StereoView

Array = NDArray[np.floating]

SCALE = 0.3125
"""Of the navcam's resolution; 320 x 240 for K9's. Stereo is off by 2 to 3 cm (95 %) within 3 m."""

STEP = 3
NEAREST_M = 0.9
FARTHEST_M = 6.0


class StereoSight:
    """A `Sight`: at each stop pairs are taken at set pan and tilt, and matched densely.

    The rover knows the mast angles as read; where the mast truly points differs by bias and noise.
    """

    def __init__(self, body: Body, cameras: MastCameras) -> None:
        self.body = body
        self.cameras = cameras
        self._angles = StereoSensor(body.profile)

    @property
    def eye(self) -> Array:
        """See `Sight`."""
        return self._angles.eye

    def cost(self, *, around: bool) -> float:
        """See `Sight`."""
        return self._angles.pairs_around / len(self._angles.pans) if around else 1.0

    def look(self, t_s: float, *, around: bool) -> list[Array]:
        """See `Sight`. A pair that cannot be taken or matched gives no cloud.

        One pair is matched while the next is taken.
        """
        with ThreadPoolExecutor(1) as hands:
            matched = []
            for pan, tilt in self._angles.pointings(around=around):
                try:
                    pair = self.cameras.pair(pan, tilt, t_s, scale=SCALE)
                except (CameraError, RenderError):
                    continue
                matched.append(hands.submit(self._cloud, pair))
            clouds = [one.result() for one in matched]
        return [cloud for cloud in clouds if cloud is not None]

    def _cloud(self, pair: StereoView) -> Array | None:
        """Return what a pair ranges (n, 3), rover frame; None where it cannot be matched."""
        cameras = pair.left_camera, pair.right_camera
        try:
            cloud = dense_stereo(pair.left, pair.right, *cameras, nearest_m=NEAREST_M, step=STEP)
        except CameraError:
            return None
        return cloud.points[np.linalg.norm(cloud.points - self.eye, axis=1) < FARTHEST_M]
