"""What the fields of a plan hold, as frozen values: times, conditions, amounts, utilities, resources.

Times are whole milliseconds, amounts are the numbers of the text, and no value knows its parent. Whatever
has a place in a text carries it as `source`, which takes no part in equality: two plans are equal when they
say the same, wherever they stand.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

Value = float | str | bool
"""A parameter, a state value or the right side of a comparison; `t` is True, `nil` is False."""

UNBOUNDED_S = 268435456
"""A time bound of this size or larger is infinite (2^28 seconds)."""


class LineTable:
    """Turns character offsets of one text into lines and columns, both counted from 1."""

    __slots__ = ("_starts",)

    def __init__(self, text: str) -> None:
        starts = [0]
        at = text.find("\n")
        while at >= 0:
            starts.append(at + 1)
            at = text.find("\n", at + 1)
        self._starts = starts

    def position(self, offset: int) -> tuple[int, int]:
        line = bisect_right(self._starts, offset)
        return line, offset - self._starts[line - 1] + 1


class Source:
    """Where something stands in its text: its own offset, and the offsets of its fields' values."""

    __slots__ = ("fields", "lines", "offset")

    def __init__(self, offset: int, lines: LineTable, fields: Mapping[str, int] | None = None) -> None:
        self.offset = offset
        self.lines = lines
        self.fields: Mapping[str, int] = fields if fields is not None else {}

    @property
    def line(self) -> int:
        return self.lines.position(self.offset)[0]

    @property
    def column(self) -> int:
        return self.lines.position(self.offset)[1]

    def position(self, name: str | None = None) -> tuple[int, int]:
        """Return line and column of the field `name` (without colon), or of the whole if it has none."""
        offset = self.offset if name is None else self.fields.get(name, self.offset)
        return self.lines.position(offset)

    def __repr__(self) -> str:
        return "Source({}, {})".format(*self.position())


class Point(StrEnum):
    """One of the two time points of a node."""

    START = "start"
    END = "end"


@dataclass(frozen=True, slots=True)
class Interval:
    """A closed interval of time in milliseconds; None is infinite (`lo_ms` minus, `hi_ms` plus)."""

    lo_ms: int | None = None
    hi_ms: int | None = None

    def contains(self, t_ms: int) -> bool:
        return (self.lo_ms is None or self.lo_ms <= t_ms) and (self.hi_ms is None or t_ms <= self.hi_ms)


# --- temporal conditions ----------------------------------------------------


@dataclass(frozen=True, slots=True)
class Absolute:
    """The point lies in the interval on the plan clock: `(2 268435456)`."""

    interval: Interval
    source: Source | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Reference:
    """The point lies in the interval after a point of another node: `(warm start (120 300))`."""

    node: str
    point: Point
    interval: Interval
    source: Source | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Relative:
    """Of a start: counted from the activation of the node; of an end: from its own start."""

    interval: Interval
    source: Source | None = field(default=None, compare=False, repr=False)


Temporal = Absolute | Reference | Relative


# --- conditions -------------------------------------------------------------


class Operator(StrEnum):
    EQ = "="
    NE = "/="
    LT = "<"
    LE = "<="
    GT = ">"
    GE = ">="


@dataclass(frozen=True, slots=True)
class Comparison:
    """`(database (:key args op value))`; `key` is without colon."""

    key: str
    arguments: tuple[str | float, ...]
    operator: Operator
    value: Value
    source: Source | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Known:
    """`(known (:key args))`."""

    key: str
    arguments: tuple[str | float, ...] = ()
    source: Source | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class And:
    parts: tuple[Condition, ...] = ()
    source: Source | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Or:
    parts: tuple[Condition, ...] = ()
    source: Source | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Not:
    part: Condition
    source: Source | None = field(default=None, compare=False, repr=False)


Condition = Comparison | Known | And | Or | Not
Conditions = tuple[Condition, ...]
"""A conjunction; the empty one is TRUE."""


# --- amounts, predictions, utilities ----------------------------------------


@dataclass(frozen=True, slots=True)
class Amount:
    """A resource and how much of it: an entry of `:uses`, `:requires` or `:budgets`."""

    resource: str
    amount: float = 1
    source: Source | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Expectation:
    """The change a node is predicted to cause: mean and spread of time (seconds) or of a consumable."""

    name: str
    mean: float
    spread: float
    source: Source | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class UtilityTable:
    """Utility over the plan clock: (milliseconds, utility) points, linear between, constant outside."""

    points: tuple[tuple[int, float], ...]
    source: Source | None = field(default=None, compare=False, repr=False)

    def at(self, t_ms: int) -> float:
        """Return the utility of an option that starts at `t_ms`."""
        points = self.points
        first, last = points[0], points[-1]
        if t_ms <= first[0]:
            return first[1]
        if t_ms >= last[0]:
            return last[1]
        right = bisect_right(points, t_ms, key=_table_time)
        (t0, u0), (t1, u1) = points[right - 1], points[right]
        return u0 + (u1 - u0) * (t_ms - t0) / (t1 - t0)


def _table_time(point: tuple[int, float]) -> int:
    return point[0]


Utility = float | UtilityTable


def utility_at(utility: Utility, t_ms: int) -> float:
    """Return the value of a utility, constant or table, at a time of the plan clock."""
    return utility.at(t_ms) if isinstance(utility, UtilityTable) else utility


# --- resources --------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class UnitResource:
    """Held by one node at a time: `(arm :unit)`."""

    name: str
    source: Source | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class CapacityResource:
    """Shared up to `capacity`: `(power :capacity 120)`."""

    name: str
    capacity: float
    source: Source | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class ConsumableResource:
    """Measured by the database value under `key` (without colon), not to fall below `floor`."""

    name: str
    key: str
    floor: float = 0
    source: Source | None = field(default=None, compare=False, repr=False)


Resource = UnitResource | CapacityResource | ConsumableResource


# --- words --------------------------------------------------------------------------


class OnResume(StrEnum):
    """What becomes of a running action when the executive comes back after a crash."""

    REATTACH = "reattach"
    RESTART = "restart"
    FAIL = "fail"


class IfNone(StrEnum):
    """What a branch does when no option is eligible."""

    FAIL = "fail"
    SKIP = "skip"
    WAIT = "wait"


class OnOptionFailure(StrEnum):
    FAIL = "fail"
    NEXT = "next"


class Mode(StrEnum):
    """Whether a floating contingency waits for running tasks or suspends them."""

    BETWEEN = "between"
    INTERRUPT = "interrupt"


class Spread(StrEnum):
    """What the second number of an expectation is."""

    STDDEV = "stddev"
    VARIANCE = "variance"


# --- time ---------------------------------------------------------------------------


def seconds_to_ms(seconds: float) -> int:
    """Return a finite time in whole milliseconds, the resolution of the plan clock."""
    return seconds * 1000 if type(seconds) is int else round(seconds * 1000)


def bounds(lo_s: float | None, hi_s: float | None) -> Interval:
    """Return the interval between two times in seconds; None and |bound| >= 2^28 are infinite."""
    lo = None if lo_s is None or lo_s <= -UNBOUNDED_S else seconds_to_ms(lo_s)
    hi = None if hi_s is None or hi_s >= UNBOUNDED_S else seconds_to_ms(hi_s)
    return Interval(lo, hi)
