"""Resection: where a camera stood, from points ranged by another pair that its one image shows.

A mast pair that has come out of calibration ranges wrongly, which no rigid motion undoes: 8 px of disparity
are an eighth of the range at three metres. Its left camera alone is not touched by that. Three points of the
other pair and their pixels in it make a guess (P3P as in OpenCV); consensus, refit and covariance are those
of the feature tracker's motion (`sift_motion.settle`).
"""

from __future__ import annotations

import numpy as np

from rover_iface.cameras.model import Array, CameraModel
from rover_iface.frames import Transform
from rover_iface.vision.sift_motion import Mask, Motion, settle

DRAWS = 1000


def resect(
    points: Array, unit: Array, pixels: Array, camera: CameraModel, *, reach_px: float, sigma_px: float
) -> tuple[Motion, Mask] | None:
    """Return the motion that brings points to where the camera shows them, and which agree; None below four.

    Guesses are P3P solutions as OpenCV finds them; the refit is that of `sift_motion.settle`.

    Parameters
    ----------
    points, unit
        (n, 3), m, in the frame of `camera`, and their covariance (n, 3, 3), m^2, for one pixel of error of
        what ranged them.
    pixels
        (n, 2) where the image shows them.
    camera
        As believed; what is wrong with its pose goes into the motion.
    reach_px
        Consensus distance of the draws and, in units of the expected error of a pixel, of the refits.
    sigma_px
        Error of a pixel.
    """
    import cv2

    if len(points) < 4:
        return None
    axes = np.stack((camera.horizontal, np.cross(camera.A, camera.horizontal), camera.A))
    rays = camera.back_project(pixels)[1] @ axes.T
    ahead = np.flatnonzero(rays[:, 2] > 0.2)
    if len(ahead) < 4:
        return None
    found, turn, shift, inliers = cv2.solvePnPRansac(
        points[ahead],
        np.ascontiguousarray(rays[ahead, :2] / rays[ahead, 2:]),
        np.eye(3),
        None,
        flags=cv2.SOLVEPNP_AP3P,
        iterationsCount=DRAWS,
        reprojectionError=reach_px / camera.hs,
    )
    if not found or inliers is None or len(inliers) < 4:
        return None
    rotation = axes.T @ cv2.Rodrigues(turn)[0]
    guess = Transform(rotation, axes.T @ shift[:, 0] + camera.C)
    best = np.zeros(len(points), bool)
    best[ahead[inliers[:, 0]]] = True
    return settle(guess, points, unit, pixels, (camera,), best, inlier_px=reach_px, sigma_px=sigma_px)
