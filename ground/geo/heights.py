"""Heights over ellipsoid, geoid, areoid and sphere, told apart; converted where that is known, or refused."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ground.errors import InvalidInputError
from ground.geo.place import Heights
from ground.geo.references import WGS84, degrees_of, reference, transformer

if TYPE_CHECKING:
    from pyproj import CRS

Floats = NDArray[np.float64]
GEOIDS = {"EGM96": "EPSG:5773", "EGM2008": "EPSG:3855", "NAVD88": "EPSG:5703"}
"""Geoids by the names that people give them."""


def convert_heights(
    lonlat: ArrayLike,
    heights_m: ArrayLike,
    given: Heights,
    wanted: Heights,
    crs: CRS,
    *,
    geoid: str = "EGM96",
) -> Floats:
    """Return heights (n,), m, over `wanted` of points (n, 2) whose heights are over `given`.

    `lonlat` is in degrees of the reference's own body. Between ellipsoid and geoid PROJ's grid is used;
    between ellipsoid and sphere (whose radius is the reference's larger axis) the distance from the centre.

    Raises
    ------
    InvalidInputError
        If one of them is unknown, belongs to another body, or needs a grid that is not here. The message
        names it: heights of two references are never mixed.
    """
    points = np.asarray(lonlat, dtype=np.float64).reshape(-1, 2)
    found = np.asarray(heights_m, dtype=np.float64).reshape(-1)
    if given == wanted and given != "unknown":
        return found
    for name in (given, wanted):
        _require_known(name, crs, given, wanted)
    over_ellipsoid = _to_ellipsoid(points, found, given, crs, geoid)
    return _from_ellipsoid(points, over_ellipsoid, wanted, crs, geoid)


def _require_known(name: Heights, crs: CRS, given: Heights, wanted: Heights) -> None:
    between = f"heights over {given} cannot become heights over {wanted}"
    earth = _is_earth(crs)
    if name == "unknown":
        raise InvalidInputError(f"{between}: say what both are counted from (place.heights, --heights)")
    if name == "areoid" and earth:
        raise InvalidInputError(f"{between}: the areoid is that of Mars, the reference is {crs.name}")
    if name == "areoid":
        raise InvalidInputError(
            f"{between}: PROJ has no grid of the areoid; give heights over it throughout, or convert them "
            "with the MOLA areoid first"
        )
    if name == "geoid" and not earth:
        raise InvalidInputError(
            f"{between}: PROJ's geoids are those of the Earth, the reference is {crs.name}"
        )
    if name == "sphere" and earth:
        raise InvalidInputError(f"{between}: heights on Earth count from the ellipsoid or the geoid")


def _is_earth(crs: CRS) -> bool:
    return bool(degrees_of(crs).to_epsg() == 4326)


def _to_ellipsoid(points: Floats, heights: Floats, given: Heights, crs: CRS, geoid: str) -> Floats:
    if given == "geoid":
        return _through_grid(points, heights, geoid, up=True)
    if given == "sphere":
        return _on_sphere(points, heights, crs, up=True)
    return heights


def _from_ellipsoid(points: Floats, heights: Floats, wanted: Heights, crs: CRS, geoid: str) -> Floats:
    if wanted == "geoid":
        return _through_grid(points, heights, geoid, up=False)
    if wanted == "sphere":
        return _on_sphere(points, heights, crs, up=False)
    return heights


def _through_grid(points: Floats, heights: Floats, geoid: str, *, up: bool) -> Floats:
    """Return heights brought from a geoid to WGS 84's ellipsoid (`up`) or back, by the geoid's own grid."""
    import warnings

    from pyproj.crs import CompoundCRS
    from pyproj.transformer import TransformerGroup

    if geoid not in GEOIDS:
        raise InvalidInputError(f"there is no geoid {geoid!r}; known are {', '.join(GEOIDS)}")
    over_geoid = CompoundCRS(f"WGS 84 + {geoid}", [reference(WGS84), _vertical(geoid)])
    ends = (over_geoid, reference("EPSG:4979"))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # pyproj's word for the missing grid named below
        group = TransformerGroup(*(ends if up else ends[::-1]), always_xy=True, allow_ballpark=False)
    if not group.transformers:
        grids = {grid.short_name for op in group.unavailable_operations for grid in op.grids}
        told = ", ".join(sorted(grids)) or "a grid that PROJ does not know"
        raise InvalidInputError(
            f"heights over the {geoid} geoid need PROJ's grid {told}, which is not installed; get it with "
            f"`projsync --file {told}`, or give heights over the ellipsoid"
        )
    _, _, found = group.transformers[0].transform(points[:, 0], points[:, 1], heights)
    result = np.asarray(found, dtype=np.float64)
    if not np.isfinite(result).all():
        row = int(np.flatnonzero(~np.isfinite(result))[0])
        raise InvalidInputError(
            f"the grid of the {geoid} geoid does not reach ({points[row, 0]:.6f}, {points[row, 1]:.6f})"
        )
    return result


def _vertical(geoid: str) -> CRS:
    from pyproj import CRS

    return CRS.from_user_input(GEOIDS[geoid])


def _on_sphere(points: Floats, heights: Floats, crs: CRS, *, up: bool) -> Floats:
    """Return heights over the ellipsoid from those over the sphere of its larger axis (`up`), or the reverse.

    The vertical of both is taken as one: over 5 km of height the two differ by 0.3 m on Mars at most.
    """
    ellipsoid = crs.ellipsoid
    if ellipsoid is None:
        raise InvalidInputError(f"{crs.name} has no ellipsoid")
    a, b = ellipsoid.semi_major_metre, ellipsoid.semi_minor_metre
    if math.isclose(a, b):
        return heights
    own = degrees_of(crs)
    geodetic = crs.geodetic_crs
    if geodetic is not None and own != geodetic:
        x, y = transformer(own, geodetic).transform(points[:, 0], points[:, 1])
        points = np.column_stack([x, y])
    graphic = np.radians(points[:, 1])
    latitude = np.arctan2(b**2 * np.sin(graphic), a**2 * np.cos(graphic))  # of the foot, from the centre
    radius = a * b / np.hypot(b * np.cos(latitude), a * np.sin(latitude))
    return np.asarray(heights + (radius - a if not up else a - radius))
