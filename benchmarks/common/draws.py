"""Tables of draws: whole futures fixed in advance, to be met by the evaluator and by the executive alike."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planner.evaluate.model import Floats, Model
from planner.evaluate.program import Program, compile_plan
from planner.evaluate.rollout import Costs, Draws, Odds, Outcome, Passages, Rows, Standing, World, roll
from planner.plan_tree import Plan
from planner.problem import Problem
from planner.sol_kind import all_kinds


@dataclass(frozen=True, eq=False)
class DrawTable:
    """What would happen in each of N futures, whatever is done. Places are 0 = start, then the targets in
    order.

    Durations are whole milliseconds (as seconds), energies whole thousandths of a joule. A tracked target i
    is lost on the leg a -> b iff `leg_loss_u[f, a, b, i]` is less than its chance, and the drive fails iff
    `leg_fail_u[f, a, b]` is less than its own; an observation succeeds iff `obs_success_u[f, k]` is less
    than its probability. Amounts are as they come out on the future's kind of sol, `energy_factor` is that of
    the kind on the hotel load and on the starts of tracks.
    """

    leg_time_s: Floats  # (N, n + 1, n + 1), without the overhead per tracked target
    leg_energy_j: Floats  # (N, n + 1, n + 1)
    leg_loss_u: Floats  # (N, n + 1, n + 1, n + 1)
    leg_fail_u: Floats  # (N, n + 1, n + 1)
    obs_time_s: Floats  # (N, m)
    obs_energy_j: Floats  # (N, m)
    obs_success_u: Floats  # (N, m)
    energy_factor: Floats  # (N,)
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
            self.leg_fail_u[rows],
            self.obs_time_s[rows],
            self.obs_energy_j[rows],
            self.obs_success_u[rows],
            self.energy_factor[rows],
            self.seed,
        )


def draw_table(problem: Problem, futures: int, seed: int) -> DrawTable:
    """Return `futures` futures of a problem; the same for the same seed."""
    model = Model.of(problem)
    n1, m = model.n + 1, model.m
    streams = np.random.SeedSequence(seed).spawn(8)
    rng = [np.random.Generator(np.random.PCG64(s)) for s in streams]

    kinds = all_kinds(problem.sol_kinds)
    kind = rng[7].choice(len(kinds), futures, p=[k.p for k in kinds])
    drive_s, drive_j, every_j = (
        np.array(
            [
                (k.drive_time_factor, k.drive_energy_factor * k.energy_factor, k.energy_factor)[i]
                for k in kinds
            ]
        )
        for i in range(3)
    )

    def amounts(r: np.random.Generator, mu: Floats, sigma: Floats, factor: Floats) -> Floats:
        z = r.standard_normal((futures, *mu.shape))
        times = factor[kind].reshape(-1, *(1 for _ in mu.shape))
        with np.errstate(over="ignore", invalid="ignore"):
            return np.asarray(np.round(times * np.exp(mu + sigma * z), 3), np.float64)

    has, usual = model.has_leg, np.ones(len(kinds))
    leg_time = np.where(has, amounts(rng[0], model.leg_ln[..., 0], model.leg_ln[..., 1], drive_s), 0.0)
    leg_energy = np.where(has, amounts(rng[1], model.leg_ln[..., 2], model.leg_ln[..., 3], drive_j), 0.0)
    return DrawTable(
        leg_time_s=leg_time,
        leg_energy_j=leg_energy,
        leg_loss_u=rng[2].random((futures, n1, n1, n1)),
        leg_fail_u=rng[6].random((futures, n1, n1)),
        obs_time_s=amounts(rng[3], model.obs_ln[:, 0], model.obs_ln[:, 1], usual),
        obs_energy_j=amounts(rng[4], model.obs_ln[:, 2], model.obs_ln[:, 3], every_j),
        obs_success_u=rng[5].random((futures, m)),
        energy_factor=every_j[kind],
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


def _milliseconds(seconds: Floats) -> Floats:
    """Return times in whole milliseconds, as exact as integers."""
    return np.asarray(np.round(np.clip(seconds, -1e12, 1e12) * 1000.0), np.float64)


def earned(problem: Problem, plan: Plan, table: DrawTable) -> Earned:
    """Return what a plan earns in each future of a table, on a clock of whole milliseconds."""
    model = Model.of(problem)
    program = compile_plan(model, plan)
    count = len(table)
    outcome = Outcome.empty(count)
    visited = np.zeros((count, len(program)), np.bool_)
    draws = Draws(
        _milliseconds(table.leg_time_s), table.leg_energy_j, table.leg_loss_u, table.leg_fail_u,
        _milliseconds(table.obs_time_s), table.obs_energy_j, table.obs_success_u,
        table.energy_factor,
    )  # fmt: skip
    roll(
        Rows.of(program), Costs.of(model, 1000), World.of(model, model.utility), Odds(0), 0, count, True,
        draws, outcome, np.zeros(0, np.int64), visited, Passages.empty(0, 0), Standing.at_start(),
    )  # fmt: skip
    return Earned(*outcome, visited, program)
