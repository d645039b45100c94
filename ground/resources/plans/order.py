"""What the job that computes a plan is given."""

from __future__ import annotations

from typing import Any

from ground.day.worksite import Worksite, from_version_0
from mission import Day
from mission.codec import Codec
from mission.sol_timeline import SolNumber, SolSeries
from mission.values import NotNegative, value
from planner.changes import Changes


@value
class Search:
    """How the planner is to search; see `planner.solve.solve`."""

    strategy: str
    max_branches: int
    time_limit_s: NotNegative
    iterations: int | None
    seed: int


@value
class Ahead:
    """How many sols the plan looks ahead, and their battery and power; None for the day's budgets anew."""

    sols: SolNumber
    series: SolSeries | None = None


@value
class PlanWork:
    """A plan for a day at a worksite; with `what_if` for that day changed.

    With `ahead` the plan is for the first of several sols. The best plan so far is kept in the file `draft`,
    for whoever watches; without one it is not.
    """

    site: Worksite
    day: Day
    plan_id: str
    search: Search
    what_if: Changes | None = None
    draft: str = ""
    ahead: Ahead | None = None


def _from_version_0(payload: dict[str, Any]) -> dict[str, Any]:
    """Return the members of a job that version 0.1 left in a database."""
    order = payload["order"]
    return {
        **from_version_0(payload),
        "plan_id": payload["plan_id"],
        "search": {
            name: order[name] for name in ("strategy", "max_branches", "time_limit_s", "iterations", "seed")
        },
        "what_if": payload.get("what_if"),
    }


ORDERS = Codec(PlanWork, "plan-order/1", "order for a plan", upgrades={"": ("plan-order/1", _from_version_0)})
