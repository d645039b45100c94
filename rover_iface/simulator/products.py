"""What goes into the files that a rover on terrain brings home: pictures, camera models, tables."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from rover_iface.frames import Pose

if TYPE_CHECKING:
    from rover_iface.cameras.model import CameraModel


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


def camera_label(camera: CameraModel) -> dict[str, Any]:
    """Return a camera model as plain values for a product's label; vectors in the true site frame."""
    label: dict[str, Any] = {"kind": camera.kind.value, "width": camera.width, "height": camera.height}
    for letter in camera.kind.value:
        label[letter] = [float(v) for v in getattr(camera, letter)]
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
