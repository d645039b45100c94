"""Monte Carlo value of a plan tree, with draws that are keyed by (seed, future, action).

Every draw is a hash of the seed, the number of the future and the action that asks for it. So a future does
not depend on the order in which actions are carried out, two plans compared under one seed meet the same
durations, energies and losses (common random numbers), and the answer is the same on any number of threads.
The success coin is not tossed: an observation earns its utility times its probability of success.
"""

from __future__ import annotations

import math
import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from planner.evaluate.model import Floats, Ints, Model
from planner.evaluate.program import Program, compile_plan
from planner.evaluate.rollout import flat_costs, flat_model, flat_program, no_table, roll, unwatched
from planner.plan_tree import Plan

CHUNK = 4096
"""Futures per chunk; sums are formed within chunks and then over chunks in order."""


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
class Passages:
    """Time, energy and tracks (bits of places) with which each future came to each row of the program.

    Arrays of shape (futures, rows); the time is NaN where a future never came to a row.
    """

    time_s: Floats
    energy_j: Floats
    tracked: Ints

    @staticmethod
    def empty(futures: int, rows: int) -> Passages:
        shape = futures, rows
        return Passages(np.full(shape, np.nan), np.full(shape, np.nan), np.zeros(shape, np.int64))

    def part(self, low: int, high: int) -> tuple[Floats, Floats, Ints]:
        return self.time_s[low:high], self.energy_j[low:high], self.tracked[low:high]


@dataclass(frozen=True, eq=False)
class Futures:
    """What a plan earned and used in each of the futures 0..N-1 of a seed; arrays of length N."""

    utility: Floats
    time_s: Floats
    energy_j: Floats
    overrun: np.ndarray[tuple[int], np.dtype[np.bool_]]
    row_visits: np.ndarray[tuple[int], np.dtype[np.int64]]
    seen: Passages | None = None

    def estimate(self) -> Estimate:
        """Return the summary, summed chunk by chunk so that it does not depend on the number of threads."""
        count = len(self.utility)
        mean = math.fsum(self.utility) / count if count else 0.0
        spread = float(np.std(self.utility)) if count else 0.0
        return Estimate(
            mean=mean,
            standard_error=spread / math.sqrt(max(count, 1)),
            standard_deviation=spread,
            mean_time_s=float(np.mean(self.time_s)) if count else 0.0,
            mean_energy_j=float(np.mean(self.energy_j)) if count else 0.0,
            overrun=float(np.mean(self.overrun)) if count else 0.0,
            futures=count,
        )


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
    how = correlation or Correlation()
    utility = np.empty(futures)
    time_s = np.empty(futures)
    energy_j = np.empty(futures)
    overrun = np.empty(futures, np.bool_)
    workers = max(1, min(threads or os.cpu_count() or 1, -(-futures // CHUNK)))
    visits = [np.zeros(len(program) if count_visits else 0, np.int64) for _ in range(workers)]

    flat = flat_program(program)
    amounts = (1.0, model.t_max_s, model.e_max_j, *flat_costs(model), model.track_leg_s, model.window)
    arrays = flat_model(model, model.utility * model.p_success)
    odds = (seed, how.day_factor_sd, how.slip_persistence, how.p_recover)
    table = no_table()
    unmarked = np.zeros((0, 0), np.bool_)
    seen = Passages.empty(futures, len(program)) if watch else None

    def work(worker: int) -> None:
        for chunk in range(worker, -(-futures // CHUNK), workers):
            low, high = chunk * CHUNK, min(futures, (chunk + 1) * CHUNK)
            roll(
                flat, amounts, arrays, odds, low, high - low, False, *table,
                utility[low:high], time_s[low:high], energy_j[low:high], overrun[low:high], visits[worker],
                unmarked, *(unwatched() if seen is None else seen.part(low, high)),
            )  # fmt: skip

    if workers == 1:
        work(0)
    else:
        with ThreadPoolExecutor(workers) as pool:
            list(pool.map(work, range(workers)))
    return Futures(utility, time_s, energy_j, overrun, np.sum(visits, axis=0), seen)


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
