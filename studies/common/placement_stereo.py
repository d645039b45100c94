"""What a stereo pair makes of a rock: by dense stereo on rendered images, or by a cheap model on cast ranges.

Two pairs look at each rock: the hazard cameras, and the mast's, which stands at other angles than those that
are read and is out of calibration.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from rover_iface.behaviour.close_look import (
    BLOCK_PX,
    LEAST_CONTRAST,
    NARROW,
    SCALE,
    STEP,
    aim,
    depths,
)
from rover_iface.behaviour.repertoire import RIGHT_MARGIN_PX, WINDOW_PX
from rover_iface.cameras.linear import FAR_M, aligned_pair
from rover_iface.cameras.model import CameraModel, ModelKind
from rover_iface.cameras.rig import CameraRig, load_cameras
from rover_iface.cameras.stereo import Cloud, dense_stereo
from rover_iface.frames import Transform
from rover_iface.placement.cloud import (
    DISPARITY_RAD,
    NARROW_DISPARITY_RAD,
    NAVCAM_DISPARITY_RAD,
    SurfaceCloud,
    cloud_of_stereo,
)
from rover_iface.simulator.render.renderer import Renderer, Sun
from rover_iface.simulator.render.scene import Scene

Array = npt.NDArray[np.float64]
Seen = tuple[CameraModel, CameraModel, Array, npt.NDArray[np.int32], Array]
"""The aligned pair, and for each pixel of the left one range (inf: none), body and normal."""

MAST_M = (0.15, 0.0, 1.45)
MAST_ERROR_RAD = math.radians(1.0)
"""Deviation of pan and tilt from what is read: that of Kim et al. 2009, five times the K9 profile's."""

SAME_ERROR = 0.89
"""Correlation of what the mast is off in two looks: K9's has 3.5 mrad of bias and 1.2 of noise."""

OFF_PX = 1.4
"""Deviation of what all disparities of the mast's pair are off: one per cent of the range."""

NAVCAM_NEAREST_M = 1.15
"""Nothing is nearer to the mast: a subframe of 400 pixels bears disparities of 192."""


@dataclass(frozen=True)
class StereoModel:
    """The cheap model of stereo; defaults fit rendered pairs of the hazcams (docs/results/placement.md)."""

    block_px: int = 5
    disparity_rad: float = 0.0011
    shared_px: float = 2.5
    wrong_above: float = 2.6
    lost_lit: float = 0.003
    lost_shade: float = 0.15
    lost_slant: float = 0.20
    hole_px: float = 10.0
    lost_alike: float = 0.7
    """Where the other pair is without a match this one often is, too: correlation of what draws the holes."""


NAVCAM = StereoModel(disparity_rad=0.00028, hole_px=20.0)


