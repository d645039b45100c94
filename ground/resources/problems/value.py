"""A planning problem as it was given to the planner."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import Any


@dataclass(frozen=True, slots=True)
class Problem:
    """A planning problem as it was given to the planner (`document`: `problem/1` or `problem/2`)."""

    id: str
    mission_id: str
    sha256: str
    document: dict[str, Any]
    author: str
    created_utc: datetime
