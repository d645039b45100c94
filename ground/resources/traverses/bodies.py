"""What the API takes for traverses."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, StringConstraints, model_validator

from ground.records.forms import Body, Id, LongName, Text, unset


class StopBody(Body):
    """A stop: the frame it stands for, and one of a run with a stereo panorama, or an upload (a zip of a
    `panorama/1` folder, or a point file .npz, .ply, .csv).
    """

    frame_id: Id
    run_id: Id | None = None
    upload_id: Id | None = None
    panorama: Annotated[
        str, StringConstraints(max_length=200, pattern=r"^[A-Za-z0-9_./-]*$"), Field(description="of the run")
    ] = ""

    @model_validator(mode="after")
    def _one_source(self) -> StopBody:
        if (self.run_id is None) == (self.upload_id is None):
            raise ValueError("a stop has either a run_id or an upload_id")
        return self


EXAMPLE = [
    {"frame_id": "frm-1qep8e5zsqmg5", "run_id": "run-1qep8e5zsqmg5"},
    {"frame_id": "frm-1qep8f0c3wmg7", "upload_id": "upl-1qep8e5zsqmg5"},
]


class TraverseCreate(Body):
    """Match rocks between stops in the order driven and adjust them together.

    `odometry` is the error of the way between stops as a share of it, `heading_rad` that of the turn between
    two, `sun_rad` that of each stop's own heading where there is one.
    """

    name: LongName
    notes: Text = ""
    stops: Annotated[list[StopBody], Field(min_length=2, max_length=60, examples=[EXAMPLE])]
    odometry: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.001, le=0.5)] = 0.05
    heading_rad: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=1e-4, le=0.5)] = 0.0524
    sun_rad: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=1e-4, le=0.5)] | None = None
    longest_m: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=1.0, le=100.0)] = 30.0


class TraverseChange(Body):
    name: LongName = Field(default_factory=unset)
    notes: Text = Field(default_factory=unset)
