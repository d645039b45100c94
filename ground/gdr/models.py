"""Tables of the Ground Data Repository.

Every resource has a `revision` that grows by one with each change (the optimistic lock) and is written
together with an event in the same transaction. Composite values (poses, polygons, labels) are JSON.
"""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any, ClassVar

from sqlalchemy import (
    JSON,
    BigInteger,
    Boolean,
    DateTime,
    Float,
    ForeignKey,
    Index,
    Integer,
    LargeBinary,
    MetaData,
    String,
    Text,
    UniqueConstraint,
)
from sqlalchemy.engine import Dialect
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column
from sqlalchemy.types import TypeDecorator

CONVENTION = {
    "ix": "ix_%(column_0_label)s",
    "uq": "uq_%(table_name)s_%(column_0_N_name)s",
    "ck": "ck_%(table_name)s_%(constraint_name)s",
    "fk": "fk_%(table_name)s_%(column_0_name)s",
    "pk": "pk_%(table_name)s",
}


class Utc(TypeDecorator[datetime]):
    """An aware UTC time on every database."""

    impl = DateTime(timezone=True)
    cache_ok = True

    def process_bind_param(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        if value is None:
            return None
        value = value.astimezone(UTC)
        return value.replace(tzinfo=None) if dialect.name == "sqlite" else value

    def process_result_value(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        if value is None:
            return None
        return value.replace(tzinfo=UTC) if value.tzinfo is None else value.astimezone(UTC)


def utc_now() -> datetime:
    """Return the wall-clock time, aware, in UTC."""
    return datetime.now(UTC)


class Base(DeclarativeBase):
    metadata = MetaData(naming_convention=CONVENTION)
    type_annotation_map: ClassVar[dict[Any, Any]] = {
        dict[str, Any]: JSON(none_as_null=True),
        list[Any]: JSON(none_as_null=True),
        datetime: Utc(),
        str: String(),
        int: Integer(),
        float: Float(),
        bool: Boolean(),
    }


class Row(Base):
    """What all resources have."""

    __abstract__ = True

    id: Mapped[str] = mapped_column(String(40), primary_key=True)
    author: Mapped[str] = mapped_column(String(80))
    created_utc: Mapped[datetime] = mapped_column(default=utc_now)
    modified_utc: Mapped[datetime] = mapped_column(default=utc_now)
    revision: Mapped[int] = mapped_column(default=1)


def _mission() -> Mapped[str]:
    return mapped_column(ForeignKey("missions.id", ondelete="CASCADE"), index=True)


class TerrainRow(Row):
    __tablename__ = "terrains"

    name: Mapped[str] = mapped_column(String(200))
    credits: Mapped[str] = mapped_column(Text)
    sha256: Mapped[str] = mapped_column(String(64), index=True)
    description: Mapped[dict[str, Any]]
    """Layers, bounds and start pose as in `values.Terrain`."""


class MissionRow(Row):
    __tablename__ = "missions"

    name: Mapped[str] = mapped_column(String(200))
    notes: Mapped[str] = mapped_column(Text, default="")
    terrain_id: Mapped[str] = mapped_column(ForeignKey("terrains.id"))
    copied_from: Mapped[str | None] = mapped_column(String(40))
    rover_profile: Mapped[str] = mapped_column(String(80))
    anchor_frame_id: Mapped[str | None] = mapped_column(String(40))
    """The site whose frame, east-north-up, is the one of terrain, targets and keep-outs."""
    calibration: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))
    """`calibration/1` of the path network; the rover profile's numbers when there is none."""
    drive_rules: Mapped[list[Any] | None] = mapped_column(JSON(none_as_null=True))
    """Drives that people forbid or draw, as in `values.DriveRule`; null = none."""


class SolRow(Row):
    __tablename__ = "sols"
    __table_args__ = (UniqueConstraint("mission_id", "number"),)

    mission_id: Mapped[str] = _mission()
    number: Mapped[int]
    notes: Mapped[str] = mapped_column(Text, default="")
    start_pose: Mapped[dict[str, Any]]
    start_utc: Mapped[datetime | None]
    start_lmst_h: Mapped[float]
    battery_j: Mapped[float]
    energy_floor_j: Mapped[float]
    time_budget_s: Mapped[float]
    energy_budget_j: Mapped[float]
    overrun_penalty: Mapped[float]
    passes: Mapped[list[Any]]
    uplink_deadline_utc: Mapped[datetime | None]


