"""What behaviour sees of a rover: clock, power, believed pose, wheels, cameras, arm, telemetry, products.

Whoever implements `Hardware` can be driven by everything in this package: the simulator does, a process
beside it does over a pipe (`remote`), and a real rover would. What takes time is a `Doing`. Poses, points and
cameras are in the *believed* site frame, the one of dead reckoning, unless said otherwise; no member tells
where the rover truly is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
import numpy.typing as npt

from executive.ports import Command, Value
from mission.instrument import Instrument
from rover_iface.behaviour.action import Doing
from rover_iface.cameras.model import Array, CameraModel
from rover_iface.frames import Pose
from rover_iface.navigation.navigator import Way
from rover_iface.placement.arm_motion import Motion
from rover_iface.profile import RoverProfile

Cloud = npt.NDArray[np.floating]
Window = tuple[int, int, int, int]
"""Left, top, width, height of a subframe, pixels."""


@dataclass(frozen=True, slots=True)
class Look:
    """Pictures to be taken at once, exposed alike: which cameras, which part of their frames.

    Attributes
    ----------
    cameras
        Names of mounted cameras; the first sets the exposure.
    windows
        Of each, in pixels of the frame at `scale`.
    pan_rad, tilt_rad
        Of the mast; without meaning for cameras fixed to the body.
    scale
        Resolution to read out at, as a share of the full one.
    track
        The target whose tracker asked for the pictures, if one did.
    """

    cameras: tuple[str, ...]
    windows: tuple[Window, ...]
    pan_rad: float = 0.0
    tilt_rad: float = 0.0
    scale: float = 1.0
    track: str = ""


@dataclass(frozen=True, eq=False)
class Picture:
    """What a camera took.

    Attributes
    ----------
    read
        Reads it out; see `unit`. What is kept and never looked at need not be worked out.
    bits
        Of the sensor.
    number
        By which the hardware knows the picture again.
    """

    read: Callable[[], npt.NDArray[np.float32]]
    bits: int
    number: int

    @cached_property
    def unit(self) -> npt.NDArray[np.float32]:
        """Return the image (height, width), float32 in 0..1."""
        return self.read()

    @property
    def image8(self) -> npt.NDArray[np.uint8]:
        """Return the image in 8 bits, by square root coding where it has more (as MER's tables do)."""
        levels = self.unit if self.bits == 8 else np.sqrt(self.unit)
        return np.asarray(np.round(255.0 * levels), dtype=np.uint8)

    def __reduce__(self) -> tuple[Callable[..., Picture], tuple[npt.NDArray[np.float32], int, int]]:
        """Return what another process gets: the image read out, as the camera stays here."""
        return _read_out, (self.unit, self.bits, self.number)


def _read_out(unit: npt.NDArray[np.float32], bits: int, number: int) -> Picture:
    return Picture(lambda: unit, bits, number)


@dataclass(frozen=True, slots=True)
class Drive:
    """How a drive ended: what the body touched, if anything, and whether the wheels did not move it."""

    hazard: str = ""
    stuck: bool = False


@dataclass(frozen=True, eq=False)
class Contact:
    """Where a tool touches: surface point (3,), NaN without one, and how it came about.

    Attributes
    ----------
    made
        Whether the tool stands on the surface.
    reason
        Why not.
    beyond_m
        How far beyond the expected surface the tool stopped (negative: before), NaN where unknown.
    """

    made: bool
    reason: str
    point: Array
    beyond_m: float = float("nan")


@dataclass(frozen=True, eq=False)
class CloseUp:
    """What the imager on the tool brought: the merged picture of a focus stack, (height, width) uint8.

    `sharp` is the share of it in focus, `pixel_m` the size of a pixel on the surface in the middle, `planes`
    how many pictures were merged; both figures are NaN for an imager that does not tell them.
    """

    image: npt.NDArray[np.uint8]
    camera: CameraModel
    number: int
    sharp: float = float("nan")
    pixel_m: float = float("nan")
    planes: int = 1


@dataclass(frozen=True, eq=False)
class TrackReport:
    """One answer of a tracker, for the engineering log; position (3,) and pixel (2,) of the left `picture`.

    `begun` marks the first answer of a new track; `picture` is None where nothing could be taken.
    """

    target: str
    state: str
    confidence: float
    range_m: float
    reasons: tuple[str, ...]
    position: Array
    pixel: Array
    picture: int | None
    begun: bool = False


@dataclass(frozen=True, slots=True)
class ProductFile:
    """One file of a product that is a folder; `kind` is empty for a file that is not a product by itself."""

    name: str
    data: bytes
    kind: str
    label: Mapping[str, object]


class Platform(Protocol):
    """Clock, power, pose, telemetry and the store of products: what every behaviour needs.

    An implementer promises that a `Doing` may be closed at any step, and that what has moved then stands
    still.
    """

    @property
    def profile(self) -> RoverProfile:
        """Return what kind of rover this is."""

    @property
    def t_s(self) -> float:
        """Return the time since the plan started, seconds."""

    @property
    def drawn_j(self) -> float:
        """Return the energy used by actions so far, hotel load left out."""

    @property
    def believed(self) -> Pose:
        """Return where dead reckoning puts the rover."""

    @property
    def travelled_m(self) -> float:
        """Return the reading of the odometer."""

    @property
    def cameras_work(self) -> bool:
        """Return whether the cameras report themselves healthy."""

    @property
    def keeps_products(self) -> bool:
        """Return whether there is anywhere to store products."""

    def spend(self, activity: str, share: float = 1.0) -> Doing[float]:
        """Wait as long as an activity of the profile takes, `share` times; gives the energy used, joules."""

    def operate(self, instrument: Instrument, dwell_s: float = 0.0) -> Doing[float]:
        """Run an instrument, and `dwell_s` more; gives the energy used, joules."""

    def get(self, key: str) -> Value | None:
        """Return a state key of telemetry."""

    def set(self, key: str, value: Value) -> None:
        """Set a state key; a change is reported with the next result or report."""

    def report(self) -> None:
        """Send what has changed in telemetry now."""

    def log_track(self, report: TrackReport) -> None:
        """Put an answer of a tracker into the engineering log."""

    def write_log(self, command: Command, kind: str) -> int:
        """Store the log `odometry` or `tracking` as a product; returns how many products that made."""

    def write_product(
        self,
        command: Command,
        kind: str,
        data: bytes,
        suffix: str,
        label: Mapping[str, object],
        *,
        picture: int | None = None,
    ) -> int:
        """Store a file as a product with its label; returns how many products that made, 0 or 1.

        `picture` is the number of the picture that it shows.
        """

    def write_folder(self, command: Command, kind: str, files: Sequence[ProductFile]) -> int:
        """Store files in a folder of their own, those of a kind as products; returns how many."""


class Hardware(Platform, Protocol):
    """A whole rover: what a platform has, wheels, cameras, a ranging sensor and an arm.

    Attributes that a rover lacks it may refuse by raising `RoverError`: the `subframe` behaviour scans and
    reaches, the `full` one looks and moves the joints of its arm.
    """

    def drive(self, way: Way) -> Doing[Drive]:
        """Turn and drive; telemetry has the new pose when it ends."""

    def correct(self, pose: Pose) -> None:
        """Take where the rover stands, as its pictures have it; dead reckoning goes on from there."""

    def look(self, look: Look) -> Sequence[Picture]:
        """Point the mast and take pictures, one per camera.

        Raises
        ------
        RenderError
            If a camera sees nothing that can be exposed.
        """

    def scan(self, *, around: bool) -> list[Cloud]:
        """Return ranges of the ground, a cloud (n, 3) per view, rover frame; `around`: to all sides."""

    def reach(self, target: str, point: Array, instrument: str) -> Contact:
        """Put a tool on a point (3,) of the believed site frame, m, the way there left to the arm's
        controller; says if it met a surface.

        Raises
        ------
        PlacementError
            If the arm does not reach or the place is not safe; the message says why.
        """

    def move_arm(self, target: str, motion: Motion) -> Doing[Contact]:
        """Move the joints along a motion until the tool's sensors report contact."""

    def take_close_up(self, camera: str) -> CloseUp:
        """Return what an imager on the tool sees where it touches; `camera` of the rover's rig.

        Raises
        ------
        RenderError
            If that is nothing.
        """

    def instrument_delivers(self, instrument: Instrument) -> bool:
        """Return whether an instrument that was run has brought what it should."""
