"""What planning tells on the way, and when it has to end."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

from planner.plan_result import Progress
from planner.plan_tree import Plan, count_branches
from planner.tally import Tally


@dataclass(eq=False)
class Watch:
    """The limit of one planning, and the best plan that it has told of.

    `limit_s` are seconds of one processor as `tally` reckons them, infinite where a search counts its own
    steps. What the clock says is told, and decides nothing.
    """

    limit_s: float
    tally: Tally
    report: Callable[[Progress], None]
    began: float = field(default_factory=time.monotonic)
    begun_s: float = 0.0
    best_value: float = 0.0
    best_plan: Plan = ()
    first_plan_s: float = 0.0

    def elapsed_s(self) -> float:
        """Return the seconds that went by on the clock."""
        return time.monotonic() - self.began

    def work_s(self) -> float:
        """Return the seconds of a processor that were used, as they are reckoned."""
        return self.tally.seconds - self.begun_s

    def left_s(self) -> float:
        """Return the seconds of a processor that are left."""
        return self.limit_s - self.work_s()

    def stop(self, share: float = 1.0) -> bool:
        """Return whether a share of the limit is used up: what a part of the work may use."""
        return self.work_s() > share * self.limit_s

    def told(self, plan: Plan, value: float) -> None:
        """Take note of a better plan and pass it on."""
        if not self.first_plan_s:
            self.first_plan_s = self.elapsed_s()
        self.best_value, self.best_plan = value, plan
        fraction = min(0.9, 0.1 + 0.8 * self.work_s() / self.limit_s)
        self.report(Progress(fraction, "branching", value, None, count_branches(plan), plan))
