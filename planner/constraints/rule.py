"""What a constraint of the planning problem says to each part of the planner."""

from __future__ import annotations

from collections.abc import Set
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from mission import Constraint, MissionError, Sky
from planner.problem import Observation, ObservationId, Problem, TargetId

if TYPE_CHECKING:
    from executive.crl.values import Condition

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Truths = NDArray[np.bool_]
Span = tuple[float, float]

MAX_BITS = 60
"""Targets and observations are kept as bits of one integer; larger problems are reduced first."""


@dataclass(eq=False)
class Columns:
    """What the rules of a problem come to, over its m observations: all that kernels and tables read.

    `predecessors` are bits of observations that must be done before; a problem of more than 60 holds none.
    """

    window: Floats  # (m, 2) first and last start, seconds
    is_place: Truths  # (m,) needs its target tracked
    predecessors: Ints  # (m,)
    must_do: Truths  # (m,)
    data_mbit: Floats  # (m,)
    data_limit_mbit: float = np.inf

    @classmethod
    def free(cls, m: int) -> Columns:
        """Return the columns of m observations that nothing constrains."""
        return cls(
            window=np.tile([-np.inf, np.inf], (m, 1)),
            is_place=np.zeros(m, bool),
            predecessors=np.zeros(m, np.int64),
            must_do=np.zeros(m, bool),
            data_mbit=np.zeros(m),
        )

    def settle(self) -> None:
        """Let observations that may start at no time have no window: it closed, or two exclude each other."""
        opens_s, closes_s = self.window.T
        self.window[(opens_s > closes_s) | (closes_s < 0.0)] = -np.inf

    def precede(self, first: int, second: int) -> None:
        """Let observation `second` be made only after `first`, as far as bits hold them."""
        if len(self.predecessors) <= MAX_BITS:
            self.predecessors[second] |= 1 << first


class Reads(Protocol):
    """Columns as they are read: those of a model."""

    @property
    def window(self) -> Floats: ...
    @property
    def is_place(self) -> Truths: ...
    @property
    def predecessors(self) -> Ints: ...
    @property
    def data_mbit(self) -> Floats: ...
    @property
    def data_limit_mbit(self) -> float: ...


@dataclass(eq=False)
class Chances:
    """Limits on the chances y (m,) that observations are made, kept by every policy in the mean."""

    survival: Floats
    """(m,) chance that the track of its target lives until the best arrival."""
    most: Floats
    """(m,) largest chance of each."""
    rows: list[tuple[Floats, float]] = field(default_factory=list)
    """(values, limit): values @ y is at most the limit."""


class Before(Protocol):
    """What may have happened before a point of the emitted plan."""

    @property
    def started(self) -> Set[TargetId]: ...
    def done(self, observation: ObservationId) -> Condition: ...


@dataclass(frozen=True, slots=True)
class Emission:
    """Conditions under which an observation may start, and the times between which it does."""

    guards: tuple[Condition, ...] = ()
    window_s: Span | None = None


@dataclass(frozen=True, slots=True)
class Obstacle:
    """What keeps an observation out of every plan: a word for the limit, and a sentence."""

    limit: str
    sentence: str


@dataclass(eq=False)
class Stated:
    """What the constraints on a request of a day come to."""

    tracked: bool = False
    must_do: bool = False
    after: tuple[str, ...] = ()
    spans: list[Span] = field(default_factory=list)
    """Windows that were given outright: it may start in any of them."""
    any_of: list[list[Span]] = field(default_factory=list)
    """Windows that other constraints come to: it may start in any of each group."""
    refs: dict[str, str] = field(default_factory=dict)
    """Travels with the observation: what a rule of one's own reads again from the problem."""

    def windows(self) -> tuple[Span, ...] | None:
        """Return the times at which it may start, in order; None is at any time.

        Raises
        ------
        MissionError
            If none is left.
        """
        groups = [self.spans, *self.any_of] if self.spans else self.any_of
        if not groups:
            return None
        allowed, *others = (sorted(group) for group in groups)
        for group in others:
            allowed = [(max(a, c), min(b, d)) for a, b in allowed for c, d in group if max(a, c) <= min(b, d)]
        if not allowed:
            raise MissionError("its time constraints leave no time in common")
        return tuple(allowed)


class Rule:
    """One constraint of the planning problem.

    It is made from the problem (`of`) and comes to columns (`propagate`), which every table, kernel and
    engine reads; so a rule of one's own that narrows windows, asks for a track or for what goes before is
    kept, bounded and emitted by the product's own. The other methods say what it means elsewhere; `feasible`
    and `admits` must agree with the columns.
    """

    name: ClassVar[str]

    @classmethod
    def state(cls, value: Constraint, stated: Stated, sky: Sky, day_s: float) -> None:
        """Add what a constraint on a request of a day of `day_s` seconds comes to.

        A rule that does not say it leaves a kind of its name to the constraint's own `reduced`.
        """

    @classmethod
    def states(cls) -> bool:
        """Return whether the rule says what a constraint of its name comes to."""
        return cls.state.__func__ is not Rule.state.__func__  # type: ignore[attr-defined]

    @classmethod
    def of(cls, problem: Problem) -> Self | None:
        """Return the rule as the problem states it; None where it does not."""
        del problem
        return None

    def propagate(self, columns: Columns) -> None:
        """Write into the columns what the rule comes to."""

    def feasible(self, on: Reads, m: int, done: int, tracked: bool) -> bool:
        """Return whether observation m may begin after those `done` (bits), its time aside."""
        del on, m, done, tracked
        return True

    def admits(self, on: Reads, made: int) -> bool:
        """Return whether one path through a plan may make all these observations (bits)."""
        del on, made
        return True

    def counted(self, on: Reads) -> int:
        """Return the observations (bits) that `admits` looks at."""
        return (1 << len(on.is_place)) - 1

    def side_limit(self) -> tuple[str, tuple[int, ...], int] | None:
        """Return what goal selection keeps to: a name, what each observation takes of it, and how much there
        is, in whole units; None where all observations together keep to it.
        """
        return None

    def relax(self, on: Reads, chances: Chances) -> None:
        """Write what it means in the mean, for bounds over every policy."""

    def emit(self, on: Reads, m: int, what: Observation, before: Before) -> Emission:
        """Return what CRL asks before `what`, the m-th observation."""
        del on, m, what, before
        return Emission()

    def explain(self, problem: Problem, what: Observation) -> Obstacle | None:
        """Return why no plan whatever makes an observation, as far as this rule tells."""
        del problem, what
        return None
