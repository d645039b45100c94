"""A terrain: its layers, and the ground at one point."""

from __future__ import annotations

from dataclasses import dataclass

from ground.gdr.geometry import Bounds, Pose


@dataclass(frozen=True, slots=True)
class TerrainLayer:
    """One raster layer: `rows` x `columns` posts of height, `spacing_m` apart, and its ortho image."""

    name: str
    bounds_m: Bounds
    rows: int
    columns: int
    spacing_m: float
    ortho_width: int
    ortho_height: int
    ortho_media: str
    has_ortho: bool


@dataclass(frozen=True, slots=True)
class Terrain:
    """What is known of a mission's ground; layers go from coarse (`outer`) to fine (`inner`)."""

    id: str
    name: str
    credits: str
    sha256: str
    bounds_m: Bounds
    layers: list[TerrainLayer]
    start_pose: Pose
    lowest_m: float
    highest_m: float


@dataclass(frozen=True, slots=True)
class TerrainPoint:
    """The ground at one point, asked of the full-resolution terrain; `covariance_m2` is row by row.

    `observed` is whether a camera ever saw it, `in_view` whether the mast at the start pose sees it.
    """

    east_m: float
    north_m: float
    up_m: float
    normal: list[float]
    slope_rad: float
    covariance_m2: list[list[float]]
    range_m: float
    observed: bool
    in_view: bool
    layer: str
