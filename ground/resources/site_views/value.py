"""What the views are told beside the resources: the rover's shape, its cameras, what it sees."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ground.gdr.geometry import Pose


@dataclass(frozen=True, slots=True)
class Camera:
    """A camera model (CAHV, CAHVOR or CAHVORE); vectors in the frame of `mount`, H and V in pixels.

    Pixel (0, 0) is the centre of the upper left one. Vectors the model does not have are zero.
    """

    name: str
    mount: Literal["mast", "body", "site"]
    kind: Literal["CAHV", "CAHVOR", "CAHVORE"]
    width: int
    height: int
    C: list[float]
    A: list[float]
    H: list[float]
    V: list[float]
    O: list[float]
    R: list[float]
    E: list[float]
    linearity: float


@dataclass(frozen=True, slots=True)
class SunPlace:
    """Unit vector to the sun, east-north-up, at a local mean solar time."""

    lmst_h: float
    direction: list[float]


@dataclass(frozen=True, slots=True)
class RoverShape:
    """What a view draws of a mission's rover, from its profile; points in the rover frame, metres.

    `cone_half_angle_rad` is that of the tracking region as the path network uses it. `odometry_error` is
    the share of the distance by which dead reckoning is off (one standard deviation). `sun` is the light of
    the day as the simulator has it.
    """

    profile: str
    version: str
    length_m: float
    width_m: float
    height_m: float
    clearance_m: float
    wheel_radius_m: float
    wheel_width_m: float
    track_m: float
    axle_x_m: list[float]
    mast_pivot_m: list[float]
    pan_limit_rad: float
    tilt_limits_rad: list[float]
    shoulder_m: list[float]
    arm_reach_m: float
    arm_min_reach_m: float
    arm_azimuth_limit_rad: float
    max_slope_rad: float
    max_tilt_rad: float
    cone_half_angle_rad: float
    odometry_error: float
    heading_drift_rad_m: float
    navigation_camera: str
    cameras: list[Camera]
    sun: list[SunPlace]


@dataclass(frozen=True, slots=True)
class CameraView:
    """A camera of the rover at a pose, site frame, with how the rover stands there and the mast points."""

    camera: Camera
    pose: Pose
    up_m: float
    pitch_rad: float
    roll_rad: float
    pan_rad: float
    tilt_rad: float


@dataclass(frozen=True, slots=True)
class PanoramaTile:
    """A part of a panorama: its columns go clockwise from `left_azimuth_rad` (clockwise from north).

    `eye_m` is the centre of the camera that took it, site frame.
    """

    index: int
    left_azimuth_rad: float
    eye_m: list[float]
    ready: bool
    url: str


@dataclass(frozen=True, slots=True)
class Panorama:
    """What the navigation camera sees from the start pose, as cylindrical tiles of one size side by side.

    A place of a tile x pixels right of and y below its upper left corner looks at azimuth `left_azimuth_rad`
    + x `rad_per_px` and elevation `top_elevation_rad` - y `rad_per_px`.
    """

    pose: Pose
    camera: str
    lmst_h: float
    tile_width: int
    tile_height: int
    top_elevation_rad: float
    rad_per_px: float
    tiles: list[PanoramaTile]
