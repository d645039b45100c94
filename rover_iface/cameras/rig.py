"""Cameras on a rover: presets from TOML, and the pan-tilt mast that carries some of them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from mission.codec import read_toml
from rover_iface.cameras.model import CameraModel, ModelKind
from rover_iface.errors import CameraError
from rover_iface.frames import Transform
from rover_iface.profile import RoverProfile

if TYPE_CHECKING:
    from rover_iface.profile import RoverProfile

_FOLDER = Path(__file__).parent / "data"
FORMAT = "cameras/1"


@dataclass(frozen=True, slots=True)
class Sensor:
    """How a camera turns light into numbers."""

    bits: int = 12
    full_well_e: float = 170_000.0
    read_noise_e: float = 25.0
    psf_sigma_px: float = 0.55
    max_exposure_s: float = 5.0

    def __post_init__(self) -> None:
        if self.bits not in (8, 10, 12, 16):
            raise CameraError(f"sensor has {self.bits} bits; 8, 10, 12 or 16 are known")
        if not (self.full_well_e > 0 and self.read_noise_e >= 0 and self.psf_sigma_px >= 0):
            raise CameraError("sensor needs a positive full well and no negative noise or blur")


@dataclass(frozen=True, slots=True)
class MountedCamera:
    """A camera model in the frame of its mount (`mast`, `body` or `tool`), with its sensor.

    The frame of the tool has its origin at the middle of the contact face and its x axis out of it.
    """

    name: str
    mount: str
    model: CameraModel
    sensor: Sensor
    source: str


def preset_names() -> list[str]:
    """Return the names of the camera sets that come with the program."""
    return sorted(path.stem for path in _FOLDER.glob("*.toml"))


def rig_of(profile: RoverProfile) -> CameraRig:
    """Return a rover's cameras on its mast; raises as `load_cameras` does."""
    mast = profile.mast
    return CameraRig(
        load_cameras(profile.camera_set),
        (mast.base_m[0], mast.base_m[1], mast.height_m),
        mast.pan_limit_rad,
        mast.tilt_limits_rad,
    )


def load_cameras(source: str | Path) -> Mapping[str, MountedCamera]:
    """Return the cameras of a preset (`mer`, `k9`, `marsyard`) or of a TOML file, by name.

    Raises
    ------
    CameraError
        If the preset is unknown, or the file holds no usable cameras.
    """
    if isinstance(source, str) and not source.endswith(".toml"):
        path = _FOLDER / f"{source}.toml"
        if not path.is_file():
            raise CameraError(f'unknown camera set "{source}"; known: {", ".join(preset_names())}')
    else:
        path = Path(source)
    try:
        return _parse(path.read_bytes(), path.name)
    except OSError as err:
        raise CameraError(f"camera set {path}: {err.strerror or err}") from err


@lru_cache(maxsize=16)
def _parse(raw: bytes, name: str) -> Mapping[str, MountedCamera]:
    document = read_toml(raw, f"camera set {name}", CameraError)
    if document.pop("format", None) != FORMAT:
        raise CameraError(f'camera set {name}: "format" must be "{FORMAT}"')
    try:
        sensors = {key: Sensor(**value) for key, value in document.pop("sensors", {}).items()}
        return {key: _camera(key, value, sensors) for key, value in document.items()}
    except (KeyError, TypeError, ValueError) as err:
        raise CameraError(f"camera set {name}: {type(err).__name__}: {err}") from err


def _camera(name: str, table: Mapping[str, Any], sensors: Mapping[str, Sensor]) -> MountedCamera:
    if table["mount"] not in ("mast", "body", "tool"):
        raise CameraError(f'camera {name}: mount is "{table["mount"]}"; mast, body or tool')
    kind = ModelKind(table["model"])
    model = CameraModel(
        kind,
        int(table["width"]),
        int(table["height"]),
        **{letter: np.array(table[letter], float) for letter in kind},
        linearity=float(table.get("linearity", 1.0)),
    )
    sensor = sensors[table["sensor"]] if "sensor" in table else Sensor()
    return MountedCamera(name, table["mount"], model, sensor, str(table["source"]))


