"""Rover profiles: one TOML file holds what a rover is, and every room reads it from here.

`load_profile("k9")` reads a profile that comes with the program, `load_profile(Path("mine.toml"))` any other.
"""

from __future__ import annotations

import dataclasses
import hashlib
import math
import tomllib
import types
import typing
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar, cast

from rover_iface.errors import ProfileError

FORMAT = "profile/1"
_FOLDER = Path(__file__).parent / "profiles"

Triple = tuple[float, float, float]
Pair = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Body:
    """The box of the rover, metres and kilograms; the belly is the part between the wheels."""

    length_m: float
    width_m: float
    height_m: float
    mass_kg: float
    clearance_m: float
    belly_length_m: float
    belly_width_m: float

    @property
    def radius_m(self) -> float:
        """Return the radius of the circle round the whole rover, seen from above."""
        return math.hypot(self.length_m, self.width_m) / 2


@dataclass(frozen=True, slots=True)
class Wheels:
    """Six wheels of a rocker-bogie; x of the axles from front to rear in the rover frame."""

    radius_m: float
    width_m: float
    track_m: float
    axle_x_m: Triple
    bogie_pivot_x_m: float
    rocker_pivot_x_m: float


@dataclass(frozen=True, slots=True)
class Mobility:
    """How the rover drives; the odometry error is a share of the distance (one standard deviation)."""

    speed_m_s: float
    turn_rate_rad_s: float
    step_m: float
    min_arc_radius_m: float
    max_slope_rad: float
    max_tilt_rad: float
    max_step_m: float
    odometry_error: float
    heading_drift_rad_m: float
    max_stops_per_m: float = 3.0


@dataclass(frozen=True, slots=True)
class Power:
    """Loads in watts, energies in joules; `floor_j` is the state of charge that ends a day."""

    hotel_w: float
    drive_w: float
    turn_w: float
    battery_j: float
    initial_j: float
    floor_j: float
    solar_peak_w: float
    heater_w: float
    downlink_w: float


@dataclass(frozen=True, slots=True)
class Mast:
    """Pan-tilt mast: `base_m` in the rover frame, `height_m` of the camera bar above ground."""

    base_m: Triple
    height_m: float
    pan_limit_rad: float
    tilt_limits_rad: Pair
    rate_rad_s: float
    bias_rad: float
    noise_rad: float
    settle_s: float


@dataclass(frozen=True, slots=True)
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
    links_m: Triple
    joint_limits_rad: tuple[Pair, ...]
    stow_rad: tuple[float, ...]
    reach_m: float
    min_reach_m: float
    azimuth_limit_rad: float
    max_tool_tilt_rad: float
    tool_radius_m: float
    link_radius_m: float
    workspace_height_m: Pair
    accuracy_m: float
    standoff_m: float
    overtravel_m: float
    joint_rate_rad_s: float
    approach_m_s: float


@dataclass(frozen=True, slots=True)
class Cameras:
    """Names of camera models; which one serves science, navigation and hazard avoidance."""

    science: str
    navigation: str
    hazard: str
    names: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Spread:
    """Mean and standard deviation of a quantity that is not negative."""

    mean: float
    sd: float = 0.0


@dataclass(frozen=True, slots=True)
class Instrument:
    """One instrument: `kind` contact (placed by the arm) or remote (looks from a distance)."""

    kind: str
    time_s: Spread
    energy_j: Spread
    doc: str = ""
    camera: str = ""
    volume_mb: float = 0.0
    standoff_m: float = 0.0
    p_success: float = 1.0


@dataclass(frozen=True, slots=True)
class Activity:
    """Time and drive energy of an activity: fixed part + part per metre; `cv` is sd / mean."""

    fixed_s: float = 0.0
    per_m_s: float = 0.0
    cv: float = 0.0
    fixed_j: float = 0.0
    per_m_j: float = 0.0
    energy_cv: float = 0.0

    def time_s(self, length_m: float = 0.0) -> Spread:
        """Return mean and spread of the time for a way of `length_m`."""
        mean = self.fixed_s + self.per_m_s * length_m
        return Spread(mean, self.cv * mean)

    def energy_j(self, length_m: float = 0.0) -> Spread:
        """Return mean and spread of the energy, hotel load excluded, for a way of `length_m`."""
        mean = self.fixed_j + self.per_m_j * length_m
        return Spread(mean, self.energy_cv * mean)


