"""Rover profiles: one TOML file holds what a rover is, and every room reads it from here.

`load_profile("k9")` reads a profile that comes with the program or with an installed package (entry point
group `outcrop.profiles`, a path of a file), `load_profile(Path("mine.toml"))` any other.
"""

from __future__ import annotations

import hashlib
import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

from executive.crl.dictionary import Dictionary, load_dictionary
from executive.crl.errors import DictionaryError
from mission.codec import Codec
from mission.errors import MissionError, PluginError
from mission.instrument import USUAL_ACTIONS, Amount, Instrument, Use
from mission.plugins import Registry
from mission.values import NotNegative, Positive, value
from rover_iface import profiles
from rover_iface.errors import ProfileError

_FOLDER = Path(__file__).parent
STANDARD_DICTIONARY = "outcrop-rover"
"""Dictionary of a profile that names none: that of the simulated rovers."""
PARTS = ("mobility", "mast", "arm", "cameras", "power")
"""Parts of a rover that an action may need."""

Triple = tuple[float, float, float]
Pair = tuple[float, float]


@lru_cache(maxsize=32)
def dictionary_file(name: str) -> Dictionary:
    """Return a dictionary by name, or from a file that ends in `.toml` or `.json`.

    Raises
    ------
    DictionaryError
        If there is none of that name, or the file cannot be read as one.
    """
    if name.endswith((".toml", ".json")):
        return load_dictionary(Path(name))
    path = _FOLDER / "dictionaries" / f"{name}.toml"
    if not path.is_file():
        known = ", ".join(sorted(p.stem for p in path.parent.glob("*.toml")))
        raise DictionaryError(f'unknown dictionary "{name}"; known are {known}, or a file')
    return load_dictionary(path)


def standard_dictionary() -> Dictionary:
    """Return the dictionary of the rovers that come with the program."""
    return dictionary_file(STANDARD_DICTIONARY)


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


@value
class ProfileFile:
    """What a profile file holds: metres, radians, rover frame (x forward, y left, z up, origin on the
    ground).

    `dictionary` names a dictionary that comes with the program, or a file beside the profile.
    """

    name: str
    version: str
    body: Body
    wheels: Wheels
    mobility: Mobility
    power: Power
    mast: Mast
    arm: Arm
    cameras: Cameras
    leg_model: LegModel
    instruments: Mapping[str, Instrument]
    activities: Mapping[str, Activity]
    doc: str = ""
    dictionary: str = STANDARD_DICTIONARY

    def __post_init__(self) -> None:
        held: dict[str, str] = {name: name for name in self.instruments}
        for name, instrument in self.instruments.items():
            if instrument.alias and held.setdefault(instrument.alias, name) != name:
                raise MissionError(
                    f'instruments.{name}.alias is "{instrument.alias}", which the instrument '
                    f"{held[instrument.alias]} has already"
                )


