"""A flight image as one eye of a stereo pair: its camera in the site frame, when and from where it was taken.

Labels count in the missions' frames: site north-east-nadir, rover forward-right-down. What leaves here is
east-north-up.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.labels import ImageProduct, read_product
from rover_iface.cameras.model import Array, CameraModel
from rover_iface.errors import CameraError, FrameError
from rover_iface.frames import NED_FROM_ENU, Transform, rotation_from_quaternion, site_from_rover_flu
from rover_iface.reconstruction.outcomes import Reason, RefusedError

Samples = npt.NDArray[np.generic]

POINTING_RAD = math.radians(4.0)
"""By how much the camera's axis may differ from the pointing that the same label tells: a mast camera stands
0 to 2 degrees off the mast's boresight (1.2 degrees in the Spirit navcam label of sol 1869)."""

MALFORMED = (KeyError, TypeError, ValueError, OverflowError, AttributeError, IndexError)
"""What reading a member of another kind than it should be raises."""

_ROVER_GROUPS = ("ROVER_COORDINATE_SYSTEM", "ROVER_COORD_SYSTEM_PARMS")
_ROVER_FRAMES = {"ROVER_FRAME", "ROVER_NAV_FRAME"}
_POINTING_GROUPS = ("ROVER_DERIVED_GEOMETRY_PARMS", "DERIVED_IMAGE_PARMS")
_EYES = {"LEFT": "left", "RIGHT": "right", "L": "left", "R": "right"}


@dataclass(frozen=True, slots=True, eq=False)
class EyeFrame:
    """One picture with its camera.

    Attributes
    ----------
    samples
        (height, width) or (height, width, 3), as stored.
    camera
        In the site frame, east-north-up, m.
    instrument, eye
        What the camera is of ("NAVCAM") and on which side: "left" or "right".
    place
        Motion counter of the place it was taken from: (site, drive).
    site_from_rover
        The rover's pose when it was taken; x forward, y left, z up.
    lost_value
        The sample that stands for pixels that never arrived.
    """

    name: str
    samples: Samples
    camera: CameraModel
    instrument: str
    eye: str
    taken: datetime | None
    place: tuple[int, int]
    site_from_rover: Transform
    lost_value: float = 0.0


def frame_of_product(path: Path) -> EyeFrame:
    """Return the frame in a flight image and its label.

    Raises
    ------
    RefusedError
        If it cannot be read, holds no picture, does not tell where the rover stood, or contradicts itself.
    """
    from PIL import Image

    name = path.name
    try:
        product = read_product(path)
    except CameraError as err:
        raise RefusedError(Reason.UNREADABLE, name, str(err).removeprefix(f"{name}: ")) from err
    except OSError as err:
        raise RefusedError(Reason.UNREADABLE, name, err.strerror or str(err)) from err
    except (*MALFORMED, RecursionError, Image.DecompressionBombError) as err:
        # a label is text from outside: a member of another kind than it should be fails anywhere in it
        raise RefusedError(Reason.UNREADABLE, name, f"malformed label: {type(err).__name__} {err}") from err
    try:
        return _frame(product, name)
    except (*MALFORMED, FrameError, CameraError) as err:
        raise RefusedError(
            Reason.NO_POSE, name, f"its label does not tell the pose: {type(err).__name__} {err}"
        ) from err


def _frame(product: ImageProduct, name: str) -> EyeFrame:
    if product.image is None:
        raise RefusedError(Reason.NO_PICTURE, name, "a label without its picture")
    _require_size(product, name)
    _require_pointing(product, name)
    label = product.label
    ned_from_frd = _rover_pose(label, product, name)
    site_from_rover = site_from_rover_flu(ned_from_frd)
    in_rover = product.frame in _ROVER_FRAMES
    enu_from_here = NED_FROM_ENU.T @ (ned_from_frd.rotation if in_rover else np.eye(3))
    shift = NED_FROM_ENU.T @ ned_from_frd.translation if in_rover else np.zeros(3)
    instrument, eye = _side(product, name)
    place = label["ROVER_MOTION_COUNTER"]
    image = label.get("IMAGE")
    described: Mapping[str, object] = image if isinstance(image, dict) else {}
    lost = described.get("MISSING_CONSTANT", 0.0)
    return EyeFrame(
        name=product.name,
        samples=product.image,
        camera=product.camera.moved(enu_from_here, shift),
        instrument=instrument,
        eye=eye,
        taken=_taken(label),
        place=(int(place[0]), int(place[1])),
        site_from_rover=site_from_rover,
        lost_value=float(lost) if isinstance(lost, int | float) else 0.0,
    )


