"""From a problem and its sols to a sol path: a plan for the first sol, an outline of the others, a bound."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mission.sol_timeline import SolSeries
from planner.contingency.selection import places_through
from planner.errors import PlannerError
from planner.evaluate.model import Floats, Ints
from planner.plan_result import PlanResult, Progress
from planner.problem import START, Budget, ObservationId, Problem
from planner.sols.order_kernels import Days, Needs, Told
from planner.sols.order_policy import OrderPolicies, OrderPolicy
from planner.sols.order_search import FUTURES, annealed_order, days_of, first_order, needs_of
from planner.sols.path_bound import PathBound, path_bound
from planner.sols.path_problem import PathProblem, path_problem
from planner.solve import solve
from planner.tally import StoppedError, now_s, tallied
from planner.threads import one_blas_thread

NODES = (41, 49)
"""Grid of a sol's table, time by energy. By hand: the table agrees with 20,000 futures within 0.5 %."""

BOUND_SHARE, SEARCH_SHARE = 0.5, 0.85
"""Shares of the limit after which the bound, and bound and search together, end. By hand."""

COARSE = (21, 25)
"""Grid on which orders are compared. By hand: values are some 1 % below those on `NODES`."""

CHUNKS, STARTS = 40, 3
"""Chunks of one annealing by the rule, and how many of them begin a run. By hand: their values differ
by up to 6 % from one set of futures to another."""

PARTS, PART = 8, 500
"""Parts of annealing by the policy's value, and steps of each. By hand: three times as many won nothing."""

WARM, COLD = 0.1, 0.01
"""First and last temperature of it, in mean utilities of an observation. By hand: 0.3 wins less."""

CHECKED = 20_000
"""Futures in which the policy is carried out at the end."""

LIKELY = 0.5
"""Chance from which on an observation stands in the outline of a sol."""

SOME, MOST = 0.02, 8
"""Least chance that the policy makes an observation on sol 1 for the plan to know of it, and most of them:
those a table of the optimal policy holds."""

ERRORS_99 = 2.576
"""Standard errors on both sides of a mean that hold 99 %."""


@dataclass(frozen=True, slots=True)
class OutlinedSol:
    """What the policy does on one sol, in the mean.

    `observations` are those that it makes there likelier than not.

    `charge_j` is that of the morning, `drawn_j` what the work draws, `overrun` the chance of one.
    """

    sol: int
    observations: tuple[ObservationId, ...]
    utility: float
    charge_j: float
    drawn_j: float
    overrun: float


@dataclass(frozen=True, eq=False)
class SolPath:
    """The answer. `mean` is what the policy along `order` earned in drawn futures, `lower` that less its 99 %
    error; no policy whatever earns more than `upper` over all sols.

    `plan` is for the first sol alone: the contingent plan for what the policy makes there, of
    `first_sol`, the problem with that sol's time and the energy that the policy draws there in 99 % of the
    futures. It is None where the first sol has nothing to do.
    """

    outline: tuple[OutlinedSol, ...]
    order: tuple[ObservationId, ...]
    mean: float
    standard_error: float
    lower: float
    upper: float
    first_sol: Problem | None
    plan: PlanResult | None
    stopped: bool
    runs: int
    work_s: float
    wall_s: float
    seed: int


def solve_sols(
    problem: Problem,
    series: SolSeries,
    *,
    time_limit_s: float = 300.0,
    max_branches: int = 6,
    seed: int = 0,
    report: Callable[[Progress], None] = lambda _: None,
    should_stop: Callable[[], bool] = lambda: False,
) -> SolPath:
    """Return the best path found through the sols of a series.

    Parameters
    ----------
    time_limit_s
        Seconds of one processor, as `planner.tally` reckons them: the same order gives the same path at any
        load.
    max_branches
        Of the plan for the first sol.
    report, should_stop
        Told of progress; asked wherever the work stands. When stopped, the best path so far is returned.

    Raises
    ------
    PlannerError
        If the problem cannot be planned over several sols (`path_problem`), or a limit is out of range.
    """
    if not (math.isfinite(time_limit_s) and time_limit_s > 0.0):
        raise PlannerError(f"time_limit_s is {time_limit_s:g}; it must be above 0")
    path, began = path_problem(problem, series), time.monotonic()
    with one_blas_thread(), tallied() as tally:
        search = PathSearch(path, seed, tally.seconds + SEARCH_SHARE * time_limit_s, report)
        begun, stopped = tally.seconds, False
        tally.stop = should_stop
        try:
            report(Progress(0.0, "bound"))
            search.bound = path_bound(path, limit_s=BOUND_SHARE * time_limit_s)
            search.run()
        except StoppedError:
            stopped = True
        finally:
            tally.stop = None
        told = search.policies.carry_out(
            search.best.table, search.days, search.needs, seed=seed + 1, futures=CHECKED
        )
        left = max(time_limit_s - (tally.seconds - begun), 0.05 * time_limit_s)
        first = _first_sol(path, told)
        plan = None
        if first is not None:
            plan = solve(
                first,
                time_limit_s=left,
                max_branches=max_branches,
                seed=seed,
                quick=stopped,
                should_stop=should_stop if not stopped else lambda: False,
            )
        earned = told.utility.sum(axis=1)
        mean, error = float(earned.mean()), float(earned.std() / math.sqrt(CHECKED))
        bound = search.bound
        names = path.model.observation_ids
        return SolPath(
            outline=_outline(path, search.best.table.order, told),
            order=tuple(names[m] for m in search.best.table.order),
            mean=mean,
            standard_error=error,
            lower=mean - ERRORS_99 * error,
            upper=_all(path) if bound is None else bound.value,
            first_sol=first,
            plan=plan,
            stopped=stopped,
            runs=search.runs,
            work_s=tally.seconds - begun,
            wall_s=time.monotonic() - began,
            seed=seed,
        )


