"""What the API takes for keep-outs."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from ground.records.forms import Body, Corner, FrameId, Name, Text


class KeepOutCreate(Body):
    """A polygon the rover must not enter; the ring is closed by itself."""

    name: Name | None = None
    notes: Text = ""
    polygon_m: Annotated[list[Corner], Field(min_length=3, max_length=500)]
    frame_id: FrameId | None = None


class KeepOutChange(KeepOutCreate, partial=True, never_null={"name"}):
    pass