def _rover_pose(label: Mapping[str, object], product: ImageProduct, name: str) -> Transform:
    """Return the rover's pose in the site, both with the missions' axes."""
    group = next((g for key in _ROVER_GROUPS if isinstance(g := label.get(key), dict)), None)
    if group is None:
        raise RefusedError(
            Reason.NO_POSE, name, "its label does not tell where the rover stood (no rover coordinate system)"
        )
    if product.frame not in {*_ROVER_FRAMES, "SITE_FRAME"} or (
        group.get("REFERENCE_COORD_SYSTEM_NAME", "SITE_FRAME") != "SITE_FRAME"
    ):
        raise RefusedError(
            Reason.NO_POSE, name, f"its camera is in {product.frame}, which its label does not tie to a site"
        )
    quaternion = np.array(group["ORIGIN_ROTATION_QUATERNION"], dtype=np.float64)
    offset = np.array(group["ORIGIN_OFFSET_VECTOR"], dtype=np.float64)
    if quaternion.shape != (4,) or offset.shape != (3,) or not np.isfinite([*quaternion, *offset]).all():
        raise RefusedError(Reason.NO_POSE, name, f"the rover's pose is {offset}, {quaternion}")
    if abs(float(np.linalg.norm(quaternion)) - 1.0) > 1e-3:
        raise RefusedError(
            Reason.LABEL_CONTRADICTION,
            name,
            f"the rover's quaternion has length {np.linalg.norm(quaternion):.4f}, not 1",
        )
    w, x, y, z = (float(q) for q in quaternion)
    return Transform(rotation_from_quaternion(w, x, y, z), offset)


def _require_size(product: ImageProduct, name: str) -> None:
    assert product.image is not None
    found = product.image.shape[1::-1]
    camera = product.camera.size
    if found != camera:
        raise RefusedError(
            Reason.LABEL_CONTRADICTION, name, f"the picture is {found}, its label's camera {camera} pixels"
        )


def _require_pointing(product: ImageProduct, name: str) -> None:
    """Refuse a label whose camera looks elsewhere than the label itself says that it points."""
    for key in _POINTING_GROUPS:
        group = product.label.get(key)
        if not isinstance(group, dict) or product.frame not in _ROVER_FRAMES:
            continue
        angles = [group.get(f"INSTRUMENT_{angle}") for angle in ("AZIMUTH", "ELEVATION")]
        azimuth, elevation = (math.radians(a) if isinstance(a, int | float) else math.nan for a in angles)
        if math.isnan(azimuth + elevation):
            continue
        # NAVCAL's products (Spirit's 2N292280938RAD) count the elevation downwards, the others upwards
        level, up = math.cos(elevation), abs(math.sin(elevation)) * math.copysign(1.0, -product.camera.A[2])
        ray = np.array([level * math.cos(azimuth), level * math.sin(azimuth), -up])
        apart = math.acos(max(-1.0, min(1.0, float(ray @ product.camera.A))))
        if not apart <= POINTING_RAD:
            raise RefusedError(
                Reason.LABEL_CONTRADICTION,
                name,
                f"its camera looks {math.degrees(apart):.1f} degrees beside the pointing in the label; "
                f"the limit is {math.degrees(POINTING_RAD):g}",
            )


def _side(product: ImageProduct, name: str) -> tuple[str, str]:
    """Return the instrument without its side, and the side."""
    words = [w for w in re.split(r"[^A-Z0-9]+", product.instrument.upper()) if w]
    sides = [w for w in words if w in _EYES]
    told = _EYES.get(str(product.label.get("FRAME_ID", "")).upper())
    eye = _EYES[sides[0]] if sides else told
    if eye is None:
        raise RefusedError(
            Reason.NO_PARTNER, name, f"instrument {product.instrument!r} is not one of a left and a right eye"
        )
    if told is not None and told != eye:
        raise RefusedError(
            Reason.LABEL_CONTRADICTION,
            name,
            f"its instrument is {product.instrument}, its frame the {told} one",
        )
    return "_".join(w for w in words if w not in _EYES), eye


def _taken(label: Mapping[str, object]) -> datetime | None:
    try:
        return datetime.fromisoformat(str(label.get("START_TIME")).removesuffix("Z"))
    except ValueError:
        return None


def grey_of(samples: Samples) -> Array:
    """Return `samples` [height, width] or [height, width, bands] as brightness [height, width]."""
    values = np.asarray(samples, dtype=np.float64)
    return values if values.ndim == 2 else np.asarray(values[..., :3].mean(axis=2))
