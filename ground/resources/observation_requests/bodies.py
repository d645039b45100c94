"""What the API takes for observation requests."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from ground.records.forms import Body, Flag, Id, PoseBody, Seconds, Text, Utility, Window, unset

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
    """What is asked of a target. `observation_pose` sets the observation point by hand."""

    target_id: Id
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


class ObservationRequestChange(
    ObservationRequestCreate, partial=True, without={"target_id"}, never_null={"tracked"}
):
    """`observation_pose: null` gives the choice of the observation point back to the program."""

    state: Literal["open", "carried"] = Field(default_factory=unset)
