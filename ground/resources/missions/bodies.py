"""What the API takes for missions."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field

from ground.records.forms import Body, Corner, Id, LongName, Name, Text, unset


class DriveRuleBody(Body):
    """A drive between two targets' stands, in both directions: forbidden, or by these corners."""

    from_target_id: Id | None = Field(description="null is the start pose")
    to_target_id: Id
    via_m: Annotated[list[Corner], Field(max_length=50)] | None = Field(
        default=None,
        description="corners from the first to the second, none for a straight line; null forbids the drive",
    )


class MissionChange(Body):
    name: LongName = Field(default_factory=unset)
    notes: Text = Field(default_factory=unset)
    rover_profile: Name = Field(default_factory=unset)
    anchor_frame_id: Id | None = None
    calibration: dict[str, Any] | None = Field(
        default=None, description="a calibration/1 document; null for the numbers of the rover profile"
    )
    drive_rules: Annotated[list[DriveRuleBody], Field(max_length=500)] = Field(
        default_factory=unset, description="all of them: what is not in the list is planned freely"
    )
