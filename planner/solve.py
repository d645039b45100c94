"""From a problem to a plan, and what is known about the answer."""

from __future__ import annotations

import math
from collections.abc import Callable

from planner.answers import when_stopped, with_long_plan, with_plan, with_warm_plan, without_plan
from planner.constraints.overrun import OverrunChance
from planner.contingency.reduction import reduce_problem
from planner.errors import PlannerError
from planner.evaluate.model import Model
from planner.options import PlannerOptions
from planner.plan_result import PlanResult, PlanStatus, Progress
from planner.plan_tree import Plan, planned_observations
from planner.problem import Problem
from planner.progress import Watch
from planner.reasons import why_empty, why_impossible
from planner.stages import (
    Order,
    best_warm_plan,
    chosen,
    grown_further,
    long_plan,
    pressed,
    searched_with_part,
    searched_within,
    tell_route,
)
from planner.strategies import strategy_named
from planner.tally import StoppedError, tallied
from planner.threads import one_blas_thread

__all__ = ["PlanResult", "PlanStatus", "Progress", "solve"]


def solve(
    problem: Problem,
    *,
    strategy: str = "optimal",
    max_branches: int = 6,
    time_limit_s: float = 60.0,
    iterations: int | None = None,
    seed: int = 0,
    least_taken: float = 0.0,
    options: PlannerOptions | None = None,
    report: Callable[[Progress], None] = lambda _: None,
    should_stop: Callable[[], bool] = lambda: False,
    warm: tuple[Plan, ...] = (),
    quick: bool = False,
    plan_only: bool = False,
) -> PlanResult:
    """Return the best contingent plan found for a problem.

    Parameters
    ----------
    strategy
        Name of a strategy: `optimal` (gain-driven branches, with bounds), `pico2005` (the 2004 planner), or
        one of an installed package.
    max_branches
        Most options in the whole tree.
    time_limit_s
        Seconds of one processor, as `planner.tally` reckons them from the steps that were done: the same
        order gives the same plan at any load. The search also ends by itself when nothing more is to be won.
    iterations
        A limit in candidates looked at instead.
    seed
        Of the Monte Carlo check; the search itself draws nothing.
    least_taken
        Options taken in a smaller share of the futures are left out.
    options
        Numbers that steer the work.
    report, should_stop
        Told of progress with the best plan so far; asked after every fiftieth part of a second or so,
        wherever the work stands. When stopped, the best plan so far is returned.
    warm
        Plans to begin with, from an earlier solution of a similar problem.
    quick
        Search on a coarse grid and from few main lines, for an answer within a second.
    plan_only
        Leave the bound (`upper` is infinite) and the notes on the plan's steps away, for who needs neither.

    Raises
    ------
    PlannerError
        If the strategy is unknown or a limit is out of range.
    """
    search = strategy_named(strategy)
    if max_branches < 0 or max_branches > 200:
        raise PlannerError(f"max_branches is {max_branches}; it must be between 0 and 200")
    if not time_limit_s > 0.0:
        raise PlannerError(f"time_limit_s is {time_limit_s:g}; it must be more than 0")
    if iterations is not None and iterations < 1:
        raise PlannerError(f"iterations is {iterations}; it must be at least 1")
    with one_blas_thread(), tallied() as tally:
        watch = Watch(time_limit_s if iterations is None else math.inf, tally, report, begun_s=tally.seconds)
        order = Order(
            problem, strategy, search, max_branches, iterations, seed, least_taken, warm, quick,
            options or PlannerOptions(), watch, plan_only,
        )  # fmt: skip
        tally.stop = should_stop
        try:
            return _planned(order)
        except StoppedError:
            return when_stopped(order)
        finally:
            tally.stop = None


def _planned(order: Order) -> PlanResult:
    problem, watch, must = order.problem, order.watch, order.must
    chance = OverrunChance.of(problem)

    # 1. The part of the problem that a table of the optimal policy holds: mostly all of it.
    watch.report(Progress(0.0, "reading"))
    tell_route(order)
    part = reduce_problem(
        problem, most_live_sets=order.affordable_live_sets, should_stop=lambda: watch.stop(0.5)
    )
    small = Model.of(part.problem)
    if must and (missing := why_impossible(small, must)):
        return without_plan(order, part, PlanStatus.INFEASIBLE, missing)
    if small.t_max_s <= 0.0 or small.e_max_j <= 0.0:
        return without_plan(order, part, PlanStatus.EMPTY, why_empty(problem, planned=False))

    # 2. Days that make more than the table holds are grown on sampled futures.
    grown = order.strategy == "optimal" and not part.exact and not part.hurried and not must
    long = long_plan(order) if grown else None
    held = len(part.problem.observations)
    if long is not None and chance is None and len(planned_observations(long.plan)) > held:
        return with_long_plan(order, part, long)

    # 3. Plans with 0, 1, 2, ... branches; under a chance constraint an overrun has a multiplier (Everett
    # 1963).
    model, prices = pressed(small.within_reach()), [0.0]
    if chance is None:
        found = grown_further(order, model, searched_with_part(order, model, part))
    else:
        found, prices = searched_within(order, model, small, part, chance)

    # 4. One of them: the plan that holds up on futures that took no part in the search.
    choice = chosen(order, small, found.curve)
    warm = None if part.exact else best_warm_plan(order)
    if warm is not None and warm.check.mean > max(choice.mean, 0.0 if long is None else long.check.mean):
        return with_warm_plan(order, part, warm, found, prices)
    if chance is not None and must and not choice.plan:
        return without_plan(order, part, PlanStatus.INFEASIBLE, (chance.why_none_does(must),))
    if long is not None and long.check.mean > choice.mean:
        return with_long_plan(order, part, long, prices)
    if not choice.plan:
        status = PlanStatus.TIMEOUT if watch.stop() and not watch.first_plan_s else PlanStatus.EMPTY
        reasons = why_empty(problem, planned=bool(watch.first_plan_s))
        return without_plan(order, part, status, reasons, prices)

    # 5. What no policy earns more than, and notes on the plan.
    return with_plan(order, part, choice, small, found, prices)
