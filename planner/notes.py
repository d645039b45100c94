"""What is expected at each step and option of a plan: odds, quantile bands, gains, utility still to come."""

from __future__ import annotations

from contextvars import Context
from dataclasses import replace
from typing import Any

import numpy as np

from planner.evaluate.grid import Grid
from planner.evaluate.model import Floats, Model
from planner.evaluate.monte_carlo import simulate
from planner.evaluate.program import compile_plan
from planner.evaluate.propagate import Backward, State, TailValues, forward
from planner.plan_edits import replace_option, without_option
from planner.plan_tree import Branch, OptionNotes, Path, Plan, PlanTree, StepNotes, TrackStart, walk
from planner.problem import Problem

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
TABLE_POINTS = 5
"""Points of an option's table of utility over time. By hand: a person reads it."""

FUTURES = 20_000
"""For notes that are sampled."""


def _quantiles(values: Floats, weights: Floats) -> tuple[float, ...]:
    order = np.argsort(values, kind="stable")
    total = np.cumsum(weights[order])
    at = np.searchsorted(total, np.array(QUANTILES) * total[-1])
    return tuple(round(float(values[order][min(k, len(order) - 1)]), 3) for k in at)


SKETCH_FUTURES = 2_000
"""For a plan that is looked at while better ones are sought: a chance is right to 1 in 50."""


def sketch(problem: Problem, plan: Plan) -> PlanTree:
    """Return a plan with notes from a few futures: its work is not counted, and steers no search."""
    tree = PlanTree(problem.name, plan)
    alone = Context()  # without the tally of the search that tells of the plan
    return alone.run(annotate_sampled, Model.of(problem), tree, seed=0, count=SKETCH_FUTURES)


def annotate_sampled(model: Model, tree: PlanTree, *, seed: int, count: int = FUTURES) -> PlanTree:
    """Return the tree with notes from sampled futures, for plans with too many states for a grid."""
    program = compile_plan(model, tree.plan)
    futures = simulate(model, program, count, seed=seed, watch=True)
    assert futures.seen is not None
    time_s, energy_j = futures.seen.time_s, futures.seen.energy_j
    steps: dict[Path, StepNotes] = {}
    options: dict[Path, OptionNotes] = {}
    for path, step in walk(tree.plan):
        row = program.step_row[path]
        there = ~np.isnan(time_s[:, row])
        if row and there.any():
            steps[path] = StepNotes(
                round(float(there.mean()), 6),
                QUANTILES,
                tuple(np.round(np.quantile(time_s[there, row], QUANTILES), 3).tolist()),
                tuple(np.round(np.quantile(energy_j[there, row], QUANTILES), 3).tolist()),
            )
        for k, option in enumerate(step.options if isinstance(step, Branch) else ()):
            here = (*path, k)
            taken = ~np.isnan(time_s[:, program.option_entry[here]])
            less = simulate(model, without_option(tree.plan, here), count, seed=seed).utility
            ended = replace_option(tree.plan, here, replace(option, plan=()))
            to_come = futures.utility - simulate(model, ended, count, seed=seed).utility
            options[here] = OptionNotes(
                round(float(taken.mean()), 6),
                round(float((futures.utility - less).mean()), 6),
                _sampled_table(time_s[taken, program.option_entry[here]], to_come[taken]),
            )
    return replace(tree, step_notes=steps, option_notes=options)


def _sampled_table(time_s: Floats, to_come: Floats) -> tuple[tuple[float, float], ...]:
    """Return a few points (time, mean utility still to come) over futures in order of time."""
    parts = np.array_split(np.argsort(time_s, kind="stable"), TABLE_POINTS)
    return tuple(
        (round(float(time_s[part].mean()), 3), round(float(to_come[part].mean()), 4))
        for part in parts
        if len(part)
    )


def annotate(model: Model, grid: Grid, tree: PlanTree) -> PlanTree:
    """Return the tree with notes on its steps and options, from the distributions on a grid."""
    program = compile_plan(model, tree.plan)
    flow = forward(grid, program)
    tails = TailValues(grid)
    backward = Backward(grid, program, tails)
    total = backward.total()
    times = np.broadcast_to(grid.t[:, None], grid.shape).ravel()
    energies = grid.energy.ravel()

    def mass_at(row: int) -> Any:
        masses = flow.get(row)
        return None if not masses else np.sum(list(masses.values()), axis=0)

    steps: dict[Path, StepNotes] = {}
    options: dict[Path, OptionNotes] = {}
    t_s = g_j = 0.0
    for k, step in enumerate(tree.plan):  # the beginning takes known amounts
        if not isinstance(step, TrackStart):
            break
        many = len(QUANTILES)
        energy = round(g_j + model.hotel_w * t_s, 3)
        steps[(k,)] = StepNotes(1.0, QUANTILES, (round(t_s, 3),) * many, (energy,) * many)
        t_s, g_j = t_s + model.track_t_s, g_j + model.track_e_j
    for path, step in walk(tree.plan):
        row = program.step_row[path]
        mass = mass_at(row) if row else None
        if mass is not None and float(mass.sum()) > 1e-9:
            flat = mass.ravel()
            steps[path] = StepNotes(
                round(min(1.0, float(flat.sum())), 6),
                QUANTILES,
                _quantiles(times, flat),
                _quantiles(energies, flat),
            )
        if not isinstance(step, Branch):
            continue
        for k in range(len(step.options)):
            here = (*path, k)
            entry = program.option_entry[here]
            taken = mass_at(entry)
            p_taken = 0.0 if taken is None else float(taken.sum())
            less = compile_plan(model, without_option(tree.plan, here))
            gain = total - Backward(grid, less, tails).total()
            options[here] = OptionNotes(
                round(min(1.0, p_taken), 6),
                round(gain, 6),
                _table(grid, backward, entry, flow.get(entry, {})),
            )
    return replace(tree, step_notes=steps, option_notes=options)


def _table(
    grid: Grid, backward: Backward, row: int, masses: dict[State, Any]
) -> tuple[tuple[float, float], ...]:
    """Return a few points (time, expected utility still to come), averaged over energy and states."""
    if not masses:
        return ()
    weight = np.sum([m.sum(axis=1) for m in masses.values()], axis=0)
    if float(weight.sum()) <= 1e-9:
        return ()
    value = np.sum([(m * backward.value(row, s)).sum(axis=1) for s, m in masses.items()], axis=0)
    kept = np.flatnonzero(weight > 1e-3 * weight.max())
    chosen = np.unique(kept[np.linspace(0, len(kept) - 1, TABLE_POINTS).astype(int)])
    return tuple((round(float(grid.t[k]), 3), round(float(value[k] / weight[k]), 4)) for k in chosen)
