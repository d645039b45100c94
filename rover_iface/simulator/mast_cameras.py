"""The rover's cameras in its true world: pointing by what the rover believes, pictures of what is there.

A picture is rendered with the camera where it truly is: on the true pose, with the mast off by its bias and
noise. What the rover knows of it is another camera: on the believed pose, with the mast angles as read.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rover_iface.cameras.model import Array, CameraModel
from rover_iface.cameras.panorama import Panorama, StereoWedge
from rover_iface.cameras.rig import CameraRig, load_cameras, preset_names
from rover_iface.errors import CameraError, TrackerError
from rover_iface.side_by_side import side_by_side
from rover_iface.simulator.body import Body
from rover_iface.simulator.render.panorama import wedge_pans
from rover_iface.simulator.render.picture import Frame, Negative, Window
from rover_iface.vision.tracker import StereoView

SUBFRAME_PX = 161
RIGHT_MARGIN_PX = 60
PANORAMA_TILT_RAD = -0.3

_Wanted = tuple[str, CameraModel, Window]
"""Name of a mounted camera, where it truly is (site frame), and what of its frame is read out."""


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

    def designated(self, point_true: Array, camera: str = "navcam_left") -> Array:
        """Return where a surface point (3,) of the true site lies by a picture that a person points at it in.

        Believed site frame. The mast is off by its bias in that picture as in all that are taken later, so
        the pixel that the person meant is found again; by its noise they differ.

        Raises
        ------
        CameraError
            If the mast cannot point there.
        """
        point = np.asarray(point_true, dtype=np.float64)
        believed, true = self.body.believed.site_from_rover, self.body.pose.site_from_rover
        there = np.asarray(believed.apply(true.inverse().apply(point)), dtype=np.float64)
        pan, tilt = self.point_at(there, camera)
        bias = self._bias
        actual = self.rig.camera(camera, pan + float(bias[0]), tilt + float(bias[1])).transformed(true)
        told = self.rig.camera(camera, pan, tilt).transformed(believed)
        eye, way = told.back_project(actual.project(point))
        return np.asarray(eye + float(np.linalg.norm(point - actual.C)) * way)

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
        wanted: list[_Wanted] = []
        models: list[CameraModel] = []
        for name, margin in ((left_name, 0), (right_name, self.right_margin_px)):
            model = self.rig.camera(name, pan, tilt).transformed(believed)
            pixel = model.project(point_believed)
            if not np.isfinite(pixel).all():
                raise TrackerError("target is behind the camera")
            window = self._window(pixel, margin, model)
            actual = self.rig.camera(name, pan + float(jitter[0]), tilt + float(jitter[1])).transformed(true)
            wanted.append((name, actual, window))
            models.append(model.window(*window))
        frames = self._render_pair(wanted, t_s)
        travelled = self.body.chassis.travelled_m
        view = StereoView(frames[0].unit, frames[1].unit, models[0], models[1], t_s, travelled)
        return Sighting(view, frames[0], frames[1])

    def pair(
        self, pan_rad: float, tilt_rad: float, t_s: float, *, scale: float = 1.0, camera: str = "navcam"
    ) -> StereoView:
        """Take whole frames at mast angles; the cameras of the view are in the rover frame, as read.

        Raises
        ------
        RenderError
            If a camera is below the ground.
        """
        jitter = self._jitter()
        wanted: list[_Wanted] = []
        models: list[CameraModel] = []
        for side in ("left", "right"):
            name = f"{camera}_{side}"
            off = self.rig.camera(name, pan_rad + float(jitter[0]), tilt_rad + float(jitter[1])).scaled(scale)
            actual = off.transformed(self.body.pose.site_from_rover)
            wanted.append((name, actual, (0, 0, off.width, off.height)))
            models.append(self.rig.camera(name, pan_rad, tilt_rad).scaled(scale))
        frames = self._render_pair(wanted, t_s)
        travelled = self.body.chassis.travelled_m
        return StereoView(frames[0].unit, frames[1].unit, models[0], models[1], t_s, travelled)

    def body_pair(self, camera: str, t_s: float) -> Sighting:
        """Take whole frames of a pair fixed to the body (`hazcam`), cameras in the believed site frame.

        Raises
        ------
        RenderError
            If a camera is below the ground.
        """
        believed, true = self.body.believed.site_from_rover, self.body.pose.site_from_rover
        wanted: list[_Wanted] = []
        models: list[CameraModel] = []
        for side in ("left", "right"):
            name = f"{camera}_{side}"
            model = self.rig.camera(name)
            wanted.append((name, model.transformed(true), (0, 0, model.width, model.height)))
            models.append(model.transformed(believed))
        frames = self._render_pair(wanted, t_s)
        view = StereoView(
            frames[0].unit, frames[1].unit, models[0], models[1], t_s, self.body.chassis.travelled_m
        )
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

    def panorama(
        self, left_rad: float, right_rad: float, t_s: float, *, camera: str = "navcam", name: str = ""
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
        believed, true = self.body.believed, self.body.pose.site_from_rover
        pair = (f"{camera}_left", f"{camera}_right")
        span = (left_rad - right_rad) % math.tau or math.tau
        limit = self.rig.pan_limit_rad
        if any(self.rig.mounted(mounted).mount != "mast" for mounted in pair):
            raise CameraError(f'camera "{camera}" is fixed to the body and takes no panorama')
        wedges: list[StereoWedge] = []
        for pan in wedge_pans(self.rig.mounted(pair[0]).model, left_rad - believed.heading, span):
            pan = min(limit, max(-limit, pan))
            jitter = self._jitter()
            shots: list[Shot] = []
            for mounted in pair:
                told = self.rig.camera(mounted, pan, PANORAMA_TILT_RAD)
                actual = self.rig.camera(
                    mounted, pan + float(jitter[0]), PANORAMA_TILT_RAD + float(jitter[1])
                )
                frame = self._render(
                    mounted,
                    actual.transformed(true),
                    t_s,
                    window=(0, 0, told.width, told.height),
                    exposure=shots[0].frame.exposure if shots else None,
                )
                shots.append(Shot(frame, told.transformed(believed.site_from_rover)))
            left, right = shots
            wedges.append(
                StereoWedge(
                    f"{len(wedges)}", left.frame.image8, right.frame.image8, left.camera, right.camera
                )
            )
        return Panorama(wedges, name, t_s)

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

    def _render_pair(self, wanted: Sequence[_Wanted], t_s: float) -> list[Frame]:
        """Return the pictures of a pair, exposed alike; the light of both is gathered at once."""
        sun, render = self.body.sun(t_s), self.body.renderer

        def gather(one: _Wanted) -> Negative:
            name, camera, window = one
            return render.gather(camera, None, sun, window=window, sensor=self.rig.mounted(name).sensor)

        frames: list[Frame] = []
        for negative in side_by_side(gather, wanted):
            self._pictures += 1
            seed = self.body.seed * 100_003 + self._pictures
            frames.append(negative.develop(frames[0].exposure if frames else None, seed))
        return frames

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
