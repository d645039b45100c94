"""What the API takes: strict models, every number bounded, every text limited. What it gives:
`gdr.values`."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any, Generic, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, StringConstraints

from ground.gdr import values as v
from planner.changes import Changes, changes_of

T = TypeVar("T")


class Page(BaseModel, Generic[T]):
    """One page of a list; give `next_cursor` as `cursor` for the one behind it."""

    items: list[T]
    next_cursor: str | None


class Body(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


def _unset() -> Any:
    """Stand in for a member that was not sent; null is not allowed there."""
    return None


_PRINTABLE = r"^[^\x00-\x08\x0b\x0c\x0e-\x1f\x7f]*$"
_ONE_LINE = r"^[^\x00-\x1f\x7f]*$"


def _not_blank(text: str) -> str:
    if not text.strip():
        raise ValueError("a name needs a visible character")
    return text


Name = Annotated[
    str, StringConstraints(min_length=1, max_length=80, pattern=_ONE_LINE), AfterValidator(_not_blank)
]
LongName = Annotated[
    str, StringConstraints(min_length=1, max_length=200, pattern=_ONE_LINE), AfterValidator(_not_blank)
]
Line = Annotated[str, StringConstraints(max_length=200, pattern=_ONE_LINE)]
Text = Annotated[str, StringConstraints(max_length=20_000, pattern=_PRINTABLE)]
Id = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9_-]{1,40}$")]
Flag = Annotated[bool, Field(strict=True)]
Metres = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-100_000.0, le=100_000.0)]
Radians = Annotated[
    float, Field(strict=True, allow_inf_nan=False, ge=-6.2831853071795869, le=6.2831853071795869)
]
Seconds = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=1e7)]
Joules = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=1e12)]
Utility = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=1e6)]
Chance = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0.0, lt=1.0)]
Corner = Annotated[list[Metres], Field(min_length=2, max_length=2)]
Window = Annotated[
    list[Seconds], Field(min_length=2, max_length=2, description="[earliest start, latest start]")
]
Seed = Annotated[int, Field(strict=True, ge=0, le=2**53 - 1)]
Moment = Annotated[datetime, Field(description="UTC, RFC 3339")]


class PoseBody(Body):
    """A place to stand in the site frame; heading counter-clockwise from east."""

    east_m: Metres
    north_m: Metres
    heading_rad: Radians = 0.0

    def value(self) -> v.Pose:
        return v.Pose(self.east_m, self.north_m, self.heading_rad)


class DemoTerrain(Body):
    """The demo site, generated from the seed the demo uses."""

    source: Literal["demo"]


class GeneratedTerrain(Body):
    """A terrain made from a seed."""

    source: Literal["generated"]
    seed: Seed = 0
    size_m: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=48.0, le=256.0)] = 128.0
    rock_cover: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=0.3)] = 0.05


class UploadedTerrain(Body):
    """A terrain from uploads: a zip of a terrain folder, a GeoTIFF (with an ortho image of its own), a
    mesh."""

    source: Literal["uploaded"]
    upload_id: Id
    ortho_upload_id: Id | None = None


class MissionCreate(Body):
    """A new mission. With `demo_content`, the demo's targets and observation requests are filed as well."""

    name: LongName
    notes: Text = ""
    terrain: Annotated[DemoTerrain | GeneratedTerrain | UploadedTerrain, Field(discriminator="source")]
    rover_profile: Name = "k9"
    demo_content: Flag = False

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {"name": "Murray Buttes", "terrain": {"source": "generated", "seed": 7}},
                {"name": "Demo", "terrain": {"source": "demo"}, "demo_content": True},
            ]
        }
    )


class DriveRuleBody(Body):
    """A drive between two targets' stands, in both directions: forbidden, or by these corners."""

    from_target_id: Id | None = Field(description="null is the start pose")
    to_target_id: Id
    via_m: Annotated[list[Corner], Field(max_length=50)] | None = Field(
        default=None,
        description="corners from the first to the second, none for a straight line; null forbids the drive",
    )


