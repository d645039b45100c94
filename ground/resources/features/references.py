"""The references that features can be had in, by the URIs of OGC, in their own order of axes."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

from ground.errors import InvalidInputError, StateError
from ground.geo.place import Place
from ground.geo.references import reference
from ground.geo.site_frame import site_frame

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray
    from pyproj import CRS
    from shapely.geometry.base import BaseGeometry

CRS84 = "http://www.opengis.net/def/crs/OGC/1.3/CRS84"
MAP_TILES = "EPSG:3857"


@dataclass(frozen=True, slots=True)
class Reference:
    """A reference by its URI, and by the name that `ground.geo` knows. `north_first`: y goes before x."""

    uri: str
    name: str
    north_first: bool


@lru_cache(maxsize=32)
def references_of(place: Place) -> tuple[Reference, ...]:
    """Return the references of a mission's features, the default first.

    On Earth that is CRS84. On another body it is the body's own longitude and latitude in the order of its
    definition, as CRS84 says nothing there.

    Raises
    ------
    StateError
        If the body's longitude and latitude have no name.
    """
    frame = site_frame(place)
    body = _named(frame.degrees)
    if body is None:
        raise StateError(
            f"{frame.degrees.name} has no name (EPSG:..., IAU_2015:...), by which features could be given out"
        )
    found = [body]
    if body.name == "EPSG:4326":
        found = [Reference(CRS84, "EPSG:4326", False), body]
    own = _named(frame.crs)
    if own is not None:
        found.append(own)
    if body.name == "EPSG:4326" and abs(frame.out([(0.0, 0.0)], "EPSG:4326")[0, 1]) < 85.0:
        tiles = _named(reference(MAP_TILES))
        assert tiles is not None
        found.append(tiles)
    return tuple(dict.fromkeys(found))


def storage_of(place: Place) -> Reference | None:
    """Return the reference in which the site's metres come from; None where they are turned, or unnamed."""
    own = _named(site_frame(place).crs)
    kept = site_frame(place).crs.is_geographic or place.rotation_rad == 0.0
    return own if kept else None


def _named(crs: CRS) -> Reference | None:
    authority = crs.to_authority(min_confidence=100)
    if authority is None:
        return None
    name, code = authority
    family, _, version = name.partition("_")
    uri = f"http://www.opengis.net/def/crs/{family}/{version or 0}/{code}"
    return Reference(uri, f"{name}:{code}", crs.axis_info[0].direction == "north")


def wanted(place: Place, uri: str | None, parameter: str) -> Reference:
    """Return the reference of a URI, the default without one.

    Raises
    ------
    InvalidInputError
        If features cannot be had in it; it names those that there are.
    """
    known = references_of(place)
    if uri is None:
        return known[0]
    plain = re.sub(r"^https:", "http:", uri.strip("[]"))
    for found in known:
        if found.uri == plain:
            return found
    there = ", ".join(found.uri for found in known)
    raise InvalidInputError(f"{parameter} is {uri[:100]!r}; there are {there}", pointer=parameter)


def out(
    place: Place, geometries: Sequence[BaseGeometry | None], to: Reference, *, in_order: bool = True
) -> Sequence[BaseGeometry | None]:
    """Return geometries in site metres in another reference, in the order of its axes or x before y."""
    import shapely

    frame = site_frame(place)

    def move(points: NDArray[np.float64]) -> NDArray[np.float64]:
        found = frame.out(points, to.name)
        return found[:, ::-1] if to.north_first and in_order else found

    found: list[BaseGeometry | None] = list(shapely.transform(list(geometries), move))
    return found


def flipped(geometry: BaseGeometry) -> BaseGeometry:
    """Return a geometry with x and y exchanged."""
    import shapely

    turned: BaseGeometry = shapely.transform(geometry, lambda points: points[:, ::-1])
    return turned