@dataclass(frozen=True, slots=True)
class RoverProfile:
    """What a rover is: metres, radians, rover frame (x forward, y left, z up, origin on the ground)."""

    name: str
    version: str
    body: Body
    wheels: Wheels
    mobility: Mobility
    power: Power
    mast: Mast
    arm: Arm
    cameras: Cameras
    instruments: Mapping[str, Instrument]
    activities: Mapping[str, Activity]
    doc: str = ""
    sha256: str = field(default="", compare=False)

    def activity(self, name: str) -> Activity:
        """Return the times of an activity, zero when the profile does not list it."""
        return self.activities.get(name, Activity())

    def instrument(self, name: str) -> Instrument:
        """Return one instrument.

        Raises
        ------
        ProfileError
            If the rover has none of that name.
        """
        try:
            return self.instruments[name]
        except KeyError:
            known = ", ".join(sorted(self.instruments))
            raise ProfileError(
                f'rover "{self.name}" has no instrument "{name}"; it carries {known}'
            ) from None


def profile_names() -> list[str]:
    """Return the names of the profiles that come with the program."""
    return sorted(path.stem for path in _FOLDER.glob("*.toml"))


def load_profile(source: str | Path) -> RoverProfile:
    """Return a profile by name (`k9`, `mer`) or from a TOML file.

    Raises
    ------
    ProfileError
        If the name is unknown, the file is no TOML, or a member is missing, unknown or out of range.
    """
    if isinstance(source, str) and not source.endswith(".toml"):
        path = _FOLDER / f"{source}.toml"
        if not path.is_file():
            raise ProfileError(f'unknown rover profile "{source}"; known: {", ".join(profile_names())}')
    else:
        path = Path(source)
    try:
        raw = path.read_bytes()
    except OSError as err:
        raise ProfileError(f"rover profile {path}: {err.strerror or err}") from err
    return _parse(raw, str(path))


