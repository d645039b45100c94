"""An attempt to place an instrument: what was decided and done, and a hazcam picture with it drawn on."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from rover_iface.behaviour.hardware import Contact
from rover_iface.behaviour.placing import HandedOff
from rover_iface.cameras.model import Array, CameraModel
from rover_iface.placement.arm import Arm
from rover_iface.placement.arm_motion import Motion
from rover_iface.placement.cloud import SurfaceCloud
from rover_iface.placement.cloud_alignment import Alignment
from rover_iface.placement.segmentation import Segmentation
from rover_iface.placement.verdict import PlacementVerdict


@dataclass(frozen=True, eq=False)
class Attempt:
    """One placement as it was decided and carried out; rover frame where not said otherwise.

    `laid` is the mast's cloud as it was registered to the hazcams' `cloud`, None where that failed; `looks`
    what the narrow pair ranged of the places that it was pointed to, registered too, None where that failed.
    """

    handed: HandedOff
    verdict: PlacementVerdict
    cloud: SurfaceCloud
    segmentation: Segmentation
    laid: Alignment | None
    motion: Motion | None
    touch: Contact | None
    looks: tuple[SurfaceCloud | None, ...] = ()


def overlay(
    image: npt.NDArray[np.uint8], camera: CameraModel, attempt: Attempt, arm: Arm
) -> npt.NDArray[np.uint8]:
    """Return a hazcam image with what was decided, RGB [rows, columns, 3]: the rock (orange), the target as
    handed off (white cross), the tool's circle (green; red when refused), the arm at contact (blue).

    `image` [rows, columns], DN of 8 bits, is that of `camera`, the left hazcam in the rover frame.
    """
    import cv2

    out = np.repeat(image[:, :, None], 3, axis=2)
    verdict = attempt.verdict
    if verdict.rock is not None:
        points = attempt.cloud.points[attempt.segmentation.labels == verdict.rock.label]
        pixels = _inside(camera.project(points), out.shape)
        tint = out[pixels[:, 1], pixels[:, 0]].astype(np.float64)
        out[pixels[:, 1], pixels[:, 0]] = (0.7 * tint + 0.3 * np.array([255, 150, 40])).astype(np.uint8)
    good, bad, blue = (60, 230, 90), (240, 50, 50), (70, 140, 255)
    if verdict.point is not None and verdict.normal is not None:
        ring = _circle(verdict.point, verdict.normal, arm.profile.tool_radius_m)
        line = np.round(camera.project(ring)).astype(np.int32)
        cv2.polylines(out, [line.reshape(-1, 1, 2)], True, good if verdict.accepted else bad, 2, cv2.LINE_AA)
    if attempt.motion is not None:
        places = arm.joint_places(attempt.motion.contact)
        t = np.linspace(0.0, 1.0, 12)[:, None]
        for a, b in pairwise(places[1:]):
            link = camera.project(a + t * (b - a))
            link = link[np.isfinite(link).all(axis=1)]
            if len(link) > 1:
                cv2.polylines(
                    out, [np.round(link).astype(np.int32).reshape(-1, 1, 2)], False, blue, 3, cv2.LINE_AA
                )
    x, y = (round(float(v)) for v in attempt.handed.update.pixel)
    cv2.drawMarker(out, (x, y), (255, 255, 255) if verdict.accepted else bad, cv2.MARKER_CROSS, 17, 2)
    return np.asarray(out, dtype=np.uint8)


def _inside(pixels: Array, shape: tuple[int, ...]) -> npt.NDArray[np.int64]:
    whole = np.round(pixels[np.isfinite(pixels).all(axis=1)]).astype(np.int64)
    keep = (whole >= 0).all(axis=1) & (whole[:, 0] < shape[1]) & (whole[:, 1] < shape[0])
    return np.asarray(whole[keep])


def _circle(middle: Array, normal: Array, radius: float) -> Array:
    side = np.cross(normal, (0.0, 0.0, 1.0) if abs(normal[2]) < 0.9 else (1.0, 0.0, 0.0))
    side /= np.linalg.norm(side)
    turn = np.linspace(0.0, 2.0 * np.pi, 40)[:, None]
    return np.asarray(middle + radius * (np.cos(turn) * side + np.sin(turn) * np.cross(normal, side)))
