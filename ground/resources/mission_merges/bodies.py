"""What the API takes for merges of missions."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from ground.records.forms import Body, Flag, Id

_Event = Annotated[int, Field(strict=True, ge=1, le=2**53)]


class MissionChoice(Body):
    """The side that is taken in one conflict, which `kind`, `id` and `field` name."""

    kind: Literal["both-changed", "removed-and-changed", "refers-to-removed", "same-name", "not-merged"]
    id: Id
    field: Annotated[str, Field(max_length=120)] = ""
    take: Literal["ours", "theirs"]


class MissionMergeCreate(Body):
    """Merge another mission into this one. `take` decides all conflicts in which a side can be taken,
    `choices` single ones. With `preview` nothing is kept.
    """

    from_id: Id
    event: _Event | None = Field(
        default=None, description="newest event of the mission that was looked at; needed but for a preview"
    )
    from_event: _Event | None = Field(default=None, description="newest event of the other one")
    take: Literal["ours", "theirs"] | None = None
    choices: Annotated[list[MissionChoice], Field(max_length=10_000)] = []
    preview: Flag = False
