"""The folder `run/1` of a recording: poses and battery as telemetry, pictures as products."""

from __future__ import annotations

import hashlib
import json
import math
from bisect import bisect_right
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from ground.errors import ArchiveError

if TYPE_CHECKING:
    from neighbours.robots.recording import Mapping, Picture, RecordedPose, Recording

OUTCOME = "RECORDED"
ROVER = "recording"
NANO = 1_000_000_000
LAST_S = 4_000_000_000
"""Seconds since 1970 in the year 2096; stamps of ROS 2 end in 2106."""


@dataclass(frozen=True, slots=True)
class _Kept:
    """A picture whose file is written."""

    t_ns: int
    topic: str
    frame: str
    path: str
    sha256: str


def write_recording(
    folder: Path,
    source: Path,
    name: str,
    mapping: Mapping,
    tell: Callable[[float], None] = lambda _share: None,
) -> Recording:
    """Write the folder of a recording and return what was read; `tell` hears the share that is done.

    Raises
    ------
    ArchiveError
        If a time stamp is none of our days.
    RobotFormatError
        If the recording cannot be read, or the mapping does not fit it.
    """
    from neighbours.robots.recording import read_recording

    (folder / "products").mkdir(parents=True)
    pictures: list[_Kept] = []
    recording = read_recording(source, mapping, _keeper(folder, pictures), tell)
    _write(folder, name, recording, pictures)
    return recording


def _keeper(folder: Path, pictures: list[_Kept]) -> Callable[[Picture], None]:
    """Return what writes each picture into the folder as it comes."""

    def keep(picture: Picture) -> None:
        path = f"products/{len(pictures):06d}.{picture.format}"
        (folder / path).write_bytes(picture.data)
        sha256 = hashlib.sha256(picture.data).hexdigest()
        pictures.append(_Kept(picture.t_ns, picture.topic[:200], picture.frame[:200], path, sha256))

    return keep


def _write(folder: Path, name: str, recording: Recording, pictures: list[_Kept]) -> None:
    """Write the folder `run/1` of a recording; its time 0 is its first pose, level or picture."""
    stamps = [
        *(p.t_ns for p in recording.poses),
        *(t for t, _ in recording.battery),
        *(p.t_ns for p in pictures),
    ]
    zero_ns, end_ns = min(stamps), max(stamps)
    for stamp in (zero_ns, end_ns):
        if not 0 <= stamp < LAST_S * NANO:
            raise ArchiveError(f"a time stamp of {stamp / NANO:g} s; 0 to {LAST_S} since 1970 are taken")
    document = {
        "format": "run/1",
        "name": name,
        "whole": recording.whole,
        "outcome": OUTCOME,
        "end_s": (end_ns - zero_ns) / NANO,
        "rover": ROVER,
        "start_utc": datetime.fromtimestamp(zero_ns / NANO, UTC).isoformat(),
        "topics": dict(recording.messages),
        "findings": recording.findings,
    }
    (folder / "run.json").write_text(json.dumps(document, indent=1), encoding="utf-8")
    (folder / "trace.jsonl").write_text("", encoding="utf-8")
    with (folder / "telemetry.jsonl").open("w", encoding="utf-8") as file:
        file.writelines(json.dumps(sample) + "\n" for sample in _samples(recording, zero_ns))
    with (folder / "products.jsonl").open("w", encoding="utf-8") as file:
        for one in sorted(pictures, key=lambda p: p.t_ns):
            label = {"topic": one.topic, "frame": one.frame, **_pose_label(recording.poses, one.t_ns)}
            line = {
                "t_s": (one.t_ns - zero_ns) / NANO,
                "task": "",
                "kind": "image",
                "path": one.path,
                "sha256": one.sha256,
                "label": label,
            }
            file.write(json.dumps(line) + "\n")


def _samples(recording: Recording, zero_ns: int) -> Iterator[dict[str, object]]:
    """Yield a sample for each pose, with the last battery level; NaN is what was not told."""
    levels = recording.battery
    times = [t for t, _ in levels]
    for pose in recording.poses:
        place = bisect_right(times, pose.t_ns)
        level = levels[place - 1][1] if place else math.nan
        yield {
            "t_s": (pose.t_ns - zero_ns) / NANO,
            "east_m": round(pose.east_m, 6),
            "north_m": round(pose.north_m, 6),
            "heading_rad": round(pose.heading_rad, 7),
            "battery_j": level,
            "energy_used_j": levels[0][1] - level if place else math.nan,
            "task": "",
            "trackers": {},
        }


def _pose_label(poses: list[RecordedPose], t_ns: int) -> dict[str, float]:
    """Return the pose at a time, between two recorded ones on the straight line; nothing outside them."""
    place = bisect_right(poses, t_ns, key=lambda pose: pose.t_ns)
    if not poses or place == 0 or (place == len(poses) and poses[-1].t_ns != t_ns):
        return {}
    before, after = poses[place - 1], poses[min(place, len(poses) - 1)]
    span = after.t_ns - before.t_ns
    share = (t_ns - before.t_ns) / span if span else 0.0
    turn = math.remainder(after.heading_rad - before.heading_rad, 2 * math.pi)
    return {
        "east_m": before.east_m + share * (after.east_m - before.east_m),
        "north_m": before.north_m + share * (after.north_m - before.north_m),
        "heading_rad": before.heading_rad + share * turn,
    }
