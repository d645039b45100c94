"""What a target tracker is: the Protocol, the view it is given and the answer it gives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import Array, CameraModel
from rover_iface.errors import TrackerError
from rover_iface.telemetry import TrackState

__all__ = [
    "Expects",
    "FindsBeside",
    "Image",
    "StereoView",
    "TakesBack",
    "TrackState",
    "TrackUpdate",
    "Tracker",
]

Image = npt.NDArray[np.float32]


@dataclass(frozen=True)
class StereoView:
    """A stereo pair at one stop.

    Attributes
    ----------
    left, right
        Images, float32 in 0..1; whole frames or subframes.
    left_camera, right_camera
        Their models in the frame in which targets are kept: the site frame as the rover *believes* it to be
        (pose estimate and mast angles as read). What is wrong in it is what tracking corrects.
    t_s
        Time of the pictures, seconds.
    travelled_m
        Distance driven since tracking of the first target began, as far as the rover knows.
    """

    left: Image
    right: Image
    left_camera: CameraModel
    right_camera: CameraModel
    t_s: float = 0.0
    travelled_m: float = 0.0

    def __post_init__(self) -> None:
        for name, image, camera in (
            ("left", self.left, self.left_camera),
            ("right", self.right, self.right_camera),
        ):
            if image.shape != (camera.height, camera.width):
                raise TrackerError(
                    f"{name} image is {image.shape}, its camera {camera.height} x {camera.width}"
                )
            if image.dtype != np.float32:
                raise TrackerError(f"{name} image is {image.dtype}; float32 in 0..1 is needed")

    def shows(self, at: Array, margin_px: float) -> bool:
        """Return whether a pixel (2,) lies so far inside the left image; one that is not finite does not."""
        height, width = self.left_camera.height, self.left_camera.width
        return bool(
            margin_px <= at[0] <= width - 1 - margin_px and margin_px <= at[1] <= height - 1 - margin_px
        )


@dataclass(frozen=True)
class TrackUpdate:
    """What a tracker knows of one target after a stop.

    Attributes
    ----------
    state
        `TRACKED`, `LOST` or `FAILED`; a tracker never answers `IDLE`.
    position
        (3,), frame of the view's cameras, metres: while lost the last valid one, or where what lies round the
        target has it.
    covariance
        (3, 3), m^2, of that position relative to the cameras.
    confidence
        0..1; what it means is the tracker's to say, 0.5 is where it gives up.
    pixel
        (2,) in the left image, NaN while lost.
    reasons
        Which criteria were not met, in words; empty while tracked.
    scores
        Figures behind the decision, by name.
    deep_m
        What of the covariance is open along the line of sight by the depth of the surface within what the
        pixel may be off, one standard deviation, m: a camera that ranges the target anew has its own.
    """

    target: str
    state: TrackState
    position: Array
    covariance: Array
    confidence: float
    pixel: Array
    reasons: tuple[str, ...] = ()
    scores: Mapping[str, float] = field(default_factory=dict)
    deep_m: float = 0.0


class Tracker(Protocol):
    """Follows targets from stop to stop. Several at once; each has its own state.

    An implementer promises: a lost target is told as `LOST`, with its last valid position (or where what lies
    round it has it), and found again if it comes back within the allowed number of updates; after that it is
    `FAILED` until `clear`. Nothing is drawn by chance: the same views give the same answers.
    """

    def start(self, target: str, position: npt.ArrayLike, view: StereoView) -> TrackUpdate:
        """Begin to follow the surface point at `position` (3,), which both images show.

        Position in the frame of the view's cameras, m.

        Raises
        ------
        TrackerError
            If the target is followed already, or lies behind the cameras or outside the images.
        """

    def update(self, target: str, view: StereoView) -> TrackUpdate:
        """Find the target again after a move.

        Raises
        ------
        TrackerError
            If the target is not followed.
        """

    def predicted(self, target: str) -> Array:
        """Return where the target is believed to be (3,): what the mast should point at."""

    def clear(self, target: str) -> None:
        """Forget a target."""


@runtime_checkable
class FindsBeside(Protocol):
    """A tracker that finds a target in another wide picture of the stop it was last tracked at."""

    def beside(self, target: str, view: StereoView) -> Array | None:
        """Return its pixel (2,) in the left image, None where it is not seen there."""


@runtime_checkable
class Expects(Protocol):
    """A tracker that can be told where a target should be, by the drive and by the other targets."""

    def expect(self, target: str, position: Array, covariance: Array) -> None:
        """Take where the next look should have a target (3,), m, and the covariance (3, 3), m^2, of that."""


@runtime_checkable
class TakesBack(Protocol):
    """A tracker that goes on from where something else has found a target that it lost."""

    def take_back(
        self, target: str, view: StereoView, position: Array, covariance: Array
    ) -> TrackUpdate | None:
        """Return the answer about a target that a view shows at `position` (3,), m, frame of its cameras.

        `covariance` (3, 3), m^2, is what that leaves open, all that was known before included. None where
        stereo does not range it there.
        """
