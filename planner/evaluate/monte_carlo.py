"""Monte Carlo value of a plan tree: a numba kernel whose draws are keyed by (seed, future, action).

Every draw is a hash of the seed, the number of the future and the action that asks for it (SplitMix64 over a
counter). So a future does not depend on the order in which actions are carried out, two plans compared
under one seed meet the same durations, energies and losses (common random numbers), and the answer is the
same on any number of threads. The success coin is not tossed: an observation earns its utility times its
probability of success.
"""

from __future__ import annotations

import math
import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit, uint64

from planner.evaluate.model import Floats, Model
from planner.evaluate.program import Program, compile_plan
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


@njit(inline="always")
def _mix(x: Any) -> Any:
    x = (x ^ (x >> uint64(30))) * uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> uint64(27))) * uint64(0x94D049BB133111EB)
    return x ^ (x >> uint64(31))


@njit(inline="always")
def _uniform(key: Any, counter: Any) -> Any:
    """A number in (0, 1) that is a hash of key and counter."""
    x = _mix(key + (uint64(counter) + uint64(1)) * uint64(0x9E3779B97F4A7C15))
    return (float(x >> uint64(11)) + 0.5) * (1.0 / 9007199254740992.0)


@njit(nogil=True, cache=True, fastmath=True)
def _simulate(
    op: Any,
    arg: Any,
    value: Any,
    go: Any,
    fail: Any,
    entry: Any,
    seed: Any,
    first: Any,
    count: Any,
    n: Any,
    t_max: Any,
    e_max: Any,
    hotel: Any,
    penalty: Any,
    track_t: Any,
    track_e: Any,
    track_leg: Any,
    leg_ln: Any,
    has_leg: Any,
    loss: Any,
    obs_ln: Any,
    obs_place: Any,
    worth: Any,
    is_place: Any,
    window: Any,
    predecessors: Any,
    trackable: Any,
    place_bits: Any,
    target_bits: Any,
    diminishing: Any,
    day_sd: Any,
    persistence: Any,
    p_recover: Any,
    utility: Any,
    time_used: Any,
    energy_used: Any,
    over: Any,
    visits: Any,
) -> Any:
    """Fill utility, time, energy and overrun of futures first .. first + count - 1; count visits of rows."""
    n1 = n + 1
    day_sigma = math.sqrt(math.log1p(day_sd * day_sd))
    keep = persistence
    fresh = math.sqrt(max(0.0, 1.0 - keep * keep))
    counting = visits.shape[0] > 0
    for f in range(count):
        key = _mix(uint64(seed) * uint64(0xD1342543DE82EF95) + uint64(first + f) + uint64(0x2545F4914F6CDD1D))
        key = _mix(key ^ uint64(0x9E3779B97F4A7C15))
        t = 0.0
        g = 0.0
        u = 0.0
        ended_over = False
        loc = 0
        tracked = 0
        ever = 0
        ntrk = 0
        done = 0
        pc = entry
        last_z = 0.0
        factor = 1.0
        if day_sigma > 0.0:
            z = math.sqrt(-2.0 * math.log(_uniform(key, 1))) * math.cos(6.283185307179586 * _uniform(key, 2))
            factor = math.exp(day_sigma * z - 0.5 * day_sigma * day_sigma)
        while True:
            o = op[pc]
            if counting:
                visits[pc] += 1
            if o == 0:
                break
            i = arg[pc]
            if o == 3:
                if loc != i:
                    if not has_leg[loc, i]:
                        pc = fail[pc]
                        continue
                    base = 16 + (loc * n1 + i) * (n1 + 2)
                    r = math.sqrt(-2.0 * math.log(_uniform(key, base)))
                    a = 6.283185307179586 * _uniform(key, base + 1)
                    z1 = r * math.cos(a)
                    if keep > 0.0:
                        z1 = keep * last_z + fresh * z1
                        last_z = z1
                    t += factor * math.exp(leg_ln[loc, i, 0] + leg_ln[loc, i, 1] * z1) + track_leg * ntrk
                    g += math.exp(leg_ln[loc, i, 2] + leg_ln[loc, i, 3] * r * math.sin(a))
                    if t > t_max or g + hotel * t > e_max:
                        u -= penalty
                        ended_over = True
                        break
                    if tracked != 0 or (p_recover > 0.0 and ever != 0):
                        for k in range(1, n1):
                            if (tracked >> k) & 1:
                                p = loss[loc, i, k]
                                if p > 0.0 and _uniform(key, base + 1 + k) < p:
                                    tracked &= ~(1 << k)
                                    ntrk -= 1
                            elif (ever >> k) & 1 and _uniform(key, base + 1 + k) < p_recover:
                                tracked |= 1 << k
                                ntrk += 1
                    loc = i
                pc = go[pc]
            elif o == 4:
                place = obs_place[i]
                if (
                    loc != place
                    or (done >> i) & 1
                    or t > window[i, 1]
                    or (is_place[i] and not (tracked >> place) & 1)
                    or (predecessors[i] & ~done) != 0
                ):
                    pc = fail[pc]
                    continue
                if t < window[i, 0]:
                    t = window[i, 0]
                base = 16 + n1 * n1 * (n1 + 2) + 2 * i
                r = math.sqrt(-2.0 * math.log(_uniform(key, base)))
                a = 6.283185307179586 * _uniform(key, base + 1)
                t += factor * math.exp(obs_ln[i, 0] + obs_ln[i, 1] * r * math.cos(a))
                g += math.exp(obs_ln[i, 2] + obs_ln[i, 3] * r * math.sin(a))
                if t > t_max or g + hotel * t > e_max:
                    u -= penalty
                    ended_over = True
                    break
                w = worth[i]
                if diminishing[place] != 1.0:
                    before = done & target_bits[place]
                    while before != 0:
                        w *= diminishing[place]
                        before &= before - 1
                u += w
                done |= 1 << i
                if is_place[i] and (place_bits[place] & ~done) == 0 and (tracked >> place) & 1:
                    tracked &= ~(1 << place)
                    ntrk -= 1
                    ever &= ~(1 << place)
                pc = go[pc]
            elif o == 5:
                pc = go[pc] if (not trackable[i]) or (tracked >> i) & 1 else fail[pc]
            elif o == 6:
                pc = go[pc] if t >= value[pc] else fail[pc]
            elif o == 7:
                pc = go[pc] if g + hotel * t >= value[pc] else fail[pc]
            elif o == 8:
                pc = go[pc] if (tracked >> i) & 1 else fail[pc]
            elif o == 9:
                pc = go[pc] if (done >> i) & 1 else fail[pc]
            elif o == 1:
                if loc != 0 or not trackable[i] or (tracked >> i) & 1:
                    pc = fail[pc]
                    continue
                t += track_t
                g += track_e
                if t > t_max or g + hotel * t > e_max:
                    u -= penalty
                    ended_over = True
                    break
                tracked |= 1 << i
                ever |= 1 << i
                ntrk += 1
                pc = go[pc]
            else:
                if (tracked >> i) & 1:
                    tracked &= ~(1 << i)
                    ntrk -= 1
                ever &= ~(1 << i)
                pc = go[pc]
        utility[f] = u
        time_used[f] = t
        energy_used[f] = g + hotel * t
        over[f] = ended_over