@dataclass(frozen=True, eq=False)
class RockView:
    """A pair before a rock: where it stands, where it is believed to stand, and how it is matched.

    Attributes
    ----------
    left, right
        The true cameras, rover frame, subframes.
    camera
        The left one's name, for its sensor.
    told_from_true, off_px
        How the rover's belief differs: a motion, and what all disparities are off.
    step
        Every so many columns and rows give points.
    farthest_m
        Nothing beyond this depth is searched for; None without a limit.
    """

    scene: Scene
    sun: Sun
    left: CameraModel
    right: CameraModel
    camera: str
    nearest_m: float
    model: StereoModel
    disparity_rad: float = DISPARITY_RAD
    told_from_true: Transform | None = None
    off_px: float = 0.0
    block_px: int = 7
    least_contrast: float = 2.5
    step: int = 1
    farthest_m: float | None = None

    @cached_property
    def seen(self) -> Seen:
        """Return what the left camera truly sees."""
        one, two = aligned_pair(self.left, self.right)
        if self.left.kind is ModelKind.CAHV:
            # the axis of a subframe's camera does not lie in its middle
            origin, ray = self.left.back_project(((one.width - 1) / 2.0, (one.height - 1) / 2.0))
            aside = one.project(origin + FAR_M * ray) - ((one.width - 1) / 2.0, (one.height - 1) / 2.0)
            corner = round(float(aside[0])), round(float(aside[1]))
            one, two = (camera.window(*corner, one.width, one.height) for camera in (one, two))
        u, v = np.meshgrid(np.arange(one.width), np.arange(one.height))
        origins, rays = one.back_project(np.stack((u, v), axis=-1).reshape(-1, 2).astype(float))
        hit = self.scene.cast(origins, rays)
        far = hit["tfar"].astype(np.float64)
        met = far < 1e30
        body = np.where(met, self.scene.objects[np.maximum(hit["primID"], 0)], -1).astype(np.int32)
        normal = hit["Ng"].astype(np.float64)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        normal *= np.where((normal * rays).sum(axis=1) > 0, -1.0, 1.0)[:, None]
        shape = (one.height, one.width)
        return (
            one,
            two,
            np.where(met, far, np.inf).reshape(shape),
            body.reshape(shape),
            normal.reshape(*shape, 3),
        )

    def lit(self, points: Array, normals: Array) -> npt.NDArray[np.bool_]:
        """Return which surface points (n, 3) the sun reaches."""
        to_sun = np.array(self.sun.direction)
        start = points + 3e-3 * normals
        free = ~np.isfinite(self.scene.ranges(start, np.broadcast_to(to_sun, start.shape)))
        return np.asarray(free & (normals @ to_sun > 0))

    def _told(self, camera: CameraModel) -> CameraModel:
        return camera if self.told_from_true is None else camera.transformed(self.told_from_true)

    def _cloud(self, cloud: Cloud) -> SurfaceCloud:
        """Return the cloud of a dense one that has every `step`-th column and row."""
        found = cloud_of_stereo(cloud, disparity_rad=self.disparity_rad, farthest_m=3.0)
        return found if self.step == 1 else found.thinned(self.step)

    def rendered_cloud(self, seed: int) -> SurfaceCloud:
        """Return the cloud that dense stereo makes of a rendered pair."""
        renderer = Renderer(self.scene)
        sensor = load_cameras("k9")[self.camera].sensor
        one = renderer.render(self.left, None, self.sun, sensor=sensor, seed=seed)
        two = renderer.render(self.right, None, self.sun, sensor=sensor, exposure=one.exposure, seed=seed + 1)
        left, right = self._told(self.left), self._told(self.right)
        if self.off_px:
            right = replace(right, H=right.H + self.off_px * right.A)
        dense = dense_stereo(
            one.unit,
            two.unit,
            left,
            right,
            nearest_m=self.nearest_m,
            block_px=self.block_px,
            least_contrast=self.least_contrast,
            step=self.step,
            farthest_m=self.farthest_m,
        )
        return self._cloud(dense)

    def cast_cloud(self, seed: int, other: tuple[RockView, int] | None = None) -> SurfaceCloud:
        """Return a cloud like that of stereo from cast ranges: what it costs is a twentieth of a rendered
        one.

        Disparities are averaged over the matched block, the foreground grows over its edge, errors are shared
        by neighbours; what the right camera does not see has no point, nor have patches that are drawn by
        light and slant, and some patches are matched falsely.

        Parameters
        ----------
        other
            Another view and its seed, whose patches without a match are mostly without one here.
        """
        import cv2
        from scipy.special import ndtr

        model = self.model
        rng = _numbers(seed)
        one, two, far, _, normal = self.seen
        shape = far.shape
        u, v = np.meshgrid(np.arange(shape[1]), np.arange(shape[0]))
        eye, rays = one.back_project(np.stack((u, v), axis=-1).astype(float))
        known = np.isfinite(far)
        points = eye + np.where(known, far, 1.0)[..., None] * rays
        baseline = float(np.linalg.norm(two.C - one.C))
        depth = np.where(known, (points - one.C) @ one.A, 1e3)
        true = (one.hs * baseline / depth).astype(np.float32)
        toward = two.C - points.reshape(-1, 3)
        distance = np.linalg.norm(toward, axis=1)
        back = self.scene.ranges(two.C, -toward / distance[:, None])
        both = known & (back > distance - 0.01).reshape(shape)

        holes = _holes(rng, shape, model)
        if other is not None:
            alike = other[0].holes_at(other[1], points)
            holes = math.sqrt(model.lost_alike) * alike + math.sqrt(1.0 - model.lost_alike) * holes
        block = np.ones((model.block_px, model.block_px), np.uint8)
        highest = cv2.dilate(true, block)
        one_surface = highest - cv2.erode(true, block) < 1.5
        smooth = cv2.blur(true, (model.block_px, model.block_px))
        grown = (highest - true > 1.0) & (_field(rng, shape, 8.0) > 0.0)
        disparity = np.where(one_surface, smooth, np.where(grown, highest, true))
        noise = _field(rng, shape, model.shared_px)
        disparity = disparity + model.disparity_rad * one.hs * noise
        wrong = _field(rng, shape, 4.0) > model.wrong_above
        disparity = np.where(wrong, disparity + 2.5 * _field(rng, shape, 6.0), disparity)

        slant = np.clip(-(normal * rays).sum(axis=-1), 0.0, 1.0)
        lit = self.lit(points.reshape(-1, 3), normal.reshape(-1, 3)).reshape(shape)
        chance = np.where(lit, model.lost_lit, model.lost_shade) + model.lost_slant * (slant < 0.2)
        valid = (both | grown) & known & (ndtr(holes) >= chance) & (disparity > 0.5)
        # single points are taken away by the speckle filter
        valid &= cv2.blur(valid.astype(np.float32), (7, 7)) > 0.4
        lines, samples = np.nonzero(valid[:: self.step, :: self.step])
        lines, samples = lines * self.step, samples * self.step
        told = self._told(one)
        d = disparity[lines, samples].astype(np.float64) + self.off_px
        pixels = np.column_stack((samples, lines)).astype(np.float64)
        ray = told.back_project(pixels)[1]
        place = told.C + ray * (told.hs * baseline / d / (ray @ told.A))[:, None]
        shade = np.where(lit, np.clip(normal @ np.array(self.sun.direction), 0.1, 1.0), 0.05)
        intensity = shade[lines, samples].astype(np.float32).clip(0, 1)
        return self._cloud(Cloud(place, pixels, d, told, baseline, intensity))

    def holes_at(self, seed: int, points: Array) -> Array:
        """Return what draws this view's holes (`cast_cloud` with this seed) at true points (..., 3)."""
        one, _, far, _, _ = self.seen
        holes = _holes(_numbers(seed), far.shape, self.model)
        pixels = np.round(np.nan_to_num(one.project(points.reshape(-1, 3)), nan=0.0)).astype(np.int64)
        x = np.clip(pixels[:, 0], 0, far.shape[1] - 1)
        y = np.clip(pixels[:, 1], 0, far.shape[0] - 1)
        return np.asarray(holes[y, x].reshape(points.shape[:-1]))


