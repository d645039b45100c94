"""What the API takes for campaigns, and the form of their result."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel as Model
from pydantic import ConfigDict, Field

from ground.records.forms import Body, Id, Name, Seed


class CampaignCreate(Body):
    """Fly a plan so many times on a simulated rover, one seed after the other."""

    plan_id: Id
    rover: Name = "abstract"
    runs: Annotated[int, Field(strict=True, ge=1, le=1_000_000)] = 1000
    seed: Seed = 1
    until_se: Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0.0, le=1e9)] | None = None
    help_runs: Annotated[int, Field(strict=True, ge=0, le=100_000)] = 0


class CampaignDocument(Model):
    """A `campaign/1` (docs/formats/campaign-1.schema.json); of one that goes on, what it has so far."""

    model_config = ConfigDict(extra="allow")

    format: str
    runs: int
