"""The parts of a rover as its profile has them: metres, kilograms, seconds, joules, watts, radians."""

from __future__ import annotations

import math

from mission.errors import MissionError
from mission.instrument import Amount
from mission.values import NotNegative, Positive, value

Triple = tuple[float, float, float]
Pair = tuple[float, float]


@value
class Body:
    """The box of the rover, metres and kilograms; the belly is the part between the wheels."""

    length_m: Positive
    width_m: Positive
    height_m: Positive
    mass_kg: Positive
    clearance_m: Positive
    belly_length_m: float
    belly_width_m: float

    @property
    def radius_m(self) -> float:
        """Return the radius of the circle round the whole rover, seen from above."""
        return math.hypot(self.length_m, self.width_m) / 2


@value
class Wheels:
    """Six wheels of a rocker-bogie; x of the axles from front to rear in the rover frame."""

    radius_m: Positive
    width_m: float
    track_m: Positive
    axle_x_m: Triple
    bogie_pivot_x_m: float
    rocker_pivot_x_m: float


@value
class Mobility:
    """How the rover drives; the odometry error is a share of the distance (one standard deviation)."""

    speed_m_s: Positive
    turn_rate_rad_s: Positive
    step_m: Positive
    min_arc_radius_m: float
    max_slope_rad: Positive
    max_tilt_rad: Positive
    max_step_m: Positive
    odometry_error: float
    heading_drift_rad_m: float
    max_stops_per_m: float = 3.0


@value
class Power:
    """Loads in watts, energies in joules; `floor_j` is the state of charge that ends a day."""

    hotel_w: float
    drive_w: float
    turn_w: float
    battery_j: Positive
    initial_j: NotNegative
    floor_j: float
    solar_peak_w: float
    heater_w: float
    downlink_w: float

    def __post_init__(self) -> None:
        if self.initial_j > self.battery_j:
            raise MissionError(
                f"initial_j is {self.initial_j} J; it must be at most battery_j {self.battery_j} J"
            )


@value
class Mast:
    """Pan-tilt mast: `base_m` in the rover frame, `height_m` of the camera bar above ground."""

    base_m: Triple
    height_m: Positive
    pan_limit_rad: float
    tilt_limits_rad: Pair
    rate_rad_s: float
    bias_rad: float
    noise_rad: float
    settle_s: float


@value
class Arm:
    """Arm of five joints: waist yaw, shoulder pitch, elbow pitch, forearm twist, wrist pitch.

    All angles are 0 when the arm points straight ahead; pitches are positive downwards, waist and twist to
    the left (rover frame, REP 103).

    Attributes
    ----------
    shoulder_m
        Where the axes of waist and shoulder cross, rover frame.
    links_m
        Upper arm (shoulder to elbow), forearm (elbow to wrist), tool (wrist to its contact face).
    joint_limits_rad
        Least and largest angle of the five joints, in that order.
    stow_rad
        Posture in which the rover drives.
    reach_m, min_reach_m
        Largest distance from the shoulder to the tool tip, that of all links stretched, and the least one
        that is planned with.
    azimuth_limit_rad
        How far from straight ahead targets are planned.
    max_tool_tilt_rad
        Largest angle between the tool axis and the surface normal.
    tool_radius_m
        Of the circle round the tool's contact face.
    link_radius_m
        Of upper arm and forearm.
    workspace_height_m
        Heights above the ground plane that the tool can be put to.
    accuracy_m
        Largest error of the tool's place along each axis.
    standoff_m
        Distance above the surface from which the tool is moved along the normal.
    overtravel_m
        How far beyond the expected surface the tool is moved in search of contact.
    joint_rate_rad_s, approach_m_s
        Speed of the fastest joint, and of the tool along the normal.
    """

    shoulder_m: Triple
    joints: int
    links_m: tuple[Positive, Positive, Positive]
    joint_limits_rad: tuple[Pair, ...]
    stow_rad: tuple[float, ...]
    reach_m: Positive
    min_reach_m: float
    azimuth_limit_rad: float
    max_tool_tilt_rad: float
    tool_radius_m: Positive
    link_radius_m: Positive
    workspace_height_m: Pair
    accuracy_m: NotNegative
    standoff_m: Positive
    overtravel_m: NotNegative
    joint_rate_rad_s: Positive
    approach_m_s: Positive

    def __post_init__(self) -> None:
        if self.min_reach_m >= self.reach_m:
            raise MissionError(
                f"min_reach_m is {self.min_reach_m} m; it must be less than reach_m {self.reach_m} m"
            )
        for name, values in (("joint_limits_rad", self.joint_limits_rad), ("stow_rad", self.stow_rad)):
            if len(values) != self.joints or self.joints != 5:
                raise MissionError(
                    f"{name} has {len(values)} entries and joints is {self.joints}; both must be 5"
                )
        if abs(sum(self.links_m) - self.reach_m) > 1e-6:
            raise MissionError(f"links_m add up to {sum(self.links_m):.3f} m; reach_m is {self.reach_m} m")
        for joint, ((low, high), stow) in enumerate(
            zip(self.joint_limits_rad, self.stow_rad, strict=True), 1
        ):
            if not low <= stow <= high:
                raise MissionError(f"stow_rad of joint {joint} is {stow}, outside its limits {low} to {high}")


@value
class Cameras:
    """Names of camera models; which one serves science, navigation and hazard avoidance.

    `set` names a camera set that comes with the program, or a file (`cameras/1`) beside the profile.
    """

    set: str
    science: str
    navigation: str
    hazard: str
    names: tuple[str, ...]


@value
class Activity:
    """Time and drive energy of an activity: fixed part + part per metre; `cv` is sd / mean."""

    fixed_s: float = 0.0
    per_m_s: float = 0.0
    cv: float = 0.0
    fixed_j: float = 0.0
    per_m_j: float = 0.0
    energy_cv: float = 0.0

    def time_s(self, length_m: float = 0.0) -> Amount:
        """Return mean and spread of the time for a way of `length_m`."""
        mean = self.fixed_s + self.per_m_s * length_m
        return Amount(mean, self.cv * mean)

    def energy_j(self, length_m: float = 0.0) -> Amount:
        """Return mean and spread of the energy, hotel load excluded, for a way of `length_m`."""
        mean = self.fixed_j + self.per_m_j * length_m
        return Amount(mean, self.energy_cv * mean)


@value
class LegModel:
    """How drives and tracks go beyond what the activities say; the path network's leg model takes it.

    Attributes
    ----------
    source
        Where the numbers come from.
    turn_factor, energy_factor
        Factors on the time of turns and on the energy of a drive.
    slope_gain
        Share by which a drive takes longer for each unit of the mean uphill slope (tangent).
    inside_per_m, outside_per_m, occluded_per_m
        Tracks lost a metre inside the tracking region, outside it, and with the target hidden by ground.
    angle_gain_per_rad
        Share by which a metre outside counts more for each radian beyond the region's cone.
    """

    source: str
    turn_factor: NotNegative
    slope_gain: NotNegative
    energy_factor: NotNegative
    inside_per_m: NotNegative
    outside_per_m: NotNegative
    occluded_per_m: NotNegative
    angle_gain_per_rad: NotNegative
