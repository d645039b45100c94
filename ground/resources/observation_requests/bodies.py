"""What the API takes for observation requests."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import ConfigDict, Field, model_validator

from ground.records.forms import (
    Body,
    Flag,
    Id,
    PoseBody,
    Seconds,
    Text,
    Utility,
    Window,
    member_fault,
    unset,
)
from ground.resources.targets.bodies import TargetCreate

InstrumentName = Annotated[
    str,
    Field(
        min_length=1,
        max_length=40,
        description="an instrument of the mission's rover, as `GET /rovers/{name}` lists them",
        examples=["microscopic_imager", "science_camera"],
    ),
]


ConstraintDocument = Annotated[
    dict[str, Any],
    Field(
        description="a constraint with its `kind`; `GET /rovers/{name}` lists the kinds and their members",
        examples=[{"kind": "sun_elevation", "at_least_rad": 0.349}],
    ),
]


class ObservationRequestCreate(Body):
    """What is asked of a target that is there, or of one that is made with the request.

    `observation_pose` sets the observation point by hand.
    """

    target_id: Id = Field(default_factory=unset)
    target: TargetCreate = Field(default_factory=unset)
    instrument: InstrumentName
    value: Utility
    tracked: Flag | None = None
    window_s: Window | None = None
    after: Annotated[list[Id], Field(max_length=100)] = []
    must_do: Flag = False
    dwell_s: Seconds | None = None
    constraints: Annotated[list[ConstraintDocument], Field(max_length=20)] = []
    notes: Text = ""
    rationale: Annotated[
        Text, Field(description="why it is worth the rover's time; reports of plans show it")
    ] = ""
    observation_pose: PoseBody | None = None

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{"target_id": "tgt-1", "instrument": "science_camera", "value": 10.0}],
            "oneOf": [{"required": ["target_id"]}, {"required": ["target"]}],
        }
    )

    @model_validator(mode="after")
    def _is_on_one_target(self) -> Self:
        given = {"target_id", "target"} & self.model_fields_set
        if len(given) == 2:
            raise member_fault("target", "target_id and target both say what it is on; give one of them")
        if not given:
            raise member_fault("target_id", "target_id is missing; give it, or target for a new one")
        return self


class ObservationRequestChange(
    ObservationRequestCreate, partial=True, without={"target_id", "target"}, never_null={"tracked"}
):
    """`observation_pose: null` gives the choice of the observation point back to the program."""

    state: Literal["open", "carried"] = Field(default_factory=unset)

    model_config = ConfigDict(json_schema_extra={"examples": [{"value": 12.0, "must_do": True}]})

    @model_validator(mode="after")
    def _is_on_one_target(self) -> Self:
        return self
