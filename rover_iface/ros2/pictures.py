"""Files out of images of ROS: PNG of raw ones, compressed ones as they are."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from executive.ports import Value
from rover_iface.ros2.field_paths import AbsentError

_RAW: Mapping[str, tuple[str, int, tuple[int, ...]]] = {
    "mono8": ("u1", 1, (0,)),
    "8UC1": ("u1", 1, (0,)),
    "mono16": ("u2", 1, (0,)),
    "16UC1": ("u2", 1, (0,)),
    "rgb8": ("u1", 3, (0, 1, 2)),
    "8UC3": ("u1", 3, (0, 1, 2)),
    "bgr8": ("u1", 3, (2, 1, 0)),
    "rgba8": ("u1", 4, (0, 1, 2)),
    "bgra8": ("u1", 4, (2, 1, 0)),
}
"""Type of a sample, channels, and which of them are red, green and blue (REP 118 and sensor_msgs)."""
_MAGIC = {b"\x89PNG\r\n\x1a\n": ".png", b"\xff\xd8\xff": ".jpg"}
LARGEST = 1 << 28
"""Bytes of an image, at most."""


def picture_of(message: Any) -> tuple[str, bytes, dict[str, Value]]:
    """Return the ending, the bytes and the label of the file that an image makes.

    Raises
    ------
    AbsentError
        If the encoding is not known, or the image is shorter than it says.
    """
    label: dict[str, Value] = {"frame": str(message.header.frame_id)}
    stamp = message.header.stamp
    label["stamp_s"] = stamp.sec + stamp.nanosec * 1e-9
    data = bytes(message.data)
    if len(data) > LARGEST:
        raise AbsentError(f"it has {len(data)} bytes; at most {LARGEST} are taken")
    if hasattr(message, "format"):
        for magic, suffix in _MAGIC.items():
            if data.startswith(magic):
                return suffix, data, label
        raise AbsentError(f"its format is {str(message.format)[:60]!r}; PNG and JPEG are taken")
    pixels = _pixels(message, data)
    label |= {
        "encoding": str(message.encoding),
        "width": float(message.width),
        "height": float(message.height),
    }
    return ".png", _png(pixels), label


def _pixels(message: Any, data: bytes) -> npt.NDArray[Any]:
    """Return the samples [rows, columns] or [rows, columns, 3] of a raw image."""
    if message.encoding not in _RAW:
        raise AbsentError(f"its encoding is {str(message.encoding)[:60]!r}; taken are {', '.join(_RAW)}")
    kind, channels, colours = _RAW[message.encoding]
    sample = np.dtype(kind).newbyteorder(">" if message.is_bigendian else "<")
    rows, columns, step = int(message.height), int(message.width), int(message.step)
    row_bytes = columns * channels * sample.itemsize
    if rows < 1 or columns < 1 or step < row_bytes or len(data) < step * rows:
        raise AbsentError(
            f"{columns} x {rows} samples in rows of {step} bytes do not fit in {len(data)} bytes"
        )
    lines = np.frombuffer(data, np.uint8, step * rows).reshape(rows, step)[:, :row_bytes]
    samples = np.ascontiguousarray(lines).view(sample).reshape(rows, columns, channels)
    plain = samples.astype(sample.newbyteorder("="))
    return plain[:, :, 0] if channels == 1 else np.ascontiguousarray(plain[:, :, list(colours)])


def _png(pixels: npt.NDArray[Any]) -> bytes:
    import io

    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "PNG")
    return stream.getvalue()