class MissionChange(Body):
    name: LongName = Field(default_factory=_unset)
    notes: Text = Field(default_factory=_unset)
    rover_profile: Name = Field(default_factory=_unset)
    anchor_frame_id: Id | None = None
    calibration: dict[str, Any] | None = Field(
        default=None, description="a calibration/1 document; null for the numbers of the rover profile"
    )
    drive_rules: Annotated[list[DriveRuleBody], Field(max_length=500)] = Field(
        default_factory=_unset, description="all of them: what is not in the list is planned freely"
    )


class MissionCalibrate(Body):
    """Runs to learn from; all recorded ones of the mission when there are none."""

    run_ids: Annotated[list[Id], Field(max_length=10_000)] = Field(default_factory=list)
    name: Annotated[str, Field(max_length=200)] = ""


class MissionCopy(Body):
    """A copy of a mission with its sols, targets, requests, keep-outs (and plans if wanted)."""

    name: LongName
    notes: Text = ""


class PassBody(Body):
    name: Name
    start_s: Seconds
    end_s: Seconds
    data_mbit: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=1e9)] = 0.0


_LMST = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, lt=24.0)]
_Number = Annotated[int, Field(strict=True, ge=0, le=100_000)]


class SolCreate(Body):
    """A new sol; what is left out has the default of the K9 rover."""

    number: _Number | None = None
    notes: Text = ""
    start_pose: PoseBody | None = None
    start_utc: Moment | None = None
    start_lmst_h: _LMST = 9.0
    battery_j: Joules = 2_000_000.0
    energy_floor_j: Joules = 300_000.0
    time_budget_s: Seconds = 21_600.0
    energy_budget_j: Joules = 1_500_000.0
    overrun_penalty: Utility = 20.0
    passes: Annotated[list[PassBody], Field(max_length=50)] = []
    uplink_deadline_utc: Moment | None = None


class SolChange(Body):
    number: _Number = Field(default_factory=_unset)
    notes: Text = Field(default_factory=_unset)
    start_pose: PoseBody = Field(default_factory=_unset)
    start_utc: Moment | None = None
    start_lmst_h: _LMST = Field(default_factory=_unset)
    battery_j: Joules = Field(default_factory=_unset)
    energy_floor_j: Joules = Field(default_factory=_unset)
    time_budget_s: Seconds = Field(default_factory=_unset)
    energy_budget_j: Joules = Field(default_factory=_unset)
    overrun_penalty: Utility = Field(default_factory=_unset)
    passes: Annotated[list[PassBody], Field(max_length=50)] = Field(default_factory=_unset)
    uplink_deadline_utc: Moment | None = None


class TargetCreate(Body):
    """A point picked on the ground; height, normal and covariance come from the server's terrain."""

    name: Name | None = None
    east_m: Metres
    north_m: Metres
    notes: Text = ""
    source_image: Line = ""
    frame_id: Id | None = None

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"name": "Rock1", "east_m": 4.2, "north_m": -1.5}]}
    )


class TargetChange(Body):
    name: Name = Field(default_factory=_unset)
    east_m: Metres = Field(default_factory=_unset)
    north_m: Metres = Field(default_factory=_unset)
    notes: Text = Field(default_factory=_unset)
    source_image: Line = Field(default_factory=_unset)
    frame_id: Id | None = None


class ObservationRequestCreate(Body):
    """What is asked of a target. `observation_pose` sets the observation point by hand."""

    target_id: Id
    instrument: v.Instrument
    value: Utility
    tracked: Flag | None = None
    window_s: Window | None = None
    after: Annotated[list[Id], Field(max_length=100)] = []
    must_do: Flag = False
    dwell_s: Seconds | None = None
    notes: Text = ""
    observation_pose: PoseBody | None = None


