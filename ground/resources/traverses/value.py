"""A traverse: stops of recorded runs that were adjusted together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ground.records.stored import OfMission


@dataclass(frozen=True, slots=True)
class TraverseStop:
    """A stop of a traverse: the frame it stands for, and the run or upload with its panorama."""

    frame_id: str
    name: str
    run_id: str | None
    upload_id: str | None
    panorama: str


@dataclass(frozen=True, slots=True)
class Traverse(OfMission):
    """Stops adjusted together. `document` is `localization/1`, null while the job goes on; `solution_ids` are
    the solutions that came of it.
    """

    name: str
    notes: str
    job_id: str
    stops: list[TraverseStop]
    document: dict[str, Any] | None
    solution_ids: list[str]
