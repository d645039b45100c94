"""The rules of the planning problem by name: the product's own, and those of installed packages."""

from __future__ import annotations

from functools import cache

from mission import Constraint, MissionError, PluginError, Request, Sky, Window
from mission.plugins import Registry
from planner.constraints.must_do import MustDo
from planner.constraints.precedence import Precedence
from planner.constraints.rule import Columns, Rule, Stated
from planner.constraints.track import Track
from planner.constraints.volume import Volume
from planner.constraints.window import StartWindow
from planner.errors import ProblemError
from planner.problem import Problem

GROUP = "outcrop.planner_constraints"
BUILT_IN: tuple[type[Rule], ...] = (Track, Precedence, StartWindow, MustDo, Volume)
"""In the order in which conditions are emitted."""

_OTHERS = Registry("planner constraint", GROUP, {})


@cache
def rule_types() -> dict[str, type[Rule]]:
    """Return all classes of rules by name, the product's own first.

    Raises
    ------
    ProblemError
        If one that a package announces cannot be imported or is not a rule: a plan without it might break it.
    """
    found = {kind.name: kind for kind in BUILT_IN}
    for name in _OTHERS:
        try:
            kind = _OTHERS.load(name)
        except PluginError as err:
            raise ProblemError(str(err)) from err
        if not (isinstance(kind, type) and issubclass(kind, Rule)):
            raise ProblemError(f'planner constraint "{name}" is {kind!r}; a class of planner Rule is needed')
        found[name] = kind
    return found


def rules_of(problem: Problem) -> tuple[Rule, ...]:
    """Return the rules that a problem states."""
    return tuple(rule for kind in rule_types().values() if (rule := kind.of(problem)) is not None)


def columns_of(problem: Problem) -> tuple[tuple[Rule, ...], Columns]:
    """Return the rules that a problem states, and what all of them together come to."""
    rules, columns = rules_of(problem), Columns.free(len(problem.observations))
    for rule in rules:
        rule.propagate(columns)
    columns.settle()
    return rules, columns


def stated(request: Request, sky: Sky, day_s: float) -> Stated:
    """Return what the constraints on a request come to on a day of `day_s` seconds.

    A kind without a rule that states it says in `reduced` which others it comes to, and these again.

    Raises
    ------
    MissionError
        If one can hold at no time, is of a kind that comes to none with a rule, or all have no time in
        common, naming the request.
    """
    found = Stated()
    try:
        for value in request.constraints:
            _state(value, found, sky, day_s, ())
        found.windows()
    except MissionError as err:
        raise MissionError(f"observation request {request.id}: {err}") from err
    return found


def _state(value: Constraint, found: Stated, sky: Sky, day_s: float, within: tuple[str, ...]) -> None:
    """Add what a constraint comes to; `within` are the kinds that came to it."""
    rule = rule_types().get(value.kind)
    if rule is not None and rule.states():
        rule.state(value, found, sky, day_s)
        return
    within = (*within, value.kind)
    group = []
    for part in value.reduced(sky, day_s):
        if isinstance(part, Window):
            group.append((part.opens_s, part.closes_s))
        elif part.kind in within:
            raise MissionError(
                f'constraint "{part.kind}" comes to no window and to no constraint that has a planner rule'
            )
        else:
            _state(part, found, sky, day_s, within)
    if group:
        found.any_of.append(group)
