"""Which runs count as the failure asked for: `end_s > 12600`, `failed observe-R4`, joined by `and`."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from ground.campaigns.row import Row
from ground.errors import InvalidInputError

_AMOUNT = re.compile(r"(utility|end_s|energy_used_j)\s*(<=|>=|<|>)\s*([-+0-9.eE]+)")
_WORD = re.compile(r"(failed|lost|outcome|over|option)\s+(\S+)")

_READ: dict[str, Callable[[Row], float]] = {
    "utility": lambda row: row.utility,
    "end_s": lambda row: row.end_s,
    "energy_used_j": lambda row: row.energy_used_j,
}


@dataclass(frozen=True, slots=True)
class Term:
    """One part of an event. `progress` is 1 where it holds, else less, and more the nearer a run came."""

    text: str
    holds: Callable[[Row], bool]
    progress: Callable[[Row], float]


@dataclass(frozen=True, slots=True)
class RareEvent:
    """A conjunction of terms."""

    text: str
    terms: tuple[Term, ...]

    def holds(self, row: Row) -> bool:
        """Return whether a run is one of those asked for."""
        return all(term.holds(row) for term in self.terms)

    def score(self, row: Row) -> float:
        """Return how near a run came: the number of terms where it holds."""
        return sum(1.0 if term.holds(row) else term.progress(row) for term in self.terms)


def read_event(text: str, known: Mapping[str, Sequence[str]]) -> RareEvent:
    """Return the event that a text describes; `known` are the names that may follow a word.

    Terms are `utility`, `end_s` or `energy_used_j` with `<`, `<=`, `>`, `>=` and a number; `failed NODE`;
    `lost TARGET`; `over BUDGET`; `option ID`; `outcome WORD`.

    Raises
    ------
    InvalidInputError
        If a term cannot be read, or names something that the plan or the world does not have.
    """
    terms = tuple(_term(part.strip(), known) for part in re.split(r"\s+and\s+", text.strip()))
    return RareEvent(" and ".join(t.text for t in terms), terms)


def _term(text: str, known: Mapping[str, Sequence[str]]) -> Term:
    if match := _AMOUNT.fullmatch(text):
        return _amount(*match.groups())
    match = _WORD.fullmatch(text)
    if match is None:
        raise InvalidInputError(
            f'event "{text}": a term is utility, end_s or energy_used_j with <, <=, > or >= and a number, or '
            "failed NODE, lost TARGET, over BUDGET, option ID, outcome WORD"
        )
    word, name = match.groups()
    names = known.get(word, ())
    if name not in names:
        listed = ", ".join(names[:12]) or "none"
        raise InvalidInputError(f'event "{text}": there is no {word} {name}; known are {listed}')
    return Term(text, _word(word, name), lambda _row: 0.0)


def _word(word: str, name: str) -> Callable[[Row], bool]:
    match word:
        case "failed":
            return lambda row: name in row.reasons
        case "lost":
            return lambda row: name in row.lost
        case "over":
            return lambda row: name in row.exceeded
        case "option":
            return lambda row: name in row.options
        case _:
            return lambda row: row.outcome == name


def _amount(name: str, operator: str, limit_text: str) -> Term:
    try:
        limit = float(limit_text)
    except ValueError as err:
        raise InvalidInputError(f'event: "{limit_text}" is not a number') from err
    if not math.isfinite(limit):
        raise InvalidInputError(f"event: the limit {limit_text} is not finite")
    read, scale = _READ[name], max(1.0, abs(limit))
    tests: dict[str, Callable[[float], bool]] = {
        "<": lambda x: x < limit,
        "<=": lambda x: x <= limit,
        ">": lambda x: x > limit,
        ">=": lambda x: x >= limit,
    }
    holds = tests[operator]
    return Term(
        f"{name} {operator} {limit:g}",
        lambda row: holds(read(row)),
        lambda row: 1.0 / (1.0 + abs(read(row) - limit) / scale),
    )
