"""What must hold for an observation to be made: an open union, each kind a frozen value with its name.

The planner knows the primitive kinds (`Window`, `Tracked`, `MustDo`, `After`). Any other kind, also one of an
installed package (entry point group `outcrop.constraints`), says in `reduced` which primitive ones it comes
to on a given day; so a new kind is one class and no change elsewhere.
"""

from __future__ import annotations

import math
from functools import cache
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Literal

from mission.errors import MissionError, PluginError
from mission.plugins import Registry
from mission.values import Positive, value

if TYPE_CHECKING:
    from pydantic import GetCoreSchemaHandler
    from pydantic_core import CoreSchema

    from mission.sky import Sky

GROUP = "outcrop.constraints"
SUN_STEP_S = 60.0
"""Step in which a window of the sun is searched for: the sun climbs at most 0.25 degrees in it."""
SUN_EXACT_S = 0.5
"""To which the ends of a window of the sun are found; a tenth of the shortest task."""


class Constraint:
    """One condition on an observation. A kind is a `mission.values.value` with a literal member `kind`."""

    __slots__ = ()
    kind: str

    def reduced(self, sky: Sky, day_s: float) -> tuple[Constraint, ...]:
        """Return the primitive constraints that say the same on a day of `day_s` seconds under `sky`.

        Several windows mean that one of them must hold; none at all is said by a `MissionError`.
        """
        del sky, day_s
        return (self,)

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        if cls is not Constraint:
            return handler(source)
        from pydantic_core import core_schema

        choices = {name: handler.generate_schema(constraint_type(name)) for name in constraint_kinds()}
        return core_schema.tagged_union_schema(choices, discriminator="kind")


@value
class Window(Constraint):
    """The observation starts at `opens_s` to `closes_s` seconds of the plan clock, both inclusive."""

    opens_s: float
    closes_s: float
    kind: Literal["window"] = "window"

    def __post_init__(self) -> None:
        if self.opens_s > self.closes_s:
            raise MissionError(f"a window opens at {self.opens_s:g} s after it closes at {self.closes_s:g} s")


@value
class Tracked(Constraint):
    """The target's track is alive when the observation starts."""

    kind: Literal["tracked"] = "tracked"


@value
class MustDo(Constraint):
    """Every plan must contain the observation."""

    kind: Literal["must_do"] = "must_do"


@value
class After(Constraint):
    """The observation of another request was made before."""

    request_id: str
    kind: Literal["after"] = "after"


@value
class SunElevation(Constraint):
    """The sun stands at least so high, and at most so high, when the observation starts."""

    at_least_rad: float = -math.pi / 2
    at_most_rad: float = math.pi / 2
    kind: Literal["sun_elevation"] = "sun_elevation"

    def __post_init__(self) -> None:
        if self.at_least_rad > self.at_most_rad:
            raise MissionError(
                f"the sun is to stand at least {math.degrees(self.at_least_rad):g} degrees high and at most "
                f"{math.degrees(self.at_most_rad):g}"
            )

    def reduced(self, sky: Sky, day_s: float) -> tuple[Constraint, ...]:
        """Return the windows of the day in which the sun stands so high."""
        found = tuple(Window(opens, closes) for opens, closes in _spans(self, sky, day_s))
        if not found:
            raise MissionError(
                f"the sun stands at {math.degrees(self.at_least_rad):g} to "
                f"{math.degrees(self.at_most_rad):g} degrees at no time of the plan's {day_s:g} s"
            )
        return found


def _spans(asked: SunElevation, sky: Sky, day_s: Positive) -> list[tuple[float, float]]:
    """Return the times in which the sun is as asked: a scan by steps, its ends by bisection."""
    clock = sky.clock()

    def holds(t_s: float) -> bool:
        return asked.at_least_rad <= clock.elevation_rad(t_s) <= asked.at_most_rad

    def edge(before_s: float, after_s: float) -> float:
        inside = holds(after_s)
        while after_s - before_s > SUN_EXACT_S:
            middle = (before_s + after_s) / 2
            if holds(middle) is inside:
                after_s = middle
            else:
                before_s = middle
        return after_s if inside else before_s

    times = [min(k * SUN_STEP_S, day_s) for k in range(math.ceil(day_s / SUN_STEP_S) + 1)]
    spans: list[tuple[float, float]] = []
    opened: float | None = 0.0 if holds(0.0) else None
    for before_s, after_s in pairwise(times):
        inside = holds(after_s)
        if inside and opened is None:
            opened = edge(before_s, after_s)
        elif not inside and opened is not None:
            spans.append((opened, edge(before_s, after_s)))
            opened = None
    if opened is not None:
        spans.append((opened, day_s))
    return spans


_REGISTRY = Registry(
    "constraint",
    GROUP,
    {
        "window": "mission.constraints:Window",
        "tracked": "mission.constraints:Tracked",
        "must_do": "mission.constraints:MustDo",
        "after": "mission.constraints:After",
        "sun_elevation": "mission.constraints:SunElevation",
    },
)


@cache
def constraint_kinds() -> tuple[str, ...]:
    """Return the kinds that can be read: the product's, and those of packages that can be imported."""
    usable = []
    for name in _REGISTRY:
        try:
            constraint_type(name)
        except PluginError:
            continue  # said by name when a document uses it
        usable.append(name)
    return tuple(usable)


def constraint_type(name: str) -> type[Constraint]:
    """Return the class of a kind of constraint.

    Raises
    ------
    PluginError
        If there is none of that name, its package cannot be imported, or announces something else.
    """
    found = _REGISTRY.load(name)
    if not (isinstance(found, type) and issubclass(found, Constraint)):
        raise PluginError(f'constraint "{name}" is {found!r}; a class of mission.Constraint is needed')
    return found
