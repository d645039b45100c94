"""What the bodies of requests are made of: strict members, every number bounded, every text limited."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from datetime import datetime
from types import NoneType
from typing import Annotated, Any, Generic, TypeVar, get_args, get_type_hints

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, StringConstraints
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError

from ground.gdr.geometry import Pose

T = TypeVar("T")


class Page(BaseModel, Generic[T]):
    """One page of a list; give `next_cursor` as `cursor` for the one behind it."""

    items: list[T]
    next_cursor: str | None
    total: int | None = Field(default=None, description="How many there are in all, with `count=true`")


class Body(BaseModel):
    """A form that a person fills in.

    The form by which a thing is changed is made of that by which it was made, as in
    `class TargetChange(TargetCreate, partial=True)`: every member may be left out. Those that cannot be
    changed are named in `without`; in `never_null` those that the program fills in when one is made, and that
    stay filled in.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    def __init_subclass__(
        cls, *, partial: bool = False, without: Collection[str] = (), never_null: Collection[str] = ()
    ) -> None:
        super().__init_subclass__()

    @classmethod
    def __pydantic_init_subclass__(cls, **kwargs: Any) -> None:
        if not kwargs.get("partial"):
            return
        without, never_null = kwargs.get("without", ()), kwargs.get("never_null", ())
        hints = get_type_hints(cls, include_extras=True)
        for name in [name for name in cls.__pydantic_fields__ if name not in cls.__annotations__]:
            if name in without:
                del cls.__pydantic_fields__[name]
                continue
            options = [part for part in get_args(hints[name]) if part is not NoneType]
            hint = options[0] if name in never_null else hints[name]
            default = Field(default=None) if NoneType in get_args(hint) else Field(default_factory=unset)
            cls.__pydantic_fields__[name] = FieldInfo.from_annotated_attribute(hint, default)
        cls.model_rebuild(force=True)


@dataclass(frozen=True, slots=True)
class Reference:
    """Marks a member that names another resource of the same mission, of this kind."""

    kind: str


MEMBER_FAULT = "member"
"""The type of an error that a rule between members finds, and that is one member's fault."""


def member_fault(member: str, why: str) -> PydanticCustomError:
    """Return the error of a rule between members; answers point to that member."""
    return PydanticCustomError(MEMBER_FAULT, "{why}", {"member": member, "why": why})


def unset() -> Any:
    """Stand in for a member that was not sent; null is not allowed there."""
    return None


PRINTABLE = r"^[^\x00-\x08\x0b\x0c\x0e-\x1f\x7f]*$"


ONE_LINE = r"^[^\x00-\x1f\x7f]*$"


def not_blank(text: str) -> str:
    if not text.strip():
        raise ValueError("a name needs a visible character")
    return text


Name = Annotated[
    str, StringConstraints(min_length=1, max_length=80, pattern=ONE_LINE), AfterValidator(not_blank)
]


LongName = Annotated[
    str, StringConstraints(min_length=1, max_length=200, pattern=ONE_LINE), AfterValidator(not_blank)
]


Line = Annotated[str, StringConstraints(max_length=200, pattern=ONE_LINE)]


Text = Annotated[str, StringConstraints(max_length=20_000, pattern=PRINTABLE)]


Id = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9_-]{1,40}$")]


FrameId = Annotated[Id, Reference("frame")]
Flag = Annotated[bool, Field(strict=True)]


Metres = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-100_000.0, le=100_000.0)]


Radians = Annotated[
    float, Field(strict=True, allow_inf_nan=False, ge=-6.2831853071795869, le=6.2831853071795869)
]


Seconds = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=1e7)]


Joules = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=1e12)]


Utility = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=1e6)]


Chance = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0.0, lt=1.0)]


Corner = Annotated[list[Metres], Field(min_length=2, max_length=2)]


Window = Annotated[
    list[Seconds], Field(min_length=2, max_length=2, description="[earliest start, latest start]")
]


Index = Annotated[int, Field(strict=True, ge=0, le=2**31 - 1)]
Unit = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-1.01, le=1.01)]
Variance = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-1e12, le=1e12)]
Seed = Annotated[int, Field(strict=True, ge=0, le=2**53 - 1)]


Moment = Annotated[datetime, Field(description="UTC, RFC 3339")]


class PoseBody(Body):
    """A place to stand in the site frame; heading counter-clockwise from east."""

    east_m: Metres
    north_m: Metres
    heading_rad: Radians = 0.0

    def value(self) -> Pose:
        return Pose(self.east_m, self.north_m, self.heading_rad)


def references(form: type[Body]) -> dict[str, str]:
    """Return the members of a form that name another resource of the mission, each with its kind."""
    found = {}
    for name, hint in get_type_hints(form, include_extras=True).items():
        for part in (hint, *get_args(hint)):
            for mark in getattr(part, "__metadata__", ()):
                if isinstance(mark, Reference):
                    found[name] = mark.kind
    return found
