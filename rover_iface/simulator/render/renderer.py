"""Images of a scene through a camera model, with the truth behind every pixel."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import CameraModel
from rover_iface.cameras.rig import Sensor
from rover_iface.errors import RenderError
from rover_iface.frames import Pose, Transform
from rover_iface.simulator.render.look import Look
from rover_iface.simulator.render.picture import AutoExposure, Frame, Negative, Truth, Window
from rover_iface.simulator.render.scene import Array, Scene

BAND = 8192
"""Pixels that are worked on at a time: some 0.7 MB, which a processor's second cache holds."""


@dataclass(frozen=True, slots=True)
class Sun:
    """Light from the sun and the dusty sky.

    Attributes
    ----------
    direction
        Unit vector to the sun, site frame.
    opacity
        Optical depth of the dust; 0.4 is a clear day.
    strength
        1 for a clear sun; less when something covers it (a cloud).
    """

    direction: tuple[float, float, float]
    opacity: float = 0.45
    strength: float = 1.0

    def __post_init__(self) -> None:
        length = math.sqrt(sum(v * v for v in self.direction))
        if not math.isfinite(length) or abs(length - 1.0) > 1e-3:
            raise RenderError(f"sun direction has length {length}; it must be a unit vector")

    @classmethod
    def from_angles(cls, azimuth_rad: float, elevation_rad: float, **options: float) -> Sun:
        """Return the sun at an azimuth (clockwise from north) and elevation."""
        level = math.cos(elevation_rad)
        return cls(
            (level * math.sin(azimuth_rad), level * math.cos(azimuth_rad), math.sin(elevation_rad)), **options
        )

    @property
    def direct(self) -> float:
        """Return what of the sun's light arrives unscattered; 0 below the horizon."""
        height = self.direction[2]
        if height <= 0.0:
            return 0.0
        return self.strength * math.exp(-self.opacity / max(height, 0.05))

    @property
    def diffuse(self) -> float:
        """Return the light of the sky on a level plate: most of what the dust takes, forward scattered."""
        height = max(self.direction[2], 0.0)
        lost = height * (1.0 - math.exp(-self.opacity / max(height, 0.05)))
        return 0.004 + 0.5 * lost


