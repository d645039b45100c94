"""Solutions of the site chain: where a frame lies, and what a choice among them carries along.

`offset_m` and `quaternion` are in the rovers' convention (north, east, nadir; a rover's forward, right,
down).
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import Any

from ground.resources.frames.value import Frame


@dataclass(frozen=True, slots=True)
class Solution:
    """One answer to where a frame lies in its reference.

    `covariance` is [6, 6] of a small motion (turn in rad, shift in m) in the frame's axes; `source` says
    where it came from (`file`, `traverse`, `by_hand`).
    """

    id: str
    mission_id: str
    frame_id: str
    reference_id: str
    label: str
    offset_m: list[float]
    quaternion: list[float]
    covariance: list[list[float]] | None
    added_utc: datetime
    in_use: bool
    source: dict[str, Any]
    notes: str
    author: str
    created_utc: datetime
    revision: int


@dataclass(frozen=True, slots=True)
class FrameFile:
    """A mission's frame file that was taken in: how many of its solutions were new, how many known."""

    id: str
    mission_id: str
    file_name: str
    sha256: str
    rover: str
    variant: str
    counter: list[int]
    priority: list[str]
    added: int
    known: int
    author: str
    created_utc: datetime
    revision: int


@dataclass(frozen=True, slots=True)
class Moved:
    """Something tied to a frame that a choice carries along: how far, and its deviation before and after."""

    kind: str
    id: str
    name: str
    shift_m: float
    sigma_before_m: float
    sigma_after_m: float


@dataclass(frozen=True, slots=True)
class Carried:
    """What the choice of a solution does, or, as a preview, would do."""

    frame: Frame
    preview: bool
    moved: list[Moved]
    revision: int
