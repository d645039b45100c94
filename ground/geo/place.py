"""Where a mission's site frame lies on Earth, Moon or Mars."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, get_args

from ground.errors import InvalidInputError

Heights = Literal["unknown", "ellipsoid", "geoid", "areoid", "sphere"]
"""What a site's heights are counted from: the ellipsoid of the reference, a geoid, Mars' areoid, a sphere."""

_NAMED: Mapping[str, Heights] = {word: word for word in get_args(Heights)}


def heights_named(word: str) -> Heights:
    """Return what heights are counted from, by its word.

    Raises
    ------
    InvalidInputError
        If there is no such word.
    """
    if word not in _NAMED:
        raise InvalidInputError(f"heights is {word[:40]!r}; use one of {', '.join(_NAMED)}")
    return _NAMED[word]


@dataclass(frozen=True, slots=True)
class Place:
    """The site frame's origin in a coordinate reference; x goes before y, longitude before latitude.

    `rotation_rad` is the turn, counter-clockwise, from the reference's grid (true east and north for degrees)
    to the site's east and north. `height_m` is that of the site's zero over what `heights` names.
    """

    crs: str
    x: float
    y: float
    rotation_rad: float = 0.0
    height_m: float | None = None
    heights: Heights = "unknown"