class TargetRow(Row):
    __tablename__ = "targets"
    __table_args__ = (UniqueConstraint("mission_id", "name"),)

    mission_id: Mapped[str] = _mission()
    name: Mapped[str] = mapped_column(String(80))
    notes: Mapped[str] = mapped_column(Text, default="")
    east_m: Mapped[float]
    north_m: Mapped[float]
    up_m: Mapped[float]
    normal: Mapped[list[Any]]
    slope_rad: Mapped[float]
    covariance_m2: Mapped[list[Any]]
    source_image: Mapped[str] = mapped_column(String(200), default="")
    frame_id: Mapped[str | None] = mapped_column(String(40), index=True)
    in_frame: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))
    """What was seen from the frame, in its own axes; the columns above follow from it."""


class ObservationRequestRow(Row):
    __tablename__ = "observation_requests"

    mission_id: Mapped[str] = _mission()
    target_id: Mapped[str] = mapped_column(ForeignKey("targets.id", ondelete="CASCADE"), index=True)
    instrument: Mapped[str] = mapped_column(String(40))
    value: Mapped[float]
    tracked: Mapped[bool]
    window_s: Mapped[list[Any] | None] = mapped_column(JSON(none_as_null=True))
    after: Mapped[list[Any]]
    must_do: Mapped[bool] = mapped_column(default=False)
    dwell_s: Mapped[float | None]
    notes: Mapped[str] = mapped_column(Text, default="")
    observation_point: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))
    state: Mapped[str] = mapped_column(String(20), index=True)
    state_reason: Mapped[str] = mapped_column(Text, default="")


class KeepOutRow(Row):
    __tablename__ = "keep_outs"

    mission_id: Mapped[str] = _mission()
    name: Mapped[str] = mapped_column(String(80))
    notes: Mapped[str] = mapped_column(Text, default="")
    polygon_m: Mapped[list[Any]]
    frame_id: Mapped[str | None] = mapped_column(String(40), index=True)
    in_frame: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))
    sigma_m: Mapped[float] = mapped_column(default=0.0, server_default="0")
    """Of where the outline lies, the worst direction, by the solutions between its frame and the anchor."""


class FrameRow(Row):
    """A site, the end of a drive or a pose, by its motion counter, and the solution in use for it."""

    __tablename__ = "frames"
    __table_args__ = (UniqueConstraint("mission_id", "key"), Index("ix_frames_site", "mission_id", "site"))

    mission_id: Mapped[str] = _mission()
    key: Mapped[str] = mapped_column(String(120))
    """Name and motion counter, `ROVER_FRAME 137.26`."""
    name: Mapped[str] = mapped_column(String(80))
    counter: Mapped[list[Any]]
    level: Mapped[str] = mapped_column(String(10))
    site: Mapped[int]
    drive: Mapped[int | None]
    notes: Mapped[str] = mapped_column(Text, default="")
    solution_id: Mapped[str | None] = mapped_column(String(40))
    chosen_utc: Mapped[datetime | None]
    """When a person chose the solution; null while the rule of the files did."""


class FrameFileRow(Row):
    """A mission's frame file (.svf, .rvf) that was taken in: all of it that is no solution."""

    __tablename__ = "frame_files"

    mission_id: Mapped[str] = _mission()
    file_name: Mapped[str] = mapped_column(String(300))
    sha256: Mapped[str] = mapped_column(String(64))
    rover: Mapped[str] = mapped_column(String(80))
    variant: Mapped[str] = mapped_column(String(80))
    counter: Mapped[list[Any]]
    priority: Mapped[list[Any]]
    aliases: Mapped[list[Any]]
    """`old`, `new` and `position` of each."""
    added: Mapped[int]
    known: Mapped[int]
    """Solutions that came with it, and that were here before."""


class SolutionRow(Row):
    """One answer to where a frame lies; never changed and never deleted."""

    __tablename__ = "solutions"
    __table_args__ = (Index("ix_solutions_position", "mission_id", "position"),)

    mission_id: Mapped[str] = _mission()
    frame_id: Mapped[str] = mapped_column(ForeignKey("frames.id", ondelete="CASCADE"), index=True)
    reference_id: Mapped[str] = mapped_column(ForeignKey("frames.id", ondelete="CASCADE"), index=True)
    file_id: Mapped[str | None] = mapped_column(String(40))
    label: Mapped[str] = mapped_column(String(80))
    offset_m: Mapped[list[Any]]
    quaternion: Mapped[list[Any]]
    covariance: Mapped[list[Any] | None] = mapped_column(JSON(none_as_null=True))
    """[6, 6] of a small motion (turn in rad, shift in m) in the frame's axes."""
    added_utc: Mapped[datetime]
    position: Mapped[int] = mapped_column(BigInteger)
    """Place in the order of arrival, that of the files."""
    source: Mapped[dict[str, Any]]
    notes: Mapped[str] = mapped_column(Text, default="")


