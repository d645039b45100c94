"""What the API takes for plans."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, model_validator

from ground.records.forms import (
    PRINTABLE,
    Body,
    Chance,
    Corner,
    Id,
    Joules,
    LongName,
    Seconds,
    Seed,
    Text,
    Utility,
    unset,
)
from planner.changes import Changes, changes_of


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
    name: LongName = Field(default_factory=unset)
    notes: Text = Field(default_factory=unset)


CrlText = Annotated[str, StringConstraints(max_length=1_000_000, pattern=PRINTABLE)]


class CrlCheck(Body):
    """A text in CRL, whatever it says."""

    crl: CrlText


class PlanEdit(Body):
    """The whole text of an edited plan in CRL."""

    crl: CrlText
    name: LongName | None = None
    notes: Text = ""


class PlanSide(Body):
    """A plan of the mission, or the text of one in CRL: exactly one of the two."""

    model_config = ConfigDict(
        json_schema_extra={
            "oneOf": [{"required": ["plan_id"]}, {"required": ["crl"]}],
            "examples": [{"plan_id": "pln-1qep8e5zsqmg5"}],
        }
    )
    plan_id: Id | None = None
    crl: CrlText | None = None

    @model_validator(mode="after")
    def _one(self) -> PlanSide:
        if (self.plan_id is None) == (self.crl is None):
            raise ValueError("give plan_id or crl, and not both")
        return self


class PlanBase(Body):
    """The plan of the mission that both edits began with."""

    plan_id: Id


class PlanChoice(Body):
    """Whose side stands in a conflict, which its kind, id and field name as the answer told them."""

    kind: Annotated[str, Field(max_length=40)]
    id: Annotated[str, StringConstraints(max_length=200, pattern=PRINTABLE)]
    field: Annotated[str, StringConstraints(max_length=80, pattern=PRINTABLE)] = ""
    take: Literal["ours", "theirs"]


class PlanMergeCreate(Body):
    """Join two edits of a plan. `take` decides all conflicts in which a side can be taken, `choices` single
    ones. With `preview` nothing is made.
    """

    base: PlanBase
    ours: PlanSide
    theirs: PlanSide
    take: Literal["ours", "theirs"] | None = None
    choices: Annotated[list[PlanChoice], Field(max_length=2000)] = []
    name: LongName | None = None
    notes: Text = ""
    preview: bool = False


class TreeDocument(BaseModel):
    """A plan tree, `plan-tree/1` or `plan-tree/2`."""

    model_config = ConfigDict(extra="allow")
    format: str


class GeometryDocument(BaseModel):
    """Nodes and segments of a path network."""

    model_config = ConfigDict(extra="allow")


class DraftDocument(BaseModel):
    """The best plan so far: its tree, the network it drives on, its value and the bound if known.

    `number` counts the plans drawn so far; this one was found at `found_utc`.
    """

    model_config = ConfigDict(extra="allow")
    format: str
    number: int
    found_utc: datetime
    value: float
    upper: float | None
    branches: int
    tree: TreeDocument
    network: GeometryDocument


class SummaryDocument(BaseModel):
    """The planner's summary."""

    model_config = ConfigDict(extra="allow")
    format: str = ""
