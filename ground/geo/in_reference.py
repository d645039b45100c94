"""Which reference coordinates count in, and the way from there to site metres and back."""

from __future__ import annotations

from collections.abc import Sequence

from ground.errors import InvalidInputError
from ground.geo.place import Place
from ground.geo.references import SITE
from ground.geo.site_frame import FAR_M, SiteFrame, site_frame

Corner = tuple[float, float]


def to_site(corners: Sequence[Corner], name: str, site: Place | None) -> list[Corner]:
    """Return points in site metres.

    Raises
    ------
    InvalidInputError
        If nobody has said where the site lies, or the points cannot be brought there.
    """
    if name == SITE:
        return [_near(corner) for corner in corners]
    return [(float(e), float(n)) for e, n in placed(site, name).into(corners, name)]


def from_site(corners: Sequence[Sequence[float]], name: str, site: Place | None) -> list[list[float]]:
    """Return site points [east, north], m, in another reference, x before y."""
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


def _near(corner: Corner) -> Corner:
    east, north = corner
    if not (abs(east) <= FAR_M and abs(north) <= FAR_M):  # also for what is not a number
        raise InvalidInputError(f"({east:g}, {north:g}) is not within {FAR_M:g} m of the site")
    return east, north
