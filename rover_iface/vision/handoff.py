"""Hand-off of a target from mast cameras to the body's hazcams: the twelve published methods.

Six methods, each from the navcams where the rover stands (near) and from where it stood about three metres
before (far), seen along the hazcams' line of sight:

pure kinematic
    point stereo, transform by mast and pose, project
alternate kinematic
    the same with dense stereo
refined kinematic
    near: the navcam cloud splatted into an expected hazcam image, correlated; far: the window scaled by focal
    length and range, correlated round the near kinematic point
pure geometric
    hazcam cloud projected into the navcam, the point nearest to the target
refined geometric
    navcam image draped over the hazcam cloud, correlated
registration
    kinematic through the motion that lays the navcam mesh on the hazcam mesh

All cameras are given in one frame as the rover believes it; what is wrong there (mast, pose, calibration) is
what the methods differ in. `handoff_cascade` combines them and tests itself.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import Array, CameraModel
from rover_iface.cameras.stereo import Cloud, PointMatch, PointStereo, dense_stereo, point_stereo
from rover_iface.errors import CameraError, TrackerError
from rover_iface.frames import Transform
from rover_iface.vision.relief import ReliefOptions, align_relief
from rover_iface.vision.shape import register
from rover_iface.vision.sift_features import Descriptors, Features, detect, find_features
from rover_iface.vision.surface import ShapeOptions, Surface, surface_from_cloud
from rover_iface.vision.tracker import Image, StereoView

STEP = 2
UNTOLD = PointStereo(told=False)
"""The trackers' window; what its disparities may be off nobody asks a side."""
TEMPLATE_PX = 21
SEARCH_PX = 61
SPREAD_PX = 2
FEATURES = 1500
WINDOW_PX, CONTEXT_PX = 31, 51
"""Window that is searched from pancam to navcam, and that over which its best places are compared."""
WINDOWS = (ReliefOptions(), ReliefOptions(half_px=15, weight_px=7.0, bend_px=0.4))
WINDOWS_AGREE_PX, SEARCH_OFF_PX = 0.2, 1.5
"""How far apart two alignments may put the target, and how far from where the search has it."""


@dataclass(frozen=True)
class Side:
    """A stereo pair with its dense cloud, made when first asked for.

    `nearest_m` is the least depth that its stereo looks for. With a largest depth `farthest_m` a subframe of
    a near thing, whose disparities are wider than itself, is matched too. `unmoved` is the same pair in
    another frame with the motion from there: what is made of its pictures is made there, once, and moved.
    """

    view: StereoView
    nearest_m: float
    unmoved: tuple[Side, Transform] | None = None
    farthest_m: float | None = None

    @cached_property
    def cloud(self) -> Cloud | None:
        """Return the dense cloud of the pair at every second pixel, None where there is none."""
        if self.unmoved is not None:
            pair, motion = self.unmoved
            return None if pair.cloud is None else _moved(pair.cloud, motion)
        v = self.view
        try:
            found = dense_stereo(
                v.left,
                v.right,
                v.left_camera,
                v.right_camera,
                nearest_m=self.nearest_m,
                step=STEP,
                farthest_m=self.farthest_m,
            )
        except CameraError:
            return None
        return found if len(found.points) >= 100 else None

    @cached_property
    def surface(self) -> Surface | None:
        """Return the cloud as a mesh."""
        if self.unmoved is not None:
            pair, motion = self.unmoved
            return None if pair.surface is None else pair.surface.moved(motion)
        return None if self.cloud is None else surface_from_cloud(self.cloud, STEP)

    @cached_property
    def features(self) -> Features:
        """Return the features that both images show, ranged."""
        if self.unmoved is not None:
            pair, motion = self.unmoved
            return pair.features.moved(motion)
        return find_features(self.view, count=FEATURES, ratio=0.85, row_px=1.5)

    @cached_property
    def picture_features(self) -> tuple[Array, Descriptors]:
        """Return pixels (n, 2) and descriptors (n, 128) of the left image's features."""
        if self.unmoved is not None:
            return self.unmoved[0].picture_features
        return detect(self.view.left, FEATURES)

    @cached_property
    def ranged(self) -> dict[tuple[float, float, float], PointMatch | None]:
        """Return what was ranged so far: corners of the left image by pixel, px, and expected range, m."""
        return {}

    def moved(self, motion: Transform) -> Side:
        """Return the same pair with its cameras, and what is made of them, in another frame."""
        v = self.view
        view = replace(
            v,
            left_camera=v.left_camera.transformed(motion),
            right_camera=v.right_camera.transformed(motion),
        )
        pair, before = (self, Transform.identity()) if self.unmoved is None else self.unmoved
        return Side(view, self.nearest_m, (pair, motion * before), self.farthest_m)

    def point(self, pixel: Array, expected_m: float | None = None, spread: float = 0.25) -> PointMatch | None:
        """Return the surface point under a pixel [2] of the left image by point stereo.

        It is looked for within a share `spread` of the expected range, m.
        """
        v = self.view
        return point_stereo(
            v.left,
            v.right,
            v.left_camera,
            v.right_camera,
            pixel,
            options=UNTOLD,
            expected_range_m=expected_m,
            range_spread=spread,
        )


