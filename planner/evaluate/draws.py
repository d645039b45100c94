"""Tables of draws: whole futures fixed in advance, to be met by the evaluator and by the executive alike."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from planner.evaluate.model import Floats, Model
from planner.evaluate.program import Program, compile_plan
from planner.plan_tree import Plan
from planner.problem import Problem


@dataclass(frozen=True, eq=False)
class DrawTable:
    """What would happen in each of N futures, whatever is done. Places are 0 = start, then the targets in
    order.

    Durations are whole milliseconds (as seconds), energies whole thousandths of a joule. A tracked target i
    is lost on the leg a -> b iff `leg_loss_u[f, a, b, i]` is less than its chance; an observation succeeds
    iff `obs_success_u[f, k]` is less than its probability.
    """

    leg_time_s: Floats  # (N, n + 1, n + 1), without the overhead per tracked target
    leg_energy_j: Floats  # (N, n + 1, n + 1)
    leg_loss_u: Floats  # (N, n + 1, n + 1, n + 1)
    obs_time_s: Floats  # (N, m)
    obs_energy_j: Floats  # (N, m)
    obs_success_u: Floats  # (N, m)
    seed: int

    def __len__(self) -> int:
        return len(self.leg_time_s)

    def future(self, k: int) -> DrawTable:
        """Return the table that holds future k alone."""
        rows = slice(k, k + 1)
        return DrawTable(
            self.leg_time_s[rows],
            self.leg_energy_j[rows],
            self.leg_loss_u[rows],
            self.obs_time_s[rows],
            self.obs_energy_j[rows],
            self.obs_success_u[rows],
            self.seed,
        )


def draw_table(problem: Problem, futures: int, seed: int) -> DrawTable:
    """Return `futures` futures of a problem; the same for the same seed."""
    model = Model.of(problem)
    n1, m = model.n + 1, model.m
    streams = np.random.SeedSequence(seed).spawn(6)
    rng = [np.random.Generator(np.random.PCG64(s)) for s in streams]

    def amounts(r: np.random.Generator, mu: Floats, sigma: Floats) -> Floats:
        z = r.standard_normal((futures, *mu.shape))
        with np.errstate(over="ignore", invalid="ignore"):
            return np.asarray(np.round(np.exp(mu + sigma * z), 3), np.float64)

    has = model.has_leg
    leg_time = np.where(has, amounts(rng[0], model.leg_ln[..., 0], model.leg_ln[..., 1]), 0.0)
    leg_energy = np.where(has, amounts(rng[1], model.leg_ln[..., 2], model.leg_ln[..., 3]), 0.0)
    return DrawTable(
        leg_time_s=leg_time,
        leg_energy_j=leg_energy,
        leg_loss_u=rng[2].random((futures, n1, n1, n1)),
        obs_time_s=amounts(rng[3], model.obs_ln[:, 0], model.obs_ln[:, 1]),
        obs_energy_j=amounts(rng[4], model.obs_ln[:, 2], model.obs_ln[:, 3]),
        obs_success_u=rng[5].random((futures, m)),
        seed=seed,
    )


@dataclass(frozen=True, eq=False)
class Earned:
    """What a plan earned in each future of a table, when it ended, and which program rows it went through.

    `utility` tosses the success coin; `options` lists, per future, the tests that held (rows of the program).
    """

    utility: Floats
    time_s: Floats
    energy_j: Floats
    overrun: np.ndarray[tuple[int], np.dtype[np.bool_]]
    visited: np.ndarray[tuple[int, int], np.dtype[np.bool_]]  # (N, rows of the program)
    program: Program


@njit(nogil=True, cache=True)
def _replay(
    op: Any,
    arg: Any,
    value: Any,
    go: Any,
    fail: Any,
    entry: Any,
    n: Any,
    t_max_ms: Any,
    e_max: Any,
    hotel: Any,
    penalty: Any,
    track_ms: Any,
    track_e: Any,
    track_leg_ms: Any,
    has_leg: Any,
    loss: Any,
    obs_place: Any,
    worth: Any,
    p_success: Any,
    is_place: Any,
    window_ms: Any,
    predecessors: Any,
    trackable: Any,
    place_bits: Any,
    target_bits: Any,
    diminishing: Any,
    leg_ms: Any,
    leg_e: Any,
    leg_u: Any,
    obs_ms: Any,
    obs_e: Any,
    obs_u: Any,
    utility: Any,
    time_s: Any,
    energy: Any,
    over: Any,
    visited: Any,
) -> Any:
    n1 = n + 1
    for f in range(leg_ms.shape[0]):
        t = 0
        g = 0.0
        u = 0.0
        loc = 0
        tracked = 0
        ntrk = 0
        done = 0
        pc = entry
        ended_over = False
        while True:
            o = op[pc]
            visited[f, pc] = True
            if o == 0:
                break
            i = arg[pc]
            if o == 3:
                if loc != i:
                    if not has_leg[loc, i]:
                        pc = fail[pc]
                        continue
                    t += leg_ms[f, loc, i] + track_leg_ms * ntrk
                    g += leg_e[f, loc, i]
                    if t > t_max_ms or g + hotel * (t / 1000.0) > e_max:
                        ended_over = True
                        break
                    for k in range(1, n1):
                        if (tracked >> k) & 1 and leg_u[f, loc, i, k] < loss[loc, i, k]:
                            tracked &= ~(1 << k)
                            ntrk -= 1
                    loc = i
                pc = go[pc]
            elif o == 4:
                place = obs_place[i]
                if (
                    loc != place
                    or (done >> i) & 1
                    or t > window_ms[i, 1]
                    or (is_place[i] and not (tracked >> place) & 1)
                    or (predecessors[i] & ~done) != 0
                ):
                    pc = fail[pc]
                    continue
                if t < window_ms[i, 0]:
                    t = window_ms[i, 0]
                t += obs_ms[f, i]
                g += obs_e[f, i]
                if t > t_max_ms or g + hotel * (t / 1000.0) > e_max:
                    ended_over = True
                    break
                if obs_u[f, i] < p_success[i]:
                    w = worth[i]
                    before = done & target_bits[place]
                    while before != 0:
                        w *= diminishing[place]
                        before &= before - 1
                    u += w
                done |= 1 << i
                if is_place[i] and (place_bits[place] & ~done) == 0 and (tracked >> place) & 1:
                    tracked &= ~(1 << place)
                    ntrk -= 1
                pc = go[pc]
            elif o == 5:
                pc = go[pc] if (not trackable[i]) or (tracked >> i) & 1 else fail[pc]
            elif o == 6:
                pc = go[pc] if t / 1000.0 >= value[pc] else fail[pc]
            elif o == 7:
                pc = go[pc] if g + hotel * (t / 1000.0) >= value[pc] else fail[pc]
            elif o == 8:
                pc = go[pc] if (tracked >> i) & 1 else fail[pc]
            elif o == 9:
                pc = go[pc] if (done >> i) & 1 else fail[pc]
            elif o == 1:
                if loc != 0 or not trackable[i] or (tracked >> i) & 1:
                    pc = fail[pc]
                    continue
                t += track_ms
                g += track_e
                if t > t_max_ms or g + hotel * (t / 1000.0) > e_max:
                    ended_over = True
                    break
                tracked |= 1 << i
                ntrk += 1
                pc = go[pc]
            else:
                if (tracked >> i) & 1:
                    tracked &= ~(1 << i)
                    ntrk -= 1
                pc = go[pc]
        utility[f] = u - (penalty if ended_over else 0.0)
        time_s[f] = t / 1000.0
        energy[f] = g + hotel * (t / 1000.0)
        over[f] = ended_over


def _milliseconds(seconds: Floats) -> np.ndarray[tuple[int, ...], np.dtype[np.int64]]:
    return np.round(np.clip(seconds, -1e12, 1e12) * 1000.0).astype(np.int64)


def earned(problem: Problem, plan: Plan, table: DrawTable) -> Earned:
    """Return what a plan earns in each future of a table, on a clock of whole milliseconds."""
    model = Model.of(problem)
    program = compile_plan(model, plan)
    count = len(table)
    utility, time_s, energy = np.zeros(count), np.zeros(count), np.zeros(count)
    over = np.zeros(count, np.bool_)
    visited = np.zeros((count, len(program)), np.bool_)
    _replay(
        program.op, program.arg, program.value, program.go, program.fail, program.entry,
        model.n, round(model.t_max_s * 1000), model.e_max_j, model.hotel_w, model.penalty,
        round(model.track_t_s * 1000), model.track_e_j, round(model.track_leg_s * 1000),
        model.has_leg, model.loss, model.obs_place, model.utility, model.p_success, model.is_place,
        _milliseconds(model.window), model.predecessors, model.trackable, model.place_bits, model.target_bits,
        model.diminishing,
        _milliseconds(table.leg_time_s), table.leg_energy_j, table.leg_loss_u,
        _milliseconds(table.obs_time_s), table.obs_energy_j, table.obs_success_u,
        utility, time_s, energy, over, visited,
    )  # fmt: skip
    return Earned(utility, time_s, energy, over, visited, program)
