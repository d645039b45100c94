"""What the fields of a plan mean: one normal form, so that two spellings of one thing are equal.

Conditions are three-valued (CRL.md 3), and what is used here holds of them: `and` and `or` may be
reordered, nested and repeated, `not` goes inward, and `not <` is `>=` (both UNKNOWN where the key is absent
or no number).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Hashable, Iterable, Mapping
from itertools import pairwise
from typing import Any

from executive.crl.nodes import Option
from executive.crl.values import (
    Absolute,
    And,
    Comparison,
    Condition,
    Conditions,
    Expectation,
    Interval,
    Known,
    Not,
    Operator,
    Or,
    Reference,
    Relative,
    Spread,
    Temporal,
    UtilityTable,
    Value,
)

Meaning = Hashable
"""A value whose equality is equality of meaning."""

OPPOSITE: Mapping[Operator, Operator] = {
    Operator.EQ: Operator.NE,
    Operator.NE: Operator.EQ,
    Operator.LT: Operator.GE,
    Operator.GE: Operator.LT,
    Operator.LE: Operator.GT,
    Operator.GT: Operator.LE,
}
TEMPORAL_FIELDS = ("start_temporal_conditions", "end_temporal_conditions")


def scalar(value: object) -> Meaning:
    """Return a value apart from others of another type: the truth value t is not the number 1."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return (type(value).__name__, value if isinstance(value, Hashable) else repr(value))
    return ("number", float(value))


def condition_meaning(condition: Condition, negated: bool = False) -> Meaning:
    """Return the normal form of a condition: `not` at the leaves, parts of `and` and `or` as a set."""
    match condition:
        case Not(part=part):
            return condition_meaning(part, not negated)
        case And(parts=parts) | Or(parts=parts):
            word = "and" if isinstance(condition, And) is not negated else "or"
            return _joined(word, (condition_meaning(p, negated) for p in parts))
        case Comparison(key=key, arguments=arguments, operator=operator, value=value):
            held = OPPOSITE[operator] if negated else operator
            return ("compare", key, tuple(map(str, arguments)), str(held), scalar(value))
        case Known(key=key, arguments=arguments):
            return ("unknown" if negated else "known", key, tuple(map(str, arguments)))


def _joined(word: str, parts: Iterable[Meaning]) -> Meaning:
    flat: set[Meaning] = set()
    for part in parts:
        if isinstance(part, tuple) and part and part[0] == word:
            flat |= part[1]
        else:
            flat.add(part)
    return next(iter(flat)) if len(flat) == 1 else (word, frozenset(flat))


def conditions_meaning(conditions: Conditions) -> Meaning:
    """Return the normal form of a conjunction."""
    return _joined("and", map(condition_meaning, conditions))


def temporals_meaning(temporals: Iterable[Temporal]) -> Meaning:
    """Return the windows by what they are counted from; several from one point are intersected."""
    bounds: dict[tuple[str, str], tuple[float, float]] = {}
    for temporal in temporals:
        match temporal:
            case Absolute():
                origin = ("clock", "")
            case Relative():
                origin = ("relative", "")
            case Reference(node=node, point=point):
                origin = (f"node {node}", str(point))
        low, high = bounds.get(origin, (float("-inf"), float("inf")))
        lo, hi = _ends(temporal.interval)
        bounds[origin] = (max(low, lo), min(high, hi))
    limited = {o: b for o, b in bounds.items() if b != (float("-inf"), float("inf"))}
    return frozenset(limited.items())


def _ends(interval: Interval) -> tuple[float, float]:
    low = float("-inf") if interval.lo_ms is None else float(interval.lo_ms)
    return low, float("inf") if interval.hi_ms is None else float(interval.hi_ms)


def utility_meaning(utility: float | UtilityTable) -> Meaning:
    """Return a utility as its points without those on the line between their neighbours."""
    if not isinstance(utility, UtilityTable):
        return ((0, float(utility)),)
    points = [(t, float(u)) for t, u in utility.points]
    if len({u for _, u in points}) == 1:
        return ((0, points[0][1]),)
    kept = [points[0]]
    for (t, u), (after_t, after_u) in pairwise(points[1:]):
        before_t, before_u = kept[-1]
        if (u - before_u) * (after_t - before_t) != (after_u - before_u) * (t - before_t):
            kept.append((t, u))
    return (*kept, points[-1])


def expectations_meaning(expectations: Iterable[Expectation], spread: Spread) -> Meaning:
    """Return predictions with their spread as a standard deviation, to 12 digits: roots are rounded."""
    restated = expectations_in(expectations, spread, Spread.STDDEV)
    return frozenset((e.name, float(e.mean), float(f"{abs(e.spread):.12g}")) for e in restated)


def expectations_in(
    expectations: Iterable[Expectation], spread: Spread, wanted: Spread
) -> tuple[Expectation, ...]:
    """Return predictions that state their spread as `spread` with it stated as `wanted`."""
    if spread is wanted:
        return tuple(expectations)
    power = 0.5 if wanted is Spread.STDDEV else 2.0
    return tuple(dataclasses.replace(e, spread=abs(e.spread) ** power) for e in expectations)


def map_meaning(values: Mapping[str, Value]) -> frozenset[tuple[str, Meaning]]:
    """Return named values, in whatever order they stand."""
    return frozenset((name, scalar(value)) for name, value in values.items())


def members_meaning(members: Iterable[Any]) -> Meaning:
    """Return amounts or resources, in whatever order they stand, as often as each stands there."""
    return tuple(sorted(map(repr, map(_member, members))))


def _member(member: Any) -> Meaning:
    values = (getattr(member, f.name) for f in dataclasses.fields(member) if f.compare)
    return (type(member).__name__, *map(scalar, values))


_BY_NAME: Mapping[str, Callable[[Any], Meaning]] = {
    **dict.fromkeys(
        (
            "start_conditions",
            "wait_for_conditions",
            "maintain_conditions",
            "end_conditions",
            "eligible_conditions",
            "trigger_conditions",
        ),
        conditions_meaning,
    ),
    **dict.fromkeys(TEMPORAL_FIELDS, temporals_meaning),
    **dict.fromkeys(("uses", "requires", "budgets", "resources"), members_meaning),
    **dict.fromkeys(("parameters", "metadata"), map_meaning),
    "utility": utility_meaning,
    "probability": lambda p: None if not p else float(p),
}


def field_meaning(attribute: str, value: Any, spread: Spread) -> Meaning:
    """Return the normal form of a field's value, by the field's name in `executive.crl.nodes`."""
    if attribute == "expectations":
        return expectations_meaning(value, spread)
    found = _BY_NAME.get(attribute)
    return scalar(value) if found is None else found(value)


def order_matters(options: Iterable[Option]) -> bool:
    """Return whether the order of options may decide: of those with equal utility the first is taken."""
    levels = [None if isinstance(o.utility, UtilityTable) else float(o.utility) for o in options]
    return None in levels or len(set(levels)) < len(levels)
