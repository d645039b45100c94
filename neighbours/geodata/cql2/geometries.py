"""Literals of geometry: well-known text, and boxes."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol, TypeAlias, TypeVar

from neighbours.geodata.cql2.errors import Cql2Error
from neighbours.geodata.cql2.words import Word

if TYPE_CHECKING:
    from shapely import Polygon
    from shapely.geometry.base import BaseGeometry

T = TypeVar("T")
Corner: TypeAlias = tuple[float, float]
LEVELS = {"point": 0, "linestring": 1, "multipoint": 1, "polygon": 2, "multilinestring": 2, "multipolygon": 3}
"""Lists within lists that hold a geometry's coordinates."""
SHAPES = frozenset({*LEVELS, "geometrycollection", "bbox"})


class Words(Protocol):
    """What reads a filter word by word."""

    @property
    def word(self) -> Word: ...

    def next(self) -> Word: ...

    def take(self, *keys: str) -> str | None: ...

    def expect(self, key: str, where: str) -> None: ...


def read_shape(words: Words) -> BaseGeometry:
    """Return the geometry that stands next; heights are read and dropped.

    Raises
    ------
    Cql2Error
        If it is none: too few corners, a ring that is open or crosses itself, an empty box.
    """
    from shapely.errors import GEOSException

    begin = words.next()
    try:
        shape = _shape(words, begin.key)
    except (ValueError, GEOSException) as err:
        if isinstance(err, Cql2Error):
            raise
        raise Cql2Error(f"{begin.text} is none: {err}", begin.position) from err
    if not shape.is_valid:
        from shapely.validation import explain_validity

        raise Cql2Error(f"{begin.text} cannot be used: {explain_validity(shape)}", begin.position)
    return shape


def _shape(words: Words, name: str) -> BaseGeometry:
    import shapely

    if name == "bbox":
        return box(_numbers(words))
    words.take("z")
    if name == "geometrycollection":
        words.expect("(", f"behind {name}")
        parts: list[BaseGeometry] = []
        while not parts or words.take(","):
            if words.word.key not in LEVELS:
                raise Cql2Error(f"{words.word.text[:40]!r} is not a geometry", words.word.position)
            parts.append(read_shape(words))
        words.expect(")", f"behind {name}")
        return shapely.GeometryCollection(parts)
    if name == "point":
        return shapely.Point(_points(words, 1)[0])
    if name in {"linestring", "multipoint"}:
        make = shapely.LineString if name == "linestring" else shapely.MultiPoint
        return make(_points(words))
    if name == "multilinestring":
        return shapely.MultiLineString(_several(words, _points))
    if name == "polygon":
        return _polygon(words)
    return shapely.MultiPolygon(_several(words, _polygon))


def _polygon(words: Words) -> Polygon:
    import shapely

    rings = _several(words, _points)
    for ring in rings:
        if len(ring) < 4 or ring[0] != ring[-1]:
            raise ValueError("a ring has 4 corners or more, and the last is the first")
    return shapely.Polygon(rings[0], rings[1:])


def box(numbers: list[float]) -> BaseGeometry:
    """Return the rectangle of a box: west, south, east, north, with two heights between or without.

    One whose west is east of its east goes over the meridian of 180 degrees.

    Raises
    ------
    ValueError
        If there are other than 4 or 6 numbers, one is none, or south is north of north.
    """
    import shapely

    if len(numbers) not in {4, 6}:
        raise ValueError(f"a box has 4 numbers, or 6 with heights, not {len(numbers)}")
    if not all(math.isfinite(number) for number in numbers):
        raise ValueError("a number of the box is none")
    west, south = numbers[:2]
    east, north = numbers[len(numbers) // 2 :][:2]
    if south > north:
        raise ValueError(f"the box reaches from {south:g} up to {north:g}: the smaller goes first")
    if west > east:
        if not (abs(west) <= 180.0 and abs(east) <= 180.0):
            raise ValueError(f"the box reaches from {west:g} to {east:g}: the smaller goes first")
        return shapely.union(shapely.box(west, south, 180.0, north), shapely.box(-180.0, south, east, north))
    if west == east and south == north:
        return shapely.Point(west, south)
    if west == east or south == north:
        return shapely.LineString([(west, south), (east, north)])
    return shapely.box(west, south, east, north)


def _numbers(words: Words) -> list[float]:
    words.expect("(", "behind bbox")
    found: list[float] = []
    while not found or words.take(","):
        found.append(_number(words))
    words.expect(")", "behind the numbers of bbox")
    return found


def _number(words: Words) -> float:
    word = words.word
    if word.kind != "number":
        raise Cql2Error(f"a number expected, not {word.text[:40]!r}", word.position)
    words.next()
    value = float(word.text)
    if not math.isfinite(value):
        raise Cql2Error(f"{word.text[:40]} is not a number that can be used", word.position)
    return value


def _points(words: Words, most: int | None = None) -> list[Corner]:
    words.expect("(", "before coordinates")
    found: list[Corner] = []
    while not found or words.take(","):
        bracket = words.take("(")
        x, y = _number(words), _number(words)
        if words.word.kind == "number":
            words.next()
        if bracket:
            words.expect(")", "behind the coordinates of a point")
        found.append((x, y))
        if len(found) == most:
            break
    words.expect(")", "behind coordinates")
    return found


def _several(words: Words, part: Callable[[Words], T]) -> list[T]:
    words.expect("(", "before parts of a geometry")
    found = [part(words)]
    while words.take(","):
        found.append(part(words))
    words.expect(")", "behind the parts of a geometry")
    return found
