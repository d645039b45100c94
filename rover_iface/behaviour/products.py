"""What goes into the files that a rover brings home: pictures, camera models, tracks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from rover_iface.cameras.model import CameraModel
    from rover_iface.vision.tracker import TrackUpdate


def png(pixels: Any) -> bytes:
    """Return an 8-bit image [rows, columns] or [rows, columns, 3] as PNG."""
    import io

    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "PNG")
    return stream.getvalue()


def picture_label(camera: CameraModel, point: npt.ArrayLike | None) -> dict[str, object]:
    """Return the part of a picture's label that says what it looks at, in the believed site frame.

    The camera of the picture itself (subframe and scale taken in) on the pose of dead reckoning with the mast
    angles as read, and the point (3,), m, it was taken of.
    """
    from rover_iface.cameras.panorama import camera_document

    label: dict[str, object] = {"camera_model": camera_document(camera)}
    if point is not None:
        label["point_m"] = [float(v) for v in np.asarray(point, dtype=float)]
    return label


def track_label(update: TrackUpdate, corner: tuple[int, int] = (0, 0)) -> dict[str, object]:
    """Return the part of a picture's label that says where its target is tracked.

    Position (3,) and covariance (3, 3), m^2, in the believed site frame; pixel (2,) and outline of the
    template (4, 2) in the picture whose left upper pixel is `corner` of the one tracked in, absent while the
    target is lost.
    """
    label: dict[str, object] = {
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
