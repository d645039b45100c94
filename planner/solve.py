"""From a problem to a plan: strategies, limits, bounds and what is known about the answer."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from planner.contingency.bounds import upper_bound
from planner.contingency.branching import Search, SearchLimits, plan_optimal
from planner.contingency.chance import keeps_to, plans_within
from planner.contingency.pico2005 import plan_pico2005
from planner.contingency.policy import Policy
from planner.contingency.reduction import Reduction, reduce_problem, several
from planner.contingency.sampled_branches import Curve
from planner.contingency.sampled_futures import Growth
from planner.contingency.seeding import mean_seed, route_steps, track_steps
from planner.errors import PlannerError
from planner.evaluate.grid import Grid, Rounding
from planner.evaluate.model import Model
from planner.evaluate.monte_carlo import Estimate
from planner.evaluate.notes import annotate, annotate_sampled
from planner.evaluate.program import compile_plan
from planner.evaluate.propagate import Backward, Evaluator
from planner.large_plans import CHECK_FUTURES, Checked, plan_large
from planner.plan_choice import held_up
from planner.plan_edits import fitted
from planner.plan_result import PlanResult, PlanStatus, Progress
from planner.plan_tree import (
    Observe,
    OnFail,
    Plan,
    PlanTree,
    TrackStart,
    Visit,
    count_branches,
    planned_observations,
    with_ids,
)
from planner.problem import Problem
from planner.reasons import why_empty, why_impossible
from planner.threads import one_blas_thread

__all__ = ["STRATEGIES", "PlanResult", "PlanStatus", "Progress", "solve"]

STRATEGIES = ("optimal", "pico2005")
DEFAULT_BRANCHES = 6
DEFAULT_TIME_LIMIT_S = 60.0
SEARCH_GRID = (49, 29)
COARSE_GRID = (33, 21)
QUICK_GRID = (25, 15)
MANY_LIVE_SETS = 5_000
NOTES_GRID = (61, 37)
MAX_NOTED_TRACKS = 9
"""With more targets tracked a grid has too many states for notes on the steps: they are sampled."""

BOUND_S = 4.0
HASTY_BOUND_S = 0.2
"""Processor seconds for the bound, and for one that is waited for."""

QUICK_PLANS = 2
"""Cuts of the mean route that the search begins with."""

PRICE = 0.1
"""First price of an overrun under a chance constraint, as a share of all utility."""

QUICK_SEARCH_S = 0.3
"""Processor seconds for a quick search, the table of the policy not counted."""

SEARCH_S = 6.5
SEARCH_S_PER_TARGET = 6.0
"""Processor seconds for the search: with up to 8 targets and 6 branches, and for each target more."""


@dataclass(frozen=True, slots=True)
class _Clock:
    began: float
    limit_s: float
    deterministic: bool
    cancelled: Callable[[], bool]

    def elapsed_s(self) -> float:
        return time.monotonic() - self.began

    def stop(self, share: float = 1.0) -> bool:
        """Return whether to stop; `share` of the time limit is what this part of the work may use."""
        if self.cancelled():
            return True
        return not self.deterministic and self.elapsed_s() > share * self.limit_s


def solve(
    problem: Problem,
    *,
    strategy: str = "optimal",
    max_branches: int = DEFAULT_BRANCHES,
    time_limit_s: float = DEFAULT_TIME_LIMIT_S,
    iterations: int | None = None,
    seed: int = 0,
    least_taken: float = 0.0,
    report: Callable[[Progress], None] = lambda progress: None,
    should_stop: Callable[[], bool] = lambda: False,
    warm: tuple[Plan, ...] = (),
    quick: bool = False,
) -> PlanResult:
    """Return the best contingent plan found for a problem.

    Parameters
    ----------
    strategy
        `optimal` (gain-driven branches, with bounds) or `pico2005` (the 2004 planner).
    max_branches
        Most options in the whole tree.
    time_limit_s
        Wall time; the search also ends by itself when nothing more is to be won.
    iterations
        A deterministic limit instead of time: with it the same seed gives the same plan on every machine.
    seed
        Of the Monte Carlo check; the search itself draws nothing.
    least_taken
        Options taken in a smaller share of the futures are left out.
    report, should_stop
        Told of progress with the best plan so far; asked often. When stopped, the best plan so far is
        returned.
    warm
        Plans to begin with, from an earlier solution of a similar problem.
    quick
        Search on a coarse grid and from few main lines, for an answer within a second.

    Raises
    ------
    PlannerError
        If the strategy is unknown or a limit is out of range.
    """
    if strategy not in STRATEGIES:
        raise PlannerError(f'strategy "{strategy}" is unknown; known are {", ".join(STRATEGIES)}')
    if max_branches < 0 or max_branches > 200:
        raise PlannerError(f"max_branches is {max_branches}; it must be between 0 and 200")
    if not time_limit_s > 0.0:
        raise PlannerError(f"time_limit_s is {time_limit_s:g}; it must be more than 0")
    if iterations is not None and iterations < 1:
        raise PlannerError(f"iterations is {iterations}; it must be at least 1")
    clock = _Clock(time.monotonic(), time_limit_s, iterations is not None, should_stop)
    with one_blas_thread():
        work = _Work(
            problem, strategy, max_branches, iterations, seed, least_taken, clock, report, warm, quick
        )
        return work.run()


def _main_line(plan: Plan) -> set[str]:
    return {str(s.observation) for s in plan if isinstance(s, Observe | Visit)}


class _Work:
    def __init__(
        self,
        problem: Problem,
        strategy: str,
        max_branches: int,
        iterations: int | None,
        seed: int,
        least_taken: float,
        clock: _Clock,
        report: Callable[[Progress], None],
        warm: tuple[Plan, ...],
        quick: bool,
    ) -> None:
        self.problem, self.strategy, self.max_branches = problem, strategy, max_branches
        self.iterations, self.seed, self.least_taken = iterations, seed, least_taken
        self.clock, self.report, self.warm, self.quick = clock, report, warm, quick
        self.best_plan: Plan = ()
        self.best_value = 0.0
        self.first_plan_s = 0.0
        self.prices: list[float] = [0.0]
        self.evaluator = "grid"
        self.notes: tuple[str, ...] = ()

    def told(self, plan: Plan, value: float) -> None:
        """Take note of a better plan and pass it on."""
        if not self.first_plan_s:
            self.first_plan_s = self.clock.elapsed_s()
        self.best_plan, self.best_value = plan, value
        limit = self.clock.limit_s
        fraction = min(0.9, 0.1 + 0.8 * self.clock.elapsed_s() / limit)
        self.report(Progress(fraction, "branching", value, None, count_branches(plan), plan))

    # ------------------------------------------------------------------------------------- the parts

    def run(self) -> PlanResult:
        problem = self.problem
        self.report(Progress(0.0, "reading"))
        reduction = reduce_problem(problem, should_stop=lambda: self.clock.stop(0.5))
        small = Model.of(reduction.problem)
        must = [o for o in problem.observations if o.must_do]
        if must:
            missing = why_impossible(small)
            if missing:
                return self.answer(PlanStatus.INFEASIBLE, (), missing, reduction)
        if small.t_max_s <= 0.0 or small.e_max_j <= 0.0:
            return self.answer(
                PlanStatus.EMPTY, (), why_empty(self.problem, planned=bool(self.first_plan_s)), reduction
            )
        long: Checked | None = None
        if not reduction.exact and not must and self.strategy == "optimal":
            long = self.long_plan()
            held = len(reduction.problem.observations)
            free = problem.max_overrun_probability is None  # else the table, of less, may keep to it better
            if free and long is not None and len(planned_observations(long.plan)) > held:
                return self.answer_long(long, reduction)
        pressed = self.pressed(small)
        allowed = problem.max_overrun_probability
        search: Search | None = None
        if allowed is None:
            curve, search = self.searched(pressed, reduction, quick=self.quick)
        else:
            curve = self.searched_within(pressed, small, reduction, allowed)
        plan, check, values = self.choose(small, curve)
        if must and not {str(o.id) for o in must} <= _main_line(plan):
            order = mean_seed(small, must=sum(1 << m for m in range(small.m) if small.must_do[m]))
            plan = (*track_steps(small, set(order)), *route_steps(small, order, 0, OnFail.SKIP))
            plan, check, values = self.choose(small, [(0.0, plan)])
            if not plan and allowed is not None:
                names = ", ".join(str(o.id) for o in must)
                reason = (
                    f"observation {names} must be done, but no plan found does that with a chance of at most "
                    f"{allowed:g} to end over a budget"
                )
                return self.answer(PlanStatus.INFEASIBLE, (), (reason,), reduction)
        if long is not None and long.check.mean > (0.0 if check is None else check.mean):
            return self.answer_long(long, reduction)
        if not plan:
            status = PlanStatus.TIMEOUT if self.clock.stop() and not self.first_plan_s else PlanStatus.EMPTY
            return self.answer(
                status, (), why_empty(self.problem, planned=bool(self.first_plan_s)), reduction
            )
        return self.answer(PlanStatus.PLANNED, plan, (), reduction, small, check, values, search)

    def long_plan(self) -> Checked | None:
        """Return a plan for more observations than a table holds, as it holds up on fresh futures."""
        found = plan_large(
            self.problem,
            Growth(0 if self.quick else self.max_branches, self.seed + 3, self.iterations),
            most=self.max_branches,
            fresh_seed=self.seed + 1,
            first_price=self.first_price(self.problem.utility_sum),
            warm=self.warm,
            should_stop=lambda: self.clock.stop(0.6 if self.quick else 0.75),
            told=self.told,
        )
        if found is not None:
            self.told(found.plan, found.check.mean)
        return found

    def first_price(self, utility_sum: float) -> float:
        return PRICE * max(1.0, utility_sum)

    def answer_long(self, long: Checked, reduction: Reduction) -> PlanResult:
        self.evaluator = "monte-carlo"
        self.notes = (
            f"grown on sampled futures from a route that makes {len(planned_observations(long.plan))} of "
            f"{len(self.problem.observations)} observations: more than a table of the optimal policy holds",
        )
        values = list(long.values)
        return self.answer(PlanStatus.PLANNED, long.plan, (), reduction, long.model, long.check, values)

    def pressed(self, model: Model) -> Model:
        """Return the model with what must be done worth more than everything else together."""
        if not np.any(model.must_do):
            return model
        bonus = 2.0 * float(model.utility.sum()) + 1.0
        return dataclasses.replace(
            model, utility=np.where(model.must_do, model.utility + bonus, model.utility)
        )

    def searched(self, model: Model, reduction: Reduction, *, quick: bool) -> tuple[Curve, Search | None]:
        """Return the plans that the strategy finds, by number of branches."""
        grid = Grid(model, *self.search_grid(reduction, quick))
        if self.strategy == "pico2005":
            return self.pico(model, grid), None
        search = self.optimal(model, grid, quick)
        return search.curve, search

    def searched_within(self, model: Model, small: Model, reduction: Reduction, allowed: float) -> Curve:
        """Return the plans found whose chance of an overrun is within `allowed`, by number of branches."""

        def find(price: float, quick: bool) -> list[Plan]:
            priced = dataclasses.replace(model, penalty=model.penalty + price)
            return [plan for _, plan in self.searched(priced, reduction, quick=quick)[0]]

        plans, self.prices = plans_within(
            find,
            lambda plan: keeps_to(small, plan, allowed, seed=self.seed + 2),
            first_price=self.first_price(float(small.utility.sum())),
            should_stop=lambda: self.clock.stop(0.55),
        )
        evaluator = Evaluator(small)
        valued = sorted(((evaluator.value(plan).value, plan) for plan in plans), key=lambda pair: pair[0])
        curve: Curve = []
        for most in range(self.max_branches + 1):
            within = [pair for pair in valued if count_branches(pair[1]) <= most]
            curve.append(within[-1] if within else (0.0, ()))
        return curve

    def search_grid(self, reduction: Reduction, quick: bool) -> tuple[int, int]:
        """Return the nodes to search with: fewer where the table of the policy is large."""
        if quick:
            return QUICK_GRID
        return COARSE_GRID if reduction.live_sets > MANY_LIVE_SETS else SEARCH_GRID

    def pico(self, model: Model, grid: Grid) -> Curve:
        plan = plan_pico2005(
            model,
            grid,
            max_branches=self.max_branches,
            max_steps=self.iterations,
            should_stop=lambda: self.clock.stop(0.9),
            report=self.told,
        )
        return [(0.0, plan)]

    def quick_plans(self, model: Model, grid: Grid) -> tuple[Plan, ...]:
        """Return plans that need no table, best first: the route on mean values, cut short at every length.

        They are there before the table of the optimal policy is, and on problems that are large for the time
        limit they are what the search begins with.
        """
        order = mean_seed(model)
        plans: list[tuple[float, Plan]] = []
        for length in range(len(order), 0, -1):
            route = order[:length]
            plan = (*track_steps(model, set(route)), *route_steps(model, route, 0, OnFail.SKIP))
            plans.append((Backward(grid, compile_plan(model, plan)).total(), plan))
        plans.sort(key=lambda pair: -pair[0])
        if plans and plans[0][0] > self.best_value:
            self.told(plans[0][1], plans[0][0])
        return tuple(plan for _, plan in plans[:QUICK_PLANS])

    def optimal(self, model: Model, grid: Grid, quick: bool) -> Search:
        early = self.quick_plans(model, grid)
        policy = Policy(
            Grid(model, grid.nt, grid.ng, Rounding.MID, np.float32),
            one_stay=several(model),
            should_stop=lambda: self.clock.stop(0.6),
        )
        limits = SearchLimits(
            max_branches=self.max_branches,
            iterations=self.iterations,
            main_lines=1 if quick else 4,
            tolerance=1e-3 if quick else 2e-4,
        )
        allowed_s = SEARCH_S * max(1.0, self.max_branches / DEFAULT_BRANCHES)
        allowed_s += SEARCH_S_PER_TARGET * max(0, model.n - 8)
        until = time.thread_time() + (QUICK_SEARCH_S if quick else allowed_s)
        return plan_optimal(
            policy,
            grid,
            limits,
            should_stop=lambda: (
                self.clock.stop(0.6) or (not self.clock.deterministic and time.thread_time() > until)
            ),
            report=self.told,
            extra=(*(fitted(model.problem, plan) for plan in self.warm), *early),
        )

    def choose(self, model: Model, curve: Curve) -> tuple[Plan, Estimate | None, list[float]]:
        return held_up(
            model,
            curve,
            futures=CHECK_FUTURES // 10 if self.quick else CHECK_FUTURES,
            seed=self.seed + 1,
            allowed=self.problem.max_overrun_probability,
            least_taken=self.least_taken,
            hasty=lambda: self.quick or self.clock.cancelled(),
        )

    def upper(self, model: Model) -> float:
        """Return what no policy earns more than; under a chance constraint, no policy that keeps to it."""
        left = max(0.5, self.clock.limit_s - self.clock.elapsed_s())
        hasty = self.clock.cancelled()
        seconds, wall_s = (HASTY_BOUND_S, 1.0) if self.quick or hasty else (BOUND_S, left)
        share = 1.0 / len(self.prices)
        allowed = self.problem.max_overrun_probability or 0.0
        return min(
            upper_bound(
                dataclasses.replace(model, penalty=model.penalty + price),
                time_limit_s=min(left, seconds) * share,
                wall_limit_s=wall_s * share,
                deterministic=self.clock.deterministic,
                should_stop=lambda: not hasty and self.clock.cancelled(),
            ).value
            + price * allowed
            for price in self.prices
        )

    def answer(
        self,
        status: PlanStatus,
        plan: Plan,
        reasons: tuple[str, ...],
        reduction: Reduction,
        model: Model | None = None,
        check: Estimate | None = None,
        values: list[float] | None = None,
        search: Search | None = None,
    ) -> PlanResult:
        tree = PlanTree(self.problem.name, with_ids(plan), self.strategy)
        upper = 0.0
        if status in (PlanStatus.PLANNED, PlanStatus.EMPTY):
            self.report(Progress(0.9, "bounds", self.best_value, None, count_branches(plan), plan))
            upper = self.upper(reduction.whole())
        if model is not None and plan:
            many = sum(isinstance(step, TrackStart) for step in plan) > MAX_NOTED_TRACKS
            if many:
                tree = annotate_sampled(model, tree, seed=self.seed + 4)
            else:
                tree = annotate(model, Grid(model, *NOTES_GRID), tree)
        expected = values[-1] if values else 0.0
        lower = max(0.0, check.mean - 2.576 * check.standard_error) if check else 0.0
        result = PlanResult(
            status=status,
            tree=tree,
            strategy=self.strategy,
            expected_utility=expected,
            check=check,
            lower=min(lower, expected),
            upper=max(upper, expected),
            optimum_estimate=search.optimum if search is not None and reduction.exact else None,
            curve=tuple(values or ()),
            evaluator=self.evaluator,
            wall_s=self.clock.elapsed_s(),
            first_plan_s=self.first_plan_s,
            seed=self.seed,
            reasons=reasons + (self.notes or reduction.notes),
            regret_left=(
                max(0.0, search.optimum - expected) if search is not None and reduction.exact else None
            ),
        )
        self.report(Progress(1.0, "done", expected, result.upper, tree.branches, tree.plan))
        return result
