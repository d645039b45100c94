"""How values are declared: frozen dataclasses with slots, whose documents may hold no other members."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any, TypeVar, dataclass_transform

from annotated_types import Ge, Gt, Le

if TYPE_CHECKING:
    from pydantic import GetCoreSchemaHandler
    from pydantic_core import CoreSchema

T = TypeVar("T")


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
def value(kind: type[T]) -> type[T]:
    """Make a class a frozen dataclass with slots that a `mission.codec.Codec` can read and write.

    Its annotations hold the limits of single members; what joins several is checked in `__post_init__` with
    a `MissionError`.
    """
    kind.__pydantic_config__ = {"extra": "forbid", "allow_inf_nan": False}  # type: ignore[attr-defined]
    return dataclass(frozen=True, slots=True)(kind)


def document(kind: type[T]) -> type[T]:
    """Let a `TypedDict` of a document hold finite numbers and its own members only, as `value` does.

    Documents are declared beside a value where the two differ in shape: members that stand elsewhere, are
    named by a word of Python, or are left out when they say nothing.
    """
    kind.__pydantic_config__ = {"extra": "forbid", "allow_inf_nan": False}  # type: ignore[attr-defined]
    return kind


def reads_over(kind: type[T]) -> type[T]:
    """Let the documents of a `value` hold members that it does not know; they are read over.

    For formats of which files are about that were written when unknown members were ignored.
    """
    kind.__pydantic_config__ = {"extra": "ignore", "allow_inf_nan": False}  # type: ignore[attr-defined]
    return kind


@dataclass(frozen=True, slots=True)
class ToldBy:
    """Marks a union of documents that are told apart by what stands in one member."""

    member: str

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        from pydantic import Field

        return handler(Annotated[source, Field(discriminator=self.member)])


# Whole numbers, as pydantic's own types: `typing` keeps the first of two equal forms, and schemas show it.
NotNegative = Annotated[float, Ge(0)]
Positive = Annotated[float, Gt(0)]
Share = Annotated[float, Ge(0), Le(1)]
Chance = Annotated[float, Gt(0), Le(1)]
Point2 = tuple[float, float]
"""East, north in the site frame, metres."""
Point3 = tuple[float, float, float]
"""East, north, up in the site frame, metres (a direction: of unit length)."""
