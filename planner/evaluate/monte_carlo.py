"""Monte Carlo value of a plan tree, with draws that are keyed by (seed, future, action).

Every draw is a hash of the seed, the number of the future and the action that asks for it. So a future does
not depend on the order in which actions are carried out, two plans compared under one seed meet the same
durations, energies and losses (common random numbers), and the answer is the same on any number of threads.
The success coin is not tossed: an observation earns its utility times its probability of success
(`planner.outlook` tosses it).
"""

from __future__ import annotations

import math
import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np

from planner.evaluate.model import Floats, Model
from planner.evaluate.program import Program, compile_plan
from planner.evaluate.rollout import (
    Costs,
    Draws,
    Odds,
    Outcome,
    Passages,
    Rows,
    Standing,
    World,
    kinds_of,
    roll,
)
from planner.plan_tree import Plan
from planner.tally import Step, spend

CHUNK = 4096
"""Futures per chunk; sums are formed within chunks and then over chunks in order."""

FEWEST = 100
"""Futures of a kind of sol below which their deviation is not believed. By hand."""

UNMARKED = np.zeros((0, 0), np.bool_)
UNWATCHED = Passages.empty(0, 0)


@dataclass(frozen=True, slots=True)
class Correlation:
    """What breaks the independence between actions; the defaults leave them independent.

    `day_factor_sd` is the standard deviation of one log-normal factor of mean 1 on all durations of a day.
    `slip_persistence` in [0, 1] is the share of each drive's normal deviate that it takes over from the drive
    before. `p_recover` is the chance, per leg, that a lost target is found again.
    """

    day_factor_sd: float = 0.0
    slip_persistence: float = 0.0
    p_recover: float = 0.0


ROLLED = 0.5
"""What an action of a future takes where all are simulated at once, in `Step.ACTION`."""

