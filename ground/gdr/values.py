"""What the repository gives out: frozen values, one for each kind of resource.

Units stand in the names; positions are in the site frame (east, north, up, metres), headings and azimuths
are radians counter-clockwise from east, `t_s` is seconds on the plan clock, `*_utc` is an aware datetime.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum
from typing import Any


class Role(StrEnum):
    """What a person may do; see `ground.services.permissions`."""

    VIEWER = "viewer"
    SCIENTIST = "scientist"
    PLANNER = "planner"
    FLIGHT_DIRECTOR = "flight_director"
    OPERATOR = "operator"
    ADMIN = "admin"


class Instrument(StrEnum):
    MICROSCOPIC_IMAGER = "microscopic_imager"
    SCIENCE_CAMERA = "science_camera"


class RequestState(StrEnum):
    """Life of an observation request."""

    OPEN = "open"
    PLANNED = "planned"
    ATTEMPTED = "attempted"
    SATISFIED = "satisfied"
    FAILED = "failed"
    CARRIED = "carried"


class PlanState(StrEnum):
    DRAFT = "draft"
    COMPUTED = "computed"
    VERIFIED = "verified"
    APPROVED = "approved"
    UPLINKED = "uplinked"
    EXECUTED = "executed"


class JobState(StrEnum):
    QUEUED = "queued"
    RUNNING = "running"
    SUCCEEDED = "succeeded"
    FAILED = "failed"
    CANCELLED = "cancelled"


class RunKind(StrEnum):
    DRY_RUN = "dry_run"
    EXECUTION = "execution"


@dataclass(frozen=True, slots=True)
class Point:
    """A point in the site frame."""

    east_m: float
    north_m: float
    up_m: float


@dataclass(frozen=True, slots=True)
class Pose:
    """A place to stand in the site frame."""

    east_m: float
    north_m: float
    heading_rad: float


@dataclass(frozen=True, slots=True)
class Bounds:
    """A rectangle of the site frame."""

    east_min_m: float
    north_min_m: float
    east_max_m: float
    north_max_m: float


@dataclass(frozen=True, slots=True)
class Counts:
    targets: int
    observation_requests: int
    plans: int
    runs: int
    products: int


@dataclass(frozen=True, slots=True)
class DriveRule:
    """What people say of the drive between two targets' stands, in both directions; null is the start pose.

    `via_m` are the corners (east, north) of the way from the first to the second that the rover has to take,
    none for a straight line; null takes the drive out of the path network.
    """

    from_target_id: str | None
    to_target_id: str
    via_m: list[list[float]] | None


@dataclass(frozen=True, slots=True)
class Mission:
    """One worksite with all that is planned and done there."""

    id: str
    name: str
    notes: str
    terrain_id: str
    terrain_name: str
    copied_from: str | None
    rover_profile: str
    anchor_frame_id: str | None
    calibration: dict[str, Any] | None
    drive_rules: list[DriveRule]
    counts: Counts
    author: str
    created_utc: datetime
    modified_utc: datetime
    revision: int


@dataclass(frozen=True, slots=True)
class TerrainLayer:
    """One raster layer: `rows` x `columns` posts of height, `spacing_m` apart, and its ortho image."""

    name: str
    bounds_m: Bounds
    rows: int
    columns: int
    spacing_m: float
    ortho_width: int
    ortho_height: int
    ortho_media: str
    has_ortho: bool


@dataclass(frozen=True, slots=True)
class Terrain:
    """What is known of a mission's ground; layers go from coarse (`outer`) to fine (`inner`)."""

    id: str
    name: str
    credits: str
    sha256: str
    bounds_m: Bounds
    layers: list[TerrainLayer]
    start_pose: Pose
    lowest_m: float
    highest_m: float


@dataclass(frozen=True, slots=True)
class TerrainPoint:
    """The ground at one point, asked of the full-resolution terrain; `covariance_m2` is row by row.

    `observed` is whether a camera ever saw it, `in_view` whether the mast at the start pose sees it.
    """

    east_m: float
    north_m: float
    up_m: float
    normal: list[float]
    slope_rad: float
    covariance_m2: list[list[float]]
    range_m: float
    observed: bool
    in_view: bool
    layer: str


