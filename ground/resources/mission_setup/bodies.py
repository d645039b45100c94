"""What the API takes for new missions."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import ConfigDict, Field

from ground.records.forms import Body, Flag, Id, LongName, Name, Seed, Text
from ground.resources.missions.bodies import PlaceBody


class DemoTerrain(Body):
    """The demo site, generated from the seed the demo uses."""

    source: Literal["demo"]


class GeneratedTerrain(Body):
    """A terrain made from a seed."""

    source: Literal["generated"]
    seed: Seed = 0
    size_m: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=48.0, le=256.0)] = 128.0
    rock_cover: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=0.3)] = 0.05


class UploadedTerrain(Body):
    """A terrain from uploads: a zip of a terrain folder, a GeoTIFF (with an ortho image of its own), a
    mesh.
    """

    source: Literal["uploaded"]
    upload_id: Id
    ortho_upload_id: Id | None = None


class MissionCreate(Body):
    """A new mission. With `demo_content`, the demo's targets and observation requests are filed as well."""

    name: LongName
    notes: Text = ""
    terrain: Annotated[DemoTerrain | GeneratedTerrain | UploadedTerrain, Field(discriminator="source")]
    rover_profile: Name = "k9"
    demo_content: Flag = False
    place: PlaceBody | None = Field(
        default=None, description="where the site lies; else as the files of the terrain say it"
    )

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {"name": "Murray Buttes", "terrain": {"source": "generated", "seed": 7}},
                {"name": "Demo", "terrain": {"source": "demo"}, "demo_content": True},
            ]
        }
    )
