"""How values are declared: frozen dataclasses with slots, whose documents may hold no other members."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, TypeVar, dataclass_transform

from annotated_types import Ge, Gt, Le

T = TypeVar("T")


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
def value(kind: type[T]) -> type[T]:
    """Make a class a frozen dataclass with slots that a `mission.codec.Codec` can read and write.

    Its annotations hold the limits of single members; what joins several is checked in `__post_init__` with
    a `MissionError`.
    """
    kind.__pydantic_config__ = {"extra": "forbid", "allow_inf_nan": False}  # type: ignore[attr-defined]
    return dataclass(frozen=True, slots=True)(kind)


NotNegative = Annotated[float, Ge(0.0)]
Positive = Annotated[float, Gt(0.0)]
Share = Annotated[float, Ge(0.0), Le(1.0)]
Chance = Annotated[float, Gt(0.0), Le(1.0)]
Point2 = tuple[float, float]
"""East, north in the site frame, metres."""
Point3 = tuple[float, float, float]
"""East, north, up in the site frame, metres (a direction: of unit length)."""