@dataclass(frozen=True, slots=True)
class CommunicationPass:
    """A time in which the rover can be heard or commanded."""

    name: str
    start_s: float
    end_s: float
    data_mbit: float


@dataclass(frozen=True, slots=True)
class Sol:
    """One day of work: where it starts, what may be spent, when there is contact."""

    id: str
    mission_id: str
    number: int
    notes: str
    start_pose: Pose
    start_utc: datetime | None
    start_lmst_h: float
    battery_j: float
    energy_floor_j: float
    time_budget_s: float
    energy_budget_j: float
    overrun_penalty: float
    passes: list[CommunicationPass]
    uplink_deadline_utc: datetime | None
    author: str
    created_utc: datetime
    modified_utc: datetime
    revision: int


@dataclass(frozen=True, slots=True)
class Target:
    """A point on a rock that somebody finds worth a look."""

    id: str
    mission_id: str
    name: str
    notes: str
    position: Point
    normal: list[float]
    slope_rad: float
    covariance_m2: list[list[float]]
    source_image: str
    frame_id: str | None
    author: str
    created_utc: datetime
    modified_utc: datetime
    revision: int


@dataclass(frozen=True, slots=True)
class ObservationPoint:
    """Where the rover stands for an observation; `reason` says why there is no such place."""

    pose: Pose | None
    reachable: bool
    manual: bool
    reason: str


@dataclass(frozen=True, slots=True)
class ObservationRequest:
    """What a scientist asks of a target."""

    id: str
    mission_id: str
    target_id: str
    target_name: str
    instrument: Instrument
    value: float
    tracked: bool
    window_s: list[float] | None
    after: list[str]
    must_do: bool
    dwell_s: float | None
    notes: str
    observation_point: ObservationPoint | None
    state: RequestState
    state_reason: str
    author: str
    created_utc: datetime
    modified_utc: datetime
    revision: int


@dataclass(frozen=True, slots=True)
class KeepOut:
    """A polygon the rover must not enter; corners are [east_m, north_m], the ring is closed by itself."""

    id: str
    mission_id: str
    name: str
    notes: str
    polygon_m: list[list[float]]
    frame_id: str | None
    sigma_m: float
    author: str
    created_utc: datetime
    modified_utc: datetime
    revision: int


@dataclass(frozen=True, slots=True)
class ImportedGeometry:
    """What came of a file of targets and keep-outs."""

    targets: list[Target]
    keep_outs: list[KeepOut]


@dataclass(frozen=True, slots=True)
class NetworkNode:
    """A place of the path network: the start or an observation point."""

    id: str
    pose: Pose
    target_id: str | None
    request_ids: list[str]


@dataclass(frozen=True, slots=True)
class NetworkSegment:
    """A drive between two places, one way; `p_lose` is the chance to lose each tracked target on it."""

    id: str
    start: str
    end: str
    points_m: list[list[float]]
    length_m: float
    time_mean_s: float
    time_sd_s: float
    energy_mean_j: float
    energy_sd_j: float
    p_lose: dict[str, float]


@dataclass(frozen=True, slots=True)
class TrackingRegion:
    """The cone in which a target is tracked well."""

    target_id: str
    polygon_m: list[list[float]]


@dataclass(frozen=True, slots=True)
class PathNetwork:
    """Drives between the start and the observation points, computed from one state of the mission.

    `segments` are the drives, each a polyline; `hazards_m` what the heights forbid, `margins_m` that and the
    keep-outs with the clearance round them; `unreachable` says why a request has no drive.
    """

    id: str
    mission_id: str
    inputs_sha256: str
    stale: bool
    nodes: list[NetworkNode]
    segments: list[NetworkSegment]
    regions: list[TrackingRegion]
    hazards_m: list[list[list[float]]]
    margins_m: list[list[list[float]]]
    unreachable: dict[str, str]
    notes: list[str]
    job_id: str
    computed: bool
    author: str
    created_utc: datetime
    revision: int


@dataclass(frozen=True, slots=True)
class Problem:
    """A planning problem as it was given to the planner (`document` has the form `problem/1`)."""

    id: str
    mission_id: str
    sha256: str
    document: dict[str, Any]
    author: str
    created_utc: datetime


