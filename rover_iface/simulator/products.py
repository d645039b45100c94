"""What goes into the files that a rover on terrain brings home: pictures, camera models, tables."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rover_iface.frames import Pose
from rover_iface.simulator.engine import pose_label

if TYPE_CHECKING:
    from rover_iface.cameras.model import CameraModel
    from rover_iface.simulator.body import Body


@dataclass(frozen=True, slots=True)
class TrackRecord:
    """One answer of the tracker and, for the study of it, how far off it truly was."""

    t_s: float
    target: str
    state: str
    confidence: float
    range_m: float
    error_m: float
    reasons: tuple[str, ...]


def png(pixels: Any) -> bytes:
    """Return an 8-bit image [rows, columns] or [rows, columns, 3] as PNG."""
    import io

    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "PNG")
    return stream.getvalue()


def picture_label(
    camera: CameraModel,
    point: npt.ArrayLike | None,
    body: Body,
    true_camera: CameraModel,
    true_point: npt.ArrayLike | None,
) -> dict[str, Any]:
    """Return the part of a picture's label that says what it looks at.

    `camera_model` and `point_m` are in the believed site frame, as all of a real label: the camera of the
    picture itself (subframe and scale taken in) on the pose of dead reckoning with the mast angles as read,
    and the point (3,) it was taken of. What only a simulation knows stands under `simulation_truth`, in the
    true site frame.
    """
    from rover_iface.cameras.panorama import camera_document

    label: dict[str, Any] = {"camera_model": camera_document(camera)}
    truth: dict[str, Any] = {
        "frame": "true site",
        "camera_model": camera_document(true_camera),
        "pose": pose_label(body.pose),
    }
    for part, value in ((label, point), (truth, true_point)):
        if value is not None:
            part["point_m"] = [float(v) for v in np.asarray(value, dtype=float)]
    return {**label, "simulation_truth": truth}


def odometry_table(odometry: Iterable[tuple[float, Pose, Pose]]) -> bytes:
    """Return (t_s, true pose, believed pose) as JSON, one row each."""
    return _table(
        {
            "t_s": t,
            "true": [true.x, true.y, true.z, true.heading],
            "believed": [believed.x, believed.y, believed.z, believed.heading],
        }
        for t, true, believed in odometry
    )


def tracking_table(history: Iterable[TrackRecord]) -> bytes:
    """Return the answers of the tracker as JSON, one row each."""
    return _table(asdict(record) for record in history)


def _table(rows: Iterable[dict[str, Any]]) -> bytes:
    return (json.dumps(list(rows)) + "\n").encode()
