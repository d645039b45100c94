"""Cameras as calibration programs write them: pinhole with Brown's distortion (OpenCV, Tsai, Bouguet).

`CalibratedCamera.model` is the CAHV camera that stands for it once `straightened` has taken the distortion
out of its pictures. `CalibratedPair` is a stereo pair with the covariance of its parameters, the file
`stereo-calibration/1`; what those errors do to ranges is `CalibratedPair.point_errors`.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
import numpy.typing as npt
from annotated_types import Ge, Gt, Len

from mission.codec import Codec
from mission.errors import MissionError
from mission.values import Point3, value
from rover_iface.cameras.model import Array, CameraModel, ModelKind
from rover_iface.errors import CameraError

PARAMETERS = (
    *(
        f"{side}.{name}"
        for side in ("left", "right")
        for name in ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2")
    ),
    *(f"turn.{axis}" for axis in "xyz"),
    *(f"shift.{axis}" for axis in "xyz"),
)
"""Order of the parameters in a covariance: both cameras, then rotation vector, rad, and translation, m, of
the right camera's frame: point_right = R point_left + t (OpenCV's `stereoCalibrate`)."""


@value
class CalibratedCamera:
    """A camera of a calibration program.

    Parameters
    ----------
    focal_px, principal_px
        (fx, fy) and (cx, cy); pixel (0, 0) is the centre of the upper left one.
    distortion
        k1, k2, p1, p2 of Brown 1966 as OpenCV names them.
    center_m
        In the frame of the rig.
    rotation
        Row by row: from the camera's axes (x right, y down, z forward) to those of the rig.
    """

    width: Annotated[int, Gt(0)]
    height: Annotated[int, Gt(0)]
    focal_px: tuple[Annotated[float, Gt(0)], Annotated[float, Gt(0)]]
    principal_px: tuple[float, float]
    distortion: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    center_m: Point3 = (0.0, 0.0, 0.0)
    rotation: Annotated[tuple[float, ...], Len(9, 9)] = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)

    def model(self) -> CameraModel:
        """Return the camera in the frame of its rig, without its distortion: `straightened` takes that out of
        pictures.

        Raises
        ------
        CameraError
            If its rotation is none.
        """
        turn = np.array(self.rotation, dtype=np.float64).reshape(3, 3)
        if not np.allclose(turn @ turn.T, np.eye(3), atol=1e-4) or np.linalg.det(turn) < 0:
            raise CameraError(
                "the rotation of a calibrated camera is not orthogonal and right-handed to 1e-4"
            )
        u, _, v = np.linalg.svd(turn)  # programs print six digits: the nearest rotation is meant
        (fx, fy), (cx, cy) = self.focal_px, self.principal_px
        here = CameraModel(
            ModelKind.CAHV,
            self.width,
            self.height,
            C=np.zeros(3),
            A=np.array([0.0, 0.0, 1.0]),
            H=np.array([fx, 0.0, cx]),
            V=np.array([0.0, fy, cy]),
        )
        return here.moved(u @ v, self.center_m)

    def straightened(self, picture: npt.NDArray[np.generic]) -> npt.NDArray[np.generic]:
        """Return a picture (height, width) or (height, width, bands) as `model` sees it; 0 where it saw
        nothing.

        Brown's tangential terms have no counterpart in CAHVOR: the nearest CAHVOR camera of a wide lens
        (K10's) is 0.7 px off in a corner.
        """
        import cv2

        if not any(self.distortion):
            return picture
        (fx, fy), (cx, cy) = self.focal_px, self.principal_px
        matrix = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
        size, kind = (self.width, self.height), cv2.CV_32FC1
        x, y = cv2.initUndistortRectifyMap(matrix, np.array(self.distortion), np.eye(3), matrix, size, kind)
        source = picture if picture.dtype in (np.uint8, np.uint16) else picture.astype(np.float32)
        return np.asarray(cv2.remap(source, x, y, cv2.INTER_LINEAR))


def undistorted_rays(
    focal_px: npt.ArrayLike, principal_px: npt.ArrayLike, distortion: npt.ArrayLike, pixels: Array
) -> Array:
    """Return rays (n, 3) with z = 1, in the camera's axes, of pixels (n, 2) of a camera with distortion."""
    import cv2

    (fx, fy), (cx, cy) = np.asarray(focal_px, dtype=np.float64), np.asarray(principal_px, dtype=np.float64)
    matrix = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    # the five rounds that are the default leave tenths of a pixel in the corners of a wide lens
    rounds = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 60, 1e-12)
    flat = cv2.undistortPoints(
        np.ascontiguousarray(pixels).reshape(-1, 1, 2),
        matrix,
        np.array(distortion, dtype=np.float64),
        criteria=rounds,
    )
    return np.column_stack((flat.reshape(-1, 2), np.ones(len(pixels))))


