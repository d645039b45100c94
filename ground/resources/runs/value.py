"""A run: one execution of a plan."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from ground.jobs.value import JobState
from ground.records.stored import OfMission


class RunKind(StrEnum):
    DRY_RUN = "dry_run"
    EXECUTION = "execution"
    TRAINING = "training"
    """Executed on a training rover: it ends a sol, and the package may still be executed on a real one."""
    LIVE = "live"


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault put into a run, at `at_s` seconds or when the command of `task` arrives.

    `target_id` where it concerns one; `amount` is a factor (drives), joules (low battery) or interest
    (novelty).
    """

    kind: str
    at_s: float | None
    task: str | None
    target_id: str | None
    amount: float | None


@dataclass(frozen=True, slots=True)
class Run(OfMission):
    """One execution of a plan's CRL, by a simulated rover (dry run) or as brought down from a rover.

    What came in with an archive was made `elsewhere` and verifies nothing here.
    """

    plan_id: str
    kind: RunKind
    rover: str
    seed: int
    faults: list[Fault]
    job_id: str | None
    state: JobState
    outcome: str
    utility: float | None
    duration_s: float | None
    energy_used_j: float | None
    options_taken: list[str]
    achieved_request_ids: list[str]
    crl_sha256: str
    notes: str
    elsewhere: bool


@dataclass(frozen=True, slots=True)
class RunControl:
    """What is asked of a run that goes on: plan seconds a second (0 = all at once), held or not, single steps
    asked for so far, aborted.
    """

    run_id: str
    pace: float
    paused: bool
    steps: int
    abort: bool
