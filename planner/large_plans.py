"""Plans for problems that no table holds: checked on fresh futures, within the chance of an overrun."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from planner.constraints.overrun import OverrunChance
from planner.contingency.chance import keeps_to, plans_within
from planner.contingency.long_routes import plan_long
from planner.contingency.sampled.futures import Growth
from planner.evaluate.model import Model
from planner.evaluate.monte_carlo import Estimate, simulate
from planner.plan_tree import Plan, count_branches
from planner.problem import Problem

CHECK_FUTURES = 200_000
"""As `PlannerOptions.check_futures`."""


@dataclass(frozen=True, eq=False)
class Checked:
    """A plan with what it earns on fresh futures, and the values by number of branches."""

    model: Model
    plan: Plan
    check: Estimate
    values: tuple[float, ...]


def plan_large(
    problem: Problem,
    limits: Growth,
    *,
    most: int,
    fresh_seed: int,
    first_price: float,
    warm: tuple[Plan, ...],
    guide_s: float = 0.0,
    used: Callable[[], float] = lambda: 0.0,
    should_stop: Callable[[], bool],
    told: Callable[[Plan, float], None],
) -> Checked | None:
    """Return the best plan found with at most `most` branches; None if there is none.

    Under a chance constraint an overrun is given a multiplier, as in `chance.plans_within`: routes are
    thinned out, and branches grown, for the least multiplier at which a plan keeps to it. Quick searches try
    routes alone. `guide_s` is that of `plan_long`.
    """
    chance = OverrunChance.of(problem)
    models: dict[Plan, Model] = {}

    def find(price: float, quick: bool) -> list[Plan]:
        priced = dataclasses.replace(problem, overrun_penalty=problem.overrun_penalty + price)
        growth = dataclasses.replace(limits, max_branches=0) if quick else limits
        found = plan_long(
            priced, growth, warm=warm, guide_s=guide_s, used=used, should_stop=should_stop, told=told
        )
        if found is None:
            return []
        model = dataclasses.replace(found.model, penalty=problem.overrun_penalty)
        models.update((plan, model) for _, plan in found.curve if plan)
        return [plan for _, plan in found.curve]

    if chance is None:
        return checked(models, [plan for plan in find(0.0, False) if plan], most, fresh_seed)
    plans, _ = plans_within(
        find,
        lambda plan: keeps_to(models[plan], plan, chance, seed=fresh_seed + 1),
        first_price=first_price,
        should_stop=should_stop,
    )
    return checked(models, plans, most, fresh_seed)


def checked(models: dict[Plan, Model], plans: Sequence[Plan], most: int, seed: int) -> Checked | None:
    """Return the plan that earns most on fresh futures, with what was earned with up to 0..most branches."""
    values = [0.0] * (most + 1)
    best: Checked | None = None
    for plan in dict.fromkeys(plans):
        found = simulate(models[plan], plan, CHECK_FUTURES, seed=seed).estimate()
        for k in range(count_branches(plan), most + 1):
            values[k] = max(values[k], found.mean)
        if found.mean > (best.check.mean if best is not None else 0.0):
            best = Checked(models[plan], plan, found, ())
    return best and dataclasses.replace(best, values=tuple(values))
