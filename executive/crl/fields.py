"""Values of single fields: from items of the text to the values of `nodes.py`, with findings on what is bad.

A reader of a field returns its value, or `BAD` after it has reported why it cannot; lists keep what is good
in them, so that one slip does not hide the next.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from datetime import datetime
from enum import Enum, StrEnum
from typing import Final, TypeVar

from executive.crl.errors import Finding, Severity
from executive.crl.lexer import Atom, Form, Item, Kind
from executive.crl.values import (
    UNBOUNDED_S,
    Absolute,
    Amount,
    And,
    CapacityResource,
    Comparison,
    Condition,
    Conditions,
    ConsumableResource,
    Expectation,
    Interval,
    Known,
    LineTable,
    Not,
    Operator,
    Or,
    Point,
    Reference,
    Relative,
    Resource,
    Source,
    Temporal,
    UnitResource,
    Utility,
    UtilityTable,
    Value,
    bounds,
    seconds_to_ms,
)

MAX_DEPTH = 200


class _Bad(Enum):
    BAD = 0


BAD: Final = _Bad.BAD
E = TypeVar("E", bound=StrEnum)
FieldReader = Callable[["Report", Item], object]


class Report:
    """Collects findings; knows which node and which field is being read."""

    def __init__(self, text: str, lines: LineTable, sources: bool = True) -> None:
        self.sources = sources
        self.text = text
        self.lines = lines
        self.findings: list[Finding] = []
        self.label = "plan"
        self.node = ""
        self.field = ""

    def add(
        self,
        code: str,
        message: str,
        at: Item,
        *,
        hint: str = "",
        severity: Severity = Severity.ERROR,
    ) -> None:
        line, column = self.lines.position(at.offset)
        length = at.length if isinstance(at, Atom) else 1
        self.findings.append(
            Finding(code, severity, f"{self.label}: {message}", self.node, line, column, hint, length)
        )

    def bad(self, item: Item, needed: str, *, code: str = "E014", hint: str = "") -> _Bad:
        """Report that the field needs something else than `item`."""
        self.add(code, f'":{self.field}" needs {needed}, found {self.show(item)}', item, hint=hint)
        return BAD

    def show(self, item: Item) -> str:
        """Return the text of an item for a message, shortened."""
        raw = self.text[item.offset : item.offset + item.length]
        if isinstance(item, Atom) and item.kind is Kind.STRING:
            return "the string " + (raw if len(raw) < 40 else f'{raw[:36]}..."')
        raw = " ".join(raw.split())
        return f'"{raw}"' if len(raw) < 40 else f'"{raw[:37]}..."'

    def source(self, item: Item, places: Mapping[str, int] | None = None) -> Source | None:
        return Source(item.offset, self.lines, places) if self.sources else None


# --- atoms ----------------------------------------------------------------------


def is_nil(item: Item) -> bool:
    """Tell whether the item is `nil` or the empty list."""
    if isinstance(item, Atom):
        return item.kind is Kind.SYMBOL and item.value == "nil"
    return not item


def symbol_of(item: Item) -> str | None:
    if isinstance(item, Atom) and item.kind is Kind.SYMBOL:
        assert isinstance(item.value, str)
        return item.value
    return None


def number_of(item: Item) -> float | None:
    if isinstance(item, Atom) and item.kind is Kind.NUMBER:
        assert not isinstance(item.value, str)
        return item.value if math.isfinite(item.value) else None
    return None


def value_of(item: Item) -> Value | None:
    """Return what an item denotes as a value, None if it denotes none."""
    if isinstance(item, Form):
        return None if item else False
    if item.kind is Kind.OPERATOR:
        return None
    if item.kind is Kind.NUMBER:
        return number_of(item)
    if item.kind is Kind.SYMBOL:
        if item.value in ("t", "true"):
            return True
        if item.value == "nil":
            return False
    return item.value


def read_symbol(report: Report, item: Item) -> str | _Bad:
    name = symbol_of(item)
    if name is None or name == "nil":
        return report.bad(item, "a symbol")
    return name


def read_string(report: Report, item: Item) -> str | _Bad:
    if isinstance(item, Atom) and item.kind is Kind.STRING:
        return str(item.value)
    return report.bad(item, "a string", hint="strings stand in double quotes")


def read_epoch(report: Report, item: Item) -> str | _Bad:
    text = read_string(report, item)
    if text is BAD:
        return BAD
    try:
        datetime.fromisoformat(str(text))
    except ValueError:
        return report.bad(item, "a UTC instant in ISO 8601", hint='for example "2031-05-04T06:30:00Z"')
    return text


def _number_hint(item: Item) -> str:
    name = symbol_of(item)
    if name is not None and name.strip("+-.0123456789") == "" and any(c.isdigit() for c in name):
        return "a number has digits on both sides of its point"
    return ""


def read_number(report: Report, item: Item) -> float | _Bad:
    number = number_of(item)
    if number is None:
        return report.bad(item, "a number", hint=_number_hint(item))
    return number


def read_nonnegative(report: Report, item: Item) -> float | _Bad:
    number = number_of(item)
    if number is None or number < 0:
        return report.bad(item, "a non-negative number", hint=_number_hint(item))
    return number


def read_integer(report: Report, item: Item) -> int | _Bad:
    number = number_of(item)
    if number is None or number != int(number):
        return report.bad(item, "an integer")
    return int(number)


def read_retries(report: Report, item: Item) -> int | _Bad:
    number = number_of(item)
    if number is None:
        return report.bad(item, "a non-negative integer")
    if number < 0 or number != int(number):
        return report.bad(item, "a non-negative integer", code="E084")
    return int(number)


def read_insertions(report: Report, item: Item) -> int | _Bad:
    number = number_of(item)
    if number is not None and number < 1:
        return report.bad(item, "an integer of at least 1", code="E101")
    if number is None or number != int(number):
        return report.bad(item, "an integer of at least 1")
    return int(number)


def read_delay(report: Report, item: Item) -> int | _Bad:
    number = read_nonnegative(report, item)
    return BAD if isinstance(number, _Bad) else seconds_to_ms(number)


def read_truth(report: Report, item: Item) -> bool | _Bad:
    if is_nil(item):
        return False
    if symbol_of(item) in ("t", "true"):
        return True
    return report.bad(item, "t or nil")


def choice(values: type[E]) -> Callable[[Report, Item], E | _Bad]:
    """Return the reader of a keyword that is one of an enumeration."""
    table = {str(v): v for v in values}
    needed = " or ".join(f":{name}" for name in table)

    def read(report: Report, item: Item) -> E | _Bad:
        if isinstance(item, Atom) and item.kind is Kind.KEYWORD and item.value in table:
            return table[str(item.value)]
        return report.bad(item, needed)

    return read


# --- lists ----------------------------------------------------------------------


def items_of(report: Report, item: Item, needed: str, hint: str = "") -> list[Item]:
    """Return the entries of a list field; `nil` has none, an atom is reported and has none."""
    if isinstance(item, Form):
        return item
    if not is_nil(item):
        report.bad(item, needed, hint=hint)
    return []


def _named_number(report: Report, item: Item, needed: str) -> Amount | None:
    if isinstance(item, Form) and len(item) == 2:
        name, number = symbol_of(item[0]), number_of(item[1])
        if name is not None and number is not None:
            return Amount(name, number, report.source(item))
    report.bad(item, needed)
    return None


def read_uses(report: Report, item: Item) -> tuple[Amount, ...]:
    entries = []
    for entry in items_of(report, item, "a list of resources"):
        name = symbol_of(entry)
        if name is not None:
            entries.append(Amount(name, 1, report.source(entry)))
        elif amount := _named_number(report, entry, "entries of the form arm or (power 20)"):
            entries.append(amount)
    return tuple(entries)


def read_requires(report: Report, item: Item) -> tuple[Amount, ...]:
    needed = "entries of the form (energy 5000)"
    found = (_named_number(report, e, needed) for e in items_of(report, item, f"a list of {needed}"))
    return tuple(a for a in found if a is not None)


def read_budgets(report: Report, item: Item) -> tuple[Amount, ...]:
    needed = "entries of the form (time 14400)"
    found = (_named_number(report, e, needed) for e in items_of(report, item, f"a list of {needed}"))
    return tuple(a for a in found if a is not None)


def read_expectations(report: Report, item: Item) -> tuple[Expectation, ...]:
    needed = "entries of the form (time 60 5)"
    entries = []
    for entry in items_of(report, item, f"a list of {needed}"):
        if isinstance(entry, Form) and len(entry) == 3:
            name, mean, spread = symbol_of(entry[0]), number_of(entry[1]), number_of(entry[2])
            if name is not None and mean is not None and spread is not None:
                entries.append(Expectation(name, mean, spread, report.source(entry)))
                continue
        report.bad(entry, needed, code="E082")
    return tuple(entries)


def read_parameters(report: Report, item: Item) -> Mapping[str, Value]:
    values: dict[str, Value] = {}
    entries = items_of(report, item, "a list of name = value")
    at = 0
    while at < len(entries):
        head = entries[at]
        name = symbol_of(head)
        equals = entries[at + 1] if at + 1 < len(entries) else None
        if name is None or not (
            isinstance(equals, Atom) and equals.value == "=" and equals.kind is Kind.OPERATOR
        ):
            report.bad(head, "entries of the form name = value")
            at += 1
            while at < len(entries) and not _begins_parameter(entries, at):
                at += 1
            continue
        value = value_of(entries[at + 2]) if at + 2 < len(entries) else None
        if value is None:
            where = entries[at + 2] if at + 2 < len(entries) else head
            report.bad(where, f"a number, string, symbol or keyword as the value of {name}")
        elif name in values:
            report.add("E014", f'":{report.field}" gives {name} twice', head)
        else:
            values[name] = value
        at += 3
    return values


def _begins_parameter(entries: list[Item], at: int) -> bool:
    if at + 1 >= len(entries) or symbol_of(entries[at]) is None:
        return False
    following = entries[at + 1]
    return isinstance(following, Atom) and following.kind is Kind.OPERATOR and following.value == "="


def read_utility(report: Report, item: Item) -> Utility | _Bad:
    number = number_of(item)
    if number is not None:
        return number
    if isinstance(item, Atom):
        if is_nil(item):
            return report.bad(item, "a number or a table with at least one point", code="E070")
        return report.bad(item, "a number or a table ((time utility) ...)", hint=_number_hint(item))
    if not item:
        return report.bad(item, "a number or a table with at least one point", code="E070")
    points = []
    for entry in item:
        pair = [number_of(e) for e in entry] if isinstance(entry, Form) else []
        if len(pair) != 2 or pair[0] is None or pair[1] is None:
            return report.bad(entry, "a number or a table ((time utility) ...)")
        points.append((seconds_to_ms(pair[0]), pair[1]))
    return UtilityTable(tuple(points), report.source(item))


# --- time -----------------------------------------------------------------------


def _bound(item: Item) -> float | None:
    if isinstance(item, Atom):
        if item.kind is Kind.NUMBER:
            assert not isinstance(item.value, str)
            return item.value
        if item.kind is Kind.KEYWORD:
            if item.value == "plus-infinity":
                return math.inf
            if item.value == "minus-infinity":
                return -math.inf
    return None


def interval_of(report: Report, item: Item) -> Interval | None:
    """Return the interval an item denotes; None, after a report, if it denotes none."""
    if isinstance(item, Form) and len(item) == 2:
        lo, hi = _bound(item[0]), _bound(item[1])
        if lo is not None and hi is not None:
            if lo >= UNBOUNDED_S or hi <= -UNBOUNDED_S:
                report.add("E030", f'":{report.field}" has the empty interval {report.show(item)}', item)
                return None
            return bounds(lo, hi)
    report.bad(item, "an interval (lo hi)", hint="a bound is a number, :plus-infinity or :minus-infinity")
    return None


def read_interval(report: Report, item: Item) -> Interval | _Bad:
    interval = interval_of(report, item)
    return BAD if interval is None else interval


_POINTS = {"start": Point.START, "end": Point.END}


def read_temporals(report: Report, item: Item) -> tuple[Temporal, ...]:
    needed = "a list of temporal conditions"
    hint = "a condition is (lo hi), (node start (lo hi)), (node end (lo hi)) or (:relative (lo hi))"
    entries = items_of(report, item, needed, hint)
    if len(entries) == 2 and _bound(entries[0]) is not None and _bound(entries[1]) is not None:
        report.bad(item, needed, hint=f"one more pair of parentheses: ({report.show(item)[1:-1]})")
        return ()
    found: list[Temporal] = []
    for entry in entries:
        if isinstance(entry, Form) and entry:
            head = entry[0]
            if len(entry) == 2 and isinstance(entry[1], Form):
                if isinstance(head, Atom) and head.kind is Kind.KEYWORD and head.value == "relative":
                    if (interval := interval_of(report, entry[1])) is not None:
                        found.append(Relative(interval, report.source(entry)))
                    continue
            elif len(entry) == 2:
                if (interval := interval_of(report, entry)) is not None:
                    found.append(Absolute(interval, report.source(entry)))
                continue
            elif len(entry) == 3:
                node = symbol_of(head)
                point = _POINTS.get(symbol_of(entry[1]) or "")
                if node is not None and point is not None:
                    if (interval := interval_of(report, entry[2])) is not None:
                        found.append(Reference(node, point, interval, report.source(entry)))
                    continue
        report.bad(entry, "a temporal condition", hint=hint)
    return tuple(found)


# --- conditions -----------------------------------------------------------------

_OPERATORS = {str(o): o for o in Operator}
_ORDERING = frozenset({Operator.LT, Operator.LE, Operator.GT, Operator.GE})
_CONDITION_HINT = "for example (database (:battery-energy >= 20000)) or (not (known (:range Rock1)))"


def read_conditions(report: Report, item: Item) -> Conditions:
    entries = items_of(report, item, "a list of conditions", _CONDITION_HINT)
    if entries and symbol_of(entries[0]) in ("database", "known", "and", "or", "not"):
        report.bad(item, "a list of conditions", code="E040", hint="one more pair of parentheses")
        return ()
    found = (condition_of(report, entry, 1) for entry in entries)
    return tuple(c for c in found if c is not None)


def condition_of(report: Report, item: Item, depth: int) -> Condition | None:
    """Return the condition an item denotes; None, after a report, if it denotes none."""
    head = symbol_of(item[0]) if isinstance(item, Form) and item else None
    if head is None:
        report.bad(item, "a condition", code="E040", hint=_CONDITION_HINT)
        return None
    assert isinstance(item, Form)
    if depth > MAX_DEPTH:
        report.add("E090", f'conditions of ":{report.field}" are nested deeper than {MAX_DEPTH}', item)
        return None
    source = report.source(item)
    if head in ("and", "or"):
        parts = [condition_of(report, part, depth + 1) for part in item[1:]]
        good = tuple(p for p in parts if p is not None)
        return And(good, source) if head == "and" else Or(good, source)
    if head == "not":
        if len(item) != 2:
            report.bad(item, "one condition after not", code="E040")
            return None
        part = condition_of(report, item[1], depth + 1)
        return None if part is None else Not(part, source)
    if head in ("database", "known"):
        return _lookup(report, item, head, source)
    report.bad(item, "a condition", code="E040", hint=f"{head!r} is none of database, known, and, or, not")
    return None


def _lookup(report: Report, item: Form, head: str, source: Source | None) -> Condition | None:
    inner = item[1] if len(item) == 2 else None
    form = "(database (:key = value))" if head == "database" else "(known (:key))"
    if not isinstance(inner, Form) or not inner:
        report.bad(item, f"the form {form}", code="E040")
        return None
    key = inner[0]
    if not (isinstance(key, Atom) and key.kind is Kind.KEYWORD):
        report.bad(key, "a key that is a keyword", code="E040", hint=f"the form is {form}")
        return None
    rest = inner[1:] if head == "known" else inner[1:-2]
    arguments: list[str | float] = []
    for argument in rest:
        if not isinstance(argument, Atom) or argument.kind in (Kind.KEYWORD, Kind.OPERATOR):
            report.bad(argument, f"arguments of {head} that are symbols, strings or numbers", code="E040")
            return None
        if argument.kind is Kind.NUMBER and number_of(argument) is None:
            report.bad(argument, "a finite number", code="E040")
            return None
        arguments.append(argument.value)
    name = str(key.value)
    if head == "known":
        return Known(name, tuple(arguments), source)
    sign = inner[-2] if len(inner) >= 3 else None
    operator = (
        _OPERATORS.get(str(sign.value)) if isinstance(sign, Atom) and sign.kind is Kind.OPERATOR else None
    )
    if operator is None:
        report.bad(inner, f"the form {form}", code="E040", hint="the operators are = /= < <= > >=")
        return None
    value = value_of(inner[-1])
    if value is None:
        report.bad(inner[-1], "a value to compare with", code="E040")
        return None
    if operator in _ORDERING and isinstance(value, (str, bool)):
        report.bad(
            inner[-1],
            f"a number after {operator}",
            code="E041",
            hint="only numbers have an order; use = or /=",
        )
        return None
    return Comparison(name, tuple(arguments), operator, value, source)


# --- resources ------------------------------------------------------------------


def read_resources(report: Report, item: Item) -> tuple[Resource, ...]:
    found = (_resource(report, entry) for entry in items_of(report, item, "a list of resources"))
    return tuple(r for r in found if r is not None)


def _resource(report: Report, item: Item) -> Resource | None:
    name = symbol_of(item[0]) if isinstance(item, Form) and item else None
    if name is not None and isinstance(item, Form):
        words = [str(a.value) if isinstance(a, Atom) and a.kind is Kind.KEYWORD else None for a in item]
        source = report.source(item)
        if words[1:] == ["unit"]:
            return UnitResource(name, source)
        if len(item) == 3 and words[1] == "capacity":
            capacity = number_of(item[2])
            if capacity is not None and capacity >= 0:
                return CapacityResource(name, capacity, source)
        if len(item) in (4, 6) and words[1] == "consumable":
            pairs = {words[i]: item[i + 1] for i in range(2, len(item), 2)}
            key = pairs.get("key")
            floor = number_of(pairs["floor"]) if "floor" in pairs else 0
            if (
                isinstance(key, Atom)
                and key.kind is Kind.KEYWORD
                and floor is not None
                and set(pairs) <= {"key", "floor"}
                and len(pairs) * 2 == len(item) - 2
            ):
                return ConsumableResource(name, str(key.value), floor, source)
    report.bad(
        item,
        "a resource",
        hint="(arm :unit), (power :capacity 120) or (energy :consumable :key :battery-energy :floor 20000)",
    )
    return None