@dataclass(frozen=True, slots=True)
class RoverProfile(ProfileFile):
    """What a rover is, with its dictionary.

    Attributes
    ----------
    sha256
        Of the profile's file.
    camera_set
        Where its camera set is: a name or the path of a file.
    language
        Content of its dictionary: what it can be told, and what it tells.
    """

    sha256: str = field(default="", compare=False)
    camera_set: str = field(default="", compare=False)
    language: Dictionary = field(default_factory=standard_dictionary, compare=False)

    def activity(self, name: str) -> Activity:
        """Return the times of an activity, zero when the profile does not list it."""
        return self.activities.get(name, Activity())

    def instrument_key(self, name: str) -> str:
        """Return the profile's name of an instrument, given that or its alias.

        Raises
        ------
        ProfileError
            If the rover has no such instrument.
        """
        if name in self.instruments:
            return name
        for key, instrument in self.instruments.items():
            if instrument.alias == name:
                return key
        raise ProfileError(
            f'rover "{self.name}" has no instrument "{name}"; it carries {", ".join(self.instrument_names())}'
        )

    def instrument(self, name: str) -> Instrument:
        """Return one instrument by name or alias; raises as `instrument_key` does."""
        return self.instruments[self.instrument_key(name)]

    def instrument_names(self) -> list[str]:
        """Return the names under which requests hold the instruments, sorted."""
        return sorted(instrument.alias or key for key, instrument in self.instruments.items())

    def usual_action(self, action: str, parameters: Mapping[str, object]) -> str:
        """Return the action that a rover carries a command out as.

        An action that the dictionary gives to an instrument goes as the usual one of that instrument's use:
        a drill is placed as any contact instrument is.
        """
        spec = self.language.commands.actions.get(action)
        if spec is None or not spec.instrument or action in USUAL_ACTIONS.values():
            return action
        figures = self.instruments.get(str(parameters.get(spec.instrument, "")))
        return action if figures is None else USUAL_ACTIONS[figures.use]

    def usual_instrument(self, use: Use) -> str:
        """Return the profile's name of the first instrument of a use.

        Raises
        ------
        ProfileError
            If it has none.
        """
        for key, instrument in self.instruments.items():
            if instrument.use is use:
                return key
        raise ProfileError(f'rover "{self.name}" has no {use} instrument')


_LEG_MODEL_OF_1 = {
    "source": "Kim et al. 2009, Table II; outside and occluded rates and the angle gain assumed",
    "turn_factor": 1.0,
    "slope_gain": 1.0,
    "energy_factor": 1.0,
    "inside_per_m": 0.0048,
    "outside_per_m": 0.05,
    "occluded_per_m": 0.15,
    "angle_gain_per_rad": 1.0,
}


def _of_version_1(members: dict[str, Any]) -> dict[str, Any]:
    """Bring a `profile/1` document up to date.

    There an instrument's use was its `kind`, the repository called `mi` and `scicam` of any rover by the
    names below, what the arm placed looked through the camera `mi`, a rover without a camera set of its name
    had K9's, every rover had the leg model below, and an activity that was not listed took no time.
    """
    known_as = {"mi": "microscopic_imager", "scicam": "science_camera"}
    tables = members.get("instruments")
    if isinstance(tables, dict):
        members["instruments"] = {name: _instrument_of_1(table) for name, table in tables.items()}
        for name, alias in known_as.items():
            if isinstance(members["instruments"].get(name), dict):
                members["instruments"][name].setdefault("alias", alias)
    cameras = members.get("cameras")
    if isinstance(cameras, dict):
        name = str(members.get("name"))
        cameras.setdefault("set", name if (_FOLDER / "cameras" / "data" / f"{name}.toml").is_file() else "k9")
    members.setdefault("leg_model", dict(_LEG_MODEL_OF_1))
    if isinstance(members.get("activities"), dict):
        for action in standard_dictionary().commands.actions.values():
            if action.activity:
                members["activities"].setdefault(action.activity, {})
    return members


def _instrument_of_1(table: Any) -> Any:
    if not isinstance(table, dict) or "kind" not in table:
        return table
    use = {"use": table["kind"], **{name: item for name, item in table.items() if name != "kind"}}
    return {"camera": "mi", **use} if table["kind"] == "contact" else use


PROFILES = Codec(
    ProfileFile,
    "profile/2",
    "rover profile",
    upgrades={"profile/1": ("profile/2", _of_version_1)},
    error=ProfileError,
)
"""Reads the members of a profile; `load_profile` adds its dictionary."""

_NAMED = Registry(
    "rover profile",
    "outcrop.profiles",
    {path.stem: f"rover_iface.profiles:{path.stem}" for path in profiles.FOLDER.glob("*.toml")},
)


def profile_names() -> list[str]:
    """Return the names of the profiles that come with the program and with installed packages."""
    return _NAMED.names()


