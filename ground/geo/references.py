"""Coordinate references by name, and the transformations between them, with errors that people understand."""

from __future__ import annotations

import re
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from ground.errors import InvalidInputError, UnavailableError

if TYPE_CHECKING:
    from pyproj import CRS, Transformer

LONLAT = "lonlat"
"""Degrees of longitude and latitude on the mission's body: WGS 84 on Earth, else on the reference's datum."""
SITE = "site"
"""Metres of the site frame, east and north."""
WGS84 = "EPSG:4326"
MAX_TEXT = 8000
_CODE = re.compile(r"[A-Za-z][A-Za-z0-9_]{1,20}:[A-Za-z0-9_]{1,20}")
_URN = re.compile(r"urn:ogc:def:crs:[A-Za-z0-9_]{1,20}:[A-Za-z0-9_.]{0,10}:[A-Za-z0-9_]{1,20}")
_URL = re.compile(
    r"https?://www\.opengis\.net/def/crs/[A-Za-z0-9_]{1,20}/[A-Za-z0-9_.]{1,10}/[A-Za-z0-9_]{1,20}"
)
_WKT = re.compile(r"\s*[A-Z]{4,20}\s*\[")
MISSING = "coordinates on a body need pyproj: pip install 'outcrop[geo]'"


def reference(text: str, pointer: str | None = None) -> CRS:
    """Return a coordinate reference by `AUTHORITY:CODE`, OGC name or WKT.

    Raises
    ------
    InvalidInputError
        If it is none, counts longitudes to the west, or is neither in degrees nor a projection in metres.
    UnavailableError
        If pyproj is not installed.
    """
    try:
        return _reference(text)
    except InvalidInputError as err:
        raise InvalidInputError(err.message, pointer=pointer) from err


@lru_cache(maxsize=64)
def _reference(text: str) -> CRS:
    CRS, errors = _pyproj()
    told = text if len(text) <= 60 else f"{text[:57]}..."
    forms = (_CODE, _URN, _URL)
    if not any(form.fullmatch(text) for form in forms) and not _WKT.match(text):
        raise InvalidInputError(
            f"{told!r} names no coordinate reference; use EPSG:32612, IAU_2015:49900 or WKT (or site, lonlat)"
        )
    if len(text) > MAX_TEXT or "grids" in text.lower():
        raise InvalidInputError(f"the reference {told!r} is longer than {MAX_TEXT} or names grid files")
    try:
        found = CRS.from_user_input(text)
    except UnicodeError as err:
        raise InvalidInputError(
            f"{told!r} is not a coordinate reference: half a character of Unicode is in it"
        ) from err
    except errors.CRSError as err:
        raise InvalidInputError(
            f"{told!r} is not a coordinate reference that is known: {str(err)[:200]}"
        ) from err
    _require_usable(found, told)
    return found


def _require_usable(crs: CRS, told: str) -> None:
    directions = [axis.direction for axis in crs.axis_info[:2]]
    if not (crs.is_geographic or crs.is_projected):
        raise InvalidInputError(f"{told} ({crs.name}) is neither in degrees nor a map projection")
    if "west" in directions:
        raise InvalidInputError(f"{told} ({crs.name}) counts longitude to the west; use one that counts east")
    if crs.is_geographic and any(axis.unit_name != "degree" for axis in crs.axis_info[:2]):
        raise InvalidInputError(f"{told} ({crs.name}) counts in {crs.axis_info[0].unit_name}, not in degrees")
    if crs.is_projected and any(abs(axis.unit_conversion_factor - 1) > 1e-9 for axis in crs.axis_info[:2]):
        raise InvalidInputError(f"{told} ({crs.name}) counts in {crs.axis_info[0].unit_name}, not in metres")


def _pyproj() -> tuple[type[CRS], Any]:
    try:
        from pyproj import CRS, exceptions
    except ImportError:
        raise UnavailableError(MISSING) from None
    return CRS, exceptions


def degrees_of(crs: CRS) -> CRS:
    """Return longitude and latitude for a reference: WGS 84 on Earth, the reference's own on another body."""
    own = crs.geodetic_crs
    if own is None:
        raise InvalidInputError(f"{crs.name} has no longitude and latitude")
    ellipsoid = own.ellipsoid
    if ellipsoid is not None and abs(ellipsoid.semi_major_metre - 6_378_137.0) < 20_000.0:
        return _reference(WGS84)
    return own


@lru_cache(maxsize=128)
def transformer(one: CRS, other: CRS) -> Transformer:
    """Return what brings x and y (longitude, latitude) from one reference into the other.

    Raises
    ------
    InvalidInputError
        If there is none: another body, or a datum nobody has measured against this one.
    """
    _, errors = _pyproj()
    from pyproj import Transformer

    try:
        return Transformer.from_crs(one, other, always_xy=True, allow_ballpark=False)
    except errors.ProjError as err:
        bodies = re.search(r"celestial body \((.{1,60}?)\)", str(err))
        why = f" ({bodies[1]})" if bodies else ""
        raise InvalidInputError(
            f"there is no transformation between {one.name} and {other.name}{why}"
        ) from err
