"""What planning answers with, and what it tells on the way."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from planner.evaluate.monte_carlo import Estimate
from planner.plan_tree import Plan, PlanTree


class PlanStatus(StrEnum):
    """How planning ended. `EMPTY` is a plan that does nothing, because nothing fits or nothing is
    worth it.
    """

    PLANNED = "planned"
    EMPTY = "empty"
    INFEASIBLE = "infeasible"
    TIMEOUT = "timeout"


@dataclass(frozen=True, slots=True)
class Progress:
    """Where planning stands: `fraction` in [0, 1], the value of the best plan so far and the bound if
    known.
    """

    fraction: float
    phase: str
    value: float | None = None
    upper: float | None = None
    branches: int = 0
    plan: Plan | None = None


@dataclass(frozen=True, eq=False)
class PlanResult:
    """The answer. `lower <= value of the plan <= upper`, and no policy whatever earns more than `upper`.

    `lower` is the Monte Carlo mean less its 99 % error; `expected_utility` is the sampling-free value.
    `curve[k]` is the value of the best plan found with at most k branches. `reasons` say why a plan is
    empty or there is none. `searched` is the share of the search that was done (1: nothing was cut short),
    `work_s` the seconds of a processor that all took, as they are reckoned; `wall_s` is what the clock says.
    """

    status: PlanStatus
    tree: PlanTree
    strategy: str
    expected_utility: float = 0.0
    check: Estimate | None = None
    lower: float = 0.0
    upper: float = 0.0
    optimum_estimate: float | None = None
    curve: tuple[float, ...] = ()
    evaluator: str = "grid"
    searched: float = 1.0
    work_s: float = 0.0
    wall_s: float = 0.0
    first_plan_s: float = 0.0
    seed: int = 0
    reasons: tuple[str, ...] = ()
    regret_left: float | None = None

    @property
    def branches(self) -> int:
        return self.tree.branches
