"""What the API takes for targets."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import ConfigDict, Field, model_validator

from ground.records.forms import Body, FrameId, Line, Metres, Name, Text, unset
from ground.records.located import PointAt, one_way

PLACE = ("east_m", "north_m")


class TargetCreate(Body):
    """A point picked on the ground, in site metres or by `at` in another reference.

    Height, normal and covariance come from the server's terrain.
    """

    name: Name | None = None
    east_m: Metres = Field(default_factory=unset)
    north_m: Metres = Field(default_factory=unset)
    at: PointAt = Field(default_factory=unset)
    notes: Text = ""
    feature_type: Annotated[Line, Field(max_length=80, description="float, vein, outcrop, soil ...")] = ""
    source_image: Line = ""
    frame_id: FrameId | None = None

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{"name": "Rock1", "east_m": 4.2, "north_m": -1.5}],
            "oneOf": [{"required": list(PLACE)}, {"required": ["at"]}],
        }
    )

    @model_validator(mode="after")
    def _is_somewhere(self) -> Self:
        one_way(self, PLACE, needed=True)
        return self


class TargetChange(TargetCreate, partial=True, never_null={"name"}):
    model_config = ConfigDict(
        json_schema_extra={"examples": [{"name": "Rock2", "notes": "a float beside the drive"}]}
    )

    @model_validator(mode="after")
    def _is_somewhere(self) -> Self:
        one_way(self, PLACE, needed=False)
        return self
