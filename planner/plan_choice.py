"""The plan of a search that holds up on futures that took no part in it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from planner.constraints.overrun import OverrunChance
from planner.contingency.sampled.branches import Curve
from planner.evaluate.grid import Grid
from planner.evaluate.model import Model
from planner.evaluate.monte_carlo import Estimate, simulate
from planner.evaluate.propagate import Evaluator, GridValue
from planner.notes import annotate, annotate_sampled
from planner.plan_edits import without_option
from planner.plan_tree import Plan, PlanTree, count_branches

RARE_GRID = (49, 29)
"""Nodes on which the chance that an option is taken is found."""

RARE_SEED = 11
"""Of the futures in which it is counted where the kind of sol is hidden."""


SETTLED = 1e-3
"""Share of its value by which two grids differ that are as close as is asked for: extrapolated from them, the
value of 10 days of 3 to 8 targets was within 0.03 % then."""

FINER = ((121, 73), (241, 145))
"""Nodes of the grids asked where the usual ones differ by more."""

FAR, MATTERS = 4.0, 5e-4
"""Standard errors, and a share of the value, by which a check is far from a grid."""

DEAREST_S = 0.1
"""Reckoned seconds on the usual grids above which a plan is not valued on finer ones, which take ten times as
long. By hand: a plan of eight targets with a branch takes 0.06."""


def settled_value(
    model: Model, plan: Plan, check: Estimate, work_s: Callable[[], float]
) -> tuple[float, str] | None:
    """Return the value of a plan and what told it; None where grids that settle would take too long.

    Finer grids are asked where the usual ones have not settled, and where a window begins or ends within the
    day: both may put it into the same cell. Where no grid settles, or one is far from the check, the check
    tells the value. `work_s` tells the seconds used.
    """
    model, before = model.within_reach(), work_s()
    value, share = Evaluator(model).value(plan), SETTLED
    took_s = work_s() - before
    if not _settled(value, share) or np.any((model.window > 0.0) & (model.window < model.t_max_s)):
        if took_s > DEAREST_S:
            return None
        value, share = Evaluator(model, *FINER).value(plan), 2.0 * SETTLED
    far = abs(value.value - check.mean) > FAR * check.standard_error + MATTERS * abs(check.mean)
    if far or not _settled(value, share):
        return check.mean, "monte-carlo"
    return value.value, "grid"


def _settled(value: GridValue, share: float) -> bool:
    return abs(value.fine - value.coarse) <= share * abs(value.fine)


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