def mast_view(scene: Scene, sun: Sun, seed: int, at: Array) -> RockView:
    """Return the view of the mast's pair, turned to a point (3,), in subframes like those of the `full`
    rover.
    """
    rng = np.random.default_rng([seed, 0x3A57])
    rig = CameraRig(load_cameras("k9"), MAST_M)
    pan, tilt = rig.point_at(at, "navcam_left")
    off = MAST_ERROR_RAD * rng.standard_normal(2)
    told_from_true = (
        rig.rover_from_mast(pan, tilt)
        * rig.rover_from_mast(pan + float(off[0]), tilt + float(off[1])).inverse()
    )
    pair = []
    for name, margin in (("navcam_left", 0), ("navcam_right", RIGHT_MARGIN_PX)):
        # the subframe is cut by what is read
        x, y = (round(float(v)) for v in rig.camera(name, pan, tilt).project(at))
        camera = rig.camera(name, pan + float(off[0]), tilt + float(off[1]))
        width, height = WINDOW_PX + 2 * margin, WINDOW_PX
        left = min(max(x - width // 2, 0), camera.width - width)
        top = min(max(y - height // 2, 0), camera.height - height)
        pair.append(camera.window(left, top, width, height))
    return RockView(
        scene,
        sun,
        pair[0],
        pair[1],
        "navcam_left",
        NAVCAM_NEAREST_M,
        NAVCAM,
        disparity_rad=NAVCAM_DISPARITY_RAD,
        told_from_true=told_from_true,
        off_px=OFF_PX * float(rng.standard_normal()),
        block_px=5,
        least_contrast=1.5,
        step=2,
    )


def narrow_view(scene: Scene, sun: Sun, seed: int, at: Array, laid: Transform | None) -> RockView:
    """Return the view of the mast's narrow pair, pointed so that both cameras hold a point (3,).

    The mast stands off by much the same as when the wide pair looked (`mast_view` with this seed): most of
    what it is off is a bias (`SAME_ERROR`). `laid` is how the wide pair's cloud was moved onto the hazcams',
    None if that was not believed.
    """
    wide = MAST_ERROR_RAD * np.random.default_rng([seed, 0x3A57]).standard_normal(2)
    rng = np.random.default_rng([seed, 0x9A88, *(np.round(at * 1e4).astype(np.int64) + (1 << 20))])
    off = SAME_ERROR * wide + math.sqrt(1.0 - SAME_ERROR**2) * MAST_ERROR_RAD * rng.standard_normal(2)
    rig = CameraRig(load_cameras("k9"), MAST_M)
    pan, tilt, windows = aim(rig, at if laid is None else np.asarray(laid.inverse().apply(at)))
    pair = []
    for name, window in zip(NARROW, windows, strict=True):
        camera = rig.camera(name, pan + float(off[0]), tilt + float(off[1])).scaled(SCALE)
        pair.append(camera.window(*window))
    told = rig.camera(NARROW[0], pan, tilt)
    nearest, farthest = depths(told, at)
    return RockView(
        scene,
        sun,
        pair[0],
        pair[1],
        NARROW[0],
        nearest,
        NAVCAM,
        disparity_rad=NARROW_DISPARITY_RAD,
        told_from_true=rig.rover_from_mast(pan, tilt)
        * rig.rover_from_mast(pan + float(off[0]), tilt + float(off[1])).inverse(),
        # both pairs are out of calibration by the same angle
        off_px=OFF_PX * float(rng.standard_normal()) * pair[0].hs / rig.camera("navcam_left").hs,
        block_px=BLOCK_PX,
        least_contrast=LEAST_CONTRAST,
        step=STEP,
        farthest_m=farthest,
    )


def _numbers(seed: int) -> np.random.Generator:
    return np.random.default_rng([seed, 0xCA57])


def _holes(rng: np.random.Generator, shape: tuple[int, ...], model: StereoModel) -> Array:
    """Return the field whose low places are without a match; the first that is drawn of a view."""
    return _field(rng, shape, model.hole_px)


def _field(rng: np.random.Generator, shape: tuple[int, ...], sigma_px: float) -> Array:
    """Return noise of deviation 1 whose neighbours within `sigma_px` are alike."""
    import cv2

    white = cv2.GaussianBlur(rng.standard_normal(shape).astype(np.float32), (0, 0), sigma_px)
    return np.asarray(white / max(float(white.std()), 1e-9), dtype=np.float64)
