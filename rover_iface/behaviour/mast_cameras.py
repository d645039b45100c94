"""The rover's cameras: pointing by what the rover believes, and its pictures with the cameras it takes them
to be from.

A picture is really from where the camera truly is, with the mast off by its bias and noise. What the rover
knows of it is another camera: on the believed pose, with the mast angles as read.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rover_iface.behaviour.close_look import NARROW, SCALE, aim
from rover_iface.behaviour.hardware import Hardware, Look, Picture, Window
from rover_iface.cameras.model import Array, CameraModel
from rover_iface.cameras.panorama import Panorama, StereoWedge, wedge_pans
from rover_iface.cameras.rig import rig_of
from rover_iface.errors import CameraError, TrackerError
from rover_iface.vision.tracker import Image, StereoView

SUBFRAME_PX = 161
RIGHT_MARGIN_PX = 60
PANORAMA_TILT_RAD = -0.3


@dataclass(frozen=True, eq=False)
class Shot:
    """A picture, and the camera the rover takes it to be from: of the same pixels, believed site frame."""

    picture: Picture
    camera: CameraModel


@dataclass(frozen=True, eq=False)
class Sighting:
    """A stereo pair as it was taken: pictures, their cameras, clock, s, and odometer, m."""

    left: Picture
    right: Picture
    cameras: tuple[CameraModel, CameraModel]
    t_s: float
    travelled_m: float

    @cached_property
    def view(self) -> StereoView:
        """Return the pair as a tracker gets it."""
        return _TakenView.of(self)


class _TakenView(StereoView):
    """A pair whose pictures are read out when they are first looked at: a tracker that has given a target up
    looks at none.
    """

    @classmethod
    def of(cls, taken: Sighting) -> StereoView:
        """Return what was taken, without a look at it."""
        view = object.__new__(cls)
        left, right = taken.cameras
        view.__dict__.update(
            taken=taken, left_camera=left, right_camera=right, t_s=taken.t_s, travelled_m=taken.travelled_m
        )
        return view

    @cached_property
    def left(self) -> Image:
        return self._taken.left.unit

    @cached_property
    def right(self) -> Image:
        return self._taken.right.unit

    @property
    def _taken(self) -> Sighting:
        taken: Sighting = self.__dict__["taken"]
        return taken


class MastCameras:
    """Takes pictures.

    Parameters
    ----------
    window_px, right_margin_px
        Side of the subframe that `stereo` takes round a target, and how much wider the right one is to
        either side for the disparity; `None` takes whole frames.
    """

    def __init__(
        self,
        hardware: Hardware,
        *,
        window_px: int | None = SUBFRAME_PX,
        right_margin_px: int = RIGHT_MARGIN_PX,
    ) -> None:
        self.hardware = hardware
        self.window_px = window_px
        self.right_margin_px = right_margin_px
        self.rig = rig_of(hardware.profile)

    def point_at(self, point: Array, camera: str = "navcam_left") -> tuple[float, float]:
        """Return pan and tilt, rad, that put a point (3,), m, of the believed site frame in a camera's
        middle.

        Raises
        ------
        CameraError
            If the mast cannot point there.
        """
        rover_from_believed = self.hardware.believed.site_from_rover.inverse()
        return self.rig.point_at(rover_from_believed.apply(point), camera)

    def stereo(self, point: Array, camera: str = "navcam", *, track: str = "") -> Sighting:
        """Point the mast at a point (3,), m, of the believed site frame and take a stereo pair round it, for
        the track of a target; cameras in the believed site frame.

        Raises
        ------
        CameraError, RenderError, TrackerError
            If the mast cannot point there or the frame does not hold the point.
        """
        believed = self.hardware.believed.site_from_rover
        names = (f"{camera}_left", f"{camera}_right")
        pan, tilt = self.point_at(point, names[0])
        windows: list[Window] = []
        models: list[CameraModel] = []
        for name, margin in zip(names, (0, self.right_margin_px), strict=True):
            model = self.rig.camera(name, pan, tilt).transformed(believed)
            pixel = model.project(point)
            if not np.isfinite(pixel).all():
                raise TrackerError("target is behind the camera")
            windows.append(self._window(pixel, margin, model))
            models.append(model.window(*windows[-1]))
        left, right = self.hardware.look(Look(names, tuple(windows), pan, tilt, track=track))
        return self._sighting(left, right, *models)

    def narrow_pair(self, at: Array) -> StereoView:
        """Point the mast so that both narrow cameras hold a point (3,), m, rover frame, and take a binned
        stereo pair round it; the cameras of the view are in the rover frame, as read.

        Raises
        ------
        CameraError, RenderError
            If the mast cannot point there, the rover has no such pair, or a frame does not hold the point.
        """
        pan, tilt, windows = aim(self.rig, at)
        models = [
            self.rig.camera(name, pan, tilt).scaled(SCALE).window(*window)
            for name, window in zip(NARROW, windows, strict=True)
        ]
        left, right = self.hardware.look(Look(NARROW, windows, pan, tilt, SCALE))
        return self._sighting(left, right, *models).view

    def pair(
        self, pan_rad: float, tilt_rad: float, *, scale: float = 1.0, camera: str = "navcam"
    ) -> StereoView:
        """Take whole frames at mast angles; the cameras of the view are in the rover frame, as read.

        Raises
        ------
        RenderError
            If a camera is below the ground.
        """
        names = (f"{camera}_left", f"{camera}_right")
        models = [self.rig.camera(name, pan_rad, tilt_rad).scaled(scale) for name in names]
        windows = tuple((0, 0, model.width, model.height) for model in models)
        left, right = self.hardware.look(Look(names, windows, pan_rad, tilt_rad, scale))
        return self._sighting(left, right, *models).view

    def body_pair(self, camera: str) -> Sighting:
        """Take whole frames of a pair fixed to the body (`hazcam`), cameras in the believed site frame.

        Raises
        ------
        RenderError
            If a camera is below the ground.
        """
        believed = self.hardware.believed.site_from_rover
        names = (f"{camera}_left", f"{camera}_right")
        models = [self.rig.camera(name) for name in names]
        windows = tuple((0, 0, model.width, model.height) for model in models)
        left, right = self.hardware.look(Look(names, windows))
        return self._sighting(left, right, *(model.transformed(believed) for model in models))

    def picture(self, point: Array, camera: str, size_px: int) -> Shot:
        """Return a square picture with a point (3,), m, of the believed site frame in its middle.

        Raises
        ------
        CameraError, RenderError
            If the mast cannot point there, or the camera is below the ground.
        """
        pan, tilt = self.point_at(point, camera)
        told = self.rig.camera(camera, pan, tilt).transformed(self.hardware.believed.site_from_rover)
        window = _window(np.array([told.width / 2, told.height / 2]), size_px, size_px, told)
        (taken,) = self.hardware.look(Look((camera,), (window,), pan, tilt))
        return Shot(taken, told.window(*window))

    def body_picture(self, camera: str, most_px: int = 700) -> Shot:
        """Return the frame of a camera fixed to the body; halved where it is wider or higher than `most_px`.

        Raises
        ------
        RenderError
            If the camera is below the ground.
        """
        model = self.rig.camera(camera)
        scale = 0.5 if max(model.width, model.height) > most_px else 1.0
        model = model.scaled(scale)
        (taken,) = self.hardware.look(Look((camera,), ((0, 0, model.width, model.height),), scale=scale))
        return Shot(taken, model.transformed(self.hardware.believed.site_from_rover))

    def panorama(
        self, left_rad: float, right_rad: float, *, camera: str = "navcam", name: str = ""
    ) -> Panorama:
        """Return stereo wedges of whole frames from one azimuth of the site to the other, clockwise.

        Azimuths are counter-clockwise from east as the rover believes them to be; equal ones mean all round.
        A wedge beyond the mast's reach is taken at the end of it.

        Raises
        ------
        CameraError
            If the rover has no such pair on its mast.
        RenderError
            If a camera is below the ground.
        """
        believed = self.hardware.believed
        names = (f"{camera}_left", f"{camera}_right")
        span = (left_rad - right_rad) % math.tau or math.tau
        limit = self.rig.pan_limit_rad
        if any(self.rig.mounted(mounted).mount != "mast" for mounted in names):
            raise CameraError(f'camera "{camera}" is fixed to the body and takes no panorama')
        wedges: list[StereoWedge] = []
        for pan in wedge_pans(self.rig.mounted(names[0]).model, left_rad - believed.heading, span):
            pan = min(limit, max(-limit, pan))
            told = [self.rig.camera(mounted, pan, PANORAMA_TILT_RAD) for mounted in names]
            windows = tuple((0, 0, model.width, model.height) for model in told)
            left, right = self.hardware.look(Look(names, windows, pan, PANORAMA_TILT_RAD))
            cameras = [model.transformed(believed.site_from_rover) for model in told]
            wedges.append(StereoWedge(f"{len(wedges)}", left.image8, right.image8, *cameras))
        return Panorama(wedges, name, self.hardware.t_s)

    def _sighting(self, left: Picture, right: Picture, *cameras: CameraModel) -> Sighting:
        one, two = cameras
        return Sighting(left, right, (one, two), self.hardware.t_s, self.hardware.travelled_m)

    def _window(self, pixel: Array, margin: int, model: CameraModel) -> Window:
        if self.window_px is None:
            return 0, 0, model.width, model.height
        return _window(pixel, self.window_px + 2 * margin, self.window_px, model)


def _window(pixel: Array, width: int, height: int, model: CameraModel) -> Window:
    """Return the subframe round a pixel, moved inside the frame where it must be."""
    width, height = min(width, model.width), min(height, model.height)
    left = min(max(round(float(pixel[0])) - width // 2, 0), model.width - width)
    top = min(max(round(float(pixel[1])) - height // 2, 0), model.height - height)
    return left, top, width, height
