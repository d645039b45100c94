"""Conditions as the engine asks them: compiled once, three-valued, with the keys and instants they depend on.

A guard answers True, False or None (UNKNOWN). `:time` is an ordinary key of the database (`time`, seconds);
what makes it special is that it changes without an event, so a guard lists the instants at which its
answer can change (CRL.md 3).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TypeGuard

from executive.ports import Value

Truth = bool | None
Test = Callable[[Mapping[str, Value]], Truth]

TIME_KEY = "time"


@dataclass(frozen=True, slots=True)
class Guard:
    """A conjunction of conditions: `ask(database)`, the keys it reads, its `:time` thresholds (seconds).

    While a key goes from one number to another, the answer can change only where one of the key's `limits`
    is passed or touched; None = wherever the key says something new.
    """

    ask: Test
    limits: Mapping[str, tuple[float, ...] | None]
    thresholds_s: tuple[float, ...] = ()

    def instants_ms(self) -> list[int]:
        """Return the milliseconds at which a comparison with `:time` may change its answer."""
        instants: set[int] = set()
        for threshold in self.thresholds_s:
            if not math.isfinite(threshold) or abs(threshold) > 1e12:
                continue
            nearest = round(threshold * 1000)
            if nearest / 1000 == threshold:
                instants.update((nearest, nearest + 1))
            else:
                instants.add(math.ceil(threshold * 1000))
        return sorted(instants)


def is_number(value: object) -> TypeGuard[int | float]:
    """Tell whether a database value counts as a number; truth values do not."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def equal(left: Value, right: Value) -> Truth:
    """Compare two values; values of different type are not comparable (UNKNOWN)."""
    if isinstance(left, bool) or isinstance(right, bool):
        if isinstance(left, bool) and isinstance(right, bool):
            return left is right
        return None
    if isinstance(left, str) or isinstance(right, str):
        if isinstance(left, str) and isinstance(right, str):
            return left == right
        return None
    return left == right


def comparison(key: str, operator: str, wanted: Value) -> Test:
    """Return the test `database[key] operator wanted`; an absent key is UNKNOWN."""
    if operator in ("=", "/="):
        negate = operator == "/="

        def same(database: Mapping[str, Value]) -> Truth:
            value = database.get(key)
            if value is None:
                return None
            answer = equal(value, wanted)
            if answer is None:
                return None
            return answer is not negate

        return same

    if isinstance(wanted, bool) or not isinstance(wanted, int | float):
        return lambda _: None
    limit = float(wanted)
    holds: Callable[[float], bool]
    if operator == "<":
        holds = limit.__gt__
    elif operator == "<=":
        holds = limit.__ge__
    elif operator == ">":
        holds = limit.__lt__
    elif operator == ">=":
        holds = limit.__le__
    else:
        raise ValueError(f"unknown operator {operator!r} in a condition on {key!r}")

    def ordered(database: Mapping[str, Value]) -> Truth:
        value = database.get(key)
        if isinstance(value, bool) or not isinstance(value, int | float):
            return None
        return holds(float(value))

    return ordered


def known(key: str) -> Test:
    """Return the test that a key is present; it is never UNKNOWN."""
    return lambda database: database.get(key) is not None


def all_of(tests: tuple[Test, ...]) -> Test:
    """Return the three-valued conjunction; without parts it is TRUE."""
    if len(tests) == 1:
        return tests[0]

    def conjunction(database: Mapping[str, Value]) -> Truth:
        answer: Truth = True
        for test in tests:
            part = test(database)
            if part is False:
                return False
            if part is None:
                answer = None
        return answer

    return conjunction


def any_of(tests: tuple[Test, ...]) -> Test:
    """Return the three-valued disjunction; without parts it is FALSE."""

    def disjunction(database: Mapping[str, Value]) -> Truth:
        answer: Truth = False
        for test in tests:
            part = test(database)
            if part is True:
                return True
            if part is None:
                answer = None
        return answer

    return disjunction


def negation(test: Test) -> Test:
    """Return the three-valued negation; UNKNOWN stays UNKNOWN."""

    def opposite(database: Mapping[str, Value]) -> Truth:
        part = test(database)
        return None if part is None else not part

    return opposite
