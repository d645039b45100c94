"""The contingency planner of Pedersen et al. 2005 (section 8, "PICo"), kept for comparison.

Figure 15: a seed plan by orienteering on mean values; then again and again the point with the highest
variance of the utility still to come, a branch there on the loss of a track or on resources below 80 % of
what the rest of the plan is expected to need, a branch plan by orienteering on mean values from there, kept
if it improves the plan. The paper estimates values by Monte Carlo; here the same quantities come from the
grid, which leaves out the sampling noise.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from planner.contingency.seeding import mean_route, mean_seed, route_plan, route_steps, track_steps
from planner.evaluate.grid import Grid
from planner.evaluate.model import Model
from planner.evaluate.program import Program, compile_plan
from planner.evaluate.propagate import Backward, State, forward
from planner.plan_edits import put_option, steps_at, without_unused_tracks
from planner.plan_tree import (
    Branch,
    Comparison,
    Condition,
    EnergyCondition,
    Navigate,
    Observe,
    OnFail,
    Option,
    Path,
    Plan,
    TimeCondition,
    TrackedCondition,
    walk,
)
from planner.strategies.registry import Found, Task

SHARE = 0.8
"""A branch is taken when less than this share of the expected need is left."""

POINTS = 4
"""Of this many points of highest variance at which some branch helps, the best branch is taken."""

LEAST_GAIN = 2e-4
"""Share of the plan's value that a branch must win to be kept."""


@dataclass(frozen=True, slots=True)
class _Point:
    path: Path
    variance: float
    reached: float


def _mean_need(model: Model, steps: Plan, place: int) -> tuple[float, float]:
    """Return mean time and mean energy of the rest of a plan, its branches left out."""
    t = g = 0.0
    for step in steps:
        if isinstance(step, Navigate):
            to = model.place_of[step.to]
            if to != place and model.has_leg[place, to]:
                t += model.leg[place, to, 0]
                g += model.leg[place, to, 2]
                place = to
        elif isinstance(step, Observe):
            m = model.number_of[step.observation]
            t += model.obs[m, 0]
            g += model.obs[m, 2]
    return t, g + model.hotel_w * t


def _points(grid: Grid, plan: Plan, program: Program) -> list[tuple[_Point, dict[State, Any]]]:
    """Return the places where a branch may stand, by falling variance of the utility still to come."""
    flow = forward(grid, program)
    backward = Backward(grid, program)
    found = []
    for path, step in walk(plan):
        if not isinstance(step, Navigate | Observe):
            continue
        masses = flow.get(program.step_row[path], {})
        total = first = second = 0.0
        for state, mass in masses.items():
            value = backward.value(program.step_row[path], state)
            total += float(mass.sum())
            first += float((mass * value).sum())
            second += float((mass * value * value).sum())
        if total > 1e-4:
            found.append((_Point(path, second - first * first / total, total), masses))
    found.sort(key=lambda item: (-item[0].variance, item[0].path))
    return found


def _proposals(model: Model, plan: Plan, path: Path, masses: dict[State, Any], grid: Grid) -> list[Option]:
    """Return the options that the paper's rules propose at a point."""
    rest = steps_at(plan, path)
    largest = max(masses, key=lambda s: (float(masses[s].sum()), s))
    place = largest.place
    need_t, need_e = _mean_need(model, rest, place)
    total = sum(masses.values())
    weight = float(total.sum())
    mean_t = float((total * grid.t[:, None]).sum()) / weight
    mean_g = float((total * grid.g[None, :]).sum()) / weight
    wanted = [step for step in rest if isinstance(step, Observe)]
    options: list[Option] = []

    def propose(condition: Condition, state: State, t_s: float, g_j: float) -> None:
        if t_s >= model.t_max_s or g_j + model.hotel_w * t_s >= model.e_max_j:
            order: tuple[int, ...] = ()
        else:
            order = mean_route(model, state, t_s, g_j)
        steps = route_steps(model, order, place, OnFail.STOP)
        if steps != tuple(s for s in rest if not isinstance(s, Branch)):
            options.append(Option((condition,), steps))

    every = State(place, largest.done, 0)
    for state in masses:
        every = every._replace(tracked=every.tracked | state.tracked)
    late = max(model.t_max_s - SHARE * need_t, 0.0)
    if late < model.t_max_s:
        propose(TimeCondition(Comparison.GE, round(float(late), 4)), every, late, mean_g)
    low = max(model.e_max_j - SHARE * need_e, 0.0)
    if low < model.e_max_j:
        used_t = min(mean_t, low / model.hotel_w if model.hotel_w > 0 else mean_t)
        propose(
            EnergyCondition(Comparison.GE, round(float(low), 3)), every, used_t, low - model.hotel_w * used_t
        )
    for step in wanted:
        m = model.number_of[step.observation]
        target = int(model.obs_place[m])
        if not model.is_place[m]:
            continue
        lost = {s: mass for s, mass in masses.items() if not (s.tracked >> target) & 1}
        if sum(float(mass.sum()) for mass in lost.values()) < 1e-3:
            continue
        propose(
            TrackedCondition(step.target, False),
            every._replace(tracked=every.tracked & ~(1 << target)),
            mean_t,
            mean_g,
        )
    return options


