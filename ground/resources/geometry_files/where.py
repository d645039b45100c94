"""Which reference the coordinates of a file count in, and the way from there to site metres."""

from __future__ import annotations

from collections.abc import Sequence

from ground.errors import InvalidInputError
from ground.geo.place import Place
from ground.geo.references import LONLAT, SITE
from ground.geo.site_frame import SiteFrame, site_frame
from mission.codec import Document

CRS84 = ("OGC:1.3:CRS84", "OGC::CRS84", "OGC/1.3/CRS84", "OGC:CRS84")
"""Ends of names of longitude and latitude on WGS 84, as GeoJSON of before 2016 has them."""
Corner = tuple[float, float]


def named_in(document: Document) -> str | None:
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
            'crs is no name: {"type": "name", "properties": {"name": "EPSG:32612"}} is one'
        )
    if frame == SITE:
        raise InvalidInputError(f"the file says that it counts in the site frame and in {name[:60]!r}")
    return "EPSG:4326" if name.endswith(CRS84) else name


def to_site(corners: Sequence[Corner], name: str, site: Place | None) -> list[Corner]:
    """Return points in site metres.

    Raises
    ------
    InvalidInputError
        If nobody has said where the site lies, or the points cannot be brought there.
    """
    if name == SITE:
        return list(corners)
    return [(float(e), float(n)) for e, n in placed(site, name).into(corners, name)]


def from_site(corners: Sequence[Sequence[float]], name: str, site: Place | None) -> list[list[float]]:
    """Return site points [east, north] in another reference, x before y."""
    if name == SITE:
        return [list(corner) for corner in corners]
    return [[float(x), float(y)] for x, y in placed(site, name).out(corners, name)]


def placed(site: Place | None, name: str) -> SiteFrame:
    """Return the site frame of a mission that has a place: for another reference than site metres.

    Raises
    ------
    InvalidInputError
        If it has none, or one of no use.
    UnavailableError
        If pyproj is not installed.
    """
    if site is None:
        raise InvalidInputError(
            f"the mission has no place on a body, so that {name[:60]!r} says nothing of its site; "
            "give it one: "
            'outcrop mission set ID \'place={"crs": ..., "x": ..., "y": ...}\'',
            pointer="/crs",
        )
    return site_frame(site)