class SiteMapRow(Row):
    """A map made at a frame (GeoTIFF in the frame's east and north), and where its outline lies now."""

    __tablename__ = "site_maps"

    mission_id: Mapped[str] = _mission()
    name: Mapped[str] = mapped_column(String(80))
    notes: Mapped[str] = mapped_column(Text, default="")
    frame_id: Mapped[str] = mapped_column(ForeignKey("frames.id"), index=True)
    in_frame: Mapped[dict[str, Any]]
    outline_m: Mapped[list[Any]]
    sigma_m: Mapped[float]
    file_name: Mapped[str] = mapped_column(String(300))
    media: Mapped[str] = mapped_column(String(100))
    size_bytes: Mapped[int] = mapped_column(BigInteger)
    sha256: Mapped[str] = mapped_column(String(64))


class TraverseRow(Row):
    """Stops of recorded runs that were adjusted together: a job's result."""

    __tablename__ = "traverses"

    mission_id: Mapped[str] = _mission()
    name: Mapped[str] = mapped_column(String(200))
    notes: Mapped[str] = mapped_column(Text, default="")
    job_id: Mapped[str] = mapped_column(String(40))
    stops: Mapped[list[Any]]
    """Frame and source of each, in the order driven."""
    document: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))
    """`localization/1`, with the pictures; null while it is computed."""
    solution_ids: Mapped[list[Any]]


class PathNetworkRow(Row):
    __tablename__ = "path_networks"

    mission_id: Mapped[str] = _mission()
    job_id: Mapped[str] = mapped_column(String(40))
    inputs_sha256: Mapped[str] = mapped_column(String(64))
    geometry: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))
    """Nodes, segments and what cannot be reached, as in `values.PathNetwork`; null while it is computed."""


class ProblemRow(Row):
    __tablename__ = "problems"

    mission_id: Mapped[str] = _mission()
    sha256: Mapped[str] = mapped_column(String(64))
    document: Mapped[dict[str, Any]]


class PlanRow(Row):
    __tablename__ = "plans"
    __table_args__ = (UniqueConstraint("mission_id", "number"),)

    mission_id: Mapped[str] = _mission()
    sol_id: Mapped[str] = mapped_column(ForeignKey("sols.id"))
    parent_id: Mapped[str | None] = mapped_column(String(40))
    number: Mapped[int]
    name: Mapped[str] = mapped_column(String(200))
    notes: Mapped[str] = mapped_column(Text, default="")
    state: Mapped[str] = mapped_column(String(20), index=True)
    status: Mapped[str] = mapped_column(String(40), default="")
    strategy: Mapped[str] = mapped_column(String(40))
    max_branches: Mapped[int]
    time_limit_s: Mapped[float]
    iterations: Mapped[int | None]
    seed: Mapped[int] = mapped_column(BigInteger)
    job_id: Mapped[str] = mapped_column(String(40))
    problem_id: Mapped[str | None] = mapped_column(String(40))
    network_id: Mapped[str | None] = mapped_column(String(40))
    expected_utility: Mapped[float | None]
    standard_error: Mapped[float | None]
    lower: Mapped[float | None]
    upper: Mapped[float | None]
    branches: Mapped[int | None]
    crl_text: Mapped[str | None] = mapped_column(Text)
    crl_sha256: Mapped[str | None] = mapped_column(String(64))
    problem_sha256: Mapped[str | None] = mapped_column(String(64))
    inputs_sha256: Mapped[str] = mapped_column(String(64))
    terrain_sha256: Mapped[str] = mapped_column(String(64))
    dictionary: Mapped[str] = mapped_column(String(80))
    rover_profile: Mapped[str] = mapped_column(String(80))
    tree: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))
    summary: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))
    findings: Mapped[list[Any]]
    request_ids: Mapped[list[Any]]
    """Requests asked for; empty = all open ones."""
    planned_request_ids: Mapped[list[Any]]
    left_out: Mapped[dict[str, Any]]
    approved_by: Mapped[str | None] = mapped_column(String(80))


