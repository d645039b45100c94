"""What the API takes for localization solutions."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, StringConstraints

from ground.records.forms import Body, Flag, Id, Metres, Name, Text, Unit, Variance, unset


class SolutionCreate(Body):
    """Where a frame lies in its reference: origin (north, east, nadir) and attitude (s, v1, v2, v3).

    `covariance` [6, 6] is that of a small motion (turn in rad, shift in m) in the frame's own axes.
    """

    label: Name
    reference_id: Id
    offset_m: Annotated[list[Metres], Field(min_length=3, max_length=3)]
    quaternion: Annotated[list[Unit], Field(min_length=4, max_length=4)]
    covariance: (
        Annotated[
            list[Annotated[list[Variance], Field(min_length=6, max_length=6)]],
            Field(min_length=6, max_length=6),
        ]
        | None
    ) = None
    notes: Text = ""


class SolutionChange(Body):
    notes: Text = Field(default_factory=unset)


class SolutionChoice(Body):
    """The solution to put in use; null = none. With `preview` only the answer is made."""

    solution_id: Id | None
    preview: Flag = False
    reason: Annotated[str, StringConstraints(max_length=2000)] = ""


class FrameFileImport(Body):
    """A .svf or .rvf file, uploaded before."""

    upload_id: Id
