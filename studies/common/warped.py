"""Real stereo pairs seen again by known geometry: cameras turned about their centres and zoomed, pictures
compressed as flown. What is right is known to a hundredth of a pixel; range is not, but where the
disparity is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.linear import warp
from rover_iface.cameras.model import CameraModel, pinhole
from rover_iface.frames import Transform
from rover_iface.vision.tracker import StereoView
from studies.common.tracking_worlds import Array

Grey = npt.NDArray[np.float32]
DEVON = (968.999694824, 635.139038086, 463.537109375, 0.239977002)
"""Focal length, image centre, pixels, and baseline, metres (README of the imagery)."""
SIZE = (481, 401)
ZOOM = (0.40, 1.0)
GROWTH = 1.11


@dataclass(frozen=True)
class Sight:
    """A view, the left camera as it was, and both pictures' compression."""

    view: StereoView
    true_left: CameraModel
    true_right: CameraModel


@dataclass(frozen=True)
class WarpedRun:
    """Sights of one real pair, and the lines of sight (3,) that are followed through them."""

    name: str
    seed: int
    sights: list[Sight]
    rays: list[Array]
    origin: Array


def _pair(name: str, imagery: Path) -> tuple[Grey, Grey, CameraModel, CameraModel]:
    import cv2

    if name == "aloe":
        paths = imagery / "opencv/aloeL.jpg", imagery / "opencv/aloeR.jpg"
    else:
        paths = imagery / f"devon/{name}-left.png", imagery / f"devon/{name}-right.png"
    left, right = (
        cv2.imread(str(p), cv2.IMREAD_GRAYSCALE).astype(np.float32) / np.float32(255.0) for p in paths
    )
    focal, cx, cy, baseline = DEVON if name != "aloe" else (1100.0, 640.5, 554.5, 0.16)
    cameras = [
        pinhole(
            focal_px=focal,
            width=left.shape[1],
            height=left.shape[0],
            center=(0.0, -baseline * n, 0.0),
            principal_px=(cx, cy),
        )
        for n in (0, 1)
    ]
    return left, right, cameras[0], cameras[1]


def compressed(image: Grey, kind: str, bits: float) -> Grey:
    """Return a picture after JPEG or wavelet compression to about `bits` a pixel."""
    import cv2

    eight = np.clip(np.round(255.0 * image), 0, 255).astype(np.uint8)
    if kind == "wavelet":
        data = cv2.imencode(".jp2", eight, [cv2.IMWRITE_JPEG2000_COMPRESSION_X1000, round(1000 * bits / 8)])[
            1
        ]
    else:
        for quality in (95, 90, 85, 80, 70, 60, 50, 40, 30, 20, 10):
            data = cv2.imencode(".jpg", eight, [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
            if 8 * len(data) <= bits * eight.size:
                break
    return cv2.imdecode(data, cv2.IMREAD_GRAYSCALE).astype(np.float32) / np.float32(255.0)


def warped_run(name: str, seed: int, imagery: Path, count: int = 6) -> WarpedRun:
    """Return ten sights of a real pair, zoomed in on a spot of its lower part while the cameras turn."""
    rng = np.random.default_rng([seed, 0xC0DE])
    left, right, left_camera, right_camera = _pair(name, imagery)
    rows, columns = left.shape
    spot = np.array([rng.uniform(0.35, 0.65) * columns, rng.uniform(0.55, 0.80) * rows])
    origin, ray = left_camera.back_project(spot)
    rays = []
    for _ in range(count):
        r = left_camera.back_project(spot + rng.uniform(-90, 90, 2))[1]
        rays.append(np.asarray(r))
    kind, bits = str(rng.choice(("jpeg", "wavelet"))), float(rng.uniform(1.0, 4.0))
    sights, zoom = [], ZOOM[0]
    while zoom <= ZOOM[1]:
        turn = np.radians(rng.normal(0, (3.0, 1.0, 1.0)))
        noise = rng.normal(0, math.radians(0.15), 3)
        made = []
        for image, camera in ((left, left_camera), (right, right_camera)):
            true = _seen(camera, turn, zoom, ray)
            told = _seen(camera, turn + noise, zoom, ray)
            seen = warp(_shrunk(image, zoom), camera.scaled(_level(zoom)), true)
            noisy = seen + rng.normal(0, 0.004, seen.shape).astype(np.float32)
            made.append((compressed(noisy.astype(np.float32), kind, bits), told, true))
        (a, told_a, true_a), (b, told_b, true_b) = made
        sights.append(Sight(StereoView(a, b, told_a, told_b), true_a, true_b))
        zoom *= GROWTH
    return WarpedRun(name, seed, sights, rays, np.asarray(origin))


def _level(zoom: float) -> float:
    return 1.0 if zoom > 0.7 else 0.5


def _shrunk(image: Grey, zoom: float) -> Grey:
    import cv2

    if _level(zoom) == 1.0:
        return image
    rows, columns = image.shape
    return np.asarray(
        cv2.resize(
            image[: rows // 2 * 2, : columns // 2 * 2],
            (columns // 2, rows // 2),
            interpolation=cv2.INTER_AREA,
        )
    )


def _seen(camera: CameraModel, turn: Array, zoom: float, ray: Array) -> CameraModel:
    """Return a camera turned about its centre (roll, pitch, yaw), zoomed, and cut round a line of sight."""
    rotation = Transform.from_rpy(*turn).rotation
    turned = camera.transformed(Transform(rotation, camera.C - rotation @ camera.C)).scaled(zoom)
    middle = turned.project(turned.C + 5.0 * ray)
    left, top = round(float(middle[0])) - SIZE[0] // 2, round(float(middle[1])) - SIZE[1] // 2
    return turned.window(left, top, *SIZE)
