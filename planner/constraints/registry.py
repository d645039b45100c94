"""The rules of the planning problem by name: the product's own, and those of installed packages."""

from __future__ import annotations

from functools import cache

from mission import MissionError, PluginError, Request, Sky, Window
from mission.plugins import Registry
from planner.constraints.must_do import MustDo
from planner.constraints.overrun import Overrun, OverrunChance
from planner.constraints.precedence import Precedence
from planner.constraints.rule import Rule, Stated
from planner.constraints.track import Track
from planner.constraints.volume import Volume
from planner.constraints.window import StartWindow
from planner.errors import ProblemError
from planner.problem import Problem

GROUP = "outcrop.planner_constraints"
BUILT_IN: tuple[type[Rule], ...] = (Track, Precedence, StartWindow, MustDo, Volume, Overrun, OverrunChance)
"""In the order in which conditions are emitted."""

_OTHERS = Registry("planner constraint", GROUP, {})


@cache
def rule_types() -> dict[str, type[Rule]]:
    """Return all classes of rules by name, the product's own first.

    Raises
    ------
    ProblemError
        If one that a package announces cannot be imported or is no rule: a plan without it might break it.
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


def stated(request: Request, sky: Sky, day_s: float) -> Stated:
    """Return what the constraints on a request come to on a day of `day_s` seconds.

    A kind without a rule of its own says in `reduced` which others it comes to; so do those of packages.

    Raises
    ------
    MissionError
        If one can hold at no time, or all have none in common, naming the request.
    """
    found, kinds = Stated(), rule_types()
    try:
        for value in request.constraints:
            if value.kind in kinds:
                kinds[value.kind].state(value, found, sky, day_s)
                continue
            group = []
            for primitive in value.reduced(sky, day_s):
                if isinstance(primitive, Window):
                    group.append((primitive.opens_s, primitive.closes_s))
                else:
                    kinds[primitive.kind].state(primitive, found, sky, day_s)
            if group:
                found.any_of.append(group)
        found.windows()
    except MissionError as err:
        raise MissionError(f"observation request {request.id}: {err}") from err
    return found
