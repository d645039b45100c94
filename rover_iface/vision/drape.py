"""Draped patches: one camera's picture laid over the surface that a stereo pair ranges, and found there.

Corners of the pair's left image are ranged with their slant. Each says how the other camera's picture must
look there if its pose is as guessed; where it is found instead tells the pose (`resection`). Only the pair's
geometry enters, so that a navcam pair that ranges wrongly does not matter. The guess may come from features
common to both images (`from_features`), from registration of surfaces or from dead reckoning.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import Array, CameraModel
from rover_iface.cameras.stereo import PointMatch, PointStereo, point_stereo, triangulate
from rover_iface.frames import Transform
from rover_iface.vision.handoff import Side
from rover_iface.vision.resection import resect
from rover_iface.vision.sift_features import Descriptors, Features, mutual
from rover_iface.vision.sift_motion import Motion
from rover_iface.vision.template import NccOptions
from rover_iface.vision.tracker import Image, StereoView

SIGMA_PX = 0.3
"""Error of the place of a patch in the pair's left image."""
TEMPLATE_PX = 15
SHAPE_SD, MOST_PX = NccOptions().shape_sd, NccOptions().most_px
"""What the shape of a patch may be off, and how far its alignment may move it: those of the tracker."""
RANGED = PointStereo(template_px=TEMPLATE_PX, plane_px=19, nearest_m=0.2, told=False)
"""Window by which the surface under a pixel is ranged. What its disparity may be off nobody asks: many
patches tell the pose, and what they disagree by its error."""
FEATURE_RATIO, FEATURE_GATE_PX, FEATURE_REACH_PX = 0.85, 200.0, 4.0


@dataclass(frozen=True, slots=True)
class DrapeOptions:
    """Parameters of the patches.

    Attributes
    ----------
    patches, reach_m
        How many, and how far from the middle.
    clear_px
        How near to the middle none is taken.
    context_px
        Window over which the best places of a patch are compared.
    search_px
        Search round the prediction, of one pass after the other.
    least_score
        Correlation below which a patch has not been found.
    inlier_px
        Consensus distance, pixels of the pair's left image.
    least_features
        Features common to both pictures without which they make no guess.
    alike_rad
        Angle between the lines of sight up to which features are asked first, if neither picture is more than
        twice as fine as the other.
    enough
        Patches that agree, with which no further guess is tried.
    least_agree
        Patches without whose agreement nothing is believed.
    believed_first
        Whether the pose is tried as it is believed before others are looked for, which takes a second.
    """

    patches: int = 60
    reach_m: float = 0.35
    clear_px: float = 10.0
    context_px: int = 25
    search_px: tuple[int, ...] = (14, 5)
    least_score: float = 0.4
    inlier_px: float = 1.2
    least_features: int = 10
    alike_rad: float = 0.7
    enough: int = 20
    least_agree: int = 12
    believed_first: bool = False


@dataclass(frozen=True, eq=False)
class Draped:
    """What the patches agree on.

    Attributes
    ----------
    motion
        Brings points of the pair's frame to where the picture's camera is believed to see them.
    points, unit
        (n, 3), frame of the pair, and (n, 3, 3), m^2 for one pixel of error: the patches that agree.
    source_px, seen
        (n, 2) and (n, 4): where the picture and both images of the pair show each of those.
    """

    motion: Motion
    points: Array
    unit: Array
    source_px: Array
    seen: Array

    @property
    def scene_from_source(self) -> Transform:
        """Return the motion that puts the picture's camera right in the frame of the pair."""
        return self.motion.new_from_old.inverse()


def range_pixel(scene: StereoView, pixel: Array, expected_m: float, spread: float = 0.3) -> PointMatch | None:
    """Return the surface under a pixel [2] of the pair's left image, None where the patch is not found again.

    It is looked for within a share `spread` of the expected range, m.
    """
    found = point_stereo(
        scene.left,
        scene.right,
        scene.left_camera,
        scene.right_camera,
        pixel,
        options=RANGED,
        expected_range_m=expected_m,
        range_spread=spread,
    )
    return found if found is not None and found.score > 0.6 else None