RESUMED = 5
"""What a call of `resume` takes beside its futures, in `Step.CALL`: the plan is compiled, and where futures
stand is read. By hand, on 15 targets."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """Mean of the utility over `futures` draws, its standard error, and means of what was used.

    `standard_deviation` is that of the utility with the success coin averaged out. `overrun` is the share of
    futures that ended over a budget.
    """

    mean: float
    standard_error: float
    standard_deviation: float
    mean_time_s: float
    mean_energy_j: float
    overrun: float
    futures: int


@dataclass(frozen=True, eq=False)
class Futures:
    """What a plan earned and used in each of the futures 0..N-1 of a seed; arrays of length N.

    `kind` is that of each sol and `chance` (K,) that of each kind; empty where all sols are of one.
    """

    utility: Floats
    time_s: Floats
    energy_j: Floats
    overrun: np.ndarray[tuple[int], np.dtype[np.bool_]]
    row_visits: np.ndarray[tuple[int], np.dtype[np.int64]]
    seen: Passages | None = None
    kind: np.ndarray[tuple[int], np.dtype[np.int64]] = field(default_factory=lambda: np.zeros(0, np.int64))
    chance: Floats = field(default_factory=lambda: np.zeros(0))

    def estimate(self) -> Estimate:
        """Return the summary, summed chunk by chunk so that it does not depend on the number of threads.

        Where the kind of sol is hidden, the mean of the utility is that over the kinds of the means of their
        futures, so how many futures are of each kind adds nothing to its error (stratification afterwards:
        Cochran 1977, section 5A.9).
        """
        count = len(self.utility)
        mean = math.fsum(self.utility) / count if count else 0.0
        spread = float(np.std(self.utility)) if count else 0.0
        error = spread / math.sqrt(max(count, 1))
        if len(self.kind):
            mean, error = self._over_kinds(mean, error)
        return Estimate(
            mean=mean,
            standard_error=error,
            standard_deviation=spread,
            mean_time_s=float(np.mean(self.time_s)) if count else 0.0,
            mean_energy_j=float(np.mean(self.energy_j)) if count else 0.0,
            overrun=float(np.mean(self.overrun)) if count else 0.0,
            futures=count,
        )

    def _over_kinds(self, mean: float, error: float) -> tuple[float, float]:
        """Return mean and error by kinds; the plain ones given where a kind has too few futures to tell."""
        parts = [self.utility[self.kind == k] for k in range(len(self.chance))]
        if min(map(len, parts)) < FEWEST:
            return mean, error
        chance = self.chance.tolist()
        mean = math.fsum(p * math.fsum(part) / len(part) for p, part in zip(chance, parts, strict=True))
        square = math.fsum(
            p * p * float(part.var(ddof=1)) / len(part) for p, part in zip(chance, parts, strict=True)
        )
        return mean, math.sqrt(square)


def simulate(
    model: Model,
    plan: Plan | Program,
    futures: int,
    *,
    seed: int,
    threads: int | None = None,
    correlation: Correlation | None = None,
    count_visits: bool = False,
    watch: bool = False,
) -> Futures:
    """Run a plan through `futures` futures and return what each earned and used.

    The result depends on the plan, the seed and the number of futures only, never on `threads`. Future k of
    a seed is the same whatever plan meets it. With `watch` the futures hold what was seen at each row.
    """
    program = plan if isinstance(plan, Program) else compile_plan(model, plan)
    spend(Step.ACTION, ROLLED * futures * _actions(program))
    how = correlation or Correlation()
    odds = Odds(seed, how.day_factor_sd, how.slip_persistence, how.p_recover)
    outcome = Outcome.empty(futures)
    workers = max(1, min(threads or os.cpu_count() or 1, -(-futures // CHUNK)))
    visits = [np.zeros(len(program) if count_visits else 0, np.int64) for _ in range(workers)]
    seen = Passages.empty(futures, len(program)) if watch else None
    rows, costs, world = Rows.of(program), Costs.of(model), World.of(model, model.utility * model.p_success)

    def work(worker: int) -> None:
        for chunk in range(worker, -(-futures // CHUNK), workers):
            low, high = chunk * CHUNK, min(futures, (chunk + 1) * CHUNK)
            roll(
                rows, costs, world, odds, low, high - low, False, Draws.none(), outcome.part(low, high),
                visits[worker], UNMARKED, UNWATCHED if seen is None else seen.part(low, high),
                Standing.at_start(),
            )  # fmt: skip

    if workers == 1:
        work(0)
    else:
        with ThreadPoolExecutor(workers) as pool:
            list(pool.map(work, range(workers)))
    chance = model.sols.chance
    kind = kinds_of(chance, seed, np.arange(futures)) if len(chance) else np.zeros(0, np.int64)
    return Futures(*outcome, np.sum(visits, axis=0), seen, kind, chance)


def _actions(program: Program) -> int:
    """Return about how many rows a future of a program comes to: those of its main line."""
    here, count = program.entry, 0
    while here:
        here, count = int(program.go[here]), count + 1
    return count


def resume(model: Model, plan: Plan | Program, standing: Standing, *, seed: int) -> Floats:
    """Return what the futures of a standing earn in all when they go on from there with a plan.

    Each meets the draws that it meets under `simulate`, so that of a plan and the same plan with another
    ending only the ending is carried out again. Actions are independent of each other.
    """
    program = plan if isinstance(plan, Program) else compile_plan(model, plan)
    count = len(standing.number)
    outcome = Outcome.empty(count)
    spend(Step.CALL, RESUMED)
    spend(Step.ACTION, count * _actions(program))
    if count:
        roll(
            Rows.of(program), Costs.of(model), World.of(model, model.utility * model.p_success), Odds(seed),
            0, count, False, Draws.none(), outcome, np.zeros(0, np.int64), UNMARKED, UNWATCHED, standing,
        )  # fmt: skip
    return outcome.utility


def estimate(
    model: Model,
    plan: Plan | Program,
    futures: int,
    *,
    seed: int,
    threads: int | None = None,
    correlation: Correlation | None = None,
) -> Estimate:
    """Return the Monte Carlo estimate of a plan's expected utility."""
    return simulate(model, plan, futures, seed=seed, threads=threads, correlation=correlation).estimate()
