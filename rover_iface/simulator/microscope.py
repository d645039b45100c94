"""The microscopic imager on the tool: close-ups with the little depth that is in focus, and a stack of them.

CHAMP, K9's imager, moves its CCD behind the lens to focus (single-cycle instrument placement paper, section
3). Here a view is rendered once; each picture of the stack blurs what lies off its plane of focus, by one
pixel for every `DEPTH_M`, and has noise of its own. `rover_iface.cameras.focus` puts the stack together.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.focus import merge_stack
from rover_iface.cameras.model import CameraModel
from rover_iface.cameras.rig import Sensor
from rover_iface.errors import RenderError
from rover_iface.simulator.render.picture import Frame
from rover_iface.simulator.render.renderer import Renderer, Sun
from rover_iface.streams import stream

DEPTH_M = 0.003
"""Distance from the plane of focus at which the image is blurred by one pixel (standard deviation)."""

PLANES = 7
_BLURS = (0.0, 0.7, 1.5, 2.5, 4.0, 6.0)


@dataclass(frozen=True, eq=False)
class CloseUp:
    """What the imager brought: the merged picture and its frame, and the share of it that is sharp.

    Attributes
    ----------
    image
        (height, width), uint8.
    frame
        Of the view itself, with its truth.
    stack
        The single pictures, nearest plane first, float32 in 0..1.
    sharp
        Share of pixels within `DEPTH_M` of the plane they were taken from.
    pixel_m
        Size of a pixel on the surface in the middle.
    """

    image: npt.NDArray[np.uint8]
    frame: Frame
    stack: tuple[npt.NDArray[np.float32], ...]
    sharp: float
    pixel_m: float


def close_up(
    renderer: Renderer, camera: CameraModel, sun: Sun, *, sensor: Sensor | None = None, seed: int = 0
) -> CloseUp:
    """Return a focus stack of a view and its merged picture; `camera` in the site frame.

    The planes lie `DEPTH_M` times 1.3 apart round the distance in the middle of the picture, which is what
    the imager's own focus would find first.

    Raises
    ------
    RenderError
        If the imager sees nothing or is inside the ground.
    """
    import cv2

    sensor = sensor or Sensor()
    frame = renderer.render(camera, None, sun, sensor=sensor, seed=seed)
    depth = (frame.truth.point_site - camera.C) @ camera.A
    height, width = depth.shape
    core = depth[height // 4 : 3 * height // 4, width // 4 : 3 * width // 4]
    if not np.isfinite(core).any():
        raise RenderError("the microscopic imager sees no surface")
    middle = float(np.median(core[np.isfinite(core)]))
    depth = np.where(np.isfinite(depth), depth, middle + 1.0)
    planes = middle + 1.3 * DEPTH_M * (np.arange(PLANES) - PLANES // 2)
    blurred = np.stack([frame.unit if s == 0.0 else cv2.GaussianBlur(frame.unit, (0, 0), s) for s in _BLURS])
    levels = np.array(_BLURS)
    rng = stream("microscope", seed)
    stack = []
    for plane in planes:
        wanted = np.clip(np.abs(depth - plane) / DEPTH_M, 0.0, levels[-1])
        upper = np.clip(np.searchsorted(levels, wanted), 1, len(levels) - 1)
        share = (wanted - levels[upper - 1]) / (levels[upper] - levels[upper - 1])
        low, high = (np.take_along_axis(blurred, k[None], axis=0)[0] for k in (upper - 1, upper))
        picture = (1.0 - share) * low + share * high
        noise = sensor.read_noise_e / sensor.full_well_e
        stack.append((picture + noise * rng.standard_normal(picture.shape)).clip(0, 1).astype(np.float32))
    merged, best = merge_stack(stack)
    sharp = float((np.abs(depth - planes[best]) < DEPTH_M).mean())
    image = np.round(255.0 * (merged if sensor.bits == 8 else np.sqrt(merged))).astype(np.uint8)
    pixel_m = middle / camera.hs
    return CloseUp(image, frame, tuple(stack), sharp, float(pixel_m))