class ObservationRequestChange(Body):
    """`observation_pose: null` gives the choice of the observation point back to the program."""

    instrument: v.Instrument = Field(default_factory=_unset)
    value: Utility = Field(default_factory=_unset)
    tracked: Flag = Field(default_factory=_unset)
    window_s: Window | None = None
    after: Annotated[list[Id], Field(max_length=100)] = Field(default_factory=_unset)
    must_do: Flag = Field(default_factory=_unset)
    dwell_s: Seconds | None = None
    notes: Text = Field(default_factory=_unset)
    observation_pose: PoseBody | None = None
    state: Literal["open", "carried"] = Field(default_factory=_unset)


class KeepOutCreate(Body):
    """A polygon the rover must not enter; the ring is closed by itself."""

    name: Name | None = None
    notes: Text = ""
    polygon_m: Annotated[list[Corner], Field(min_length=3, max_length=500)]
    frame_id: Id | None = None


class KeepOutChange(Body):
    name: Name = Field(default_factory=_unset)
    notes: Text = Field(default_factory=_unset)
    polygon_m: Annotated[list[Corner], Field(min_length=3, max_length=500)] = Field(default_factory=_unset)
    frame_id: Id | None = None


class CommentCreate(Body):
    subject_kind: Literal[
        "mission",
        "sol",
        "target",
        "observation_request",
        "keep_out",
        "path_network",
        "plan",
        "run",
        "product",
    ]
    subject_id: Id
    text: Annotated[Text, Field(min_length=1)]


class CommentChange(Body):
    text: Annotated[Text, Field(min_length=1)] = Field(default_factory=_unset)


class PathNetworkCreate(Body):
    """Compute the path network from the mission as it stands."""

    sol_id: Id | None = None


class WhatIf(Body):
    """Changes of a plan's day. Budgets are what may be used in all; a late start costs time and hotel energy.

    Each chance p to lose a track becomes 1 - (1 - p) ** `loss_factor`. `keep_outs` are polygons that stand in
    the place of the mission's keep-outs.
    """

    exclude: Annotated[list[Id], Field(max_length=500)] = []
    force: Annotated[list[Id], Field(max_length=20)] = []
    values: Annotated[dict[Id, Utility], Field(max_length=500)] = {}
    time_budget_s: Seconds | None = None
    energy_budget_j: Joules | None = None
    start_delay_s: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=88_775.0)] = 0.0
    loss_factor: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=10.0)] = 1.0
    keep_outs: (
        Annotated[list[Annotated[list[Corner], Field(min_length=3, max_length=500)]], Field(max_length=200)]
        | None
    ) = None

    def value(self) -> Changes:
        """Return the changes as the service takes them."""
        members = self.model_dump()
        return changes_of({name: value for name, value in members.items() if value is not None})


class PlanCreate(Body):
    """Ask for a plan. `request_ids` limits it to some requests; empty = all that are open. With `what_if` the
    plan is made for a day changed so: it answers another question than the mission's and is never approved.

    With `iterations` the answer does not depend on the machine: same seed, same plan. With
    `max_overrun_probability` the plan keeps the chance of ending over a budget within it.
    """

    name: LongName | None = None
    notes: Text = ""
    sol_id: Id | None = None
    parent_id: Id | None = None
    strategy: Literal["optimal", "pico2005"] = "optimal"
    max_branches: Annotated[int, Field(strict=True, ge=0, le=64)] = 8
    time_limit_s: Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0.0, le=3600.0)] = 20.0
    iterations: Annotated[int, Field(strict=True, ge=1, le=10_000_000)] | None = None
    max_overrun_probability: Chance | None = None
    seed: Seed = 1
    request_ids: Annotated[list[Id], Field(max_length=5000)] = []
    what_if: WhatIf | None = None


class PlanChange(Body):
    name: LongName = Field(default_factory=_unset)
    notes: Text = Field(default_factory=_unset)


class FaultBody(Body):
    """A fault put into a run: at a time, or when the command of a task arrives (one of the two)."""

    kind: Literal[
        "lose-target",
        "shadow",
        "slow-drive",
        "slip-burst",
        "stuck-wheel",
        "low-battery",
        "camera-failure",
        "silent",
        "novelty",
        "lens-dust",
    ]
    at_s: Seconds | None = None
    task: Annotated[str, StringConstraints(min_length=1, max_length=200, pattern=_ONE_LINE)] | None = None
    target_id: Id | None = None
    amount: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=1e9)] | None = None

    def value(self) -> v.Fault:
        return v.Fault(self.kind, self.at_s, self.task, self.target_id, self.amount)


