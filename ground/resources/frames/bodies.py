"""What the API takes for frames of the site chain."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from ground.records.forms import Body, Index, Text, unset


class FrameCreate(Body):
    """A frame by its name and motion counter (site, drive, ...): a site has one index, a rover frame two to
    five.
    """

    name: Literal["SITE_FRAME", "ROVER_FRAME"]
    counter: Annotated[list[Index], Field(min_length=1, max_length=5)]
    notes: Text = ""


class FrameChange(Body):
    notes: Text = Field(default_factory=unset)
