"""What the API takes of the site chain: frames, solutions, maps, traverses."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, StringConstraints, model_validator

from ground.api.schemas import Body, Flag, Id, LongName, Metres, Name, Text, _unset

Index = Annotated[int, Field(strict=True, ge=0, le=2**31 - 1)]
Unit = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-1.01, le=1.01)]
Variance = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-1e12, le=1e12)]


class FrameCreate(Body):
    """A frame by its name and motion counter (site, drive, ...): a site has one index, a rover frame two to
    five."""

    name: Literal["SITE_FRAME", "ROVER_FRAME"]
    counter: Annotated[list[Index], Field(min_length=1, max_length=5)]
    notes: Text = ""


class FrameChange(Body):
    notes: Text = Field(default_factory=_unset)


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
    notes: Text = Field(default_factory=_unset)


class SolutionChoice(Body):
    """The solution to put in use; null = none. With `preview` only the answer is made."""

    solution_id: Id | None
    preview: Flag = False
    reason: Annotated[str, StringConstraints(max_length=2000)] = ""


class FrameFileImport(Body):
    """A .svf or .rvf file, uploaded before."""

    upload_id: Id


class SiteMapCreate(Body):
    """A GeoTIFF, uploaded before, in metres east and north of the origin of a site."""

    frame_id: Id
    upload_id: Id
    name: Name | None = None
    notes: Text = ""


class SiteMapChange(Body):
    name: Name = Field(default_factory=_unset)
    notes: Text = Field(default_factory=_unset)


class StopBody(Body):
    """A stop: the frame it stands for, and one of a run with a stereo panorama, or an upload (a zip of a
    `panorama/1` folder, or a point file .npz, .ply, .csv)."""

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


class TraverseCreate(Body):
    """Match rocks between stops in the order driven and adjust them together.

    `odometry` is the error of the way between stops as a share of it, `heading_rad` that of the turn between
    two, `sun_rad` that of each stop's own heading where there is one.
    """

    name: LongName
    notes: Text = ""
    stops: Annotated[list[StopBody], Field(min_length=2, max_length=60)]
    odometry: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.001, le=0.5)] = 0.05
    heading_rad: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=1e-4, le=0.5)] = 0.0524
    sun_rad: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=1e-4, le=0.5)] | None = None
    longest_m: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=1.0, le=100.0)] = 30.0


class TraverseChange(Body):
    name: LongName = Field(default_factory=_unset)
    notes: Text = Field(default_factory=_unset)
