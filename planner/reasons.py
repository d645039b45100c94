"""Why there is no plan, or an empty one."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Set

import numpy as np

from planner.constraints.overrun import OverrunChance
from planner.contingency.reduction import reduce_problem
from planner.contingency.seeding import mean_seed
from planner.evaluate.model import Model
from planner.problem import Problem


def why_impossible(model: Model, demanded: Set[str]) -> tuple[str, ...]:
    """Return why what must be done cannot be; empty if a route on mean values holds it all.

    `demanded` are the names of all of it; what the model does not know cannot be made on any way.
    """
    unknown = sorted(demanded - set(model.observation_ids))
    if unknown:
        return (
            f"observation {', '.join(unknown)} must be done, but no path leads there, or to what must "
            "come before it",
        )
    must = sum(1 << m for m in range(model.m) if model.must_do[m])
    lifted = dataclasses.replace(model, utility=np.where(model.must_do, model.utility + 1.0, model.utility))
    order = mean_seed(lifted, must=must)
    held = sum(1 << m for m in order)
    names = [str(model.observation_ids[m]) for m in range(model.m) if (must & ~held) >> m & 1]
    if not names:
        return ()
    return (
        f"observation {', '.join(names)} must be done, but no route on mean values makes every such "
        f"observation within {model.problem.budget.time_s:g} s and {model.e_max_j:g} J, in its window and in "
        "order" + ("" if model.data_limit_mbit == math.inf else f", within {model.data_limit_mbit:g} Mbit"),
    )


def why_empty(problem: Problem, *, planned: bool) -> tuple[str, ...]:
    """Return why nothing is planned; `planned` says that there were plans, which had too many overruns."""
    if not problem.observations:
        return ("the problem has no observation",)
    if all(o.utility <= 0.0 for o in problem.observations):
        return ("no observation is worth anything",)
    past = [(o.window_s[1], o.id) for o in problem.observations if o.window_s and o.window_s[1] < 0.0]
    if len(past) == len(problem.observations):
        closed_s, last = max(past)
        return (f"every window is in the past: the last, of {last}, closed {-closed_s:g} s before the plan",)
    budget = problem.budget
    if budget.time_s <= 0.0 or budget.usable_energy_j <= 0.0:
        return (f"the budget of {budget.time_s:g} s and {budget.usable_energy_j:g} J is too small",)
    reached = {leg.to for leg in problem.legs}
    if not any(t.id in reached for t in problem.targets):
        return ("no target can be reached: the problem has no leg that leads to one",)
    if not mean_seed(Model.of(reduce_problem(problem).problem)):
        return (
            f"the budget of {budget.time_s:g} s and {budget.usable_energy_j:g} J is too small: "
            "no observation fits in it on mean values, in its window",
        )
    chance = OverrunChance.of(problem)
    if chance is not None and planned:
        return (f"no plan found keeps the chance of ending over a budget within {chance.allowed:g}",)
    return ("no plan earns more in the mean than doing nothing",)
