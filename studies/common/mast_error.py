"""What the mast was off, by the patches that a hand-off found in both pairs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import Array, CameraModel
from rover_iface.cameras.stereo import triangulate
from rover_iface.vision.handoff import Side
from rover_iface.vision.handoff_cascade import Answer
from rover_iface.vision.sift_motion import small_rotation


@dataclass(frozen=True, slots=True)
class MastError:
    """What the mast and its pair were believed wrongly.

    Attributes
    ----------
    tilt_rad, pan_rad
        Turns about the tilt axis and about the vertical that lead from belief to truth.
    disparity_px
        What all disparities of the pair are off.
    """

    tilt_rad: float
    pan_rad: float
    disparity_px: float


def mast_error(
    side: Side, hazcam: Side, answer: Answer, pivot: npt.ArrayLike, axis: npt.ArrayLike, up: npt.ArrayLike
) -> MastError | None:
    """Return tilt, pan and disparity error of the near navcams that the patches of a hand-off tell.

    Turns about `axis` and `up` (3,) through `pivot` (3,), frame of the cameras. Tilt and pan are fitted to
    where the left picture shows what the hazcams range; the right one then tells the disparities. None
    without ten patches.
    """
    if len(answer.seen) < 10:
        return None
    centre, about = np.asarray(pivot, dtype=np.float64), (np.asarray(axis), np.asarray(up))
    navcam, view = side.view, hazcam.view
    points = triangulate(view.left_camera, view.right_camera, answer.seen[:, :2], answer.seen[:, 2:])[0]

    def shown(p: Array, camera: CameraModel) -> Array:
        turn = small_rotation(p[0] * about[0] + p[1] * about[1])
        return np.asarray(camera.project((points - centre) @ turn + centre))

    p, size = np.zeros(2), 1e-4
    for _ in range(12):
        r = (answer.left_px - shown(p, navcam.left_camera)).ravel()
        steps = [(shown(p + e, navcam.left_camera) - answer.left_px).ravel() for e in size * np.eye(2)]
        j = np.column_stack([(step + r) / size for step in steps])
        good = np.isfinite(r) & np.isfinite(j).all(axis=1)
        if good.sum() < 12:
            return None
        scale = 1.5 * max(0.2, float(np.median(np.abs(r[good]))))
        jw = j[good] / np.maximum(1.0, np.abs(r[good]) / scale)[:, None]
        step = np.linalg.solve(jw.T @ j[good], jw.T @ r[good])
        p = p + step
        if np.abs(step).max() < 1e-6:
            break
    disparity = float(np.nanmedian((answer.right_px - shown(p, navcam.right_camera))[:, 0]))
    return MastError(float(p[0]), float(p[1]), disparity)
