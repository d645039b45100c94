"""A close look before the tool touches: the mast's narrow pair on the place, registered to what was ranged.

The narrow pair ranges a rock at arm's length to within a millimetre, a point each two millimetres, and shows
the cracks and bumps that the wide ones smooth over. Its frames have little in common so near: both cameras
hold a place only if the mast points between them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rover_iface.behaviour.hardware import Window
from rover_iface.cameras.model import Array, CameraModel
from rover_iface.cameras.rig import CameraRig
from rover_iface.cameras.stereo import dense_stereo
from rover_iface.errors import CameraError
from rover_iface.frames import Transform
from rover_iface.placement.cloud import NARROW_DISPARITY_RAD, SurfaceCloud, cloud_of_stereo
from rover_iface.placement.cloud_alignment import Alignment, align
from rover_iface.vision.tracker import StereoView

NARROW = ("pancam_left", "pancam_right")

SCALE = 0.5
"""The frames are read out binned by two: on eight rocks (16000 to 16028) the holes are as wide as in whole
ones, the error is 0.7 mm instead of 0.4, and all costs a quarter."""

WINDOW_PX = (224, 240)
"""Of the binned frames; 19 cm at 1.45 m, where both cameras have 13 cm of width in common."""

NEARER_M, FARTHER_M = 0.30, 0.25
"""So far before and behind the place is searched for matches: rocks are no higher."""

BLOCK_PX, LEAST_CONTRAST, STEP = 5, 1.0, 2

ROUND_PX, LEAST_ROUND, MISSED_PX = 4.0, 6, 3.0
"""Round a designated pixel of the navcams, so many of their points tell how far away it is: the cloud holds
every second pixel, and its nearest point lies within the last. By 7 px, 9 mm, the place was up to 6.9 mm off
on rough faces, by 4 px 4.5 (14 rocks, 44300 to 44316, without what the track errs)."""

ONE_SURFACE_M = 0.02
"""What lies so far behind the nearest of them is another surface, which the ray passes over."""

HANDED_M = 0.02
"""How far from where it was handed off a target may be by its pixel: four times what the hand-off errs (0.9
cm in one of twenty, docs/results/handoff.md). Farther off one of them is another spot, nobody knows which."""


def carried(rig: CameraRig) -> bool:
    """Return whether a rover has both narrow cameras."""
    return all(name in rig.cameras for name in NARROW)


def aim(rig: CameraRig, at: Array) -> tuple[float, float, tuple[Window, Window]]:
    """Return pan and tilt, rad, by which both narrow cameras hold a point (3,), rover frame, m, and the
    windows round it of the binned frames.

    Raises
    ------
    CameraError
        If the mast cannot point there, or a camera does not hold the point.
    """
    pan, tilt = (float(v) for v in np.mean([rig.point_at(at, name) for name in NARROW], axis=0))
    windows = []
    for name in NARROW:
        camera = rig.camera(name, pan, tilt).scaled(SCALE)
        pixel = camera.project(at)
        if not bool(camera.sees(at)):
            raise CameraError(f"{name} does not hold the place {np.round(at, 3).tolist()}")
        width, height = min(WINDOW_PX[0], camera.width), min(WINDOW_PX[1], camera.height)
        left = min(max(round(float(pixel[0])) - width // 2, 0), camera.width - width)
        top = min(max(round(float(pixel[1])) - height // 2, 0), camera.height - height)
        windows.append((left, top, width, height))
    return pan, tilt, (windows[0], windows[1])


def depths(camera: CameraModel, at: Array) -> tuple[float, float]:
    """Return between which depths, m, along the axis of the left camera a match is searched for round a point
    (3,), in the camera's frame.
    """
    depth = float((at - camera.C) @ camera.A)
    return depth - NEARER_M, depth + FARTHER_M


def narrow_cloud(
    view: StereoView, at: Array, up: tuple[float, float, float] = (0.0, 0.0, 1.0)
) -> SurfaceCloud | None:
    """Return what the narrow pair ranges round a point (3,), in the frame of its cameras, in which `up`
    is upwards; None where that is nothing.
    """
    nearest, farthest = depths(view.left_camera, at)
    try:
        dense = dense_stereo(
            view.left,
            view.right,
            view.left_camera,
            view.right_camera,
            nearest_m=nearest,
            farthest_m=farthest,
            block_px=BLOCK_PX,
            least_contrast=LEAST_CONTRAST,
            step=STEP,
        )
    except CameraError:
        return None
    cloud = cloud_of_stereo(dense, disparity_rad=NARROW_DISPARITY_RAD, farthest_m=2.0 * farthest)
    return replace(cloud.thinned(STEP), up=up) if len(cloud) else None


def registered(narrow: SurfaceCloud, moved: Transform | None, to: SurfaceCloud) -> SurfaceCloud | None:
    """Return the narrow pair's cloud registered to another, all in the rover frame; None where that is not to
    be trusted.

    `moved` is how the wide pair's cloud was moved on the hazcams': the mast is off by much the same still.
    """
    laid = align(narrow if moved is None else narrow.moved(moved, up=narrow.up), to)
    return laid.cloud if laid is not None and laid.believed() else None


def meant_on(laid: Alignment, camera: CameraModel, pixel: Array, handed: Array) -> Array | None:
    """Return where (3,), m, the mast's cloud, registered to the hazcams', has a designated pixel (2,) of the
    navcams; None where it has a hole there, or that is not near where the target was `handed` off (3,), m.

    `camera` is the left one of the pair that gave the cloud, as the mast's angles say, in the rover frame.
    What the mast is off, the registration has told to a millimetre; a pixel of the hazcams, in which a
    hand-off has the target, is three.
    """
    standing = camera.transformed(laid.motion)
    points = laid.cloud.points[np.linalg.norm(laid.cloud.points - handed, axis=1) < 3.0 * HANDED_M]
    off = np.asarray(standing.project(points)).reshape(-1, 2) - pixel
    away = np.linalg.norm(points - standing.C, axis=1)
    near = np.hypot(*off.T) < ROUND_PX
    if not near.any():
        return None
    near &= away < away[near].min() + ONE_SURFACE_M
    if near.sum() < LEAST_ROUND or np.hypot(*off[near].T).min() > MISSED_PX:
        return None
    design = np.column_stack((off[near], np.ones(int(near.sum()))))
    origin, ray = standing.back_project(pixel)
    place = np.asarray(origin + float(np.linalg.lstsq(design, away[near], rcond=None)[0][2]) * ray)
    return place if float(np.linalg.norm(place - handed)) <= HANDED_M else None