@lru_cache(maxsize=32)
def _parse(raw: bytes, where: str) -> RoverProfile:
    try:
        document = tomllib.loads(raw.decode("utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as err:
        raise ProfileError(f"rover profile {where}: not TOML: {err}") from err
    if document.pop("format", None) != FORMAT:
        raise ProfileError(f'rover profile {where}: "format" must be "{FORMAT}"')
    profile = _build(RoverProfile, document, where)
    _check(profile, where)
    return dataclasses.replace(profile, sha256=hashlib.sha256(raw).hexdigest())


T = TypeVar("T")


def _build(kind: type[T], document: object, where: str) -> T:
    """Fill a dataclass from a TOML table, with the path of a wrong member in the message."""
    if not isinstance(document, dict):
        raise ProfileError(f"rover profile {where}: a table is needed, found {document!r}")
    hints = typing.get_type_hints(kind)
    values: dict[str, Any] = {}
    fields = {f.name: f for f in dataclasses.fields(cast("Any", kind)) if f.name != "sha256"}
    for name in document:
        if name not in fields:
            raise ProfileError(f'rover profile {where}: unknown member "{name}"')
    for name, spec in fields.items():
        if name not in document:
            if spec.default is dataclasses.MISSING:
                raise ProfileError(f'rover profile {where}: member "{name}" is missing')
            continue
        values[name] = _convert(hints[name], document[name], f"{where}: {name}")
    return kind(**values)


def _convert(kind: Any, value: Any, where: str) -> Any:
    origin = typing.get_origin(kind)
    if dataclasses.is_dataclass(kind):
        return _build(cast("type", kind), value, where)
    if origin is not None and issubclass(origin, Mapping):
        if not isinstance(value, dict):
            raise ProfileError(f"rover profile {where}: a table is needed, found {value!r}")
        item = typing.get_args(kind)[1]
        return types.MappingProxyType({k: _convert(item, v, f"{where}.{k}") for k, v in value.items()})
    if origin is tuple:
        items = typing.get_args(kind)
        if not isinstance(value, list) or (items[-1] is not Ellipsis and len(value) != len(items)):
            raise ProfileError(f"rover profile {where}: {len(items)} values are needed, found {value!r}")
        return tuple(_convert(items[0], v, where) for v in value)
    if kind is float:
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise ProfileError(f"rover profile {where}: a number is needed, found {value!r}")
        return float(value)
    if not isinstance(value, kind) or isinstance(value, bool):
        raise ProfileError(f"rover profile {where}: {kind.__name__} is needed, found {value!r}")
    return value


_POSITIVE = [
    "body.length_m",
    "body.width_m",
    "body.height_m",
    "body.mass_kg",
    "body.clearance_m",
    "wheels.radius_m",
    "wheels.track_m",
    "mobility.speed_m_s",
    "mobility.turn_rate_rad_s",
    "mobility.step_m",
    "mobility.max_slope_rad",
    "mobility.max_tilt_rad",
    "mobility.max_step_m",
    "power.battery_j",
    "mast.height_m",
    "arm.reach_m",
    "arm.tool_radius_m",
    "arm.link_radius_m",
    "arm.standoff_m",
    "arm.joint_rate_rad_s",
    "arm.approach_m_s",
]


def _check(profile: RoverProfile, where: str) -> None:
    for dotted in _POSITIVE:
        part, name = dotted.split(".")
        value = getattr(getattr(profile, part), name)
        if not value > 0:
            raise ProfileError(f"rover profile {where}: {dotted} is {value}; it must be positive")
    if profile.arm.min_reach_m >= profile.arm.reach_m:
        raise ProfileError(
            f"rover profile {where}: arm.min_reach_m is {profile.arm.min_reach_m} m, "
            f"not less than arm.reach_m {profile.arm.reach_m} m"
        )
    _check_arm(profile.arm, where)
    if not 0 <= profile.power.initial_j <= profile.power.battery_j:
        raise ProfileError(
            f"rover profile {where}: power.initial_j is {profile.power.initial_j} J, "
            f"outside 0 to power.battery_j {profile.power.battery_j} J"
        )
    for name, instrument in profile.instruments.items():
        if instrument.kind not in ("contact", "remote"):
            raise ProfileError(
                f'rover profile {where}: instruments.{name}.kind is "{instrument.kind}"; contact or remote'
            )
        if not 0 < instrument.p_success <= 1:
            raise ProfileError(
                f"rover profile {where}: instruments.{name}.p_success is {instrument.p_success}; 0 to 1"
            )


def _check_arm(arm: Arm, where: str) -> None:
    for name, values in (("joint_limits_rad", arm.joint_limits_rad), ("stow_rad", arm.stow_rad)):
        if len(values) != arm.joints or arm.joints != 5:
            raise ProfileError(
                f"rover profile {where}: arm.{name} has {len(values)} entries and arm.joints is "
                f"{arm.joints}; both must be 5"
            )
    for name, length in zip(("upper arm", "forearm", "tool"), arm.links_m, strict=True):
        if not length > 0:
            raise ProfileError(
                f"rover profile {where}: arm.links_m: {name} is {length} m; it must be positive"
            )
    if abs(sum(arm.links_m) - arm.reach_m) > 1e-6:
        raise ProfileError(
            f"rover profile {where}: arm.links_m add up to {sum(arm.links_m):.3f} m; "
            f"arm.reach_m is {arm.reach_m} m"
        )
    for number, ((low, high), stow) in enumerate(zip(arm.joint_limits_rad, arm.stow_rad, strict=True), 1):
        if not low <= stow <= high:
            raise ProfileError(
                f"rover profile {where}: arm.stow_rad of joint {number} is {stow}, outside its limits "
                f"{low} to {high}"
            )
    for name, value in (("accuracy_m", arm.accuracy_m), ("overtravel_m", arm.overtravel_m)):
        if value < 0:
            raise ProfileError(f"rover profile {where}: arm.{name} is {value}; it must not be negative")
