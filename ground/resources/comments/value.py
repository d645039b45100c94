"""A comment: a remark on any resource of a mission."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime


@dataclass(frozen=True, slots=True)
class Comment:
    """A remark on any resource of a mission."""

    id: str
    mission_id: str
    subject_kind: str
    subject_id: str
    text: str
    author: str
    created_utc: datetime
    modified_utc: datetime
    revision: int
