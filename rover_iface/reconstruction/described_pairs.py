"""Pairs of plain pictures, as `pairs.toml` of form `image-pairs/1` describes them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Annotated

import numpy as np
from annotated_types import Gt, Interval, MinLen

from mission.codec import Codec, read_toml
from mission.errors import MissionError
from mission.values import value
from rover_iface.cameras.calibrated import CALIBRATIONS, CalibratedCamera, CalibratedPair
from rover_iface.cameras.model import Array
from rover_iface.errors import CameraError, PicturesError, TerrainFormatError
from rover_iface.frames import Transform
from rover_iface.reconstruction.outcomes import Reason, Refusal, RefusedError
from rover_iface.reconstruction.picture_pairs import PicturePair, PointErrors, pair_of
from rover_iface.terrain.outside import inside, opened_image

DESCRIPTION = "pairs.toml"
FORMAT = "image-pairs/1"

_AXES = {
    "optical": np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]),
    "frd": np.diag([1.0, -1.0, -1.0]),
    "flu": np.eye(3),
}
"""By name of a rig's axes: what turns them to forward, left, up."""

Degrees = Annotated[float, Interval(ge=-360.0, le=360.0)]
Place = tuple[float, float, float]


@value
class PinholePair:
    """Two equal cameras without distortion, side by side, rows common: a rectified pair."""

    width: Annotated[int, Gt(0)]
    height: Annotated[int, Gt(0)]
    focal_px: Annotated[float, Gt(0)]
    baseline_m: Annotated[float, Gt(0)]
    principal_px: tuple[float, float] | None = None


@value
class Rig:
    """The two cameras, in one of three ways, and which way the axes of their frame point.

    Of a pinhole pair and of a calibration the frame is the left camera's: `optical` (x right, y down, z
    forward). Cameras that are given one by one may count in `frd` or `flu` (forward, right, down; forward,
    left, up).
    """

    pinhole: PinholePair | None = None
    calibration: str | None = None
    left: CalibratedCamera | None = None
    right: CalibratedCamera | None = None
    axes: str = "optical"

    def __post_init__(self) -> None:
        ways = (self.pinhole is not None, self.calibration is not None, self.left is not None)
        if sum(ways) != 1 or (self.left is None) != (self.right is None):
            raise MissionError(
                "a rig is told by pinhole, by calibration, or by left and right; by one of them"
            )
        if self.axes not in _AXES:
            raise MissionError(f"axes of a rig are {self.axes!r}; {', '.join(_AXES)} are known")


@value
class DescribedPair:
    """One pair, its files in the folder, and the pose of the rig's frame in the site.

    `position_m` is east, north, up. `heading_deg` counts clockwise from north, `pitch_deg` is positive
    upwards, `roll_deg` positive when the right side is low.
    """

    left: str
    right: str
    position_m: Place
    heading_deg: Degrees
    pitch_deg: Degrees = 0.0
    roll_deg: Degrees = 0.0
    name: str = ""


@value
class DescribedRover:
    """Where the rover stands: the middle of its wheels on the ground, in the site."""

    position_m: Place = (0.0, 0.0, 0.0)
    heading_deg: Degrees = 0.0
    pitch_deg: Degrees = 0.0
    roll_deg: Degrees = 0.0


@value
class PairsFile:
    """What a `image-pairs/1` document holds."""

    rig: Rig
    pairs: Annotated[tuple[DescribedPair, ...], MinLen(1)]
    name: str = ""
    credits: str = ""
    rover: DescribedRover = field(default_factory=DescribedRover)


PAIRS = Codec(PairsFile, FORMAT, "description of pairs", error=PicturesError)


@dataclass(frozen=True, slots=True)
class Described:
    """A folder of plain pictures: what it is called, and its pairs."""

    name: str
    credits: str
    pairs: list[PicturePair]


