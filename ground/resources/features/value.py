"""Collections and features, in site metres."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import TYPE_CHECKING, Any

from neighbours.geodata.cql2 import Form, Scalar

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry


@dataclass(frozen=True, slots=True)
class Feature:
    """One feature; `geometry` is in site metres, east before north. No filter asks for what is in `more`."""

    id: str
    geometry: BaseGeometry | None
    created: datetime
    properties: Mapping[str, Scalar]
    more: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Collection:
    """A kind of feature: what it is, its kind of geometry, and the properties that can be asked for."""

    id: str
    title: str
    description: str
    geometry: str
    properties: Mapping[str, Form]

    @property
    def queryables(self) -> Mapping[str, Form]:
        """Return what a filter may name."""
        return {**self.properties, "created_utc": "time", "geometry": "geometry"}


@dataclass(frozen=True, slots=True)
class Selection:
    """A page of the features that were asked for; geometries are in the reference that was asked for."""

    features: Sequence[Feature]
    matched: int
    after: str | None
    """The cursor of the page behind it."""
    reference: str
    """URI of the reference of the coordinates."""