def _moved(cloud: Cloud, motion: Transform) -> Cloud:
    points = np.asarray(motion.apply(cloud.points), dtype=np.float64)
    return replace(cloud, points=points, camera=cloud.camera.transformed(motion))


@dataclass(frozen=True)
class Handoff:
    """What is given: the hazcam pair, and navcam pairs with the target's pixel in their left images."""

    hazcam: Side
    near: Side | None = None
    near_pixel: Array | None = None
    far: Side | None = None
    far_pixel: Array | None = None

    def source(self, which: str) -> tuple[Side, Array]:
        """Return the navcam pair and pixel, `near` or `far`.

        Raises
        ------
        TrackerError
            If it is not given.
        """
        side, pixel = (self.near, self.near_pixel) if which == "near" else (self.far, self.far_pixel)
        if side is None or pixel is None:
            raise TrackerError(f'hand-off from the "{which}" navcams, whose pair or pixel is not given')
        return side, pixel


@dataclass(frozen=True)
class Found:
    """Where a method puts the target in the left hazcam image, and its correlation (1 without one)."""

    pixel: Array
    score: float = 1.0


Method = Callable[[Handoff, str], Found | None]


def pure_kinematic(given: Handoff, which: str) -> Found | None:
    """Return the projection of the point that point stereo gives."""
    side, pixel = given.source(which)
    match = side.point(pixel)
    return None if match is None else _in_image(given.hazcam, match.point)


def alternate_kinematic(given: Handoff, which: str) -> Found | None:
    """Return the projection of the point that dense stereo gives."""
    side, pixel = given.source(which)
    point = dense_point(side, pixel)
    return None if point is None else _in_image(given.hazcam, point)


def refined_kinematic(given: Handoff, which: str) -> Found | None:
    """Return the match of an expected hazcam image (near) or of the scaled window (far)."""
    side, pixel = given.source(which)
    haz = given.hazcam.view
    if which == "near":
        middle = alternate_kinematic(given, which)
        if middle is None or side.cloud is None:
            return None
        template = _splat(side.cloud, haz.left_camera, middle.pixel)
        return _correlate(haz.left, template, middle.pixel, middle.pixel)
    match = side.point(pixel)
    prior = pure_kinematic(given, "near" if given.near is not None else "far")
    if match is None or prior is None:
        return None
    here = float(np.linalg.norm(match.point - haz.left_camera.C))
    there = float(np.linalg.norm(match.point - side.view.left_camera.C))
    scale = (haz.left_camera.hs / here) / (side.view.left_camera.hs / there)
    return _correlate(haz.left, _scaled(side.view.left, pixel, scale), prior.pixel, prior.pixel)


def pure_geometric(given: Handoff, which: str) -> Found | None:
    """Return the hazcam pixel whose point falls nearest to the target in the navcam image."""
    side, pixel = given.source(which)
    cloud = given.hazcam.cloud
    if cloud is None:
        return None
    seen = side.view.left_camera.project(cloud.points)
    away = np.where(np.isfinite(seen).all(axis=1), np.hypot(*(seen - pixel).T), np.inf)
    nearest = int(np.argmin(away))
    if not away[nearest] < 20.0:
        return None
    return _in_image(given.hazcam, cloud.points[nearest])


