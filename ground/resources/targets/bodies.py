"""What the API takes for targets."""

from __future__ import annotations

from pydantic import ConfigDict, Field

from ground.records.forms import Body, FrameId, Line, Metres, Name, Text, unset


class TargetCreate(Body):
    """A point picked on the ground; height, normal and covariance come from the server's terrain."""

    name: Name | None = None
    east_m: Metres
    north_m: Metres
    notes: Text = ""
    source_image: Line = ""
    frame_id: FrameId | None = None

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"name": "Rock1", "east_m": 4.2, "north_m": -1.5}]}
    )


class TargetChange(Body):
    name: Name = Field(default_factory=unset)
    east_m: Metres = Field(default_factory=unset)
    north_m: Metres = Field(default_factory=unset)
    notes: Text = Field(default_factory=unset)
    source_image: Line = Field(default_factory=unset)
    frame_id: FrameId | None = None
