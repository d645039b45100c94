"""What the API takes for site maps."""

from __future__ import annotations

from pydantic import Field

from ground.records.forms import Body, Id, Name, Text, unset


class SiteMapCreate(Body):
    """A GeoTIFF, uploaded before, in metres east and north of the origin of a site."""

    frame_id: Id
    upload_id: Id
    name: Name | None = None
    notes: Text = ""


class SiteMapChange(Body):
    name: Name = Field(default_factory=unset)
    notes: Text = Field(default_factory=unset)
