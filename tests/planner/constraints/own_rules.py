"""Constraints as a package of somebody else's would bring them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Self

from mission import Constraint, Sky, Tracked, Window
from mission.values import NotNegative, value
from planner.constraints.rule import Columns, Obstacle, Reads, Rule, Stated
from planner.problem import Observation, Problem


@value
class Thawed(Constraint):
    """The instrument has thawed `after_s` seconds into the plan."""

    after_s: NotNegative
    kind: Literal["thawed"] = "thawed"


@dataclass(frozen=True)
class Thawing(Rule):
    """No start before an instrument has thawed; written into the references of an observation."""

    name = "thawed"
    opens_s: tuple[tuple[int, float], ...]

    @classmethod
    def state(cls, value: Constraint, stated: Stated, sky: Sky, day_s: float) -> None:
        assert isinstance(value, Thawed)
        stated.refs["thawed-s"] = f"{value.after_s:g}"

    @classmethod
    def of(cls, problem: Problem) -> Self | None:
        marked = ((m, o.refs.get("thawed-s")) for m, o in enumerate(problem.observations))
        found = tuple((m, float(text)) for m, text in marked if text is not None)
        return cls(found) if found else None

    def propagate(self, columns: Columns) -> None:
        for m, opens_s in self.opens_s:
            columns.window[m, 0] = max(columns.window[m, 0], opens_s)

    def explain(self, problem: Problem, what: Observation) -> Obstacle | None:
        thawed_s = float(what.refs.get("thawed-s", 0.0))
        if thawed_s < problem.budget.time_s:
            return None
        return Obstacle("thaw", f"{what.instrument} is frozen until {thawed_s:g} s")


@dataclass(frozen=True)
class OneSample(Rule):
    """At most one of the observations that take a sample: there is one cup."""

    name = "one_sample"
    samples: int

    @classmethod
    def of(cls, problem: Problem) -> Self | None:
        samples = sum(1 << m for m, o in enumerate(problem.observations) if "sample" in o.refs)
        return cls(samples) if samples.bit_count() > 1 else None

    def admits(self, on: Reads, made: int) -> bool:
        return (made & self.samples).bit_count() <= 1

    def counted(self, on: Reads) -> int:
        return self.samples

    def side_limit(self) -> tuple[str, tuple[int, ...], int] | None:
        amounts = tuple((self.samples >> m) & 1 for m in range(self.samples.bit_length()))
        return "samples", amounts, 1


@dataclass(frozen=True)
class Watching(Rule):
    """Observations marked so need their target tracked."""

    name = "watched"
    marked: tuple[int, ...]

    @classmethod
    def of(cls, problem: Problem) -> Self | None:
        found = tuple(m for m, o in enumerate(problem.observations) if "watched" in o.refs)
        return cls(found) if found else None

    def propagate(self, columns: Columns) -> None:
        columns.is_place[list(self.marked)] = True


@dataclass(frozen=True)
class Dusk(Rule):
    """Observations marked so may not start later than they say."""

    name = "dusk"
    closes_s: tuple[tuple[int, float], ...]

    @classmethod
    def of(cls, problem: Problem) -> Self | None:
        marked = ((m, o.refs.get("dusk-s")) for m, o in enumerate(problem.observations))
        found = tuple((m, float(text)) for m, text in marked if text is not None)
        return cls(found) if found else None

    def propagate(self, columns: Columns) -> None:
        for m, closes_s in self.closes_s:
            columns.window[m, 1] = min(columns.window[m, 1], closes_s)


@value
class Early(Constraint):
    """In the first hour: comes to a constraint of a kind that has no rule either."""

    kind: Literal["early"] = "early"

    def reduced(self, sky: Sky, day_s: float) -> tuple[Constraint, ...]:
        return (Within(3600.0), Tracked())


@value
class Within(Constraint):
    """Before a time."""

    before_s: float
    kind: Literal["dusk"] = "dusk"

    def reduced(self, sky: Sky, day_s: float) -> tuple[Constraint, ...]:
        return (Window(0.0, self.before_s),)


@value
class Unheard(Constraint):
    """No rule knows it, and it comes to itself."""

    kind: Literal["unheard"] = "unheard"
