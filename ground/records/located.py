"""Where things lie in another reference than the site's: what is sent, and what is told."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, TypeVar, cast

from pydantic import Field

from ground.errors import InvalidInputError
from ground.geo.in_reference import Corner, to_site
from ground.geo.place import Place
from ground.geo.references import MAX_TEXT
from ground.records.forms import Body, member_fault

B = TypeVar("B", bound=Body)
Coordinate = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-1e8, le=1e8)]
CrsName = Annotated[
    str,
    Field(min_length=3, max_length=MAX_TEXT, description="lonlat, EPSG:32612, IAU_2015:49900 ... or WKT"),
]


class PointAt(Body):
    """A point in another reference than the site's; x goes before y, longitude before latitude."""

    crs: CrsName
    x: Coordinate = Field(description="east, or longitude in degrees")
    y: Coordinate = Field(description="north, or latitude in degrees")


class OutlineAt(Body):
    """An outline in another reference than the site's; the ring is closed by itself."""

    crs: CrsName
    polygon: Annotated[
        list[Annotated[list[Coordinate], Field(min_length=2, max_length=2)]],
        Field(min_length=3, max_length=500, description="corners [x, y]: longitude before latitude"),
    ]


@dataclass(frozen=True, slots=True)
class PointIn:
    """Where a point lies in the reference that was asked for; x goes before y, longitude before latitude."""

    crs: str
    x: float
    y: float


@dataclass(frozen=True, slots=True)
class OutlineIn:
    """Where an outline lies in the reference that was asked for; corners are [x, y]."""

    crs: str
    polygon: list[list[float]]


def settled(corners: Sequence[Corner], crs: str, site: Place | None) -> list[Corner]:
    """Return points of a form in site metres.

    Raises
    ------
    InvalidInputError
        If the mission has no place, or the points cannot be brought there; it points to `/at`.
    """
    try:
        return to_site(corners, crs, site)
    except InvalidInputError as err:
        raise InvalidInputError(err.message, pointer="/at/crs" if err.pointer else "/at") from err


def one_way(given: Body, place: Sequence[str], *, needed: bool) -> None:
    """Raise an error of that member unless a form gives its place in site metres or by `at`, and not by both.

    A form that changes a thing (`needed` is false) may give none.
    """
    names = " and ".join(place)
    there = [name for name in place if name in given.model_fields_set]
    if "at" in given.model_fields_set and there:
        raise member_fault("at", f"{there[0]} and at both say where it lies; give {names}, or at")
    if needed and "at" not in given.model_fields_set and len(there) < len(place):
        missing = next(name for name in place if name not in there)
        raise member_fault(missing, f"{missing} is missing; give {names}, or at")


def without_at(given: B, place: Mapping[str, object]) -> B:
    """Return a form whose `at` is replaced by members in site metres."""
    others: dict[str, Any] = {n: getattr(given, n) for n in given.model_fields_set if n != "at"}
    return cast("B", type(given).model_construct(**{**others, **place}))
