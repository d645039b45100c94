"""What the API takes for files of targets and keep-outs."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from ground.geo.references import MAX_TEXT
from ground.records.forms import Body, Id


class GeometryImport(Body):
    """A GeoJSON or CSV file of targets and keep-outs, uploaded before."""

    upload_id: Id
    crs: Annotated[str, Field(min_length=3, max_length=MAX_TEXT)] | None = Field(
        default=None,
        description="site, lonlat, EPSG:..., IAU_2015:...: of a file that names none; else site",
    )
