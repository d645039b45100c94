"""What is told of a campaign."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from ground.jobs.value import JobState


@dataclass(frozen=True, slots=True)
class Campaign:
    """A plan that is flown `runs` times, seeds from `seed` on. `runs_done`, `mean_utility`, `standard_error`
    and `over_budget` (a share) are there when it has ended; until then ask for its result.

    What came in with an archive was made `elsewhere` and counts for no flight rule here.
    """

    id: str
    mission_id: str
    plan_id: str
    job_id: str
    state: JobState
    rover: str
    seed: int
    runs: int
    until_se: float | None
    crl_sha256: str
    runs_done: int
    mean_utility: float | None
    standard_error: float | None
    over_budget: float | None
    elsewhere: bool
    author: str
    created_utc: datetime
    revision: int


@dataclass(frozen=True, slots=True)
class FlownRun:
    """One run of a campaign."""

    seed: int
    utility: float
    outcome: str
    end_s: float
    energy_used_j: float
    options: list[str]
    why: str


@dataclass(frozen=True, slots=True)
class FlownRuns:
    """Runs of a campaign by seed, those asked for; `total` counts all that were meant."""

    items: list[FlownRun]
    total: int
