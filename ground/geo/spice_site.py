"""A mission's place as SPICE has it: body, longitude to the east and planetographic latitude."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from ground.errors import InvalidInputError
from ground.geo.place import Place
from ground.geo.references import LONLAT
from ground.geo.site_frame import site_frame

if TYPE_CHECKING:
    from neighbours.geodata.spice_sky import Site

AXES_M = {"EARTH": 6_378_137.0, "MARS": 3_396_190.0, "MOON": 1_737_400.0}
"""Larger axis of each body: EPSG:7030, and the report of the IAU's working group of 2015."""
MARS_POLAR_M = 3_376_200.0
WITHIN = 0.005
"""Share by which a reference's axis may be another: spheres of older maps differ by 0.1 %."""


def body_of(place: Place) -> str:
    """Return the body a place is on, by the size of its ellipsoid.

    Raises
    ------
    InvalidInputError
        If it is none that is known.
    """
    frame = site_frame(place)
    ellipsoid = frame.crs.ellipsoid
    axis = 0.0 if ellipsoid is None else float(ellipsoid.semi_major_metre)
    for body, known in AXES_M.items():
        if abs(axis / known - 1.0) <= WITHIN:
            return body
    raise InvalidInputError(
        f"{frame.crs.name} is on a body with an axis of {axis / 1000:g} km; known are {', '.join(AXES_M)}"
    )


def spice_site(place: Place) -> Site:
    """Return the site of a place. A latitude on a sphere counts as planetocentric."""
    from neighbours.geodata.spice_sky import Site

    frame, body = site_frame(place), body_of(place)
    lon, lat = (float(v) for v in frame.out([[0.0, 0.0]], LONLAT)[0])
    ellipsoid = frame.degrees.ellipsoid
    if body == "MARS" and ellipsoid is not None and ellipsoid.semi_major_metre == ellipsoid.semi_minor_metre:
        lat = math.degrees(math.atan(math.tan(math.radians(lat)) * (AXES_M[body] / MARS_POLAR_M) ** 2))
    return Site(body, lon, lat, place.height_m or 0.0)
