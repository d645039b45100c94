"""Small questions about conditions: can they be TRUE, does one set imply another, do options leave a gap.

Conditions are asked in three values over a finite table of cases: each key is absent, or has one of the
values it is compared with, or a value between or beside them. That decides every question about conditions
exactly as long as keys are independent of each other; the number of cases is bounded, and beyond the bound
the answer is "not decided" (None).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import product
from typing import Final

from executive.crl.trees import number_text
from executive.crl.values import And, Comparison, Condition, Conditions, Known, Not, Operator, Or, Value

MAX_CASES = 4_096

Truth = bool | None
Case = Mapping[str, Value | None]


Domains = Mapping[str, tuple[Value | None, ...]]
"""What the place of a node in the plan says of a key: the values it can have (None: not known)."""


OTHER: Final = "\x00another word"
OUTCOMES: tuple[Value | None, ...] = (None, "succeeded", "failed", "aborted", "skipped")


def database_key(key: str, arguments: Iterable[str | float]) -> str:
    """Return the spelling of a key: keyword without colon, arguments after blanks, numbers shortest."""
    words = [a if isinstance(a, str) else number_text(a) for a in arguments]
    return " ".join([key, *words]) if words else key


def evaluate(condition: Condition, lookup: Callable[[str], Value | None]) -> Truth:
    """Return TRUE, FALSE or UNKNOWN (None) of a condition over a database (None for an absent key)."""
    if isinstance(condition, Comparison):
        return compare(
            lookup(database_key(condition.key, condition.arguments)), condition.operator, condition.value
        )
    if isinstance(condition, Known):
        return lookup(database_key(condition.key, condition.arguments)) is not None
    if isinstance(condition, Not):
        inner = evaluate(condition.part, lookup)
        return None if inner is None else not inner
    decisive = isinstance(condition, Or)
    answer: Truth = not decisive
    for part in condition.parts:
        found = evaluate(part, lookup)
        if found is decisive:
            return decisive
        if found is None:
            answer = None
    return answer


def evaluate_all(conditions: Conditions, lookup: Callable[[str], Value | None]) -> Truth:
    """Return the truth of a conjunction; the empty one is TRUE."""
    return evaluate(And(conditions), lookup)


def compare(left: Value | None, operator: Operator, right: Value) -> Truth:
    """Return the truth of a comparison; UNKNOWN for an absent key, unlike types, or words in order."""
    if left is None:
        return None
    kinds = _kind(left), _kind(right)
    if operator is Operator.EQ or operator is Operator.NE:
        if kinds[0] != kinds[1]:
            return None
        return (left == right) is (operator is Operator.EQ)
    if kinds != ("number", "number"):
        return None
    assert not isinstance(left, str)
    assert not isinstance(right, str)
    match operator:
        case Operator.LT:
            return left < right
        case Operator.LE:
            return left <= right
        case Operator.GT:
            return left > right
        case _:
            return left >= right


def _kind(value: Value) -> str:
    if isinstance(value, bool):
        return "truth"
    return "word" if isinstance(value, str) else "number"


class Cases:
    """All cases that the given conditions can tell apart; of some keys the `domains` are known."""

    def __init__(self, conditions: Iterable[Condition], domains: Domains | None = None) -> None:
        self._values: dict[str, dict[Value, None]] = {}
        self._domains = domains or {}
        for condition in conditions:
            self._gather(condition)

    def _gather(self, condition: Condition) -> None:
        stack = [condition]
        while stack:
            top = stack.pop()
            if isinstance(top, Comparison):
                key = database_key(top.key, top.arguments)
                values = self._values.setdefault(key, {})
                # True == 1 as dictionary keys, so truths are kept apart by their own name.
                values[top.value if not isinstance(top.value, bool) else f"\x00{top.value}"] = None
            elif isinstance(top, Known):
                self._values.setdefault(database_key(top.key, top.arguments), {})
            elif isinstance(top, Not):
                stack.append(top.part)
            else:
                stack.extend(top.parts)

    def _domain(self, key: str) -> list[Value | None]:
        if key in self._domains:
            return list(self._domains[key])
        if key.startswith("outcome "):
            return list(OUTCOMES)
        given = list(self._values[key])
        numbers = sorted({v for v in given if not isinstance(v, str)})
        words = [v for v in given if isinstance(v, str) and not v.startswith("\x00")]
        truths = any(isinstance(v, str) and v.startswith("\x00") for v in given)
        domain: list[Value | None] = [] if key == "time" else [None]
        if numbers:
            domain += _around(numbers)
        if key == "time":
            return [v for v in domain if not isinstance(v, (str, type(None))) and v >= 0] or [0]
        if key.startswith("attempts "):
            domain = [v for v in domain if v is None or (not isinstance(v, str) and v >= 0)]
        if words:
            domain += [*words, OTHER]
        if truths:
            domain += [True, False]
        if not given:
            domain.append(OTHER)
        return domain

    def __iter__(self) -> Iterator[Case]:
        keys = list(self._values)
        for values in product(*(self._domain(key) for key in keys)):
            yield dict(zip(keys, values, strict=True))

    @property
    def count(self) -> int:
        count = 1
        for key in self._values:
            count *= len(self._domain(key))
        return count


def _around(numbers: list[float]) -> list[Value | None]:
    values: list[Value | None] = [numbers[0] - 1]
    for before, after in zip(numbers, [*numbers[1:], numbers[-1] + 2], strict=True):
        values += [before, (before + after) / 2]
    return values


def satisfiable(conditions: Conditions, domains: Domains | None = None, kept: Conditions = ()) -> bool | None:
    """Tell whether all conditions can be TRUE while none of the `kept` is FALSE; None if not decided."""

    def holds(case: Case) -> bool:
        return evaluate_all(conditions, case.get) is True and evaluate_all(kept, case.get) is not False

    return _some((*conditions, *kept), domains, holds) if conditions or kept else True


def implies(premise: Conditions, conclusion: Conditions) -> bool | None:
    """Tell whether the conclusion is TRUE whenever the premise is; None if that was not decided."""
    if not conclusion or set(conclusion) <= set(premise):
        return True

    def counterexample(case: Case) -> bool:
        return evaluate_all(premise, case.get) is True and evaluate_all(conclusion, case.get) is not True

    found = _some((*premise, *conclusion), None, counterexample)
    return None if found is None else not found


def gap(alternatives: Iterable[Conditions], domains: Domains | None = None) -> Case | bool | None:
    """Return a case in which no alternative is TRUE; False if there is none, None if undecided."""
    sets = list(alternatives)
    if any(not conditions for conditions in sets):
        return False
    cases = Cases([c for conditions in sets for c in conditions], domains)
    if cases.count > MAX_CASES:
        return None
    worst: Case | None = None
    for case in cases:
        if not any(evaluate_all(conditions, case.get) is True for conditions in sets):
            # A case with all keys known says more than one in which something is missing.
            if None not in case.values():
                return case
            worst = worst or case
    return False if worst is None else worst


def _some(conditions: Conditions, domains: Domains | None, wanted: Callable[[Case], bool]) -> bool | None:
    cases = Cases(conditions, domains)
    if cases.count > MAX_CASES:
        return None
    return any(wanted(case) for case in cases)


def describe(case: Case) -> str:
    """Return a case in words."""
    words = []
    for key, value in case.items():
        if value is None:
            words.append(f"{key} is unknown")
        elif value == OTHER:
            words.append(f"{key} is another word")
        elif isinstance(value, bool):
            words.append(f"{key} is {'t' if value else 'nil'}")
        else:
            words.append(f"{key} is {value if isinstance(value, str) else number_text(value)}")
    return " and ".join(words) if words else "always"
