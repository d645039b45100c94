"""The plan of a search that holds up on futures that took no part in it."""

from __future__ import annotations

import numpy as np

from planner.constraints.overrun import OverrunChance
from planner.contingency.sampled_branches import Curve
from planner.evaluate.grid import Grid
from planner.evaluate.model import Model
from planner.evaluate.monte_carlo import Estimate, simulate
from planner.evaluate.propagate import Evaluator
from planner.notes import annotate, annotate_sampled
from planner.plan_edits import without_option
from planner.plan_tree import Plan, PlanTree, count_branches

RARE_GRID = (49, 29)
"""Nodes on which the chance that an option is taken is found."""

RARE_SEED = 11
"""Of the futures in which it is counted where the kind of sol is hidden."""


def held_up(
    model: Model,
    curve: Curve,
    *,
    futures: int,
    seed: int,
    chance: OverrunChance | None,
    least_taken: float,
    hasty: bool,
    on_fine_grids: bool = True,
) -> tuple[Plan, Estimate | None, list[float]]:
    """Return the plan of the curve that holds up on fresh futures, with its check and the values by
    branches.

    A plan with more branches replaces the one before only if it is better on the fine grids and also on
    futures that took no part in the search. Without the fine grids the search's own values are taken.
    """
    evaluator = Evaluator(model.within_reach()) if on_fine_grids else None
    best: Plan = ()
    best_value = 0.0
    earned = np.zeros(futures)
    check: Estimate | None = None
    values: list[float] = []
    for most, (searched, candidate) in enumerate(curve):
        if 0 < most < len(curve) - 1 and hasty:
            values.append(best_value)  # who is in a hurry waits for the best plan alone
            continue
        plan = candidate
        if least_taken > 0.0 and count_branches(plan):
            plan = drop_rare(model, plan, least_taken)
        if plan and plan != best:
            value = searched if evaluator is None else evaluator.value(plan).value
            if value > best_value or np.any(model.must_do):
                met = simulate(model, plan, len(earned), seed=seed)
                if chance is not None and float(np.mean(met.overrun)) > chance.allowed:
                    pass  # it kept to the chance on the futures that chose it only
                elif float(np.mean(met.utility - earned)) > 0.0 or np.any(model.must_do):
                    best, best_value, earned = plan, value, met.utility
                    check = met.estimate()
        values.append(best_value)
    return best, check, values


def drop_rare(model: Model, plan: Plan, least: float) -> Plan:
    """Return the plan without options taken in a smaller share of the futures than `least`."""
    while True:
        tree = PlanTree("", plan)
        if len(model.sols.chance):
            tree = annotate_sampled(model, tree, seed=RARE_SEED)
        else:
            tree = annotate(model, Grid(model, *RARE_GRID), tree)
        rare = [(notes.p_taken, path) for path, notes in tree.option_notes.items() if notes.p_taken < least]
        if not rare:
            return plan
        plan = without_option(plan, min(rare)[1])