@dataclass(frozen=True, eq=False)
class Futures:
    """What a plan earned and used in each of the futures 0..N-1 of a seed; arrays of length N."""

    utility: Floats
    time_s: Floats
    energy_j: Floats
    overrun: np.ndarray[tuple[int], np.dtype[np.bool_]]
    row_visits: np.ndarray[tuple[int], np.dtype[np.int64]]

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
) -> Futures:
    """Run a plan through `futures` futures and return what each earned and used.

    The result depends on the plan, the seed and the number of futures only, never on `threads`. Future k of
    a seed is the same whatever plan meets it.
    """
    program = plan if isinstance(plan, Program) else compile_plan(model, plan)
    how = correlation or Correlation()
    utility = np.empty(futures)
    time_s = np.empty(futures)
    energy_j = np.empty(futures)
    overrun = np.empty(futures, np.bool_)
    workers = max(1, min(threads or os.cpu_count() or 1, -(-futures // CHUNK)))
    worth = model.utility * model.p_success
    visits = [np.zeros(len(program) if count_visits else 0, np.int64) for _ in range(workers)]

    def work(worker: int) -> None:
        for chunk in range(worker, -(-futures // CHUNK), workers):
            low, high = chunk * CHUNK, min(futures, (chunk + 1) * CHUNK)
            _simulate(
                program.op, program.arg, program.value, program.go, program.fail, program.entry,
                seed, low, high - low,
                model.n, model.t_max_s, model.e_max_j, model.hotel_w, model.penalty,
                model.track_t_s, model.track_e_j, model.track_leg_s,
                model.leg_ln, model.has_leg, model.loss, model.obs_ln, model.obs_place, worth, model.is_place,
                model.window, model.predecessors, model.trackable, model.place_bits, model.target_bits,
                model.diminishing,
                how.day_factor_sd, how.slip_persistence, how.p_recover,
                utility[low:high], time_s[low:high], energy_j[low:high], overrun[low:high], visits[worker],
            )  # fmt: skip

    if workers == 1:
        work(0)
    else:
        with ThreadPoolExecutor(workers) as pool:
            list(pool.map(work, range(workers)))
    return Futures(utility, time_s, energy_j, overrun, np.sum(visits, axis=0))


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