def search(task: Task) -> Found:
    """Return the plan of the 2004 planner."""
    plan = plan_pico2005(
        task.model,
        task.grid,
        max_branches=task.max_branches,
        max_steps=task.iterations,
        should_stop=lambda: task.watch.stop(0.9),
        report=task.watch.told,
    )
    return Found([(0.0, plan)])


def plan_pico2005(
    model: Model,
    grid: Grid,
    *,
    max_branches: int,
    max_steps: int | None = None,
    should_stop: Callable[[], bool] = lambda: False,
    report: Callable[[Plan, float], None] = lambda plan, value: None,
) -> Plan:
    """Return the plan of the 2004 planner with at most `max_branches` branches.

    The paper does not say which targets are tracked beyond those of the seed plan, and a branch can only
    turn to a tracked one; both readings are tried (those of the seed plan; all), and the better plan is
    returned without the tracks that it does not use. `max_steps` limits the number of branches tried.
    `report` is told each plan that is kept.
    """
    # Figure 15, step 1: generate seed plan.
    must = sum(1 << m for m in range(model.m) if model.must_do[m])
    order = mean_seed(model, must=must)
    route = route_steps(model, order, 0, OnFail.STOP)
    seed = route_plan(model, order, OnFail.STOP)
    if not order:
        return seed
    best, best_value = seed, Backward(grid, compile_plan(model, seed)).total()
    report(best, best_value)
    every = (*track_steps(model, set(range(model.m))), *route)
    budget = _Tries(max_steps)
    for start in dict.fromkeys((seed, every)):
        plan = _grow(model, grid, start, max_branches, budget, should_stop)
        plan = without_unused_tracks(model, plan)
        value = Backward(grid, compile_plan(model, plan)).total()
        if value > best_value:
            best, best_value = plan, value
            report(best, best_value)
    return best


class _Tries:
    """Counts branches tried against a limit."""

    def __init__(self, limit: int | None) -> None:
        self.left = limit

    def take(self) -> bool:
        if self.left is None:
            return True
        self.left -= 1
        return self.left >= 0


def _grow(
    model: Model,
    grid: Grid,
    plan: Plan,
    max_branches: int,
    budget: _Tries,
    should_stop: Callable[[], bool],
) -> Plan:
    value = Backward(grid, compile_plan(model, plan)).total()
    refused: set[tuple[Path, Option]] = set()
    for _ in range(max_branches):
        best: tuple[float, Plan] | None = None
        fruitful = 0
        # Step 2: identify best branch point, by the variance of what is still to come.
        for point, masses in _points(grid, plan, compile_plan(model, plan)):
            helps = False
            # Step 3: generate contingency branch.
            for option in _proposals(model, plan, point.path, masses, grid):
                if (point.path, option) in refused:
                    continue
                if should_stop() or not budget.take():
                    return plan
                candidate = put_option(plan, point.path, option)
                if not model.admits_plan(candidate):
                    continue
                # Step 4: evaluate & integrate branch.
                new = Backward(grid, compile_plan(model, candidate)).total()
                if new > value + LEAST_GAIN * abs(value) + 1e-9:
                    helps = True
                    if best is None or new > best[0]:
                        best = new, candidate
                elif new <= value:
                    refused.add((point.path, option))
            fruitful += helps
            if fruitful >= POINTS:
                break
        if best is None:
            break
        value, plan = best
        refused.clear()
    return plan
