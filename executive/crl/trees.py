"""Values of fields as trees of strings, the pieces of which any text of a plan is made."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TypeAlias

from executive.crl.lexer import is_symbol
from executive.crl.values import (
    Absolute,
    Amount,
    And,
    CapacityResource,
    Comparison,
    Condition,
    Expectation,
    Interval,
    Known,
    Not,
    Reference,
    Resource,
    Temporal,
    UnitResource,
    Utility,
    UtilityTable,
    Value,
)

Tree: TypeAlias = "str | list[Tree]"


def number_text(number: float) -> str:
    """Return the shortest decimal number that reads back as the same binary64 value.

    Written without exponent from 1e-6 up to below 1e21, as in RFC 8785.
    """
    if isinstance(number, int):
        if -(2**53) < number < 2**53:
            return str(number)
        number = float(number)
    if not math.isfinite(number):
        raise ValueError(f"{number} cannot be written in CRL")
    if number.is_integer() and abs(number) < 1e21:
        return str(int(number))
    mantissa, _, exponent = repr(number).partition("e")
    if not exponent:
        return mantissa
    power = int(exponent)
    if power == -5 or power == -6:
        sign = "-" if mantissa.startswith("-") else ""
        digits = mantissa.lstrip("-").replace(".", "")
        return f"{sign}0.{'0' * (-power - 1)}{digits}"
    return f"{mantissa.removesuffix('.0')}e{power:+d}"


def ms_text(t_ms: int) -> str:
    """Return a time in milliseconds as seconds."""
    seconds, rest = divmod(abs(t_ms), 1000)
    sign = "-" if t_ms < 0 else ""
    return f"{sign}{seconds}.{rest:03d}".rstrip("0") if rest else f"{sign}{seconds}"


def string_text(text: str) -> str:
    """Return a quoted string."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


def value_text(value: Value) -> str:
    """Return a value, as a symbol where it can be read as one."""
    if value is True:
        return "t"
    if value is False:
        return "nil"
    if isinstance(value, str):
        if is_symbol(value) and value not in ("t", "true", "nil"):
            return value
        return string_text(value)
    return number_text(value)


def resource_tree(resource: Resource) -> list[Tree]:
    """Return the declaration of a resource in pieces."""
    if isinstance(resource, UnitResource):
        return [resource.name, ":unit"]
    if isinstance(resource, CapacityResource):
        return [resource.name, ":capacity", number_text(resource.capacity)]
    out: list[Tree] = [resource.name, ":consumable", ":key", f":{resource.key}"]
    if resource.floor != 0:
        out += (":floor", number_text(resource.floor))
    return out


def amount_tree(amount: Amount) -> list[Tree]:
    """Return `(resource amount)` in pieces."""
    return [amount.resource, number_text(amount.amount)]


def use_tree(amount: Amount) -> Tree:
    """Return an entry of `:uses` in pieces."""
    return amount.resource if amount.amount == 1 else amount_tree(amount)


def expectation_tree(expectation: Expectation) -> list[Tree]:
    """Return `(name mean spread)` in pieces."""
    return [expectation.name, number_text(expectation.mean), number_text(expectation.spread)]


def interval_tree(interval: Interval) -> list[Tree]:
    """Return `(lo hi)` in pieces."""
    return [
        ":minus-infinity" if interval.lo_ms is None else ms_text(interval.lo_ms),
        ":plus-infinity" if interval.hi_ms is None else ms_text(interval.hi_ms),
    ]


def temporal_tree(temporal: Temporal) -> list[Tree]:
    """Return a temporal condition in pieces."""
    if isinstance(temporal, Absolute):
        return interval_tree(temporal.interval)
    if isinstance(temporal, Reference):
        return [temporal.node, temporal.point.value, interval_tree(temporal.interval)]
    return [":relative", interval_tree(temporal.interval)]


def _lookup(key: str, arguments: tuple[str | float, ...]) -> list[Tree]:
    out: list[Tree] = [f":{key}"]
    for argument in arguments:
        if isinstance(argument, str):
            out.append(argument if is_symbol(argument) else string_text(argument))
        else:
            out.append(number_text(argument))
    return out


def condition_tree(condition: Condition) -> list[Tree]:
    """Return a condition in pieces."""
    if isinstance(condition, Comparison):
        inner = _lookup(condition.key, condition.arguments)
        inner += (condition.operator.value, value_text(condition.value))
        return ["database", inner]
    if isinstance(condition, Known):
        return ["known", _lookup(condition.key, condition.arguments)]
    if isinstance(condition, Not):
        return ["not", condition_tree(condition.part)]
    head = "and" if isinstance(condition, And) else "or"
    return [head, *(condition_tree(part) for part in condition.parts)]


def utility_tree(utility: Utility) -> Tree:
    """Return a number or a table in pieces."""
    if isinstance(utility, UtilityTable):
        return [[ms_text(t), number_text(u)] for t, u in utility.points]
    return number_text(utility)


def parameters_tree(parameters: Mapping[str, Value]) -> list[Tree]:
    """Return `(name = value ...)` in pieces."""
    out: list[Tree] = []
    for key, value in parameters.items():
        out += (key, "=", value_text(value))
    return out
