"""What the API takes for drafts and sentences."""

from __future__ import annotations

from typing import Annotated

from pydantic import ConfigDict, Field, model_validator

from ground.records.forms import PRINTABLE, Body, Flag, Id, Seconds, Text, Utility, Window
from ground.resources.keep_outs.bodies import KeepOutCreate
from ground.resources.observation_requests.bodies import InstrumentName, ObservationRequestCreate
from ground.resources.plans.bodies import PlanCreate
from ground.resources.targets.bodies import TargetCreate


class RequestDraft(Body):
    """An observation request on a target that is there, or on one that is made with it."""

    target_id: Id | None = None
    target: TargetCreate | None = None
    instrument: InstrumentName
    value: Utility
    window_s: Window | None = None
    must_do: Flag = False
    dwell_s: Seconds | None = None
    notes: Text = ""
    rationale: Text = ""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{"target_id": "tgt-1", "instrument": "science_camera", "value": 10.0}]
        }
    )

    @model_validator(mode="after")
    def _one_target(self) -> RequestDraft:
        if (self.target_id is None) == (self.target is None):
            raise ValueError("a request has either target_id or target")
        return self

    def request(self) -> ObservationRequestCreate:
        """Return the form of the request."""
        members = {name: getattr(self, name) for name in self.model_fields_set}
        return ObservationRequestCreate(**{name: m for name, m in members.items() if m is not None})


class WindowDraft(Body):
    """When the observation of a request may start."""

    request_id: Id
    window_s: Window


class DraftCreate(Body):
    """A proposal: exactly one of the forms."""

    target: TargetCreate | None = None
    request: RequestDraft | None = None
    window: WindowDraft | None = None
    keep_out: KeepOutCreate | None = None
    plan: PlanCreate | None = None
    note: Annotated[str, Field(max_length=2000, pattern=PRINTABLE, description="why, in a few words")] = ""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{"target": {"name": "Rock1", "east_m": 4.2, "north_m": -1.5}, "note": "layered"}]
        }
    )

    @model_validator(mode="after")
    def _one_form(self) -> DraftCreate:
        if len(self.forms()) != 1:
            raise ValueError(f"a draft has exactly one of {', '.join(KINDS)}")
        return self

    def forms(self) -> dict[str, Body]:
        """Return the form that is given, under its kind."""
        return {kind: form for kind in KINDS if (form := getattr(self, kind)) is not None}


KINDS = ("target", "request", "window", "keep_out", "plan")
"""What can be drafted; nothing that approves, signs, packages or sends is among them."""


class DraftReject(Body):
    reason: Annotated[str, Field(max_length=2000, pattern=PRINTABLE)] = ""


class Sentence(Body):
    """A plain sentence, such as those of the how-to page."""

    text: Annotated[str, Field(max_length=2000, pattern=PRINTABLE)]

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{"text": "image the layered rock near 12, 30 in the morning with the mast camera"}]
        }
    )
