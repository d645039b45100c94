"""What a filter says of a feature: yes, no, or nothing where what it asks for is not there."""

from __future__ import annotations

import operator
import unicodedata
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Any, TypeAlias

from neighbours.geodata.cql2.errors import Cql2Error
from neighbours.geodata.cql2.expression import (
    Call,
    Constant,
    Expression,
    Instant,
    Interval,
    Name,
    Scalar,
    Shape,
)
from neighbours.geodata.cql2.reader import COMPARISONS, SPATIAL, TEMPORAL

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

Truth: TypeAlias = bool | None
FIRST = datetime.min.replace(tzinfo=UTC)
LAST = datetime.max.replace(tzinfo=UTC)
COMPARE: Mapping[str, Callable[[Any, Any], bool]] = {
    "=": operator.eq,
    "<>": operator.ne,
    "<": operator.lt,
    ">": operator.gt,
    "<=": operator.le,
    ">=": operator.ge,
}


@dataclass(frozen=True, slots=True)
class Subject:
    """What is asked of a feature: its properties, and the geometry that any spatial property stands for."""

    properties: Mapping[str, Scalar]
    geometry: BaseGeometry | None = None


def holds(expression: Expression, subject: Subject) -> bool:
    """Return whether a filter is true of a feature; where it says nothing it is not."""
    return _truth(expression, subject) is True


def moved(expression: Expression, move: Callable[[BaseGeometry], BaseGeometry]) -> Expression:
    """Return a filter with its geometries in another reference."""
    match expression:
        case Shape(geometry):
            return Shape(move(geometry))
        case Call(_, arguments):
            return replace(expression, arguments=tuple(moved(part, move) for part in arguments))
        case _:
            return expression


def _truth(expression: Expression, subject: Subject) -> Truth:
    if isinstance(expression, Constant):
        return bool(expression.value)
    assert isinstance(expression, Call)
    name, parts = expression.name, expression.arguments
    if name in {"and", "or"}:
        return _joined(name == "or", [_truth(part, subject) for part in parts])
    if name == "not":
        inner = _truth(parts[0], subject)
        return None if inner is None else not inner
    if name in SPATIAL:
        return _spatial(name, *(_geometry(part, subject) for part in parts))
    if name in TEMPORAL:
        return _temporal(name, *(_span(part, subject) for part in parts))
    if name == "isnull":
        return _is_null(parts[0], subject)
    return _compared(name, parts, subject)


def _joined(wanted: bool, found: list[Truth]) -> Truth:
    """Return `or` (wanted is true) or `and` in the logic of three values."""
    if wanted in found:
        return wanted
    return None if None in found else not wanted


def _is_null(part: Expression, subject: Subject) -> bool:
    if isinstance(part, Name) and part.name == "geometry":
        return subject.geometry is None
    return _value(part, subject) is None


def _compared(name: str, parts: tuple[Expression, ...], subject: Subject) -> Truth:
    values = [_value(part, subject) for part in parts]
    left, *others = values
    if left is None:
        return None
    if name == "in":
        return _joined(True, [None if v is None else _compare("=", left, v) for v in others])
    if any(value is None for value in others):
        return None
    if name == "like":
        return like(str(left), str(others[0]))
    if name == "between":
        return _compare(">=", left, others[0]) and _compare("<=", left, others[1])
    if name in COMPARISONS:
        return _compare(name, left, others[0])
    raise Cql2Error(f"{name} is not a condition")


def _compare(sign: str, left: Any, right: Any) -> bool:
    """Compare two values; against a day a moment counts as its date in UTC."""
    if isinstance(left, Instant) or isinstance(right, Instant):
        one, other = _moment(left), _moment(right)
        if one.day or other.day:
            return COMPARE[sign](one.at.date(), other.at.date())
        return COMPARE[sign](one.at, other.at)
    return COMPARE[sign](left, right)


def _moment(value: Any) -> Instant:
    return value if isinstance(value, Instant) else Instant(value)


def _value(part: Expression, subject: Subject) -> Scalar | Instant:
    match part:
        case Name(name):
            return subject.properties.get(name)
        case Constant(value):
            return value
        case Instant():
            return part
        case Call("casei", (inner,)):
            return _folded(_value(inner, subject), str.casefold)
        case Call("accenti", (inner,)):
            return _folded(_value(inner, subject), _plain)
        case _:
            raise Cql2Error("a geometry or interval stands where a value is expected")


