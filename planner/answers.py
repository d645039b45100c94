"""What planning hands back: a plan with its bounds and notes, or why there is none."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from planner.constraints.overrun import OverrunChance
from planner.contingency.bounds import upper_bound
from planner.contingency.reduction import Reduction, held_by
from planner.evaluate.model import Model
from planner.evaluate.monte_carlo import Estimate, simulate
from planner.large_plans import Checked
from planner.plan_result import PlanResult, PlanStatus, Progress
from planner.plan_tree import PlanTree, count_branches, planned_observations, with_ids
from planner.sol_kind import all_kinds
from planner.stages import LONG_SHARE, MANY_TARGETS, Chosen, Order, annotated, bounded
from planner.strategies import Found
from planner.tally import StoppedError

HASTY_S, HASTY_TARGETS = 0.4, 20
"""Reckoned seconds for a bound once somebody stopped the work, and most targets for which it is tried."""

SURE = 2.576
"""Quantile of the normal distribution: `PlanResult.lower` is too high once in 200 times."""

SURELY = 13
"""What is added to the seed for the last check: no other futures of a planning have it."""


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
    most = max(1, order.max_branches)
    done = min(1.0, count_branches(long.plan) / most) if order.watch.stop(LONG_SHARE) else 1.0
    found = Found([], done=done)
    return with_plan(order, part, choice, long.model, found, prices, evaluator="monte-carlo", notes=(note,))


def with_warm_plan(
    order: Order, part: Reduction, warm: Checked, found: Found, prices: Sequence[float]
) -> PlanResult:
    """Return a plan that was there before, which earns more than all found for a part of the problem."""
    note = "the plan from before is kept: it earns more than every plan found for a part of the observations"
    choice = Chosen(warm.plan, warm.check, list(warm.values))
    found = Found([], done=found.done)
    notes = (note, *part.notes)
    return with_plan(order, part, choice, warm.model, found, prices, evaluator="monte-carlo", notes=notes)


def with_plan(
    order: Order,
    part: Reduction,
    choice: Chosen,
    model: Model,
    found: Found,
    prices: Sequence[float],
    *,
    evaluator: str = "",
    notes: tuple[str, ...] = (),
) -> PlanResult:
    """Return a plan with its bounds and the notes on its steps."""
    plan, watch = choice.plan, order.watch
    watch.report(Progress(0.9, "bounds", watch.best_value, None, count_branches(plan), plan))
    expected, check = choice.values[-1], _surely_checked(order, model, choice)
    lower = max(0.0, check.mean - SURE * check.standard_error) if check is not None else 0.0
    tree = annotated(order, model, PlanTree(order.problem.name, with_ids(plan), order.strategy))
    upper = bounded(order, part.whole(), prices, lower)  # last: it may use what the rest has left
    known = found.optimum if part.exact else None
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
            evaluator=evaluator or choice.evaluator,
            searched=found.done,
            reasons=(*(notes or part.notes), *why_unbranched(order, found, tree), *of_kinds(order)),
            regret_left=None if known is None else max(0.0, known - expected),
        ),
    )


def _surely_checked(order: Order, model: Model, choice: Chosen) -> Estimate | None:
    """Return the check of a plan; of many targets one of more futures, which took no part in its choice."""
    few = len(order.problem.targets) <= MANY_TARGETS
    if choice.check is None or few or order.quick or order.plan_only:
        return choice.check
    futures = order.options.long_check_futures
    return simulate(model, choice.plan, futures, seed=order.seed + SURELY).estimate()


def of_kinds(order: Order) -> tuple[str, ...]:
    """Return what the bound leaves out where the kind of sol is hidden."""
    if not order.problem.sol_kinds or order.plan_only:
        return ()
    shares = ", ".join(f"{kind.name} {100.0 * kind.p:.3g} %" for kind in all_kinds(order.problem.sol_kinds))
    return (
        f"the kind of sol ({shares}) is hidden from the plan; the bound is of one that is told it at the "
        "start, so not all that is between them can be won",
    )


def why_unbranched(order: Order, found: Found, tree: PlanTree) -> tuple[str, ...]:
    """Return why a plan has no branches, where the limit and not the problem is the cause."""
    if tree.branches or not order.max_branches or found.done >= 1.0 or order.quick:
        return ()
    if found.done > 0.0:
        return (
            f"no branch was found in the {found.done:.0%} of the search that the limit of "
            f"{order.watch.limit_s:g} s left time for",
        )
    return (
        f"no branches were tried: the limit of {order.watch.limit_s:g} s was used up by routes and the table "
        "of the optimal policy",
    )


def when_stopped(order: Order) -> PlanResult:
    """Return the best plan that was told until somebody stopped the work, checked in a part of a second."""
    problem, plan = order.problem, order.watch.best_plan
    tree = PlanTree(problem.name, with_ids(plan), order.strategy)
    result = PlanResult(
        status=PlanStatus.TIMEOUT,
        tree=PlanTree(problem.name, (), order.strategy),
        strategy=order.strategy,
        upper=_hasty_bound(order),
        searched=0.0,
        reasons=("stopped before the search was over",),
    )
    if plan and order.must <= {str(o) for o in planned_observations(plan)}:
        model = Model.of(held_by(problem, plan))
        check = simulate(model, plan, order.options.quick_check_futures, seed=order.seed + 1).estimate()
        chance = OverrunChance.of(problem)
        if check.mean > 0.0 and (chance is None or chance.kept(check.overrun, check.futures)):
            result = dataclasses.replace(
                result,
                status=PlanStatus.PLANNED,
                tree=tree,
                evaluator="monte-carlo",
                expected_utility=check.mean,
                check=check,
                lower=max(0.0, check.mean - SURE * check.standard_error),
                curve=(check.mean,),
            )
    return _told(order, result)


def _hasty_bound(order: Order) -> float:
    """Return what no policy earns more than, as far as `HASTY_S` tell; at most the sum of all utilities."""
    problem, tally = order.problem, order.watch.tally
    most = sum(o.utility * o.p_success for o in problem.observations)
    if len(problem.targets) > HASTY_TARGETS:
        return most
    until = tally.seconds + HASTY_S
    tally.stop = lambda: tally.seconds > until
    try:
        return min(most, upper_bound(Model.of(problem), limit_s=order.options.hasty_bound_s).value)
    except StoppedError:
        return most
    finally:
        tally.stop = None


def _told(order: Order, result: PlanResult) -> PlanResult:
    tree, watch = result.tree, order.watch
    result = dataclasses.replace(
        result,
        work_s=watch.work_s(),
        wall_s=watch.elapsed_s(),
        first_plan_s=watch.first_plan_s,
        seed=order.seed,
    )
    order.watch.report(Progress(1.0, "done", result.expected_utility, result.upper, tree.branches, tree.plan))
    return result