@dataclass(frozen=True, slots=True)
class CameraRig:
    """The cameras of a rover with its mast.

    Attributes
    ----------
    cameras
        By name, as from `load_cameras`.
    pivot_rover
        Where pan and tilt axis cross, rover frame, metres.
    pan_limit_rad, tilt_limits_rad
        Reach of the axes. Pan is positive to the left, tilt positive upwards.
    """

    cameras: Mapping[str, MountedCamera]
    pivot_rover: tuple[float, float, float]
    pan_limit_rad: float = math.pi
    tilt_limits_rad: tuple[float, float] = (-1.55, 1.4)

    def rover_from_mast(self, pan_rad: float, tilt_rad: float) -> Transform:
        """Return where the mast head is when the axes stand at these angles."""
        return Transform.from_rpy(0.0, -tilt_rad, pan_rad, self.pivot_rover)

    def camera(self, name: str, pan_rad: float = 0.0, tilt_rad: float = 0.0) -> CameraModel:
        """Return a camera's model in the rover frame, one on the arm in the tool's frame.

        Raises
        ------
        CameraError
            If the rover has no such camera.
        """
        mounted = self.mounted(name)
        if mounted.mount != "mast":
            return mounted.model
        return mounted.model.transformed(self.rover_from_mast(pan_rad, tilt_rad))

    def mounted(self, name: str) -> MountedCamera:
        """Return one camera; CameraError when there is none of that name."""
        if name not in self.cameras:
            raise CameraError(f'no camera "{name}"; the rover has {", ".join(sorted(self.cameras))}')
        return self.cameras[name]

    def point_at(self, target_rover: npt.ArrayLike, name: str = "navcam_left") -> tuple[float, float]:
        """Return pan and tilt, rad, that put a point [3], rover frame, m, on the middle of a mast camera's
        frame.

        The camera sits beside the axes, so the angles are found by Newton's method on the pixel itself, to
        1e-6 px (Kim et al. 2005 do the same in closed form for an ideal head).

        Raises
        ------
        CameraError
            If the point is out of the reach of the axes, or too close to the head to be looked at.
        """
        mounted = self.mounted(name)
        if mounted.mount != "mast":
            raise CameraError(f'camera "{name}" is fixed to the {mounted.mount} and cannot be pointed')
        target = np.asarray(target_rover, dtype=np.float64)
        offset = target - np.asarray(self.pivot_rover)
        middle = np.array([(mounted.model.width - 1) / 2.0, (mounted.model.height - 1) / 2.0])
        ray = mounted.model.back_project(middle)[1]
        pan = math.atan2(offset[1], offset[0]) - math.atan2(ray[1], ray[0])
        tilt = math.atan2(offset[2], math.hypot(offset[0], offset[1])) - math.asin(ray[2])
        step = 1e-6
        for _ in range(30):
            error = self.camera(name, pan, tilt).project(target) - middle
            if not np.isfinite(error).all():
                break
            if np.abs(error).max() < 1e-6:
                self._check_reach(pan, tilt, target)
                return math.remainder(pan, math.tau), tilt
            slope = np.column_stack(
                [
                    (self.camera(name, pan + step, tilt).project(target) - middle - error) / step,
                    (self.camera(name, pan, tilt + step).project(target) - middle - error) / step,
                ]
            )
            if abs(np.linalg.det(slope)) < 1e-3:
                break
            change = np.linalg.solve(slope, error)
            change *= min(1.0, 0.5 / float(np.abs(change).max()))
            pan, tilt = pan - float(change[0]), tilt - float(change[1])
        raise CameraError(f"target {_metres(target)} is too close to the mast to be centred in {name}")

    def _check_reach(self, pan: float, tilt: float, target: npt.NDArray[np.float64]) -> None:
        low, high = self.tilt_limits_rad
        turned = math.remainder(pan, math.tau)
        if abs(turned) > self.pan_limit_rad:
            raise CameraError(
                f"{_metres(target)} needs pan {turned:.3f} rad; the limit is {self.pan_limit_rad:.3f}"
            )
        if not low <= tilt <= high:
            raise CameraError(
                f"target {_metres(target)} needs tilt {tilt:.3f} rad; the mast tilts {low:.3f} to {high:.3f}"
            )


def _metres(point: npt.NDArray[np.float64]) -> str:
    return "(" + ", ".join(f"{v:.2f}" for v in point) + ") m"
