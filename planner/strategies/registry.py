"""What a planning strategy promises, and the strategies by name.

A package adds one under the entry point group `outcrop.strategies`; `tests/planner/test_strategies.py` is
the suite that each has to pass.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from mission.errors import PluginError
from mission.plugins import Registry
from planner.errors import PlannerError
from planner.evaluate.grid import Grid
from planner.evaluate.model import Model
from planner.options import PlannerOptions
from planner.plan_tree import Plan
from planner.progress import Watch

if TYPE_CHECKING:
    from planner.contingency.policy import Policy

Curve = list[tuple[float, Plan]]
"""The best (value, plan) found with at most 0, 1, 2, ... branches."""


@dataclass(frozen=True, eq=False)
class Task:
    """What a strategy is asked for.

    Parameters
    ----------
    model, grid
        The problem as arrays, and the grid on which plans are valued.
    max_branches
        Most options in the whole tree.
    iterations
        Limit in the strategy's own steps, which does not depend on the machine; None is the clock alone.
    warm
        Plans to begin with, from an earlier solution of a similar problem.
    quick
        Whether somebody waits for the answer.
    """

    model: Model
    grid: Grid
    max_branches: int
    iterations: int | None
    warm: tuple[Plan, ...]
    quick: bool
    options: PlannerOptions
    watch: Watch


@dataclass(frozen=True, eq=False)
class Found:
    """The plans found, by number of branches, and the strategy's estimate of the optimum if it has one."""

    curve: Curve
    optimum: float | None = None
    done: float = 1.0
    """Share of the search that was done; 1 where it ended by itself."""
    lines: tuple[Plan, ...] = ()
    """Plans without branches that may be better to branch from than the first, the most promising first."""
    policy: Policy | None = None
    """The optimal policy that the plans were taken from, where it is known for every state."""


class Strategy(Protocol):
    """Search for contingent plans.

    An implementer promises: at least one entry, and entry k of the curve (the last one for any larger k)
    holds a plan of at most `task.max_branches` options whose every way fits the downlink volume; values rise
    along the curve; better plans are told to `task.watch` as they are found; it returns soon after
    `task.watch.stop()`; with `iterations` the same task gives the same plans.
    """

    def __call__(self, task: Task) -> Found: ...


STRATEGIES = Registry(
    "strategy",
    "outcrop.strategies",
    {
        "optimal": "planner.strategies.optimal:search",
        "pico2005": "planner.strategies.pico2005:search",
    },
)


def strategy_named(name: str) -> Callable[[Task], Found]:
    """Return the strategy of that name.

    Raises
    ------
    PlannerError
        If there is none, or its package cannot be imported; the message names it and what is known.
    """
    try:
        found = STRATEGIES.load(name)
    except PluginError as err:
        raise PlannerError(str(err)) from err
    if not callable(found):
        raise PlannerError(f'strategy "{name}" is {found!r}, which cannot be called')
    return found
