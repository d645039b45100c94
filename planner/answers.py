"""What planning hands back: a plan with its bounds and notes, or why there is none."""

from __future__ import annotations

from collections.abc import Sequence

from planner.contingency.reduction import Reduction
from planner.evaluate.model import Model
from planner.large_plans import Checked
from planner.plan_result import PlanResult, PlanStatus, Progress
from planner.plan_tree import PlanTree, count_branches, planned_observations, with_ids
from planner.stages import Chosen, Order, annotated, bounded

SURE = 2.576
"""Quantile of the normal distribution: `PlanResult.lower` is too high once in 200 times."""


def without_plan(
    order: Order,
    part: Reduction,
    status: PlanStatus,
    reasons: tuple[str, ...],
    prices: Sequence[float] = (0.0,),
) -> PlanResult:
    """Return that there is no plan, or an empty one, and why."""
    upper = 0.0
    if status is PlanStatus.EMPTY:
        order.watch.report(Progress(0.9, "bounds", order.watch.best_value, None, 0, ()))
        upper = bounded(order, part.whole(), prices)
    return _told(
        order,
        PlanResult(
            status=status,
            tree=PlanTree(order.problem.name, (), order.strategy),
            strategy=order.strategy,
            upper=upper,
            wall_s=order.watch.elapsed_s(),
            first_plan_s=order.watch.first_plan_s,
            seed=order.seed,
            reasons=reasons + part.notes,
        ),
    )


def with_long_plan(
    order: Order, part: Reduction, long: Checked, prices: Sequence[float] = (0.0,)
) -> PlanResult:
    """Return a plan grown on sampled futures."""
    note = (
        f"grown on sampled futures from a route that makes {len(planned_observations(long.plan))} of "
        f"{len(order.problem.observations)} observations: more than a table of the optimal policy holds"
    )
    choice = Chosen(long.plan, long.check, list(long.values))
    return with_plan(order, part, choice, long.model, None, prices, evaluator="monte-carlo", notes=(note,))


def with_plan(
    order: Order,
    part: Reduction,
    choice: Chosen,
    model: Model,
    optimum: float | None,
    prices: Sequence[float],
    *,
    evaluator: str = "grid",
    notes: tuple[str, ...] = (),
) -> PlanResult:
    """Return a plan with its bounds and the notes on its steps."""
    plan, watch = choice.plan, order.watch
    watch.report(Progress(0.9, "bounds", watch.best_value, None, count_branches(plan), plan))
    upper = bounded(order, part.whole(), prices)
    tree = annotated(order, model, PlanTree(order.problem.name, with_ids(plan), order.strategy))
    expected, check = choice.values[-1], choice.check
    lower = max(0.0, check.mean - SURE * check.standard_error) if check is not None else 0.0
    known = optimum if part.exact else None
    return _told(
        order,
        PlanResult(
            status=PlanStatus.PLANNED,
            tree=tree,
            strategy=order.strategy,
            expected_utility=expected,
            check=check,
            lower=min(lower, expected),
            upper=upper,
            optimum_estimate=known,
            curve=tuple(choice.values),
            evaluator=evaluator,
            wall_s=watch.elapsed_s(),
            first_plan_s=watch.first_plan_s,
            seed=order.seed,
            reasons=notes or part.notes,
            regret_left=None if known is None else max(0.0, known - expected),
        ),
    )


def _told(order: Order, result: PlanResult) -> PlanResult:
    tree = result.tree
    order.watch.report(Progress(1.0, "done", result.expected_utility, result.upper, tree.branches, tree.plan))
    return result
