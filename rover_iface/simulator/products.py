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
    from rover_iface.vision.tracker import TrackUpdate


@dataclass(frozen=True, slots=True)
class TrackRecord:
    """One answer of the tracker, its position in the believed site frame, and how far off it truly was."""

    t_s: float
    target: str
    state: str
    confidence: float
    range_m: float
    error_m: float
    reasons: tuple[str, ...]
    position_m: tuple[float, float, float]


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


def track_label(update: TrackUpdate, corner: tuple[int, int] = (0, 0)) -> dict[str, Any]:
    """Return the part of a picture's label that says where its target is tracked.

    Position (3,) and covariance (3, 3), m^2, in the believed site frame; pixel (2,) and outline of the
    template (4, 2) in the picture whose left upper pixel is `corner` of the one tracked in, absent while the
    target is lost.
    """
    label: dict[str, Any] = {
        "state": update.state.value,
        "confidence": float(update.confidence),
        "point_m": [float(v) for v in update.position],
        "covariance_m2": np.asarray(update.covariance, dtype=float).tolist(),
    }
    if np.isfinite(update.pixel).all():
        at = np.asarray(update.pixel, dtype=float) - corner
        label["pixel"] = at.tolist()
        half = update.scores.get("template_px", 0.0) / 2
        if half > 0:
            label["outline"] = (at + half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])).tolist()
    return label


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
