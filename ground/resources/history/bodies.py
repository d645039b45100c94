"""What the API takes for a mission's history."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from ground.records.forms import Body, Flag


class UndoBody(Body):
    """Take back the last act of the person (or of anybody, with `anyone`), or that of an event of any age."""

    anyone: Flag = False
    event: Annotated[int, Field(strict=True, ge=1, le=2**53)] | None = None
    """Number of an event in the history; the whole act that it belongs to is meant."""
