"""What the API takes for calibrations of a mission's path network."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from ground.records.forms import Body, Id


class MissionCalibrate(Body):
    """Runs to learn from; all recorded ones of the mission when there are none."""

    run_ids: Annotated[list[Id], Field(max_length=10_000)] = Field(default_factory=list)
    name: Annotated[str, Field(max_length=200)] = ""