def find_patches(side: Side, middle: Array, standing: CameraModel, options: DrapeOptions) -> list[PointMatch]:
    """Return ranged corners of the pair's left image that the other camera has in view, by its `standing`.

    They lie on the dense cloud round a surface point (3,), frame of the pair, m, whose own place is left out.
    """
    import cv2

    scene, cloud = side.view, side.cloud
    if cloud is None:
        return []
    camera = scene.left_camera
    near = cloud.points[np.linalg.norm(cloud.points - middle, axis=1) < options.reach_m]
    near = near[standing.sees(near, options.context_px / 2)]
    pixels = np.round(camera.project(np.vstack((near, middle))))
    if len(near) < 20 or not np.isfinite(pixels[-1]).all():
        return []
    mask = np.zeros(scene.left.shape, np.uint8)
    margin = options.context_px // 2
    rows, columns = scene.left.shape
    held = (pixels >= margin).all(axis=1) & (pixels < np.array([columns, rows]) - margin).all(axis=1)
    inside = pixels[held].astype(np.int64)
    mask[inside[:, 1], inside[:, 0]] = 255
    mask = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((7, 7), np.uint8))
    cv2.circle(mask, tuple(pixels[-1].astype(int).tolist()), round(options.clear_px), 0, -1)
    spacing = max(4.0, 0.8 * math.sqrt(float((mask > 0).sum()) / options.patches))
    smooth = cv2.GaussianBlur(scene.left, (0, 0), 1.0)
    corners = cv2.goodFeaturesToTrack(smooth, options.patches, 0.003, spacing, mask=mask)
    if corners is None:
        return []
    places = corners.reshape(-1, 2).astype(np.float64)
    # the cloud knows the range: a short search suffices
    ranges = np.linalg.norm(near - camera.C, axis=1)
    found = []
    for place, nearest in zip(places, nearest_pixels(pixels[:-1], places), strict=True):
        key = float(place[0]), float(place[1]), float(ranges[nearest])
        # another guess, or another picture, asks for the same corners
        if key not in side.ranged:
            side.ranged[key] = range_pixel(scene, place, key[2], 0.08)
        found.append(side.ranged[key])
    return [match for match in found if match is not None and match.score > 0.75]


def nearest_pixels(pixels: Array, places: Array) -> npt.NDArray[np.int64]:
    """Return which of the pixels [n, 2] is nearest to each place [m, 2], by the sum of both distances; the
    first where several are.
    """
    from rover_iface.vision import drape_kernels

    out = np.empty(len(places), np.int64)
    drape_kernels.nearest_pixels(pixels, places, out)
    return out


def find_draped(
    image: Image,
    camera: CameraModel,
    source_px: Array,
    scene: StereoView,
    patch: PointMatch,
    search_px: int,
    context_px: int,
) -> tuple[Array, float, Array] | None:
    """Return the pixel [2] at which the pair's left image shows what the other camera has at `source_px` [2],
    its correlation, and the covariance [2, 2], px^2, of the alignment, NaN where it could not be aligned.

    `image` [rows, columns] is the other `camera`'s. It is draped over the plane of `patch`, in the frame of
    the pair. None where either sees the plane too flat or its image does not hold the template.
    """
    pixels, scores, spreads = find_many(image, camera, source_px[None], scene, [patch], search_px, context_px)
    return (pixels[0], float(scores[0]), spreads[0]) if scores[0] > -1.5 else None


def find_many(
    image: Image,
    camera: CameraModel,
    source_px: Array,
    scene: StereoView,
    patches: Sequence[PointMatch],
    search_px: int,
    context_px: int,
) -> tuple[Array, Array, Array]:
    """Return what `find_draped` does of n patches: pixels [n, 2], correlations [n], -2 where it has none, and
    covariances [n, 2, 2], px^2.

    `source_px` is [n, 2].
    """
    from rover_iface.vision import drape_kernels

    seen = scene.left_camera
    pixels, scores = np.full((len(patches), 2), np.nan), np.full(len(patches), -2.0)
    spreads = np.full((len(patches), 2, 2), np.nan)
    drape_kernels.find_patches_of(
        image,
        camera.packed,
        np.asarray(camera.C, dtype=np.float64),
        scene.left,
        seen.packed,
        np.asarray(seen.C, dtype=np.float64),
        seen.hs / camera.hs,
        np.ascontiguousarray(source_px, dtype=np.float64),
        np.array([patch.point for patch in patches], dtype=np.float64).reshape(-1, 3),
        np.array([patch.normal for patch in patches], dtype=np.float64).reshape(-1, 3),
        TEMPLATE_PX // 2,
        context_px // 2,
        search_px,
        SHAPE_SD,
        MOST_PX,
        pixels,
        scores,
        spreads,
    )
    return pixels, scores, spreads


