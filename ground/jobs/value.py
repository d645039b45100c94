"""A job: long work, how far it is and what came of it."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum
from typing import Any


class JobState(StrEnum):
    QUEUED = "queued"
    RUNNING = "running"
    SUCCEEDED = "succeeded"
    FAILED = "failed"
    CANCELLED = "cancelled"


@dataclass(frozen=True, slots=True)
class LogLine:
    at_utc: datetime
    text: str


@dataclass(frozen=True, slots=True)
class Job:
    """Long work: `progress` goes from 0 to 1, `result_url` is what came of it, `problem` why it failed."""

    id: str
    mission_id: str | None
    kind: str
    state: JobState
    progress: float
    message: str
    attempt: int
    cancel_requested: bool
    subject_kind: str
    subject_id: str
    result_url: str | None
    problem: dict[str, Any] | None
    log: list[LogLine]
    author: str
    created_utc: datetime
    started_utc: datetime | None
    finished_utc: datetime | None
    revision: int
