"""What planning tells on the way, and when it has to end."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

from planner.plan_result import Progress
from planner.plan_tree import Plan, count_branches


@dataclass(eq=False)
class Watch:
    """The clock of one planning, and the best plan that it has told of.

    `limit_s` is wall time; where `deterministic`, only `cancelled` stops.
    """

    limit_s: float
    deterministic: bool
    cancelled: Callable[[], bool]
    report: Callable[[Progress], None]
    began: float = field(default_factory=time.monotonic)
    best_value: float = 0.0
    first_plan_s: float = 0.0

    def elapsed_s(self) -> float:
        return time.monotonic() - self.began

    def stop(self, share: float = 1.0) -> bool:
        """Return whether to stop; `share` of the time limit is what this part of the work may use."""
        return self.cancelled() or (not self.deterministic and self.elapsed_s() > share * self.limit_s)

    def told(self, plan: Plan, value: float) -> None:
        """Take note of a better plan and pass it on."""
        if not self.first_plan_s:
            self.first_plan_s = self.elapsed_s()
        self.best_value = value
        fraction = min(0.9, 0.1 + 0.8 * self.elapsed_s() / self.limit_s)
        self.report(Progress(fraction, "branching", value, None, count_branches(plan), plan))
