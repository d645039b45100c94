"""What the API takes for a mission's history."""

from __future__ import annotations

from ground.records.forms import Body, Flag


class UndoBody(Body):
    """Take back the last act of the person (or of anybody, with `anyone`)."""

    anyone: Flag = False
