"""A picture of what a stop saw, on which tie points can be drawn: a cylinder of azimuths and elevations."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.panorama import Panorama
from rover_iface.localization.ground_points import GroundPoints, direction_raster

Grey = npt.NDArray[np.uint8]


@dataclass(frozen=True, eq=False, slots=True)
class StopPicture:
    """An image [rows, columns], 8 bits, and where its pixels look.

    Column 0 looks to `left_azimuth_rad` (clockwise from north, columns to the right), row 0 to
    `top_elevation_rad`.
    """

    image: Grey
    left_azimuth_rad: float
    top_elevation_rad: float
    rad_per_px: float

    def document(self) -> dict[str, object]:
        """Return all but the image, with its size."""
        values = {name: value for name, value in asdict(self).items() if name != "image"}
        return {"width": self.image.shape[1], "height": self.image.shape[0], **values}


def picture_of_panorama(panorama: Panorama, *, width_px: int = 4096) -> StopPicture:
    """Return the mosaic of a panorama, cut to what it shows; `width_px` is a full circle."""
    mosaic, edges = panorama.cut_mosaic(width_px)
    return StopPicture(np.ascontiguousarray(mosaic), **edges)


def picture_of_points(seen: GroundPoints) -> StopPicture:
    """Return points as a relief lit from the upper left: what a cloud without images shows of its rocks."""
    raster = direction_raster(seen)
    points = raster.points()
    across = np.gradient(points, axis=1)
    down = np.gradient(points, axis=0)
    normal = np.cross(across, down)
    with np.errstate(invalid="ignore"):
        normal /= np.linalg.norm(normal, axis=2, keepdims=True)
        away = raster.directions()
        normal *= -np.sign((normal * away).sum(axis=2, keepdims=True))
        level = np.array([math.cos(raster.left), math.sin(raster.left), 0.0])
        light = 0.5 * level + np.array([0.0, 0.0, 0.8])
        shade = 70.0 + 170.0 * np.clip(normal @ light, 0.0, 1.0)
    image = np.where(np.isfinite(shade), shade, 0.0).astype(np.uint8)
    columns = image.shape[1]
    # columns of the raster run counter-clockwise from east
    left = 0.5 * math.pi - (raster.left + raster.step * (columns - 1))
    return StopPicture(np.ascontiguousarray(image[:, ::-1]), left % math.tau, raster.top, raster.step)
