"""What the API takes for files of targets and keep-outs."""

from __future__ import annotations

from ground.records.forms import Body, Id


class GeometryImport(Body):
    """A GeoJSON or CSV file of targets and keep-outs, uploaded before."""

    upload_id: Id