def described_pairs(folder: Path, refused: list[Refusal]) -> Described:
    """Return the pairs that `pairs.toml` of a folder describes; what is not used is added to `refused`.

    Raises
    ------
    PicturesError
        If the description is malformed, or its rig cannot be used.
    """
    where = folder / DESCRIPTION
    try:
        raw = where.read_bytes()
    except OSError as err:
        raise PicturesError(f"{where}: {err.strerror or err}") from err
    told = PAIRS.from_document(read_toml(raw, str(where), PicturesError), str(where))
    try:
        lens = _calibrated(told.rig, folder)
        left, right = lens.left.model(), lens.right.model()
    except CameraError as err:
        raise PicturesError(f"{where}: rig: {err}") from err
    axes = _AXES[told.rig.axes]
    rover = _pose(told.rover.position_m, told.rover.heading_deg, told.rover.pitch_deg, told.rover.roll_deg)
    pairs = []
    for entry in told.pairs:
        name = entry.name or PurePosixPath(entry.left).stem
        body = _pose(entry.position_m, entry.heading_deg, entry.pitch_deg, entry.roll_deg)
        site_from_rig = Transform(body.rotation @ axes, body.translation)
        try:
            pictures = (_picture(folder, entry.left), _picture(folder, entry.right))
            for side, picture, camera in zip(("left", "right"), pictures, (left, right), strict=True):
                if picture.shape[1::-1] != camera.size:
                    raise RefusedError(
                        Reason.SIZE_DIFFERS,
                        name,
                        f"its {side} picture has {picture.shape[1::-1]} pixels, the camera {camera.size}",
                    )
            cameras = left.transformed(site_from_rig), right.transformed(site_from_rig)
            straight = lens.left.straightened(pictures[0]), lens.right.straightened(pictures[1])
            pairs.append(pair_of(name, straight, cameras, rover, errors=_errors(lens, site_from_rig)))
        except RefusedError as err:
            refused.append(err.refusal)
    return Described(told.name or folder.name, told.credits, pairs)


def _calibrated(rig: Rig, folder: Path) -> CalibratedPair:
    """Return both cameras in the frame of the rig."""
    if rig.pinhole is not None:
        pin = rig.pinhole
        middle = (pin.width - 1) / 2.0, (pin.height - 1) / 2.0
        size, focal, principal = (
            (pin.width, pin.height),
            (pin.focal_px, pin.focal_px),
            pin.principal_px or middle,
        )
        beside = (pin.baseline_m, 0.0, 0.0)
        return CalibratedPair(
            CalibratedCamera(*size, focal, principal),
            CalibratedCamera(*size, focal, principal, center_m=beside),
        )
    if rig.calibration is not None:
        return CALIBRATIONS.read_file(inside(folder, rig.calibration))
    assert rig.left is not None
    assert rig.right is not None
    return CalibratedPair(rig.left, rig.right)


def _errors(calibrated: CalibratedPair, site_from_rig: Transform) -> PointErrors | None:
    if calibrated.covariance is None:
        return None
    turn = site_from_rig.rotation

    def errors(points: Array) -> Array:
        """Return covariances (n, 3, 3), m^2, site frame, of points (n, 3) there."""
        here = np.asarray(site_from_rig.inverse().apply(points), dtype=np.float64)
        return np.asarray(turn @ calibrated.point_errors(here) @ turn.T)

    return errors


def _pose(position: Place, heading_deg: float, pitch_deg: float, roll_deg: float) -> Transform:
    """Return the pose of a body (forward, left, up) in the site."""
    heading, pitch, roll = (math.radians(a) for a in (heading_deg, pitch_deg, roll_deg))
    return Transform.from_rpy(roll, -pitch, math.pi / 2 - heading, position)


def _picture(folder: Path, name: str) -> np.ndarray[tuple[int, ...], np.dtype[np.generic]]:
    """Return the samples of a picture of a folder."""
    try:
        path = inside(folder, name)
        if not path.is_file():
            raise RefusedError(Reason.NO_PICTURE, name, "there is no such file")
        with opened_image(path, "picture") as image:
            return np.asarray(image if image.mode in {"L", "I;16", "I", "F"} else image.convert("RGB"))
    except TerrainFormatError as err:
        raise RefusedError(Reason.UNREADABLE, name, str(err)) from err