def _folded(value: Scalar | Instant, fold: Callable[[str], str]) -> Scalar:
    return fold(value) if isinstance(value, str) else None


def _plain(text: str) -> str:
    parts = unicodedata.normalize("NFD", text)
    return "".join(part for part in parts if not unicodedata.combining(part))


def like(text: str, pattern: str) -> bool:
    r"""Return whether a text fits a pattern: `%` any characters, `_` one, `\` before what stands for itself.

    In time proportional to the product of the lengths: going back to the last `%` is enough.
    """
    signs = _signs(pattern)
    at = place = 0
    back, behind = -1, 0
    while at < len(text):
        if place < len(signs) and signs[place] == "%%":
            back, behind, place = place, at, place + 1
        elif place < len(signs) and signs[place] in ("__", text[at]):
            at, place = at + 1, place + 1
        elif back >= 0:
            behind += 1
            at, place = behind, back + 1
        else:
            return False
    return all(sign == "%%" for sign in signs[place:])


def _signs(pattern: str) -> list[str]:
    """Return a pattern's characters; wildcards are doubled."""
    found, escaped = [], False
    for character in pattern:
        if character == "\\" and not escaped:
            escaped = True
            continue
        found.append(character * 2 if character in "%_" and not escaped else character)
        escaped = False
    return [*found, "\\"] if escaped else found


def _geometry(part: Expression, subject: Subject) -> BaseGeometry | None:
    return part.geometry if isinstance(part, Shape) else subject.geometry


def _spatial(name: str, one: BaseGeometry | None, other: BaseGeometry | None) -> Truth:
    if one is None or other is None:
        return None
    return bool(getattr(one, name.removeprefix("s_"))(other))


Span: TypeAlias = tuple[datetime, datetime]


def _span(part: Expression, subject: Subject) -> Span | None:
    if isinstance(part, Interval):
        start = FIRST if part.start is None else _bound(part.start, subject, last=False)
        end = LAST if part.end is None else _bound(part.end, subject, last=True)
        return None if start is None or end is None else (start, end)
    found = _value(part, subject)
    if found is None:
        return None
    moment = _moment(found)
    return moment.at, _end_of(moment)


def _bound(part: Instant | Name, subject: Subject, *, last: bool) -> datetime | None:
    found = _value(part, subject)
    if found is None:
        return None
    moment = _moment(found)
    return _end_of(moment) if last else moment.at


def _end_of(moment: Instant) -> datetime:
    """Return the end of a moment: the last microsecond of a day."""
    return moment.at + timedelta(days=1, microseconds=-1) if moment.day else moment.at


def _temporal(name: str, one: Span | None, other: Span | None) -> Truth:
    if one is None or other is None:
        return None
    return RELATIONS[name](one, other)


def _relations() -> Mapping[str, Callable[[Span, Span], bool]]:
    """Return the relations of OGC 21-065r2, table 9, by the ends of two times."""
    plain: dict[str, Callable[[Span, Span], bool]] = {
        "t_after": lambda a, b: a[0] > b[1],
        "t_before": lambda a, b: a[1] < b[0],
        "t_contains": lambda a, b: a[0] < b[0] and a[1] > b[1],
        "t_disjoint": lambda a, b: a[0] > b[1] or a[1] < b[0],
        "t_equals": lambda a, b: a == b,
        "t_finishes": lambda a, b: a[0] > b[0] and a[1] == b[1],
        "t_intersects": lambda a, b: a[0] <= b[1] and a[1] >= b[0],
        "t_meets": lambda a, b: a[1] == b[0],
        "t_overlaps": lambda a, b: a[0] < b[0] < a[1] < b[1],
        "t_starts": lambda a, b: a[0] == b[0] and a[1] < b[1],
    }
    turned = {
        "t_during": "t_contains",
        "t_finishedby": "t_finishes",
        "t_metby": "t_meets",
        "t_overlappedby": "t_overlaps",
        "t_startedby": "t_starts",
    }
    return plain | {name: _turned(plain[inverse]) for name, inverse in turned.items()}


def _turned(relation: Callable[[Span, Span], bool]) -> Callable[[Span, Span], bool]:
    return lambda a, b: relation(b, a)


RELATIONS = _relations()
