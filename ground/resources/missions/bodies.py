"""What the API takes for missions."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field

from ground.geo.place import Heights
from ground.geo.references import MAX_TEXT
from ground.records.forms import Body, Corner, Id, LongName, Name, Radians, Text, unset
from ground.records.located import Coordinate


class DriveRuleBody(Body):
    """A drive between two targets' stands, in both directions: forbidden, or by these corners."""

    from_target_id: Id | None = Field(description="null is the start pose")
    to_target_id: Id
    via_m: Annotated[list[Corner], Field(max_length=50)] | None = Field(
        default=None,
        description="corners from the first to the second, none for a straight line; null forbids the drive",
    )


class PlaceBody(Body):
    """Where the site frame's origin lies on Earth, Moon or Mars."""

    crs: Annotated[str, Field(min_length=3, max_length=MAX_TEXT)] = Field(
        description="EPSG:32612, EPSG:4326, IAU_2015:49900 ... or WKT"
    )
    x: Coordinate = Field(description="east, or longitude in degrees")
    y: Coordinate = Field(description="north, or latitude in degrees")
    rotation_rad: Radians = Field(
        default=0.0, description="from the reference's grid to the site's axes, counter-clockwise"
    )
    height_m: Coordinate | None = Field(default=None, description="of the site's zero")
    heights: Heights = Field(default="unknown", description="what height_m is counted from")


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
    place: PlaceBody | None = Field(default=None, description="null takes it away")
