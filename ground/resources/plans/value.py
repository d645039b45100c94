"""A plan: one revision, with what the planner said of it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from ground.records.stored import OfMission


class PlanState(StrEnum):
    DRAFT = "draft"
    COMPUTED = "computed"
    VERIFIED = "verified"
    APPROVED = "approved"
    UPLINKED = "uplinked"
    EXECUTED = "executed"


class Written(StrEnum):
    """What a plan that no search made has in the place of a search strategy: how its text came about."""

    MERGED = "merged"
    EDITED = "edited"


@dataclass(frozen=True, slots=True)
class Plan(OfMission):
    """One revision of a plan. Everything computed is frozen; an edit makes a new plan in state draft.

    What its planner predicted `elsewhere`, before it came in with an archive, counts for no flight rule here.
    """

    sol_id: str
    parent_id: str | None
    number: int
    name: str
    notes: str
    state: PlanState
    status: str
    strategy: str
    max_branches: int
    time_limit_s: float
    iterations: int | None
    seed: int
    job_id: str
    problem_id: str | None
    network_id: str | None
    expected_utility: float | None
    standard_error: float | None
    lower: float | None
    upper: float | None
    branches: int | None
    crl_sha256: str | None
    problem_sha256: str | None
    terrain_sha256: str
    dictionary: str
    rover_profile: str
    planned_request_ids: list[str]
    left_out: dict[str, str]
    stale: bool
    approved_by: str | None
    elsewhere: bool


@dataclass(frozen=True, slots=True)
class Finding:
    """What a check found; `severity` is error, warning or note."""

    code: str
    severity: str
    message: str
    node: str | None
    line: int | None
    column: int | None


@dataclass(frozen=True, slots=True)
class CrlFinding(Finding):
    """What the validator found in a text that was sent: `length` characters from its place on.

    `line` and `column` count from 1. `hint` proposes a remedy and may be empty.
    """

    length: int
    hint: str


@dataclass(frozen=True, slots=True)
class PlanConflict:
    """One place where two edits of a plan cannot be joined: the part and field, and what each side says.

    With `choosable` a side can be taken; else one of the edits must change.
    """

    kind: str
    id: str
    field: str
    base: str
    ours: str
    theirs: str
    choosable: bool


@dataclass(frozen=True, slots=True)
class PlanMerge:
    """The merged plan, null where conflicts are open or it was only asked whether it can be `joined`."""

    plan: Plan | None
    conflicts: list[PlanConflict]
    joined: bool
