"""What is told of every resource."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime


@dataclass(frozen=True, slots=True)
class Stored:
    """What is told of every resource; `revision` grows by one with each change."""

    id: str
    author: str
    created_utc: datetime
    modified_utc: datetime
    revision: int


@dataclass(frozen=True, slots=True)
class OfMission(Stored):
    """What is told of every resource of a mission."""

    mission_id: str
