"""The rover's cameras in its true world: pointing by what the rover believes, pictures of what is there.

A picture is rendered with the camera where it truly is: on the true pose, with the mast off by its bias and
noise. What the rover knows of it is another camera: on the believed pose, with the mast angles as read.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_iface.cameras.model import Array, CameraModel
from rover_iface.cameras.rig import CameraRig, load_cameras, preset_names
from rover_iface.errors import TrackerError
from rover_iface.frames import wrap_angle
from rover_iface.simulator.body import Body
from rover_iface.simulator.render.renderer import Frame
from rover_iface.vision.tracker import StereoView

SUBFRAME_PX = 161
RIGHT_MARGIN_PX = 60


@dataclass(frozen=True, eq=False)
class Shot:
    """A picture, and the camera the rover takes it to be from: of the same pixels, believed site frame."""

    frame: Frame
    camera: CameraModel


@dataclass(frozen=True, eq=False)
class Sighting:
    """A stereo pair: as the tracker gets it (cameras in the believed site frame), and what it truly shows."""

    view: StereoView
    left: Frame
    right: Frame


class MastCameras:
    """Takes pictures from a body.

    Parameters
    ----------
    window_px, right_margin_px
        Side of the subframe that `stereo` takes round a target, and how much wider the right one is to
        either side for the disparity; `None` takes whole frames.
    """

    def __init__(
        self, body: Body, *, window_px: int | None = SUBFRAME_PX, right_margin_px: int = RIGHT_MARGIN_PX
    ) -> None:
        self.body = body
        self.window_px = window_px
        self.right_margin_px = right_margin_px
        mast = body.profile.mast
        self.rig = CameraRig(
            load_cameras(body.profile.name if body.profile.name in preset_names() else "k9"),
            (mast.base_m[0], mast.base_m[1], mast.height_m),
            mast.pan_limit_rad,
            mast.tilt_limits_rad,
        )
        self._bias = mast.bias_rad * body.rng.standard_normal(2)
        self._pictures = 0

    def point_at(self, point_believed: Array, camera: str = "navcam_left") -> tuple[float, float]:
        """Return pan and tilt that put a point (3,) of the believed site frame in a camera's middle.

        Raises
        ------
        CameraError
            If the mast cannot point there.
        """
        rover_from_believed = self.body.believed.site_from_rover.inverse()
        return self.rig.point_at(rover_from_believed.apply(point_believed), camera)

    def stereo(self, point_believed: Array, t_s: float, camera: str = "navcam") -> Sighting:
        """Point the mast at a believed point and take a stereo pair round it.

        Raises
        ------
        CameraError, RenderError, TrackerError
            If the mast cannot point there or the frame does not hold the point.
        """
        believed, true = self.body.believed.site_from_rover, self.body.pose.site_from_rover
        left_name, right_name = f"{camera}_left", f"{camera}_right"
        pan, tilt = self.point_at(point_believed, left_name)
        jitter = self._jitter()
        frames: list[Frame] = []
        models: list[CameraModel] = []
        exposure: float | None = None
        for name, margin in ((left_name, 0), (right_name, self.right_margin_px)):
            model = self.rig.camera(name, pan, tilt).transformed(believed)
            pixel = model.project(point_believed)
            if not np.isfinite(pixel).all():
                raise TrackerError("target is behind the camera")
            window = self._window(pixel, margin, model)
            actual = self.rig.camera(name, pan + float(jitter[0]), tilt + float(jitter[1])).transformed(true)
            frame = self._render(name, actual, t_s, window=window, exposure=exposure)
            exposure = frame.exposure
            frames.append(frame)
            models.append(model.window(*window))
        travelled = self.body.chassis.travelled_m
        view = StereoView(frames[0].unit, frames[1].unit, models[0], models[1], t_s, travelled)
        return Sighting(view, frames[0], frames[1])

    def picture(self, point_believed: Array, camera: str, t_s: float, size_px: int) -> Shot:
        """Return a square picture with a believed point (3,) in its middle.

        Raises
        ------
        CameraError, RenderError
            If the mast cannot point there, or the camera is below the ground.
        """
        pan, tilt = self.point_at(point_believed, camera)
        jitter = self._jitter()
        believed, true = self.body.believed.site_from_rover, self.body.pose.site_from_rover
        told = self.rig.camera(camera, pan, tilt).transformed(believed)
        actual = self.rig.camera(camera, pan + float(jitter[0]), tilt + float(jitter[1])).transformed(true)
        window = _window(np.array([told.width / 2, told.height / 2]), size_px, size_px, told)
        return Shot(self._render(camera, actual, t_s, window=window), told.window(*window))

    def body_picture(self, camera: str, t_s: float, most_px: int = 700) -> Shot:
        """Return the frame of a camera fixed to the body; halved where it is wider or higher than `most_px`.

        Raises
        ------
        RenderError
            If the camera is below the ground.
        """
        model = self.rig.camera(camera)
        if max(model.width, model.height) > most_px:
            model = model.scaled(0.5)
        frame = self.body.renderer.render(
            model, self.body.pose, self.body.sun(t_s), sensor=self.rig.mounted(camera).sensor
        )
        return Shot(frame, model.transformed(self.body.believed.site_from_rover))

    def strip(self, left_rad: float, right_rad: float, t_s: float) -> NDArray[np.uint8]:
        """Return pictures side by side, from one azimuth to the other, clockwise; a fourth of full
        resolution.
        """
        span = (left_rad - right_rad) % (2 * math.pi) or 2 * math.pi
        true = self.body.pose.site_from_rover
        small = self.rig.mounted(self.body.profile.cameras.navigation).model.scaled(0.25)
        fov = 2 * math.atan(small.width / 2 / small.hs)
        count = max(1, math.ceil(span / (0.9 * fov)))
        exposure: float | None = None
        strips = []
        for k in range(count):
            azimuth = left_rad - span * (k + 0.5) / count - self.body.pose.heading
            mast = self.rig.rover_from_mast(wrap_angle(azimuth), math.radians(-18))
            frame = self.body.renderer.render(
                small.transformed(mast).transformed(true), None, self.body.sun(t_s), exposure=exposure, seed=k
            )
            exposure = frame.exposure
            strips.append(frame.image8)
        return np.concatenate(strips, axis=1)

    def _jitter(self) -> Array:
        noise: Array = self._bias + self.body.profile.mast.noise_rad * self.body.rng.standard_normal(2)
        return noise

    def _render(
        self,
        name: str,
        camera: CameraModel,
        t_s: float,
        *,
        window: tuple[int, int, int, int],
        exposure: float | None = None,
    ) -> Frame:
        self._pictures += 1
        return self.body.renderer.render(
            camera,
            None,
            self.body.sun(t_s),
            window=window,
            sensor=self.rig.mounted(name).sensor,
            exposure=exposure,
            seed=self.body.seed * 100_003 + self._pictures,
        )

    def _window(self, pixel: Array, margin: int, model: CameraModel) -> tuple[int, int, int, int]:
        if self.window_px is None:
            return 0, 0, model.width, model.height
        return _window(pixel, self.window_px + 2 * margin, self.window_px, model)


def _window(pixel: Array, width: int, height: int, model: CameraModel) -> tuple[int, int, int, int]:
    """Return the subframe round a pixel, moved inside the frame where it must be."""
    width, height = min(width, model.width), min(height, model.height)
    left = min(max(round(float(pixel[0])) - width // 2, 0), model.width - width)
    top = min(max(round(float(pixel[1])) - height // 2, 0), model.height - height)
    return left, top, width, height
