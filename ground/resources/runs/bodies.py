"""What the API takes for runs."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, StringConstraints

from ground.records.forms import ONE_LINE, Body, Flag, Id, Name, Seconds, Seed, Text, unset
from ground.resources.runs.value import Fault


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
    task: Annotated[str, StringConstraints(min_length=1, max_length=200, pattern=ONE_LINE)] | None = None
    target_id: Id | None = None
    amount: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=1e9)] | None = None

    def value(self) -> Fault:
        return Fault(self.kind, self.at_s, self.task, self.target_id, self.amount)


class SentBody(Body):
    """A command that the ground wants to send so many seconds after the plan's start."""

    operation: Literal["abort", "pause", "resume"]
    sent_s: Seconds


class RunCreate(Body):
    """Run a plan's CRL on a simulated rover. With `pace` > 0 so many seconds of the plan pass in one
    real second. With `light_time_s`, one way, it is a rehearsal in the passes of the plan's sol: `commands`
    come late, and the report of the run says when the ground knows what.

    With `live` it runs on the real clock, on a rover in a process of its own, at `pace` seconds of the plan
    in a second (0 is 1): it can be held, stepped, aborted, stopped and given faults while it goes on.
    """

    plan_id: Id
    rover: Name = "abstract"
    seed: Seed = 1
    faults: Annotated[list[FaultBody], Field(max_length=50)] = []
    pace: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=1e6)] = 0.0
    notes: Text = ""
    light_time_s: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=36_000.0)] | None = None
    commands: Annotated[list[SentBody], Field(max_length=50)] = []
    live: Flag = False


class RunControlBody(Body):
    """Hold or let go a run that goes on, change its pace, let one record of the executive pass, or abort.

    `stop` is for live runs: rover and plan are stopped at once, before everything that waits.
    """

    paused: Flag | None = None
    pace: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=1e6)] | None = None
    step: Flag = False
    abort: Flag = False
    stop: Flag = False


class RunChange(Body):
    notes: Text = Field(default_factory=unset)


Topic = Annotated[str, StringConstraints(max_length=200, pattern=ONE_LINE)]
Metres = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-1e7, le=1e7)]


class RecordingMapping(Body):
    """Which topics of a recording mean what, and where its frame lies in the site; empty goes by type."""

    pose: Topic = ""
    battery: Topic = ""
    pictures: Annotated[list[Topic], Field(max_length=100)] = []
    clock: Literal["header", "log"] = "header"
    parent: Topic = ""
    child: Topic = ""
    east_m: Metres = 0.0
    north_m: Metres = 0.0
    heading_rad: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-10.0, le=10.0)] = 0.0
    capacity_j: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=1e12)] = 0.0


class RunImport(Body):
    """A recording (a .db3 or .mcap file) uploaded before, and the plan that was driven."""

    upload_id: Id
    plan_id: Id
    mapping: RecordingMapping = RecordingMapping()


class RunIngest(Body):
    """A zip of a `run/1` folder, uploaded before."""

    upload_id: Id