def on_plane(camera: CameraModel, pixel: Array, patch: PointMatch) -> Array | None:
    """Return where (3,), m, the ray of a pixel (2,) meets the plane of a patch, in their frame, None where
    they hardly do.
    """
    origin, ray = camera.back_project(pixel)
    down = float(ray @ patch.normal)
    if abs(down) < 0.1:
        return None
    return np.asarray(origin + float((patch.point - origin) @ patch.normal) / down * ray)


def drape(
    image: Image,
    camera: CameraModel,
    scene: Side,
    middle: Array,
    guess: Transform,
    options: DrapeOptions | None = None,
) -> Draped | None:
    """Return what patches round a surface point say of a camera's pose, None where fewer than four agree.

    Parameters
    ----------
    image, camera
        The picture and its camera as believed.
    scene
        The pair whose geometry counts.
    middle
        (3,), m, frame of the pair: round which the patches are taken.
    guess
        Motion that puts the camera right in that frame.
    """
    options = options or DrapeOptions()
    patches = find_patches(scene, middle, camera.transformed(guess), options)
    best: Draped | None = None
    for search_px in options.search_px:
        found = _pass(image, camera, scene.view, patches, guess, search_px, options)
        if found is None:
            break
        best, guess = found, found.scene_from_source
    return best


def _pass(
    image: Image,
    camera: CameraModel,
    scene: StereoView,
    patches: list[PointMatch],
    guess: Transform,
    search_px: int,
    options: DrapeOptions,
) -> Draped | None:
    """Return what the patches agree on that are found within a reach of where a guess has them."""
    standing = camera.transformed(guess)
    expected = standing.project(np.array([patch.point for patch in patches]).reshape(-1, 3))
    held = np.flatnonzero(np.isfinite(expected).all(axis=1))
    shown = [patches[n] for n in held]
    pixels, scores, _ = find_many(
        image, standing, expected[held], scene, shown, search_px, options.context_px
    )
    matches, sources, places, points = [], [], [], []
    for k in np.flatnonzero(scores >= options.least_score):
        point = on_plane(scene.left_camera, pixels[k], shown[k])
        if point is not None:
            matches.append(shown[k])
            sources.append(expected[held[k]])
            places.append(pixels[k])
            points.append(point)
    if len(points) < 4:
        return None
    left, right = (np.array([getattr(m, side) for m in matches]) for side in ("left_px", "right_px"))
    unit = triangulate(scene.left_camera, scene.right_camera, left, right, sigma_px=1.0)[1]
    here, there = np.array(points), np.array(sources)
    away = np.median(np.linalg.norm(here - scene.left_camera.C, axis=1))
    growth = camera.hs / float(np.median(np.linalg.norm(here - standing.C, axis=1)))
    growth *= float(away) / scene.left_camera.hs
    settled = resect(
        here, unit, there, camera, reach_px=options.inlier_px * max(1.0, growth), sigma_px=SIGMA_PX
    )
    if settled is None:
        return None
    motion, agree = settled
    shift = np.array(places) - left
    seen = np.hstack((left + shift, right + shift))
    return Draped(motion, here[agree], unit[agree], there[agree], seen[agree])


def from_features(
    image_features: tuple[Array, Descriptors], camera: CameraModel, scene: Features, least: int
) -> Transform | None:
    """Return the motion that puts a camera right, by features that its picture shares with a ranged pair.

    `image_features` are pixels (n, 2) and descriptors of the picture. None where fewer than `least` agree:
    pictures from other directions share few, and four of them agree by chance.
    """
    pixels, descriptors = image_features
    if len(pixels) < 2 or len(scene) < 2:
        return None
    expected = np.asarray(camera.project(scene.points))
    with np.errstate(invalid="ignore"):
        across = np.abs(expected[:, None, 0] - pixels[None, :, 0]) < FEATURE_GATE_PX
        gate = across & (np.abs(expected[:, None, 1] - pixels[None, :, 1]) < FEATURE_GATE_PX)
    pairs = mutual(scene.descriptors, descriptors, FEATURE_RATIO, gate)
    one, two = pairs[:, 0], pairs[:, 1]
    settled = resect(
        scene.points[one],
        scene.unit_covariance[one],
        pixels[two],
        camera,
        reach_px=FEATURE_REACH_PX,
        sigma_px=SIGMA_PX,
    )
    if settled is None or settled[0].inliers < least:
        return None
    return settled[0].new_from_old.inverse()