def refined_geometric(given: Handoff, which: str) -> Found | None:
    """Return the match of the navcam image draped over the hazcam cloud."""
    side, _ = given.source(which)
    middle, cloud = pure_geometric(given, which), given.hazcam.cloud
    if middle is None or cloud is None:
        return None
    navcam, haz = side.view, given.hazcam.view
    near = np.abs(haz.left_camera.project(cloud.points) - middle.pixel).max(axis=1) < TEMPLATE_PX
    seen = navcam.left_camera.project(cloud.points[near])
    draped = replace(cloud, points=cloud.points[near], intensity=_sample(navcam.left, seen))
    template = _splat(draped, haz.left_camera, middle.pixel, spread_px=3)
    return _correlate(haz.left, template, middle.pixel, middle.pixel)


def registration(given: Handoff, which: str) -> Found | None:
    """Return the kinematic point moved by the published registration, believed or not (as published)."""
    side, pixel = given.source(which)
    match = side.point(pixel)
    if match is None or side.surface is None or given.hazcam.surface is None:
        return None
    options = ShapeOptions(engine="nelder-mead")
    found = register(side.surface, given.hazcam.surface, Transform.identity(), match.point, options)
    return _in_image(given.hazcam, np.asarray(found.scene_from_model.apply(match.point)))


METHODS: dict[str, Method] = {
    "pure kinematic": pure_kinematic,
    "alternate kinematic": alternate_kinematic,
    "refined kinematic": refined_kinematic,
    "pure geometric": pure_geometric,
    "refined geometric": refined_geometric,
    "registration": registration,
}


def hand_off(method: str, which: str, given: Handoff) -> Found | None:
    """Return where a published method puts the target, None where it has no answer.

    Raises
    ------
    TrackerError
        If there is no such method, or the navcam pair that it needs is not given.
    """
    if method not in METHODS or which not in ("near", "far"):
        raise TrackerError(
            f'no hand-off "{method}" from "{which}"; there are {", ".join(METHODS)}, each from near and far'
        )
    return METHODS[method](given, which)


def scaled_window(
    pancam: Image,
    pancam_camera: CameraModel,
    pixel: npt.ArrayLike,
    navcam: Image,
    navcam_camera: CameraModel,
    point: npt.ArrayLike,
    *,
    search_px: int = 40,
) -> Found | None:
    """Return the target in the navcam by the pancam window shrunk to the navcam's field of view.

    `point` (3,), m, is where the target is believed, frame of the cameras: it tells scale and search. The
    shrunk window is found by correlation, then aligned twice over a surface with relief, the second time less
    of it; None where that does not lie in both images or the two are found apart. The place is that of the
    larger one. A correlation below 0.7 should not be believed.
    """
    import cv2

    from rover_iface.vision.template import NccOptions, Template, TemplateMatcher

    place, at = np.asarray(point, dtype=np.float64), np.asarray(pixel, dtype=np.float64)
    toward = pancam_camera.C - place
    away = float(np.linalg.norm(toward))
    # the pancam sees what the navcam's optics blur
    shrink = (pancam_camera.hs / away) / (navcam_camera.hs / float(np.linalg.norm(navcam_camera.C - place)))
    smooth = cv2.GaussianBlur(pancam, (0, 0), max(0.1, 0.35 * shrink)).astype(np.float32)
    expected = np.asarray(navcam_camera.project(place))
    if not np.isfinite(expected).all():
        return None
    source = Template(smooth, pancam_camera, at, place, toward / away, away)
    matcher = TemplateMatcher(NccOptions(template_px=WINDOW_PX, context_px=CONTEXT_PX, search_px=search_px))
    template = matcher.predict(source, navcam_camera, expected, place)
    match = None if template is None else matcher.search(navcam, template, expected)
    if template is None or match is None:
        return None
    along = _range_line(pancam_camera, at, navcam_camera, away)
    one, two = (align_relief(navcam, template, match.pixel, along, options) for options in WINDOWS)
    if one is None or two is None or float(np.hypot(*(one.pixel - two.pixel))) > WINDOWS_AGREE_PX:
        return None
    if float(np.hypot(*(one.pixel - match.pixel))) > SEARCH_OFF_PX:
        return None
    return Found(one.pixel, one.score)


