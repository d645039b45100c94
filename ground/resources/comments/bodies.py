"""What the API takes for comments."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from ground.records.forms import Body, Id, Line, Text, unset


class CommentCreate(Body):
    subject_kind: Literal[
        "mission",
        "sol",
        "target",
        "observation_request",
        "keep_out",
        "path_network",
        "plan",
        "run",
        "product",
    ]
    subject_id: Id
    text: Annotated[Text, Field(min_length=1)]
    part: Annotated[Line, Field(min_length=1)] | None = Field(
        default=None, description="of a plan: the step, as its line and number, `main/3`"
    )


class CommentChange(Body):
    text: Annotated[Text, Field(min_length=1)] = Field(default_factory=unset)
