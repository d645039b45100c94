"""What an administrator sees of a service: its workers, its queue, its disk and what keeps it well."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from ground.jobs.value import JobState


@dataclass(frozen=True, slots=True)
class WorkerGlance:
    """A worker that is there: `heard_s` since it was heard of, `trouble` of its engine, empty where well."""

    name: str
    executor: str
    running: int
    heard_s: float
    trouble: str


@dataclass(frozen=True, slots=True)
class Backlog:
    """How many jobs of a kind wait and run for a mission."""

    kind: str
    mission_id: str | None
    mission_name: str
    waiting: int
    running: int


@dataclass(frozen=True, slots=True)
class JobGlance:
    """A job in a line: `took_s` is how long it waits, runs, or took; `position` its turn."""

    id: str
    kind: str
    state: JobState
    mission_id: str | None
    mission_name: str
    position: int | None
    took_s: float
    attempt: int
    progress: float
    message: str
    worker: str


@dataclass(frozen=True, slots=True)
class Disk:
    """Room of the data folder's disk and what is kept; `store_bytes` is null until it was counted once."""

    free_bytes: int
    size_bytes: int
    store_bytes: int | None
    product_bytes: int
    database_bytes: int


@dataclass(frozen=True, slots=True)
class Upkeep:
    """When something was last done for the service and how many faults it found; null if it never was."""

    act: str
    at_utc: datetime | None
    faults: int | None


@dataclass(frozen=True, slots=True)
class ServiceStatus:
    """The service at a moment: jobs that run, the first that wait, and the slowest of the last week."""

    at_utc: datetime
    executor: str
    workers: list[WorkerGlance]
    backlog: list[Backlog]
    running: list[JobGlance]
    waiting: list[JobGlance]
    slowest: list[JobGlance]
    disk: Disk
    upkeep: list[Upkeep]
    history_events: int
