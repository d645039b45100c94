"""Ending over a budget: what ends the run and what it costs, and how often a plan may."""

from __future__ import annotations

import math
from collections.abc import Set
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

from planner.problem import Budget, Problem

if TYPE_CHECKING:
    from executive.crl.values import Condition

CERTAIN = 2.326
"""Quantile of the normal distribution: a plan on the limit is taken once in a hundred times."""


@dataclass(frozen=True, slots=True)
class Overrun:
    """The first action that ends over a budget ends the run, earns nothing and costs the penalty."""

    budget: Budget
    penalty: float

    @classmethod
    def of(cls, problem: Problem) -> Self:
        return cls(problem.budget, problem.overrun_penalty)

    def keep(self) -> tuple[Condition, ...]:
        """Return the conditions under which the emitted plan goes on."""
        from executive.crl.values import Comparison, Operator

        return (
            Comparison("time", (), Operator.LE, plain(self.budget.time_s)),
            Comparison("energy-used", (), Operator.LE, plain(self.budget.usable_energy_j)),
        )


@dataclass(frozen=True, slots=True)
class OverrunChance:
    """The chance of an overrun is at most `allowed`.

    It is bought out with a multiplier on top of the problem's penalty (Everett 1963, theorem 1).
    """

    allowed: float

    @classmethod
    def of(cls, problem: Problem) -> Self | None:
        allowed = problem.max_overrun_probability
        return None if allowed is None else cls(allowed)

    def kept(self, share: float, futures: int) -> bool:
        """Return whether a share of overruns over so many futures keeps to it, with 99 % confidence."""
        error = math.sqrt(self.allowed * (1.0 - self.allowed) / futures)
        return share + CERTAIN * error <= self.allowed

    def why_none_does(self, must: Set[str]) -> str:
        """Return why there is no plan, where none found that does what it must keeps to it."""
        return (
            f"observation {', '.join(sorted(must))} must be done, but no plan found does that with a chance "
            f"of at most {self.allowed:g} to end over a budget"
        )

    def bound(self, priced: float, price: float) -> float:
        """Return a bound on what keeps to it from one on everything, with overruns at a multiplier."""
        return priced + price * self.allowed


def plain(value: float) -> float:
    """Return a number as CRL writes it: whole ones without a point."""
    return int(value) if float(value).is_integer() and abs(value) < 1e15 else float(value)