def _range_line(camera: CameraModel, pixel: Array, other: CameraModel, range_m: float) -> Array:
    """Return the direction (2,) in the other image of a pixel's ray; along the rows where it is a point."""
    origin, ray = camera.back_project(pixel)
    near, far = other.project(np.stack((origin + 0.99 * range_m * ray, origin + 1.01 * range_m * ray)))
    length = float(np.hypot(*(far - near)))
    return np.asarray((far - near) / length) if length > 1e-9 else np.array([1.0, 0.0])


# ---- parts


def dense_point(side: Side, pixel: Array, reach_px: float = 4.0) -> Array | None:
    """Return the median [3] of the dense points round a pixel [2] of the left image, None where there are
    few.

    In the frame of the cloud, m.
    """
    cloud = side.cloud
    if cloud is None:
        return None
    seen = side.view.left_camera.project(cloud.points)
    with np.errstate(invalid="ignore"):
        near = np.abs(seen - pixel).max(axis=1) < reach_px
    return np.asarray(np.median(cloud.points[near], axis=0)) if near.sum() >= 4 else None


def _in_image(hazcam: Side, point: Array) -> Found | None:
    pixel = np.asarray(hazcam.view.left_camera.project(point))
    return Found(pixel) if np.isfinite(pixel).all() else None


def _splat(cloud: Cloud, camera: CameraModel, middle: Array, spread_px: int = SPREAD_PX) -> Image:
    """Return the window round `middle` that the cloud makes one expect; NaN where no point falls.

    The nearest point wins, and each takes `spread_px` x `spread_px` pixels.
    """
    half = TEMPLATE_PX // 2
    pixels = camera.project(cloud.points) - middle + half
    depth = np.linalg.norm(cloud.points - camera.C, axis=1)
    with np.errstate(invalid="ignore"):
        inside = ((pixels > -spread_px) & (pixels < TEMPLATE_PX + spread_px)).all(axis=1)
    out = np.full((TEMPLATE_PX, TEMPLATE_PX), np.nan, np.float32)
    for n in np.flatnonzero(inside)[np.argsort(-depth[inside])]:
        x, y = (int(v) for v in np.floor(pixels[n]))
        out[max(0, y) : max(0, y + spread_px), max(0, x) : max(0, x + spread_px)] = cloud.intensity[n]
    return out


def _scaled(image: Image, pixel: Array, scale: float) -> Image:
    """Return the window round a pixel, magnified by `scale`, as large as a template."""
    import cv2

    smooth = cv2.GaussianBlur(image, (0, 0), 0.4 / scale) if scale < 0.8 else image
    half = TEMPLATE_PX // 2
    warp = np.array([[1 / scale, 0, pixel[0] - half / scale], [0, 1 / scale, pixel[1] - half / scale]])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    size = (TEMPLATE_PX, TEMPLATE_PX)
    return np.asarray(cv2.warpAffine(smooth, warp, size, flags=flags, borderValue=np.nan), dtype=np.float32)


def _sample(image: Image, pixels: Array) -> npt.NDArray[np.float32]:
    import cv2

    x, y = (np.nan_to_num(pixels[:, i], nan=-9.0).astype(np.float32)[:, None] for i in (0, 1))
    found = cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=np.nan)
    return np.asarray(found[:, 0], dtype=np.float32)


def _correlate(image: Image, template: Image, at: Array, around: Array) -> Found | None:
    """Return the best match of a template cut round `at`, its holes filled, in a window of the image."""
    import cv2

    holes = np.isnan(template)
    if holes.mean() > 0.3:
        return None
    core = np.where(holes, np.nanmean(template), template).astype(np.float32)
    half = TEMPLATE_PX // 2
    x, y = (round(float(v)) for v in around)
    left, top = max(0, x - SEARCH_PX - half), max(0, y - SEARCH_PX - half)
    region = np.ascontiguousarray(image[top : y + SEARCH_PX + half + 1, left : x + SEARCH_PX + half + 1])
    if min(region.shape) < TEMPLATE_PX or float(core.std()) < 1e-5:
        return None
    _, score, _, place = cv2.minMaxLoc(cv2.matchTemplate(region, core, cv2.TM_CCOEFF_NORMED))
    fraction = at - np.floor(at) if not np.array_equal(at, around) else np.zeros(2)
    return Found(np.array([left + place[0] + half, top + place[1] + half]) + fraction, float(score))