@dataclass(frozen=True, slots=True)
class Plan:
    """One revision of a plan. Everything computed is frozen; an edit makes a new plan in state draft."""

    id: str
    mission_id: str
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
    author: str
    approved_by: str | None
    created_utc: datetime
    modified_utc: datetime
    revision: int


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
class Run:
    """One execution of a plan's CRL, by a simulated rover (dry run) or as brought down from a rover."""

    id: str
    mission_id: str
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
    author: str
    created_utc: datetime
    modified_utc: datetime
    revision: int


@dataclass(frozen=True, slots=True)
class TraceEvent:
    """One record of the executive's trace (CRL reference, section 10)."""

    t_s: float
    event: str
    arguments: list[str]


@dataclass(frozen=True, slots=True)
class Trace:
    run_id: str
    outcome: str
    end_s: float
    events: list[TraceEvent]


@dataclass(frozen=True, slots=True)
class NodeState:
    """A node of the running plan; times on the plan clock, null is unbounded or not yet.

    `window_s` bounds the start while the node waits and the end after it; `chosen` is the option taken.
    """

    id: str
    kind: str
    parent: str | None
    state: str
    outcome: str | None
    reason: str
    start_s: float | None
    end_s: float | None
    window_s: list[float | None]
    attempts: int
    chosen: str | None
    action: str | None
    held: bool


@dataclass(frozen=True, slots=True)
class CommandState:
    """A command the rover has not answered yet."""

    task: str
    attempt: int
    abort_asked: bool


@dataclass(frozen=True, slots=True)
class ContingencyState:
    """A floating contingency: whether it may fire, has fired, and is being carried out (`phase`)."""

    id: str
    armed: bool
    triggered: bool
    insertions: int
    phase: str


@dataclass(frozen=True, slots=True)
class RunSnapshot:
    """The executive after the macro step of record `seq` of the journal, which goes up to `last_seq`.

    `trace_count` records of the trace were written by then. `watched` gives for each state key the nodes
    whose conditions wait for it, `pending_events` what was announced and has not come, `resources` the level
    or capacity of each resource, `database` the state keys as the executive knew them.
    """

    run_id: str
    seq: int
    last_seq: int
    complete: bool
    t_s: float
    trace_count: int
    paused: bool
    over: bool
    outcome: str | None
    next_wakeup_s: float | None
    reward: float
    nodes: list[NodeState]
    commands: list[CommandState]
    contingencies: list[ContingencyState]
    watched: dict[str, list[str]]
    pending_events: list[dict[str, Any]]
    resources: dict[str, dict[str, float | str | bool | None]]
    database: dict[str, float | str | bool | None]


@dataclass(frozen=True, slots=True)
class Telemetry:
    """Samples of a run as columns of equal length; a value not known yet is null."""

    run_id: str
    complete: bool
    t_s: list[float]
    east_m: list[float | None]
    north_m: list[float | None]
    heading_rad: list[float | None]
    battery_j: list[float | None]
    energy_used_j: list[float | None]
    tracker_confidence: dict[str, list[float | None]]
    tracker_state: dict[str, list[str | None]]
    task: list[str | None]


@dataclass(frozen=True, slots=True)
class Product:
    """A data product with the way back to what asked for it; an orphan matches no request."""

    id: str
    mission_id: str
    run_id: str
    plan_id: str | None
    task_id: str
    request_id: str | None
    target_id: str | None
    kind: str
    instrument: str
    media: str
    file_name: str
    size_bytes: int
    sha256: str
    t_s: float
    label: dict[str, Any]
    orphan: bool
    file_url: str
    created_utc: datetime


@dataclass(frozen=True, slots=True)
class LineageNode:
    """A node of the provenance graph."""

    kind: str
    id: str
    title: str
    url: str


@dataclass(frozen=True, slots=True)
class LineageEdge:
    """`source` came about by `relation` of `target` (used, generated, derived)."""

    source: str
    relation: str
    target: str


@dataclass(frozen=True, slots=True)
class Lineage:
    nodes: list[LineageNode]
    edges: list[LineageEdge]


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


