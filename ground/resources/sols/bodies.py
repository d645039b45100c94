"""What the API takes for sols."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from ground.records.forms import Body, Joules, Moment, Name, PoseBody, Seconds, Text, Utility


class PassBody(Body):
    name: Name
    start_s: Seconds
    end_s: Seconds
    data_mbit: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=1e9)] = 0.0


_LMST = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, lt=24.0)]


_Number = Annotated[int, Field(strict=True, ge=0, le=100_000)]


class SolCreate(Body):
    """A new sol; what is left out has the default of the K9 rover."""

    # six hours on its battery, of which a reserve stays

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


class SolChange(SolCreate, partial=True, never_null={"number", "start_pose"}):
    pass
