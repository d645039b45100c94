"""Pictures: what they show, how they are exposed, and the truth behind every pixel."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import CameraModel
from rover_iface.cameras.rig import Sensor
from rover_iface.simulator.render.scene import Array

Window = tuple[int, int, int, int]
"""Left, top, width, height of a subframe, pixels."""


@dataclass(frozen=True, slots=True)
class AutoExposure:
    """Exposure set so that `percent` of the window's pixels lie above `cut` of full scale.

    The rule of the MER flight software (auto exposure data cut and percent), over the subframe as in
    Kim et al. 2009, section 4.5.
    """

    cut: float = 0.62
    percent: float = 5.0


@dataclass(frozen=True)
class Truth:
    """What each pixel of a window sees; arrays (height, width).

    Attributes
    ----------
    range_m
        Distance along the ray, inf for sky.
    object_index
        Index into `ids`, -1 for sky.
    lit
        Whether the sun reaches the surface (other bodies' shadows and its own).
    normal_site
        (height, width, 3), of the triangles.
    """

    range_m: npt.NDArray[np.float32]
    object_index: npt.NDArray[np.int32]
    lit: npt.NDArray[np.bool_]
    normal_site: npt.NDArray[np.float32]
    ids: tuple[str, ...]
    camera: CameraModel
    window: Window

    @cached_property
    def point_site(self) -> Array:
        """Return surface points (height, width, 3), site frame; not finite for sky."""
        left, top, width, height = self.window
        u, v = np.meshgrid(left + np.arange(width), top + np.arange(height))
        origins, directions = self.camera.back_project(np.stack((u, v), axis=-1))
        with np.errstate(invalid="ignore"):
            return np.asarray(origins + self.range_m[..., None] * directions)

    def object_id(self, line: int, sample: int) -> str:
        """Return the id of the body seen by a pixel of the window, "" for ground and sky."""
        index = int(self.object_index[line, sample])
        return self.ids[index] if index >= 0 else ""


@dataclass(frozen=True)
class Frame:
    """An image, the camera it was taken by (site frame, of the window itself) and its truth.

    `image` is uint8 or uint16, (height, width); `exposure` is the gain that made it.
    """

    image: npt.NDArray[np.unsignedinteger]
    camera: CameraModel
    window: Window
    exposure: float
    bits: int
    truth: Truth = field(repr=False)

    @property
    def unit(self) -> npt.NDArray[np.float32]:
        """Return the image [rows, columns] as float32 in 0..1."""
        return (self.image / np.float32((1 << self.bits) - 1)).astype(np.float32)

    @property
    def image8(self) -> npt.NDArray[np.uint8]:
        """Return the image in 8 bits, by square root coding where it has more (as MER's tables do)."""
        if self.bits == 8:
            return self.image.astype(np.uint8)
        return np.asarray(np.round(255.0 * np.sqrt(self.unit)), dtype=np.uint8)


@dataclass(frozen=True, eq=False)
class Negative:
    """A picture before it is exposed: the light (height, width) on the sensor, blurred by its optics.

    `camera` is that of the window itself, site frame.
    """

    light: npt.NDArray[np.float32]
    truth: Truth
    camera: CameraModel
    window: Window
    sensor: Sensor

    def develop(self, exposure: AutoExposure | float | None = None, seed: int = 0) -> Frame:
        """Return the picture; parameters are those of `Renderer.render`."""
        gain = exposure if isinstance(exposure, float) else _auto_gain(self.light, exposure or AutoExposure())
        image = _digitise(self.light, gain, self.sensor, self.window[:2], seed)
        return Frame(image, self.camera, self.window, gain, self.sensor.bits, self.truth)


def _auto_gain(light: npt.NDArray[np.float32], rule: AutoExposure) -> float:
    bright = float(np.quantile(light[::2, ::2], 1.0 - rule.percent / 100.0))
    return rule.cut / max(bright, 1e-4)


def _digitise(
    light: npt.NDArray[np.float32], gain: float, sensor: Sensor, corner: tuple[int, int], seed: int
) -> npt.NDArray[np.unsignedinteger]:
    from rover_iface.simulator.render import shade

    out = np.empty(light.shape, np.uint16)
    salt = int.from_bytes(hashlib.sha256(str(seed).encode()).digest()[:4], "big")
    shade.expose(
        light,
        gain,
        sensor.full_well_e,
        sensor.read_noise_e,
        1 << sensor.bits,
        corner[0],
        corner[1],
        salt,
        out,
    )
    return out.astype(np.uint8) if sensor.bits == 8 else out