class SentBody(Body):
    """A command that the ground wants to send so many seconds after the plan's start."""

    operation: Literal["abort", "pause", "resume"]
    sent_s: Seconds


class RunCreate(Body):
    """Run a plan's CRL on a simulated rover. With `pace` > 0 so many seconds of the plan pass in one
    real second. With `light_time_s`, one way, it is a rehearsal in the passes of the plan's sol: `commands`
    come late, and the report of the run says when the ground knows what."""

    plan_id: Id
    rover: Name = "abstract"
    seed: Seed = 1
    faults: Annotated[list[FaultBody], Field(max_length=50)] = []
    pace: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=1e6)] = 0.0
    notes: Text = ""
    light_time_s: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=36_000.0)] | None = None
    commands: Annotated[list[SentBody], Field(max_length=50)] = []


class RunControlBody(Body):
    """Hold or let go a run that goes on, change its pace, let one record of the executive pass, or abort."""

    paused: Flag | None = None
    pace: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=1e6)] | None = None
    step: Flag = False
    abort: Flag = False


class RunChange(Body):
    notes: Text = Field(default_factory=_unset)


class ApprovalCreate(Body):
    """The second person's word; `crl_sha256` says which text was read."""

    crl_sha256: Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{64}$")]
    note: Text = ""


class WaiverCreate(Body):
    rule: Name
    reason: Annotated[Text, Field(min_length=1)]


class RunIngest(Body):
    """A zip of a `run/1` folder, uploaded before."""

    upload_id: Id


class UndoBody(Body):
    """Take back the last act of the person (or of anybody, with `anyone`)."""

    anyone: Flag = False


class SessionCreate(Body):
    """Log in; with `OUTCROP_AUTH=profiles` the password stays empty."""

    name: Name
    password: Annotated[str, StringConstraints(max_length=1000)] = ""


class SessionValue(BaseModel):
    """Who one is; `csrf_token` goes into the header X-CSRF-Token of every change made with the cookie."""

    person: v.Person | None
    csrf_token: str
    auth: str


class PersonCreate(Body):
    name: Name
    role: v.Role = v.Role.VIEWER
    password: Annotated[str, StringConstraints(min_length=8, max_length=1000)] | None = None


class PersonChange(Body):
    role: v.Role = Field(default_factory=_unset)
    mission_roles: dict[Id, v.Role] = Field(default_factory=_unset)
    active: Flag = Field(default_factory=_unset)


class ApiKeyCreate(Body):
    name: Name
    days: Annotated[int, Field(strict=True, ge=1, le=3650)] = 90


class ApiKeyValue(BaseModel):
    """A new key; the secret is shown once."""

    id: str
    name: str
    secret: str
    expires_utc: datetime


class Health(BaseModel):
    status: str
    version: str
    checks: dict[str, str] = {}


class TreeDocument(BaseModel):
    """A plan tree, `plan-tree/1` or `plan-tree/2`."""

    model_config = ConfigDict(extra="allow")
    format: str


class SummaryDocument(BaseModel):
    """The planner's summary."""

    model_config = ConfigDict(extra="allow")
    format: str = ""


class GeometryImport(Body):
    """A GeoJSON or CSV file of targets and keep-outs, uploaded before."""

    upload_id: Id


class ArchiveImport(Body):
    upload_id: Id
    name: LongName | None = None


def set_members(body: BaseModel) -> dict[str, Any]:
    """Return the members a PATCH body names, values of our own kind unpacked."""
    out: dict[str, Any] = {}
    for name in body.model_fields_set:
        value = getattr(body, name)
        if isinstance(value, PoseBody):
            value = value.value()
        elif isinstance(value, list):
            value = [item.model_dump() if isinstance(item, BaseModel) else item for item in value]
        out[name] = value
    return out