class Renderer:
    """Takes pictures of one scene. Pure: the same arguments give the same image on any machine layout.

    `look` is that of the scene where none is given, and the default where it has none.
    """

    def __init__(self, scene: Scene, *, look: Look | None = None) -> None:
        self.scene = scene
        self.look = look or scene.look or Look()

    def render(
        self,
        camera: CameraModel,
        pose: Pose | Transform | None,
        sun: Sun,
        *,
        window: Window | None = None,
        sensor: Sensor | None = None,
        exposure: AutoExposure | float | None = None,
        seed: int = 0,
        samples: int = 1,
    ) -> Frame:
        """Return what a camera sees.

        Parameters
        ----------
        camera
            In the rover frame (then `pose` says where the rover is) or in the site frame (`pose` None).
        window
            (left, top, width, height) of a subframe, default the whole frame; only its rays are cast.
        exposure
            A rule, or a gain of an earlier frame, so that a stereo pair is exposed alike.
        seed
            Of the noise: another picture of the same view needs another seed.
        samples
            Rays per pixel along each axis; 1 is what trackers are tested on, 2 gives smooth edges.

        Raises
        ------
        RenderError
            If the camera is below the ground, or the window is outside the frame.
        """
        return self.gather(camera, pose, sun, window=window, sensor=sensor, samples=samples).develop(
            exposure, seed
        )

    def require(self, camera: CameraModel, window: Window) -> None:
        """Raise `RenderError` where `gather` would: the window (left, top, width, height), px, is outside the
        frame of a camera of the site frame, or that below the ground.
        """
        left, top, width, height = window
        if left < 0 or top < 0 or left + width > camera.width or top + height > camera.height or width < 1:
            raise RenderError(
                f"window {window} does not lie in the frame of {camera.width} x {camera.height} pixels"
            )
        self.scene.require_above_ground(camera.C)

    def gather(
        self,
        camera: CameraModel,
        pose: Pose | Transform | None,
        sun: Sun,
        *,
        window: Window | None = None,
        sensor: Sensor | None = None,
        samples: int = 1,
    ) -> Negative:
        """Return what light falls on the sensor, to be developed; parameters, errors as of `render`.

        It releases the interpreter's lock almost all of the time: two threads gather a stereo pair.
        """
        site_camera = _in_site(camera, pose)
        left, top, width, height = window or (0, 0, camera.width, camera.height)
        self.require(site_camera, (left, top, width, height))
        sensor = sensor or Sensor()
        pad = 3 if sensor.psf_sigma_px > 0 else 0
        padded = (left - pad, top - pad, width + 2 * pad, height + 2 * pad)
        light, truth = self._light(site_camera, padded, sun, samples)
        if pad:
            import cv2

            light = cv2.GaussianBlur(light, (7, 7), sensor.psf_sigma_px)[pad:-pad, pad:-pad]
        light = np.ascontiguousarray(light)
        inner = (slice(pad, pad + height), slice(pad, pad + width))
        truth = Truth(
            truth.range_m[inner],
            truth.object_index[inner],
            truth.lit[inner],
            truth.normal_site[inner],
            truth.ids,
            site_camera,
            (left, top, width, height),
        )
        return Negative(
            light,
            truth,
            site_camera if window is None else site_camera.window(left, top, width, height),
            (left, top, width, height),
            sensor,
        )

    def depth(
        self, camera: CameraModel, pose: Pose | Transform | None, *, step: int = 1
    ) -> tuple[npt.NDArray[np.float32], Array]:
        """Return ranges (h, w) and unit rays (h, w, 3, site frame) of every `step`-th pixel; inf for sky."""
        site_camera = _in_site(camera, pose)
        u, v = np.meshgrid(np.arange(0, camera.width, step), np.arange(0, camera.height, step))
        origins, directions = site_camera.back_project(np.stack((u, v), axis=-1).astype(float))
        shape = directions.shape[:2]
        ranges = self.scene.ranges(origins.reshape(-1, 3), directions.reshape(-1, 3))
        return ranges.reshape(shape).astype(np.float32), directions

    def _light(
        self, camera: CameraModel, window: Window, sun: Sun, samples: int
    ) -> tuple[npt.NDArray[np.float32], Truth]:
        if samples > 1:
            return self._supersampled(camera, window, sun, samples)
        left, top, width, height = window
        light = np.empty((height, width), np.float32)
        truth = Truth(
            np.empty((height, width), np.float32),
            np.empty((height, width), np.int32),
            np.empty((height, width), np.bool_),
            np.zeros((height, width, 3), np.float32),
            self.scene.ids,
            camera,
            window,
        )
        rows = max(1, BAND // width)
        paint = _Painter(self.scene, self.look, camera, sun, rows * width)
        for first in range(0, height, rows):
            band = slice(first, min(first + rows, height))
            paint(left, top + first, light[band], truth, band)
        return light, truth

    def _supersampled(
        self, camera: CameraModel, window: Window, sun: Sun, samples: int
    ) -> tuple[npt.NDArray[np.float32], Truth]:
        left, top, width, height = window
        fine = camera.scaled(float(samples))
        light, _ = self._light(
            fine, (left * samples, top * samples, width * samples, height * samples), sun, 1
        )
        mean = light.reshape(height, samples, width, samples).mean(axis=(1, 3), dtype=np.float32)
        return mean, self._light(camera, window, sun, 1)[1]


class _Painter:
    """Fills a picture by bands of rows, whose rays and surface points it keeps in the same small arrays.

    Those of a whole picture are cleared by the system and pushed out of the processor's cache each time.
    """

    def __init__(self, scene: Scene, look: Look, camera: CameraModel, sun: Sun, most: int) -> None:
        from rover_iface.simulator.render.gravel import no_stones

        self.scene, self.camera, self.sun = scene, camera, sun
        self.to_sun = np.array(sun.direction)
        self.look = look.parameters()
        self.stones = no_stones()
        self.limb = _lunar_lambert_weight(_phase_deg(camera, self.to_sun))
        self.origins, self.directions = np.empty((most, 3), np.float32), np.empty((most, 3), np.float32)
        self.points, self.shadows = np.empty((most, 3), np.float32), np.empty((most, 3), np.float32)
        self.base, self.loose, self.lit = (np.empty(most, np.float32) for _ in range(3))
        self.index = np.empty(most, np.int32)
        self.to_suns = np.tile(self.to_sun.astype(np.float32), (most, 1))

    def __call__(
        self, left: int, top: int, light: npt.NDArray[np.float32], truth: Truth, band: slice
    ) -> None:
        """Fill the light [rows, columns] of a band whose first pixel is (`left`, `top`), and its rows of the
        truth.
        """
        from rover_iface.simulator.render import shade

        scene, sun, (height, width) = self.scene, self.sun, light.shape
        count = height * width
        origins, directions, points = self.origins[:count], self.directions[:count], self.points[:count]
        base, loose, lit = self.base[:count], self.loose[:count], self.lit[:count]
        normal = truth.normal_site[band].reshape(-1, 3)
        shade.window_rays(
            self.camera.packed, float(left), float(top), width, height, scene.origin, origins, directions
        )
        hit = scene.cast_local(origins, directions)
        far, prim = hit["tfar"], hit["primID"]
        found = shade.surface(
            far,
            prim,
            hit["u"],
            hit["v"],
            origins,
            directions,
            scene.triangles,
            scene.normals,
            scene.albedo,
            scene.gravel,
            self.to_sun,
            2e-3,
            points,
            normal,
            base,
            loose,
            self.shadows,
            self.index,
        )
        lit[:] = 0.0
        if sun.direct > 0.0 and found:
            lit[self.index[:found]] = ~scene.occluded_local(self.shadows[:found], self.to_suns[:found])
        shade.radiance(
            far,
            prim,
            directions,
            points,
            normal,
            base,
            loose,
            lit,
            scene.objects,
            scene.materials,
            scene.origin,
            self.to_sun,
            sun.direct,
            sun.diffuse,
            self.limb,
            1.0 / self.camera.hs,
            self.look,
            scene.seed,
            self.stones,
            light.reshape(-1),
        )
        shade.tell(
            far,
            prim,
            lit,
            scene.objects,
            truth.range_m[band].reshape(-1),
            truth.object_index[band].reshape(-1),
            truth.lit[band].reshape(-1),
        )


def _in_site(camera: CameraModel, pose: Pose | Transform | None) -> CameraModel:
    """Return a camera of the rover frame in the site frame; one without a pose is there already."""
    if pose is None:
        return camera
    return camera.transformed(pose.site_from_rover if isinstance(pose, Pose) else pose)


def _phase_deg(camera: CameraModel, to_sun: Array) -> float:
    """Return the phase angle at the middle of the frame, degrees; used for the whole frame."""
    return math.degrees(math.acos(max(-1.0, min(1.0, float(-camera.A @ to_sun)))))


def _lunar_lambert_weight(phase_deg: float) -> float:
    """Return the weight of the Lommel-Seeliger part. McEwen 1996, fit for a dark dusty surface."""
    g = min(phase_deg, 120.0)
    return max(0.0, 1.0 - 0.019 * g + 2.42e-4 * g**2 - 1.46e-6 * g**3)
