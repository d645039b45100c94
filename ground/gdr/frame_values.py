"""The site chain as it is given out: frames, solutions, what is carried along, traverses.

A motion counter is (site, drive, ...). `offset_m` and `quaternion` are in the rovers' convention (north,
east, nadir; a rover's forward, right, down); all else is east, north, up of the mission's anchor site.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum
from typing import Any


class Level(StrEnum):
    """What a frame stands for."""

    SITE = "site"
    DRIVE = "drive"
    """Where a drive ended: the motion counter has two indices, or all behind them are 0."""
    POSE = "pose"
    """The same place after arm or mast moved, or any frame of another name."""


@dataclass(frozen=True, slots=True)
class FramePlace:
    """Where a frame lies as seen from the anchor, by the solutions in use.

    `unknown_links` solutions on the way have no covariance and count as exact.
    """

    east_m: float
    north_m: float
    up_m: float
    heading_rad: float
    covariance_m2: list[list[float]]
    unknown_links: int


@dataclass(frozen=True, slots=True)
class Frame:
    """A site, the end of a drive or a pose; `declared_at` is the motion counter at which a site was declared.

    `place` is null, with the `reason`, while nothing ties the frame to the anchor.
    """

    id: str
    mission_id: str
    name: str
    counter: list[int]
    level: Level
    site: int
    drive: int | None
    declared_at: list[int] | None
    solution_id: str | None
    chosen_utc: datetime | None
    solutions: int
    place: FramePlace | None
    reason: str
    notes: str
    author: str
    created_utc: datetime
    modified_utc: datetime
    revision: int


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
class SiteMap:
    """A map made at a site; `outline_m` is where it lies now, `sigma_m` how well that is known (worst)."""

    id: str
    mission_id: str
    name: str
    notes: str
    frame_id: str
    outline_m: list[list[float]]
    sigma_m: float
    file_name: str
    media: str
    size_bytes: int
    sha256: str
    file_url: str
    author: str
    created_utc: datetime
    modified_utc: datetime
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


@dataclass(frozen=True, slots=True)
class TraverseStop:
    """A stop of a traverse: the frame it stands for, and the run or upload with its panorama."""

    frame_id: str
    name: str
    run_id: str | None
    upload_id: str | None
    panorama: str


@dataclass(frozen=True, slots=True)
class Traverse:
    """Stops adjusted together. `document` is `localization/1`, null while the job goes on; `solution_ids` are
    the solutions that came of it."""

    id: str
    mission_id: str
    name: str
    notes: str
    job_id: str
    stops: list[TraverseStop]
    document: dict[str, Any] | None
    solution_ids: list[str]
    author: str
    created_utc: datetime
    modified_utc: datetime
    revision: int
