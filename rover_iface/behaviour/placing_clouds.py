"""The clouds that a placement is judged on: the hazcams', and the mast's registered to it."""

from __future__ import annotations

import numpy as np

from rover_iface.cameras.stereo import dense_stereo
from rover_iface.errors import CameraError
from rover_iface.frames import Transform
from rover_iface.placement.cloud import NAVCAM_DISPARITY_RAD, SurfaceCloud, cloud_of_stereo
from rover_iface.placement.cloud_alignment import Alignment, align
from rover_iface.vision.tracker import StereoView

HAZCAM_NEAREST_M, HAZCAM_FARTHEST_M = 0.30, 4.0
SCALE = 1.5
"""Of the aligned hazcam pair: aligning a fisheye pair takes a third of the resolution in its middle."""

MAST_NEAREST_M, MAST_FARTHEST_M = 1.15, 3.0
MAST_STEP = 2
"""Every so many columns and rows of the mast's subframe count: on the ground they are then as wide as the
hazcams'."""


def hazcam_cloud(view: StereoView, rover_from_site: Transform) -> SurfaceCloud:
    """Return what a hazcam pair, cameras in the site frame, ranges; rover frame."""
    cameras = view.left_camera, view.right_camera
    dense = dense_stereo(view.left, view.right, *cameras, nearest_m=HAZCAM_NEAREST_M, scale=SCALE)
    return _in_rover(cloud_of_stereo(dense, farthest_m=HAZCAM_FARTHEST_M), rover_from_site)


def mast_cloud(view: StereoView, rover_from_site: Transform, hazcam: SurfaceCloud) -> Alignment | None:
    """Return what the navcams range, registered to the hazcams' cloud; None where that cannot be believed.

    The view is of the same stop, cameras in the site frame as the mast angles say.
    """
    cameras = view.left_camera, view.right_camera
    try:
        dense = dense_stereo(
            view.left,
            view.right,
            *cameras,
            nearest_m=MAST_NEAREST_M,
            block_px=5,
            least_contrast=1.5,
            step=MAST_STEP,
        )
    except CameraError:
        return None
    cloud = cloud_of_stereo(dense, disparity_rad=NAVCAM_DISPARITY_RAD, farthest_m=MAST_FARTHEST_M)
    if not len(cloud):
        return None
    laid = align(_in_rover(cloud.thinned(MAST_STEP), rover_from_site), hazcam)
    return laid if laid is not None and laid.believed() else None


def _in_rover(cloud: SurfaceCloud, rover_from_site: Transform) -> SurfaceCloud:
    up = np.asarray(rover_from_site.rotate((0.0, 0.0, 1.0)), dtype=np.float64)
    up /= np.linalg.norm(up)
    return cloud.moved(rover_from_site, up=(float(up[0]), float(up[1]), float(up[2])))