class RunRow(Row):
    __tablename__ = "runs"

    mission_id: Mapped[str] = _mission()
    plan_id: Mapped[str] = mapped_column(ForeignKey("plans.id"), index=True)
    kind: Mapped[str] = mapped_column(String(20))
    rover: Mapped[str] = mapped_column(String(80))
    seed: Mapped[int] = mapped_column(BigInteger)
    faults: Mapped[list[Any]]
    job_id: Mapped[str | None] = mapped_column(String(40))
    state: Mapped[str] = mapped_column(String(20))
    outcome: Mapped[str] = mapped_column(String(40), default="")
    utility: Mapped[float | None]
    duration_s: Mapped[float | None]
    energy_used_j: Mapped[float | None]
    options_taken: Mapped[list[Any]]
    achieved_request_ids: Mapped[list[Any]]
    crl_sha256: Mapped[str] = mapped_column(String(64))
    package_sha256: Mapped[str | None] = mapped_column(String(64), unique=True)
    trace_sha256: Mapped[str | None] = mapped_column(String(64))
    telemetry_sha256: Mapped[str | None] = mapped_column(String(64))
    notes: Mapped[str] = mapped_column(Text, default="")


class ProductRow(Row):
    __tablename__ = "products"
    __table_args__ = (UniqueConstraint("run_id", "file_name"),)

    mission_id: Mapped[str] = _mission()
    run_id: Mapped[str] = mapped_column(ForeignKey("runs.id", ondelete="CASCADE"), index=True)
    plan_id: Mapped[str | None] = mapped_column(String(40))
    task_id: Mapped[str] = mapped_column(String(200))
    request_id: Mapped[str | None] = mapped_column(String(40), index=True)
    target_id: Mapped[str | None] = mapped_column(String(40), index=True)
    kind: Mapped[str] = mapped_column(String(80))
    instrument: Mapped[str] = mapped_column(String(80), default="")
    media: Mapped[str] = mapped_column(String(100))
    file_name: Mapped[str] = mapped_column(String(300))
    size_bytes: Mapped[int] = mapped_column(BigInteger)
    sha256: Mapped[str] = mapped_column(String(64), index=True)
    t_s: Mapped[float]
    label: Mapped[dict[str, Any]]


class CommentRow(Row):
    __tablename__ = "comments"
    __table_args__ = (Index("ix_comments_subject", "mission_id", "subject_kind", "subject_id"),)

    mission_id: Mapped[str] = _mission()
    subject_kind: Mapped[str] = mapped_column(String(40))
    subject_id: Mapped[str] = mapped_column(String(40))
    text: Mapped[str] = mapped_column(Text)


class ApprovalRow(Row):
    __tablename__ = "approvals"

    mission_id: Mapped[str] = _mission()
    plan_id: Mapped[str] = mapped_column(ForeignKey("plans.id", ondelete="CASCADE"), index=True)
    note: Mapped[str] = mapped_column(Text, default="")
    crl_sha256: Mapped[str] = mapped_column(String(64))
    terrain_sha256: Mapped[str] = mapped_column(String(64))
    dictionary_sha256: Mapped[str] = mapped_column(String(64))
    models_sha256: Mapped[str] = mapped_column(String(64))


class WaiverRow(Row):
    """A flight rule that does not hold for one plan, accepted by somebody with the right to."""

    __tablename__ = "waivers"
    __table_args__ = (UniqueConstraint("plan_id", "rule"),)

    mission_id: Mapped[str] = _mission()
    plan_id: Mapped[str] = mapped_column(ForeignKey("plans.id", ondelete="CASCADE"), index=True)
    rule: Mapped[str] = mapped_column(String(80))
    reason: Mapped[str] = mapped_column(Text)


class PackageRow(Row):
    """An uplink package that was made; sequence numbers ascend without a gap in each mission."""

    __tablename__ = "packages"
    __table_args__ = (UniqueConstraint("mission_id", "sequence"),)

    mission_id: Mapped[str] = _mission()
    plan_id: Mapped[str] = mapped_column(ForeignKey("plans.id", ondelete="CASCADE"), index=True)
    sequence: Mapped[int]
    sha256: Mapped[str] = mapped_column(String(64))
    key_id: Mapped[str] = mapped_column(String(64))


class UploadRow(Row):
    __tablename__ = "uploads"

    file_name: Mapped[str] = mapped_column(String(300))
    size_bytes: Mapped[int] = mapped_column(BigInteger)
    sha256: Mapped[str] = mapped_column(String(64))