@dataclass(frozen=True, slots=True)
class Event:
    """One change of a mission; `before` and `after` are the whole resource, null where there was none."""

    seq: int
    at_utc: datetime
    actor: str
    action: str
    kind: str
    subject_id: str
    reason: str
    undoes: int | None
    before: dict[str, Any] | None
    after: dict[str, Any] | None
    sha256: str


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
class FlightRuleResult:
    """One flight rule held against a plan; `waived_by` where somebody with the right accepted the
    violation."""

    rule: str
    title: str
    holds: bool
    value: float | None
    limit: float | None
    unit: str
    detail: str
    waived_by: str | None


@dataclass(frozen=True, slots=True)
class Approval:
    """A second person's word for exactly these digests; void when the plan is no longer what it was."""

    id: str
    mission_id: str
    plan_id: str
    approver: str
    note: str
    crl_sha256: str
    terrain_sha256: str
    dictionary_sha256: str
    models_sha256: str
    void: bool
    created_utc: datetime


@dataclass(frozen=True, slots=True)
class Person:
    """Somebody with a role; `mission_roles` overrides it for one mission."""

    id: str
    name: str
    role: Role
    mission_roles: dict[str, str]
    active: bool
    revision: int


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


@dataclass(frozen=True, slots=True)
class Upload:
    """A file received and not yet used."""

    id: str
    file_name: str
    size_bytes: int
    sha256: str
    author: str
    created_utc: datetime


@dataclass(frozen=True, slots=True)
class Stamp:
    """Revision of a resource as it stands in an ETag."""

    kind: str
    id: str
    revision: int


@dataclass(frozen=True, slots=True)
class Relaxation:
    """The smallest change tried that lets a request in: of what, by which factor, and the value then."""

    what: str
    factor: float
    value: float


@dataclass(frozen=True, slots=True)
class WhyNot:
    """Why a request is not in a plan.

    `change` is the value of the best plan found that must attempt it, less that of the best without that
    demand, with its standard error over the same futures; `displaced` are the requests it would cost.
    """

    request_id: str
    reason: str
    limit: str
    change: float
    standard_error: float
    displaced: list[str]
    relaxation: Relaxation | None


@dataclass(frozen=True, slots=True)
class WhatIfAnswer:
    """What changes of the day are worth to a plan, on the same futures for all three values.

    `value_present` is the plan today, `value_kept` the same plan in the changed day (without what was taken
    away), `value_found` the best plan found at once for it: a full planning can only be better. `change` is
    found less present, `replanning` found less kept. `gained` and `lost` are requests against the present
    plan, `reach` the chance of each request to be begun. `per_hour` and `per_100_kj` are what more of a
    budget would win for that plan; `why` says it in sentences.
    """

    plan_id: str
    value_present: float
    value_kept: float
    value_found: float
    change: float
    change_error: float
    replanning: float
    replanning_error: float
    overrun: float
    branches: int
    feasible: bool
    gained: list[str]
    lost: list[str]
    reach: dict[str, float]
    per_hour: float
    per_100_kj: float
    why: list[str]
    changes: str
    time_budget_s: float
    energy_budget_j: float
    elapsed_s: float


@dataclass(frozen=True, slots=True)
class Histogram:
    """Shares of the futures in bins; bin k reaches from `edges[k]` to `edges[k + 1]`, the last inclusive."""

    edges: list[float]
    share: list[float]


@dataclass(frozen=True, slots=True)
class PairHistogram:
    """Two histograms over the same bins."""

    edges: list[float]
    share_a: list[float]
    share_b: list[float]


@dataclass(frozen=True, slots=True)
class PlanComparison:
    """Two plans on the same futures; the worst 5 % are means over the worst twentieth of each.

    `histogram` is of the utility of both, `difference_histogram` of A less B future by future. `begun_a` and
    `begun_b` are the shares of the futures in which each request was begun.
    """

    plan_a: str
    plan_b: str
    value_a: float
    value_b: float
    difference: float
    standard_error: float
    a_beats_b: float
    b_beats_a: float
    worst_a: float
    worst_b: float
    overrun_a: float
    overrun_b: float
    only_in_a: list[str]
    only_in_b: list[str]
    futures: int
    histogram: PairHistogram
    difference_histogram: Histogram
    begun_a: dict[str, float]
    begun_b: dict[str, float]
