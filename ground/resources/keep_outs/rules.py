"""The ground that a keep-out keeps the rover off, when where it lies is not quite known."""

from __future__ import annotations

from collections.abc import Sequence

SIGMAS = 2.0


def kept_clear(polygon_m: Sequence[Sequence[float]], sigma_m: float) -> list[list[float]]:
    """Return the outline of a keep-out, two deviations of its place wider on all sides.

    One that is tied to no frame has no deviation and comes back as it is.
    """
    if sigma_m <= 0.0:
        return [list(corner) for corner in polygon_m]
    from shapely.geometry import Polygon

    wide = Polygon(polygon_m).buffer(SIGMAS * sigma_m, join_style="mitre", mitre_limit=2.0)
    return [[float(e), float(n)] for e, n in wide.exterior.coords[:-1]]
