"""What the API takes for targets."""

from __future__ import annotations

from typing import Annotated

from pydantic import ConfigDict, Field

from ground.records.forms import Body, FrameId, Line, Metres, Name, Text


class TargetCreate(Body):
    """A point picked on the ground; height, normal and covariance come from the server's terrain."""

    name: Name | None = None
    east_m: Metres
    north_m: Metres
    notes: Text = ""
    feature_type: Annotated[Line, Field(max_length=80, description="float, vein, outcrop, soil ...")] = ""
    source_image: Line = ""
    frame_id: FrameId | None = None

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"name": "Rock1", "east_m": 4.2, "north_m": -1.5}]}
    )


class TargetChange(TargetCreate, partial=True, never_null={"name"}):
    model_config = ConfigDict(json_schema_extra=None)
