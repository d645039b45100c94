"""What the API takes for keep-outs."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import ConfigDict, Field, model_validator

from ground.records.forms import Body, Corner, FrameId, Name, Text, unset
from ground.records.located import OutlineAt, one_way

PLACE = ("polygon_m",)


class KeepOutCreate(Body):
    """A polygon the rover must not enter; the ring is closed by itself.

    Its corners are given in site metres, or by `at` in another reference.
    """

    name: Name | None = None
    notes: Text = ""
    polygon_m: Annotated[list[Corner], Field(min_length=3, max_length=500)] = Field(default_factory=unset)
    at: OutlineAt = Field(default_factory=unset)
    frame_id: FrameId | None = None

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{"name": "Sand", "polygon_m": [[1.0, 1.0], [4.0, 1.0], [4.0, 3.0]]}],
            "oneOf": [{"required": list(PLACE)}, {"required": ["at"]}],
        }
    )

    @model_validator(mode="after")
    def _is_somewhere(self) -> Self:
        one_way(self, PLACE, needed=True)
        return self


class KeepOutChange(KeepOutCreate, partial=True, never_null={"name"}):
    model_config = ConfigDict(json_schema_extra={"examples": [{"name": "Sand", "notes": "deep"}]})

    @model_validator(mode="after")
    def _is_somewhere(self) -> Self:
        one_way(self, PLACE, needed=False)
        return self