def load_profile(source: str | Path) -> RoverProfile:
    """Return a profile by name (`k9`, `mer`) or from a TOML file.

    Raises
    ------
    ProfileError
        If the name is unknown or its package cannot be imported, the file is no TOML, a member is missing,
        unknown or out of range, or profile and dictionary contradict each other.
    """
    path = _named(source) if isinstance(source, str) and not source.endswith(".toml") else Path(source)
    try:
        raw = path.read_bytes()
    except OSError as err:
        raise ProfileError(f"rover profile {path}: {err.strerror or err}") from err
    return _parse(raw, str(path))


@cache
def _named(name: str) -> Path:
    """Return the file of a profile that has a name; looking through what is installed takes milliseconds."""
    try:
        found = _NAMED.load(name)
    except PluginError as err:
        raise ProfileError(str(err)) from err
    if not isinstance(found, str | Path):
        raise ProfileError(f'rover profile "{name}" is {found!r}; the path of a TOML file is needed')
    return Path(found)


@lru_cache(maxsize=32)
def _parse(raw: bytes, path: str) -> RoverProfile:
    where = f"rover profile {path}"
    try:
        document = tomllib.loads(raw.decode("utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as err:
        raise ProfileError(f"{where}: not TOML: {err}") from err
    read = PROFILES.from_document(document, where)
    try:
        language = dictionary_file(_beside(path, read.dictionary))
    except DictionaryError as err:
        raise ProfileError(f"{where}: dictionary is {read.dictionary!r}: {err}") from err
    wrong = contradiction(read, language)
    if wrong:
        raise ProfileError(f"{where}: dictionary {language.name} {language.version}: {wrong}")
    members = {f.name: getattr(read, f.name) for f in fields(read)}
    return RoverProfile(
        **members,
        sha256=hashlib.sha256(raw).hexdigest(),
        camera_set=_beside(path, read.cameras.set),
        language=language,
    )


def _beside(path: str, name: str) -> str:
    """Return a name as it is, a file's as it lies beside the profile."""
    return str(Path(path).parent / name) if name.endswith((".toml", ".json")) else name


def contradiction(profile: ProfileFile, language: Dictionary) -> str:
    """Return in what a dictionary contradicts a profile, the first thing found; empty if in nothing."""
    actions = language.commands.actions
    carried = ", ".join(sorted(profile.instruments)) or "none"
    for name, action in actions.items():
        if action.activity and action.activity not in profile.activities:
            return (
                f'action "{name}" takes its time from the activity "{action.activity}", which the profile '
                f"lacks; it has {', '.join(sorted(profile.activities))}"
            )
        for part in action.needs:
            if part not in PARTS:
                return f'action "{name}" needs "{part}"; a rover has {", ".join(PARTS)}'
        named = action.parameter(action.instrument) if action.instrument else None
        for choice in named.choices if named is not None else ():
            if choice not in profile.instruments:
                return (
                    f'action "{name}" lets its {action.instrument} be "{choice}", which the profile lacks; '
                    f"it carries {carried}"
                )
    for name, instrument in profile.instruments.items():
        wrong = _misused(name, instrument, language)
        if wrong:
            return wrong
    return ""


def _misused(name: str, instrument: Instrument, language: Dictionary) -> str:
    """Return what is wrong with the action that uses an instrument, or an empty string."""
    actions = language.commands.actions
    action = actions.get(instrument.used_by)
    if action is None:
        return (
            f'instrument "{name}" is used by the action "{instrument.used_by}", which the dictionary lacks; '
            f"it has {', '.join(actions)}"
        )
    for parameter in ("target", "instrument"):
        spec = action.parameter(parameter)
        if spec is None:
            known = ", ".join(p.name for p in action.parameters) or "none"
            return (
                f'instrument "{name}" is used by the action "{action.name}", which has no parameter '
                f'"{parameter}"; it has {known}'
            )
        if parameter == "instrument" and spec.choices and name not in spec.choices:
            return (
                f'instrument "{name}" is used by the action "{action.name}", whose instrument must be one of '
                f"{', '.join(spec.choices)}"
            )
    return ""
