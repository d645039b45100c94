"""Site metres and the same points on the body, both ways."""

from __future__ import annotations

import math
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ground.errors import InvalidInputError
from ground.geo.place import Place
from ground.geo.references import LONLAT, SITE, degrees_of, reference, transformer

if TYPE_CHECKING:
    from pyproj import CRS

FAR_M = 100_000.0
"""Farther from the site than this nothing is taken: the site's forms take no larger metres."""
Floats = NDArray[np.float64]


class SiteFrame:
    """The site frame of a place. Points are arrays [n, 2]: x before y, longitude before latitude.

    In a projection the site's metres are the grid's, shifted and turned. In degrees they are those of an
    azimuthal equidistant projection round the origin: distances and directions from there are true.
    """

    def __init__(self, place: Place) -> None:
        self.place = place
        self.crs = reference(place.crs, "/place/crs")
        if not (math.isfinite(place.x) and math.isfinite(place.y)):
            raise InvalidInputError(f"({place.x}, {place.y}) is not a place", pointer="/place/x")
        if self.crs.is_geographic:
            _require_degrees(np.array([[place.x, place.y]]), "the site's origin")

    @cached_property
    def grid(self) -> CRS:
        """Return the projection whose metres are the site's."""
        if self.crs.is_projected:
            return self.crs
        from pyproj.crs import ProjectedCRS
        from pyproj.crs.coordinate_operation import AzimuthalEquidistantConversion

        round_here = AzimuthalEquidistantConversion(self.place.y, self.place.x)
        return ProjectedCRS(round_here, name=f"site metres on {self.crs.name}", geodetic_crs=self.crs)

    @cached_property
    def degrees(self) -> CRS:
        """Return longitude and latitude on the site's body."""
        return degrees_of(self.crs)

    def named(self, name: str) -> CRS | None:
        """Return the reference of a name; None for the site itself."""
        if name == SITE:
            return None
        return self.degrees if name == LONLAT else reference(name, "crs")

    @cached_property
    def stretch(self) -> float:
        """Return how many metres of the site are one on the ground: the factor farthest from 1 at the origin.

        Tissot's indicatrix, from the projection's own derivatives; infinite where it has none. In degrees it
        is 1. For EPSG:3857 the derivatives are those on a sphere, 0.7 % off at most.
        """
        if self.crs.is_geographic:
            return 1.0
        from pyproj import Proj
        from pyproj.exceptions import ProjError

        try:
            here = Proj(self.crs)
            factors = here.get_factors(*here(self.place.x, self.place.y, inverse=True), errcheck=True)
        except ProjError:
            return math.inf
        found = (factors.tissot_semimajor, factors.tissot_semiminor)
        return max(found, key=lambda scale: abs(scale - 1.0)) if np.isfinite(found).all() else math.inf

    def require_true_metres(self, limit: float) -> None:
        """Raise InvalidInputError if site metres differ from those on the ground by more than a share."""
        here = f"at ({self.place.x:.9g}, {self.place.y:.9g})"
        if not math.isfinite(self.stretch):
            raise InvalidInputError(f"{self.crs.name} is of no use {here}", pointer="/place/crs")
        if abs(self.stretch - 1.0) > limit:
            raise InvalidInputError(
                f"{self.crs.name} counts {self.stretch:.3f} metres for a metre on the ground {here}; at most "
                f"{limit:.0%} of difference is allowed: use a projection of the region, such as UTM, or "
                "degrees (or are x and y swapped?)",
                pointer="/place/crs",
            )

    def require_reachable(self, name: str) -> None:
        """Raise InvalidInputError if there is no such reference, or no transformation to the site."""
        crs = self.named(name)
        if crs is not None:
            transformer(crs, self.grid)

    def out(self, points: ArrayLike, name: str) -> Floats:
        """Return site points [n, 2], m, in another reference: `site`, `lonlat` (degrees) or a name (its
        units).

        Raises
        ------
        InvalidInputError
            If there is no such reference, or no transformation to it.
        """
        site = _points(points)
        crs = self.named(name)
        if crs is None or not len(site):
            return site
        turned = site @ self._turn.T + self._origin
        x, y = transformer(self.grid, crs).transform(turned[:, 0], turned[:, 1])
        found = np.column_stack([x, y])
        if not np.isfinite(found).all():
            raise InvalidInputError(f"{crs.name} is of no use where the site lies")
        return found

    def into(self, points: ArrayLike, name: str) -> Floats:
        """Return points [n, 2] of another reference in site metres.

        Raises
        ------
        InvalidInputError
            If one is not a number, lies far from the site (then it says whether x and y look swapped), or
            there is no transformation.
        """
        given = _points(points)
        crs = self.named(name)
        if not np.isfinite(given).all():
            row = int(np.flatnonzero(~np.isfinite(given).all(axis=1))[0])
            raise InvalidInputError(f"point {row + 1} is ({given[row, 0]}, {given[row, 1]}): no numbers")
        if crs is None or not len(given):
            return given
        site = self._inward(given, crs)
        away = np.hypot(site[:, 0], site[:, 1])
        bad = ~(away <= FAR_M)
        if bad.any():
            raise InvalidInputError(self._why_far(given[int(np.flatnonzero(bad)[0])], crs))
        return site

    def _inward(self, given: Floats, crs: CRS) -> Floats:
        if crs.is_geographic:
            wrong = np.abs(given[:, 1]) > 90.0
            given = np.where(wrong[:, None], np.nan, given)
        x, y = transformer(crs, self.grid).transform(given[:, 0], given[:, 1])
        return (np.column_stack([x, y]) - self._origin) @ self._turn

    def _why_far(self, point: Floats, crs: CRS) -> str:
        told = f"({point[0]:.9g}, {point[1]:.9g}) in {crs.name}"
        swapped = self._inward(point[None, ::-1], crs)[0]
        if np.isfinite(swapped).all() and math.hypot(*swapped) <= FAR_M:
            order = "longitude before latitude" if crs.is_geographic else "x (east) before y (north)"
            return f"{told} looks swapped: {order}; the other way round it lies at the site"
        if crs.is_geographic and abs(point[1]) > 90.0:
            return f"{told} has a latitude of {point[1]:g}; it is within 90 degrees"
        away = math.hypot(*self._inward(point[None], crs)[0])
        distance = f"{away / 1000:.0f} km" if math.isfinite(away) else "out of reach"
        return f"{told} is {distance} from the site; at most {FAR_M / 1000:g} km are taken"

    @cached_property
    def _turn(self) -> Floats:
        c, s = math.cos(self.place.rotation_rad), math.sin(self.place.rotation_rad)
        return np.array([[c, -s], [s, c]])

    @cached_property
    def _origin(self) -> Floats:
        return np.array([self.place.x, self.place.y]) if self.crs.is_projected else np.zeros(2)


def _points(points: ArrayLike) -> Floats:
    return np.asarray(points, dtype=np.float64).reshape(-1, 2)


def _require_degrees(points: Floats, what: str) -> None:
    for lon, lat in points:
        if not (abs(lat) <= 90.0 and abs(lon) <= 360.0):
            swapped = " (longitude and latitude look swapped)" if abs(lon) <= 90.0 < abs(lat) else ""
            raise InvalidInputError(
                f"{what} is at longitude {lon:g}, latitude {lat:g}; a latitude is within 90 degrees{swapped}",
                pointer="/place/y",
            )


@lru_cache(maxsize=32)
def site_frame(place: Place) -> SiteFrame:
    """Return the site frame of a place, made once."""
    return SiteFrame(place)