class JobRow(Row):
    """Long work: who leases it, how far it is, what came of it. `token` fences a worker that lost its
    lease."""

    __tablename__ = "jobs"
    __table_args__ = (Index("ix_jobs_claim", "state", "lease_until_utc"),)

    mission_id: Mapped[str | None] = mapped_column(ForeignKey("missions.id", ondelete="CASCADE"), index=True)
    kind: Mapped[str] = mapped_column(String(60))
    payload: Mapped[dict[str, Any]]
    subject_kind: Mapped[str] = mapped_column(String(40))
    subject_id: Mapped[str] = mapped_column(String(40))
    state: Mapped[str] = mapped_column(String(20))
    progress: Mapped[float] = mapped_column(default=0.0)
    message: Mapped[str] = mapped_column(Text, default="")
    attempt: Mapped[int] = mapped_column(default=0)
    max_attempts: Mapped[int]
    time_limit_s: Mapped[float]
    token: Mapped[int] = mapped_column(default=0)
    lease_until_utc: Mapped[datetime | None]
    worker: Mapped[str] = mapped_column(String(120), default="")
    cancel_requested: Mapped[bool] = mapped_column(default=False)
    result_url: Mapped[str | None] = mapped_column(String(300))
    problem: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))
    log: Mapped[list[Any]]
    started_utc: Mapped[datetime | None]
    finished_utc: Mapped[datetime | None]


class ChainRow(Base):
    """Head of one hash chain of events: that of a mission, or `system`."""

    __tablename__ = "event_chains"

    id: Mapped[str] = mapped_column(String(40), primary_key=True)
    seq: Mapped[int] = mapped_column(BigInteger)
    sha256: Mapped[str] = mapped_column(String(64))


class EventRow(Base):
    """One change, never altered: `sha256` covers its content and the hash of the one before."""

    __tablename__ = "events"

    chain_id: Mapped[str] = mapped_column(String(40), primary_key=True)
    seq: Mapped[int] = mapped_column(BigInteger, primary_key=True)
    at_utc: Mapped[datetime]
    actor: Mapped[str] = mapped_column(String(80))
    action: Mapped[str] = mapped_column(String(40))
    kind: Mapped[str] = mapped_column(String(40))
    subject_id: Mapped[str] = mapped_column(String(40))
    reason: Mapped[str] = mapped_column(Text, default="")
    undoes: Mapped[int | None] = mapped_column(BigInteger)
    group: Mapped[str] = mapped_column("group_id", String(40))
    """Changes made by one act; undo takes them back together."""
    before: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))
    after: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))
    sha256: Mapped[str] = mapped_column(String(64))


class PersonRow(Row):
    __tablename__ = "people"

    name: Mapped[str] = mapped_column(String(80), unique=True)
    role: Mapped[str] = mapped_column(String(20))
    mission_roles: Mapped[dict[str, Any]]
    active: Mapped[bool] = mapped_column(default=True)
    password_hash: Mapped[str | None] = mapped_column(Text)


class CredentialRow(Base):
    """A session or an API key; only the hash of its secret is kept."""

    __tablename__ = "credentials"

    id: Mapped[str] = mapped_column(String(40), primary_key=True)
    kind: Mapped[str] = mapped_column(String(20))
    person_id: Mapped[str] = mapped_column(ForeignKey("people.id", ondelete="CASCADE"), index=True)
    name: Mapped[str] = mapped_column(String(80), default="")
    secret_sha256: Mapped[str] = mapped_column(String(64), unique=True)
    created_utc: Mapped[datetime] = mapped_column(default=utc_now)
    expires_utc: Mapped[datetime]


class LoginFailureRow(Base):
    """A login that failed; too many of them close the door for a while."""

    __tablename__ = "login_failures"

    id: Mapped[str] = mapped_column(String(40), primary_key=True)
    name: Mapped[str] = mapped_column(String(80), index=True)
    at_utc: Mapped[datetime] = mapped_column(default=utc_now)


class IdempotencyRow(Base):
    """The answer given to a POST that carried an Idempotency-Key."""

    __tablename__ = "idempotency_keys"

    actor: Mapped[str] = mapped_column(String(80), primary_key=True)
    key: Mapped[str] = mapped_column(String(255), primary_key=True)
    request_sha256: Mapped[str] = mapped_column(String(64))
    status: Mapped[int]
    headers: Mapped[dict[str, Any]]
    body: Mapped[bytes] = mapped_column(LargeBinary)
    created_utc: Mapped[datetime] = mapped_column(default=utc_now)
