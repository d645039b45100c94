"""Which reference a GeoJSON document says that it counts in."""

from __future__ import annotations

from collections.abc import Mapping

from ground.errors import InvalidInputError
from ground.geo.references import LONLAT, SITE

CRS84 = ("OGC:1.3:CRS84", "OGC::CRS84", "OGC/1.3/CRS84", "OGC:CRS84")
"""Ends of names of longitude and latitude on WGS 84, as GeoJSON before 2016 has them."""


def named_in(document: Mapping[str, object]) -> str | None:
    """Return the reference that a GeoJSON document names: None where it names none.

    Raises
    ------
    InvalidInputError
        If it names a frame that is none, or a reference by another form than its name.
    """
    frame = document.get("frame")
    if frame is not None and frame not in (SITE, LONLAT):
        raise InvalidInputError(
            f"frame is {str(frame)[:40]!r}; it is site or lonlat, or there is a member crs"
        )
    crs = document.get("crs")
    if crs is None:
        return None if frame is None else str(frame)
    properties = crs.get("properties") if isinstance(crs, dict) else None
    name = properties.get("name") if isinstance(properties, dict) else crs
    if not isinstance(name, str):
        raise InvalidInputError(
            'crs is not a name: {"type": "name", "properties": {"name": "EPSG:32612"}} is one'
        )
    if frame == SITE:
        raise InvalidInputError(f"the file says that it counts in the site frame and in {name[:60]!r}")
    return "EPSG:4326" if name.endswith(CRS84) else name
