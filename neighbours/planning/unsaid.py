"""What of a planning problem PDDL and ANML cannot say, each with what the file holds in its place."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass

from planner.constraints.registry import columns_of
from planner.problem import Amount, Problem

SHOWN = 5
"""Names that are told in one line."""


@dataclass(frozen=True, slots=True)
class Unsaid:
    """A part of the problem that does not fit: where it stands, what it is, and what the file holds."""

    where: str
    what: str
    instead: str

    def __str__(self) -> str:
        return f"{self.where}: {self.what}; {self.instead}"


def unsaid_of(problem: Problem, goals: Collection[str], *, metric: bool) -> tuple[Unsaid, ...]:
    """Return what a file of this problem leaves out; `metric` tells whether it can state a metric."""
    return (
        *_chances(problem),
        *_values(problem, goals, metric=metric),
        *_rounding(problem),
        *_never(problem),
        *_about(problem),
    )


def amounts(problem: Problem) -> Iterator[tuple[str, Amount]]:
    """Yield all durations and energies with the names of what they belong to."""
    for o in problem.observations:
        yield f"observation {o.id}", o.time_s
        yield f"observation {o.id}", o.energy_j
    for leg in problem.legs:
        yield f"leg {leg.origin} -> {leg.to}", leg.time_s
        yield f"leg {leg.origin} -> {leg.to}", leg.energy_j


def some(names: Iterable[str]) -> str:
    """Return names as one line, each once and not more than a few."""
    known = tuple(dict.fromkeys(names))
    more = f" and {len(known) - SHOWN} more" if len(known) > SHOWN else ""
    return ", ".join(known[:SHOWN]) + more


def _chances(problem: Problem) -> Iterator[Unsaid]:
    uncertain = [name for name, amount in amounts(problem) if amount.sd > 0.0]
    if uncertain:
        yield Unsaid(some(uncertain), "uncertain times and energies", "the file has their means")
    tracked = {t.id for t in problem.targets if t.tracked_kind}
    losing = [
        f"leg {leg.origin} -> {leg.to}"
        for leg in problem.legs
        if any(p > 0.0 for target, p in leg.p_lose.items() if target in tracked)
    ]
    if losing:
        yield Unsaid(some(losing), "tracks may be lost on the way", "in the file none is lost")
    short = [f"leg {leg.origin} -> {leg.to}" for leg in problem.legs if leg.p_fail > 0.0]
    if short:
        yield Unsaid(some(short), "drives may fail", "in the file each arrives")
    kinds = [f"sol kind {kind.name}" for kind in problem.sol_kinds]
    if kinds:
        yield Unsaid(some(kinds), "the kind of sol is hidden", "the file has means over the kinds")
    if uncertain or losing or short or kinds:
        what = "a plan there is one sequence, without branches for what may go otherwise"
        yield Unsaid("problem", what, "the file asks for the sequence")
    if (uncertain or kinds) and problem.overrun_penalty > 0.0:
        what = f"the penalty of {problem.overrun_penalty:g} for an end over a budget"
        yield Unsaid("problem", what, "in the file the means must fit the budgets")
    if (uncertain or kinds) and problem.max_overrun_probability is not None:
        what = f"the limit of {problem.max_overrun_probability:g} on the chance of an end over a budget"
        yield Unsaid("problem", what, "in the file the means must fit the budgets")


def _values(problem: Problem, goals: Collection[str], *, metric: bool) -> Iterator[Unsaid]:
    optional = [o for o in problem.observations if not o.must_do and o.id not in goals]
    if optional and not metric:
        what = "observations that are worth something and may be left out"
        yield Unsaid(some(f"observation {o.id}" for o in optional), what, "their values stand in comments")
    failing = [f"observation {o.id}" for o in problem.observations if o.p_success < 1.0]
    if failing:
        yield Unsaid(some(failing), "may fail", "the file counts value times chance of success")
    fading = [f"target {t.id}" for t in problem.targets if t.diminishing < 1.0 and len(t.observations) > 1]
    if fading:
        yield Unsaid(some(fading), "further observations are worth less", "the file counts each in full")


def _rounding(problem: Problem) -> Iterator[Unsaid]:
    rough = [name for name, amount in amounts(problem) if not float(amount.mean).is_integer()]
    budget = problem.budget
    rest = (
        budget.time_s,
        budget.usable_energy_j,
        problem.hotel_w,
        problem.track_start_time_s,
        problem.track_start_energy_j,
        problem.track_overhead_s_per_leg,
    )
    if not all(float(number).is_integer() for number in rest):
        rough.append("problem")
    if rough:
        what = "amounts that are not whole seconds, joules or watts"
        yield Unsaid(some(rough), what, "rounded so that what fits in the file fits the day")


def _never(problem: Problem) -> Iterator[Unsaid]:
    _, columns = columns_of(problem)
    shut = [
        f"observation {o.id}"
        for o, (_, closes_s) in zip(problem.observations, columns.window, strict=True)
        if closes_s < 0.0
    ]
    if shut:
        yield Unsaid(some(shut), "may begin at no time of the day", "the file has no action for it")


def _about(problem: Problem) -> Iterator[Unsaid]:
    told = [f"observation {o.id}" for o in problem.observations if o.instrument or o.action or o.refs]
    told += [f"leg {leg.origin} -> {leg.to}" for leg in problem.legs if leg.route]
    if told:
        what = "instruments, actions, routes and references to the mission"
        yield Unsaid(some(told), what, "they do not bear on the choice and are not in the file")
