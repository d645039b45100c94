"""Whether the two cameras of a pair agree about the rows of what both pictures show.

Points that both see are found by SIFT in the aligned pictures. There they must lie on common rows: a row that
differs tells of a calibration, a label or a partner that is wrong, and says so before any depth is believed.
What rows do not tell is an error along them: two cameras that are turned towards each other by a wrong angle
keep their rows and err in range. It shows as negative disparities only when it is large.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from rover_iface.cameras.linear import FAR_M, aligned_pair, warp
from rover_iface.cameras.model import Array, CameraModel
from rover_iface.errors import CameraError
from rover_iface.frames import rotation_from_quaternion
from rover_iface.reconstruction.outcomes import Reason, RefusedError
from rover_iface.reconstruction.picture_pairs import PicturePair

RATIO = 0.8
"""Of the best to the second-best SIFT distance (Lowe 2004, section 7.1)."""


@dataclass(frozen=True, slots=True)
class RowLimits:
    """What is asked of a pair; px of the aligned pictures.

    `most_apart_px`: two Devon pairs of a factory calibration differ by 0.5 to 0.6 px in the median, the K10
    pair, whose calibration its makers call stale, by 2. What differs by more than 3 is not the calibration
    of these pictures. `meet_px`: semi-global matching compares blocks of 7 rows and bears a difference of
    one.
    """

    least_matches: int = 40
    most_apart_px: float = 3.0
    meet_px: float = 1.0
    agree_px: float = 3.0
    least_agreeing: float = 0.5
    most_swapped: float = 0.5


@dataclass(frozen=True, slots=True)
class RowCheck:
    """How the rows of a pair meet.

    Attributes
    ----------
    matches
        Points that both pictures show and whose rows agree with each other.
    apart_px
        Median of the rows' difference, without sign, as the calibration has it.
    after_px
        The same with the right camera turned.
    bias_px
        Root mean square of the part of the difference that is a plane over the picture: what is not the
        error of single points.
    widest_px
        Disparity that all but one in a hundred points stay below.
    turned_rad
        How the right camera was turned about its row and its axis; zeros if its rows met.
    right_camera
        The right camera to use.
    """

    matches: int
    apart_px: float
    after_px: float
    bias_px: float
    widest_px: float
    turned_rad: tuple[float, float]
    right_camera: CameraModel


def check_rows(pair: PicturePair, limits: RowLimits | None = None) -> RowCheck:
    """Return how the rows of a pair meet, with the right camera turned where they meet badly.

    Raises
    ------
    RefusedError
        If too few points are seen by both, left and right are swapped, or rows differ by more than the limit.
    """
    limits = limits or RowLimits()
    try:
        one, two = aligned_pair(pair.left_camera, pair.right_camera)
    except CameraError as err:
        swapped = float((pair.right_camera.C - pair.left_camera.C) @ pair.left_camera.horizontal) < 0
        reason = Reason.SIDES_SWAPPED if swapped else Reason.LABEL_CONTRADICTION
        raise RefusedError(reason, pair.name, str(err)) from err
    found = _matches(pair, one, two)
    if len(found) < limits.least_matches:
        raise RefusedError(
            Reason.FEW_MATCHES,
            pair.name,
            f"only {len(found)} points are seen by both pictures; {limits.least_matches} are needed to check "
            "the calibration",
        )
    rows = found[:, 3] - found[:, 1]
    middle = float(np.median(rows))
    agree = np.abs(rows - middle) <= limits.agree_px + 0.5 * abs(middle)
    if float(agree.mean()) < limits.least_agreeing:
        raise RefusedError(
            Reason.FEW_MATCHES,
            pair.name,
            f"of {len(found)} like points only {100 * float(agree.mean()):.0f} % lie on matching rows; "
            f"{100 * limits.least_agreeing:g} % are needed: the two pictures do not show the same",
        )
    kept = found[agree]
    behind = float((kept[:, 0] < kept[:, 2] - limits.agree_px).mean())
    if behind > limits.most_swapped:
        raise RefusedError(
            Reason.SIDES_SWAPPED,
            pair.name,
            f"{100 * behind:.0f} % of {len(kept)} points would lie behind the cameras: left and right are "
            "swapped, or the cameras are turned towards each other by a wrong angle",
        )
    apart = float(np.median(np.abs(kept[:, 3] - kept[:, 1])))
    if apart > limits.most_apart_px:
        raise RefusedError(
            Reason.ROWS_APART,
            pair.name,
            f"the rows of {len(kept)} points that both pictures show differ by {apart:.1f} px (median); the "
            f"limit is {limits.most_apart_px:g}: the calibration is not that of these pictures",
        )
    if apart <= limits.meet_px:
        return RowCheck(len(kept), apart, apart, _bias(kept), _widest(kept), (0.0, 0.0), pair.right_camera)
    return _turned(pair, two, kept, apart)


def _widest(kept: Array) -> float:
    return float(np.percentile(kept[:, 0] - kept[:, 2], 99.0))


def _bias(kept: Array) -> float:
    """Return the rms, px, of a plane over the picture that the rows (n, 4) differ by, mismatches weighted
    down.
    """
    rows = kept[:, 3] - kept[:, 1]
    design = np.column_stack((np.ones(len(kept)), kept[:, :2]))
    weight = np.ones(len(kept))
    plane = np.zeros(len(kept))
    for _ in range(10):  # weights of Cauchy settle in a few rounds
        root = np.sqrt(weight)
        plane = design @ np.linalg.lstsq(design * root[:, None], rows * root, rcond=None)[0]
        weight = 1.0 / (1.0 + (rows - plane) ** 2)
    return float(np.sqrt(np.mean(plane**2)))


def _matches(pair: PicturePair, one: CameraModel, two: CameraModel) -> Array:
    """Return (n, 4) places of points in both aligned pictures: sample and line, left and right."""
    import cv2

    sift = cv2.SIFT.create(nfeatures=4000)
    seen = []
    for image, source, to in ((pair.left, pair.left_camera, one), (pair.right, pair.right_camera, two)):
        warped = np.round(255.0 * np.clip(warp(image, source, to), 0.0, 1.0)).astype(np.uint8)
        # the rim of what is lost or outside the frame is the same picture's own feature everywhere
        inside = cv2.erode((warped > 0).astype(np.uint8), np.ones((15, 15), np.uint8))
        points, descriptors = sift.detectAndCompute(warped, inside)
        if descriptors is None or len(points) < 2:
            return np.empty((0, 4))
        seen.append((np.array([p.pt for p in points]), descriptors))
    best = cv2.BFMatcher(cv2.NORM_L2).knnMatch(seen[0][1], seen[1][1], k=2)
    pairs = [
        (m[0].queryIdx, m[0].trainIdx) for m in best if len(m) == 2 and m[0].distance < RATIO * m[1].distance
    ]
    if not pairs:
        return np.empty((0, 4))
    left, right = np.array(pairs).T
    return np.column_stack((seen[0][0][left], seen[1][0][right]))


def _turned(pair: PicturePair, two: CameraModel, kept: Array, apart: float) -> RowCheck:
    """Return the check with the right camera turned about its row and its axis until rows meet.

    The angle about the column is left alone: it moves disparities and no rows, so rows cannot tell it.
    """
    from scipy.optimize import least_squares

    camera = pair.right_camera
    far = two.C + FAR_M * two.back_project(kept[:, 2:])[1]
    rays = camera.back_project(camera.project(far))[1]

    def rows(angles: Array) -> Array:
        lines = two.project(two.C + FAR_M * (rays @ _turn(two, angles).T))[:, 1]
        return np.asarray(lines - kept[:, 1])

    # points that are mismatched along the rows of a repeating ground pull by their root only
    fit = least_squares(rows, np.zeros(2), loss="soft_l1")
    after = float(np.median(np.abs(rows(fit.x))))
    if not after < apart:
        return RowCheck(len(kept), apart, apart, _bias(kept), _widest(kept), (0.0, 0.0), camera)
    turn = _turn(two, fit.x)
    turned = replace(camera, A=turn @ camera.A, H=turn @ camera.H, V=turn @ camera.V, O=turn @ camera.O)
    return RowCheck(
        len(kept), apart, after, _bias(kept), _widest(kept), (float(fit.x[0]), float(fit.x[1])), turned
    )


def _turn(camera: CameraModel, angles: Array) -> Array:
    """Return the rotation (3, 3) by small angles (2,), rad, about a camera's row and about its axis."""
    turn = np.eye(3)
    for axis, angle in ((camera.horizontal, angles[0]), (camera.A, angles[1])):
        half = math.sin(angle / 2) * axis
        turn = turn @ rotation_from_quaternion(math.cos(angle / 2), *(float(v) for v in half))
    return turn
