"""Rules of keep-outs: an outline that can be one, and the ground it keeps the rover off."""

from __future__ import annotations

from collections.abc import Sequence

from ground.errors import InvalidInputError, OutsideTerrainError
from ground.gdr.geometry import Bounds

SIGMAS = 2.0

MARGIN_M = 10.0
"""A keep-out drawn by hand may reach over the edge of the terrain by so much."""


def kept_clear(polygon_m: Sequence[Sequence[float]], sigma_m: float) -> list[list[float]]:
    """Return the outline of a keep-out, m, two deviations of its place wider on all sides.

    One that is tied to no frame has no deviation and comes back as it is.
    """
    if sigma_m <= 0.0:
        return [list(corner) for corner in polygon_m]
    from shapely.geometry import Polygon

    wide = Polygon(polygon_m).buffer(SIGMAS * sigma_m, join_style="mitre", mitre_limit=2.0)
    return [[float(e), float(n)] for e, n in wide.exterior.coords[:-1]]


def require_outline(polygon_m: Sequence[Sequence[float]], bounds: Bounds) -> None:
    """Raise unless the corners make a simple polygon with an area, on a terrain of these bounds.

    Raises
    ------
    InvalidInputError
        If it crosses itself or has no area.
    OutsideTerrainError
        If it lies more than `MARGIN_M` off the terrain.
    """
    from shapely.geometry import Polygon

    corners = [tuple(c) for c in polygon_m]
    if len(corners) > 1 and corners[0] == corners[-1]:
        corners = corners[:-1]
    if len(set(corners)) < 3:
        raise InvalidInputError(
            f"a keep-out needs 3 corners, this one has {len(set(corners))}", pointer="/polygon_m"
        )
    shape = Polygon(corners)
    if not shape.is_valid or shape.area < 1e-4:
        raise InvalidInputError(
            "the outline of the keep-out crosses itself or has no area", pointer="/polygon_m"
        )
    west, south, east, north = shape.bounds
    if (
        west < bounds.east_min_m - MARGIN_M
        or east > bounds.east_max_m + MARGIN_M
        or south < bounds.north_min_m - MARGIN_M
        or north > bounds.north_max_m + MARGIN_M
    ):
        raise OutsideTerrainError(
            f"the keep-out reaches from ({west:.1f}, {south:.1f}) to ({east:.1f}, {north:.1f}) m, "
            f"more than {MARGIN_M:g} m "
            f"off the terrain",
            pointer="/polygon_m",
        )