def _all(path: PathProblem) -> float:
    """Return the sum of all expected utilities that some sol allows."""
    worth = path.model.utility * path.model.p_success
    return float(worth[path.allowed.any(axis=0)].sum())


class PathSearch:
    """Looks for the order with the best policy: annealing by the rule, then by the policy's value itself.

    `until_s` is when the tally ends it.
    """

    def __init__(
        self,
        path: PathProblem,
        seed: int,
        until_s: float,
        report: Callable[[Progress], None] = lambda _: None,
    ) -> None:
        self.path, self.seed, self.until_s, self.report = path, seed, until_s, report
        self.days: Days = days_of(path)
        self.needs: Needs = needs_of(path, seed=seed, futures=FUTURES)
        self.policies = OrderPolicies(path, self.needs, NODES)
        self.coarse = OrderPolicies(path, self.needs, COARSE)
        self.bound: PathBound | None = None
        self.best: OrderPolicy = self.policies.best(np.zeros(0, np.int64))
        self.runs = 0

    def run(self) -> None:
        """Run until the limit, once at least."""
        if not first_order(self.path)[1]:
            return  # nothing is wanted on any sol: no run would spend anything of the limit
        begun = now_s()
        while self.runs == 0 or now_s() < self.until_s:
            self._polish(self._start())
            self.runs += 1
            share = (now_s() - begun) / max(self.until_s - begun, 1e-9)
            upper = None if self.bound is None else self.bound.value
            self.report(Progress(min(0.3 + 0.5 * share, 0.8), "orders", self.best.value, upper))

    def _start(self) -> Ints:
        """Return the best of a few orders annealed by the rule, each in futures of its own."""
        found: list[OrderPolicy] = []
        while not found or (len(found) < STARTS and now_s() < self.until_s):
            run = self.runs * STARTS + len(found)
            needs = needs_of(self.path, seed=self.seed + 7919 * run, futures=FUTURES)
            order, _ = annealed_order(self.path, self.days, needs, run=run, seed=self.seed, chunks=CHUNKS)
            found.append(self._offer(order))
        return max(found, key=lambda policy: policy.value).table.order

    def _polish(self, order: Ints) -> None:
        """Anneal an order by the value of its policy on the coarse grid."""
        wanted = first_order(self.path)[0]
        size, mean = len(order), float(self.needs.worth[wanted].mean())
        order = np.concatenate([order, np.setdiff1d(wanted, order)])
        best_value = -math.inf
        best = order[:0]
        for part in range(PARTS):
            if now_s() >= self.until_s:
                break
            hot, cold = (mean * WARM * (COLD / WARM) ** (k / PARTS) for k in (part, part + 1))
            draw = (self.seed * 7919 + self.runs * 104_729 + part) % (1 << 32)
            order, size, found, value = self.coarse.annealed(
                self.days, order, size, seed=draw, steps=PART, hot=hot, cold=cold
            )
            if value > best_value:
                best, best_value = found, value
        if best_value > -math.inf:
            self._offer(best)

    def _offer(self, order: Ints) -> OrderPolicy:
        found = self.policies.best(order)
        if found.value > self.best.value:
            self.best = found
        return found


def _outline(path: PathProblem, order: Ints, told: Told) -> tuple[OutlinedSol, ...]:
    chance: Floats = told.made / CHECKED
    names = path.model.observation_ids
    return tuple(
        OutlinedSol(
            sol=k + 1,
            observations=tuple(names[m] for m in order if chance[k, m] >= LIKELY),
            utility=float(told.utility[:, k].mean()),
            charge_j=float(told.charge_j[:, k].mean()),
            drawn_j=float(told.drawn_j[:, k].mean()),
            overrun=float(told.overran[k] / CHECKED),
        )
        for k in range(path.sols)
    )


def _first_sol(path: PathProblem, told: Told) -> Problem | None:
    """Return the first sol alone: its observations, its time, and the energy that it draws at most."""
    chance = told.made[0] / CHECKED
    held = [m for m in np.argsort(-chance, kind="stable")[:MOST].tolist() if chance[m] >= SOME]
    if not held:
        return None
    problem, names = path.problem, {path.model.observation_ids[m] for m in held}
    targets = []
    for target in problem.targets:
        kept = []
        for o in target.observations:
            if o.id in names:
                opens, closes = path.window[0, path.model.number_of[o.id]]
                always = opens <= 0.0 and math.isinf(closes)
                kept.append(
                    dataclasses.replace(o, window_s=None if always else (float(opens), float(closes)))
                )
        if kept:
            targets.append(dataclasses.replace(target, observations=tuple(kept)))
    kept_places = {t.id for t in targets}
    through = places_through(problem, kept_places)
    targets += [dataclasses.replace(t, observations=()) for t in problem.targets if t.id in through]
    places = {str(t.id) for t in targets}
    legs = tuple(
        dataclasses.replace(leg, p_lose={})
        for leg in problem.legs
        if leg.to in places and (leg.origin in places or leg.origin == START)
    )
    drawn = float(np.quantile(told.drawn_j[:, 0], 0.99))
    budget = Budget(
        float(path.time_s[0]), path.charge_j, max(path.charge_j - drawn, float(path.reserve_j[0]))
    )
    return dataclasses.replace(
        problem,
        name=f"{problem.name}, sol 1",
        targets=tuple(targets),
        legs=legs,
        budget=budget,
        source_format="problem/1",
    )