@value
class CalibratedPair:
    """A stereo pair of a calibration program, with what its parameters may be off.

    Parameters
    ----------
    left, right
        The left camera's frame is that of the rig.
    covariance
        Row by row, of `PARAMETERS`, in their units (px, 1, rad, m) squared; None where nobody told it.
    rms_px
        What the corners of the boards are off.
    boards
        How many views of a board it rests on.
    """

    left: CalibratedCamera
    right: CalibratedCamera
    covariance: tuple[tuple[float, ...], ...] | None = None
    rms_px: Annotated[float, Ge(0)] = 0.0
    boards: Annotated[int, Ge(0)] = 0

    def __post_init__(self) -> None:
        if self.covariance is None:
            return
        if {len(self.covariance), *map(len, self.covariance)} != {len(PARAMETERS)}:
            raise MissionError(
                f"the covariance of a stereo calibration is not {len(PARAMETERS)} x {len(PARAMETERS)}"
            )
        matrix = np.array(self.covariance)
        if not np.allclose(matrix, matrix.T, rtol=1e-6) or np.diag(matrix).min() < 0:
            raise MissionError("the covariance of a stereo calibration is not one: not symmetric")

    @property
    def parameters(self) -> Array:
        """Return the parameters (22,), as `PARAMETERS` names them."""
        import cv2

        turn = np.array(self.right.rotation, dtype=np.float64).reshape(3, 3).T
        vector, _ = cv2.Rodrigues(turn)
        shift = -turn @ np.array(self.right.center_m)
        sides = [(*c.focal_px, *c.principal_px, *c.distortion) for c in (self.left, self.right)]
        return np.array([*sides[0], *sides[1], *vector.ravel(), *shift])

    def point_errors(self, points: Array) -> Array:
        """Return covariances (n, 3, 3), m^2, that the calibration alone gives points (n, 3), m, rig's frame.

        By the Jacobian of the point that two fixed pixels give, over all parameters at once: the errors of
        one calibration are the same for every point of every pair, and no averaging takes them away.

        Raises
        ------
        CameraError
            If the calibration does not tell its covariance.
        """
        if self.covariance is None:
            raise CameraError("the calibration does not tell its covariance")
        at = self.parameters
        pixels = _projected(at, points)
        sigma = np.sqrt(np.diag(np.array(self.covariance)))
        jacobian = np.empty((len(points), 3, len(at)))
        for k, step in enumerate(np.maximum(1e-3 * sigma, 1e-9)):
            ends = []
            for sign in (1.0, -1.0):
                moved = at.copy()
                moved[k] += sign * step
                ends.append(_met(moved, *pixels))
            jacobian[:, :, k] = (ends[0] - ends[1]) / (2.0 * step)
        return np.asarray(jacobian @ np.array(self.covariance) @ np.swapaxes(jacobian, 1, 2))


CALIBRATIONS = Codec(CalibratedPair, "stereo-calibration/1", "stereo calibration", error=CameraError)


def _projected(at: Array, points: Array) -> tuple[Array, Array]:
    """Return pixels (n, 2) in both cameras of points (n, 3) in the left one's frame."""
    import cv2

    pixels = []
    zero = np.zeros(3)
    for k, vector, shift in ((0, zero, zero), (8, at[16:19], at[19:22])):
        fx, fy, cx, cy = at[k : k + 4]
        matrix = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
        found, _ = cv2.projectPoints(np.ascontiguousarray(points), vector, shift, matrix, at[k + 4 : k + 8])
        pixels.append(found.reshape(-1, 2))
    return pixels[0], pixels[1]


def _met(at: Array, left_px: Array, right_px: Array) -> Array:
    """Return (n, 3) the middles of the shortest lines between the rays of pixels (n, 2), left camera's
    frame.
    """
    import cv2

    turn, _ = cv2.Rodrigues(at[16:19])
    d1 = undistorted_rays(at[0:2], at[2:4], at[4:8], left_px)
    d2 = undistorted_rays(at[8:10], at[10:12], at[12:16], right_px) @ turn
    origin = -turn.T @ at[19:22]
    a, b, c = (d1 * d1).sum(1), (d1 * d2).sum(1), (d2 * d2).sum(1)
    d, e = d1 @ origin, d2 @ origin
    det = a * c - b * b
    one = (c * d - b * e) / det
    two = (b * d - a * e) / det
    return np.asarray((one[:, None] * d1 + origin + two[:, None] * d2) / 2.0)
