"""Why a plan is as it is: why not a target, what branches and budgets are worth, which plan is better."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from planner.constraints.registry import columns_of
from planner.constraints.rule import Obstacle
from planner.contingency.forced_order import forced_orders
from planner.contingency.policy import Policy
from planner.contingency.reduction import live_sets_of, moves_of, only, reachable_targets
from planner.contingency.seeding import route_plan
from planner.contingency.sequences import Masses, best_sequences, sequence_steps
from planner.errors import PlannerError
from planner.evaluate.grid import Grid, Rounding
from planner.evaluate.model import Model
from planner.evaluate.monte_carlo import simulate
from planner.evaluate.propagate import Evaluator, State
from planner.plan_tree import Plan, TrackStart, planned_observations
from planner.problem import Observation, ObservationId, Problem
from planner.threads import one_blas_thread

FUTURES = 100_000
"""A standard error of 1/316 of the standard deviation of a difference."""

GRID = (33, 21)
"""Nodes of the table for forced plans: each question makes a dozen. By hand."""

WIDEST, CLOSE = 3.0, 1.01
"""Largest factor tried, and the ratio to which the least one is closed in on. By hand: a day hardly has three
times its budgets, and 1 % of one is within what drives vary by."""
LEAST_CHANCE = 0.01
"""A plan that makes an observation in fewer than one future of a hundred does not let it in."""
FEW = 5_000
"""Futures to tell such a chance: its standard error is 0.0014."""
TIME, ENERGY, VOLUME, WINDOW = "time budget", "energy budget", "downlink volume", "window"
FORCED_WIDTH = 8
"""Beginnings kept at each length for plans that must attempt an observation. By hand."""


@dataclass(frozen=True, slots=True)
class Relaxation:
    """The smallest change found that lets something in: what, by which factor, and the value then.

    A window is made so many times as long, about its middle. `plan` makes the observation with the change.
    """

    what: str
    factor: float
    value: float
    plan: Plan = ()


@dataclass(frozen=True, slots=True)
class WhyNot:
    """Why an observation is not in the plan.

    `forced` is the best unbranched plan found that must attempt it; `change` its value less that of the best
    unbranched plan without that demand, with `standard_error` over common futures. `displaced` are
    observations of the plan that the forced one gives up. `relaxations` are the smallest found of each kind
    that lets it in alone, least first; where none does alone, of all together. `reason` says it in a
    sentence, and of what was not found no more than that.
    """

    observation: ObservationId
    reason: str
    limit: str
    change: float = 0.0
    standard_error: float = 0.0
    forced: Plan = ()
    displaced: tuple[ObservationId, ...] = ()
    relaxations: tuple[Relaxation, ...] = ()

    @property
    def relaxation(self) -> Relaxation | None:
        """The smallest change that lets it in."""
        return self.relaxations[0] if self.relaxations else None


@dataclass(frozen=True, slots=True)
class Comparison:
    """Plan A against plan B on the same futures; the worst 5 % are means over the worst twentieth of each."""

    value_a: float
    value_b: float
    difference: float
    standard_error: float
    a_beats_b: float
    b_beats_a: float
    worst_a: float
    worst_b: float
    overrun_a: float
    overrun_b: float


def compare_plans(
    problem: Problem, a: Plan, b: Plan, *, other: Problem | None = None, futures: int = FUTURES, seed: int = 0
) -> Comparison:
    """Return how plan A does against plan B on common random numbers.

    With `other`, B is run on that problem instead (a what-if of the same shape).
    """
    one = simulate(Model.of(problem), a, futures, seed=seed)
    two = simulate(Model.of(other or problem), b, futures, seed=seed)
    difference = one.utility - two.utility
    tail = max(1, futures // 20)
    return Comparison(
        value_a=float(one.utility.mean()),
        value_b=float(two.utility.mean()),
        difference=float(difference.mean()),
        standard_error=float(difference.std()) / float(np.sqrt(futures)),
        a_beats_b=float(np.mean(difference > 1e-9)),
        b_beats_a=float(np.mean(difference < -1e-9)),
        worst_a=float(np.partition(one.utility, tail - 1)[:tail].mean()),
        worst_b=float(np.partition(two.utility, tail - 1)[:tail].mean()),
        overrun_a=float(one.overrun.mean()),
        overrun_b=float(two.overrun.mean()),
    )


def _best_unbranched(model: Model, forced: int | None = None) -> tuple[float, Plan]:
    """Return the best unbranched plan found, by the beam search over the sets of targets to track.

    With `forced` it is one that goes for that observation, at whatever cost; empty if there is none.
    """
    if model.t_max_s <= 0.0 or model.e_max_j <= 0.0:
        return 0.0, ()
    model = model.mixed().within_reach()
    policy = Policy(Grid(model, *GRID, Rounding.MID, np.float32), moves=moves_of(model))
    best: tuple[float, Plan] = (0.0 if forced is None else -np.inf, ())
    orders: list[tuple[int, ...]] = []
    untracked: Masses = {State(0, 0, 0): np.zeros(())}
    for tracked, bound in sorted(policy.start_values().items(), key=lambda item: (-item[1], item[0]))[:24]:
        if bound <= best[0]:
            break
        masses: Masses = {State(0, 0, tracked): policy.grid.point(*policy.start_point(tracked))}
        width = 3 if forced is None else FORCED_WIDTH
        for found in best_sequences(policy, masses, width=width, forced=forced):
            if found.value > best[0]:
                head: Plan = tuple(
                    TrackStart(model.target_ids[p - 1]) for p in range(1, model.n + 1) if (tracked >> p) & 1
                )
                best = found.value, (*head, *sequence_steps(policy, found.order, untracked))
                orders.append(found.order)
    if forced is not None and best[1]:
        evaluator = Evaluator(model)
        found_near = forced_orders(model, policy.grid, reversed(orders), forced)
        plans = (best[1], *(route_plan(model, order) for order in found_near))
        best = max(((evaluator.value(plan).value, plan) for plan in plans), key=lambda pair: pair[0])
    return best


def why_not(
    problem: Problem, plan: Plan, observation: str, *, futures: int = FUTURES, seed: int = 0
) -> WhyNot:
    """Return why an observation is not in a plan.

    Raises
    ------
    PlannerError
        If the problem has no such observation, or the plan holds it.
    """
    by_name = {str(o.id): o for o in problem.observations}
    if observation not in by_name:
        raise PlannerError(f'the problem has no observation "{observation}"')
    what = by_name[observation]
    held = planned_observations(plan)
    if what.id in held:
        raise PlannerError(f'observation "{observation}" is in the plan')
    with one_blas_thread():
        return _why_not(problem, what, held, futures, seed)


def _why_not(
    problem: Problem, what: Observation, held: set[ObservationId], futures: int, seed: int
) -> WhyNot:
    obstacle = _obstacle(problem, what)
    if obstacle is not None:
        return WhyNot(what.id, obstacle.sentence, obstacle.limit)
    part = _with_room_for(problem, what, held)
    model = Model.of(part)
    m = model.number_of[what.id]
    forced = _best_unbranched(model, m)[1]
    if what.id not in planned_observations(forced):
        relaxations = _smallest_relaxations(part, what)
        return WhyNot(
            what.id,
            f"found no way to make {what.id} within the budgets; {_said(relaxations)}",
            relaxations[0].what if relaxations else "budgets",
            relaxations=relaxations,
        )
    free = _best_unbranched(model)[1]
    comparison = compare_plans(part, forced, free, futures=futures, seed=seed)
    displaced = tuple(sorted(held - planned_observations(forced)))
    relaxations = _smallest_relaxations(part, what)
    gives_up = f" and gives up {', '.join(displaced)}" if displaced else ""
    return WhyNot(
        observation=what.id,
        reason=(
            f"the best plan found that attempts {what.id} changes the value by {comparison.difference:+.2f}"
            f"{gives_up}; {_said(relaxations)}"
        ),
        limit=relaxations[0].what if relaxations else "value",
        change=comparison.difference,
        standard_error=comparison.standard_error,
        forced=forced,
        displaced=displaced,
        relaxations=relaxations,
    )


def _said(relaxations: tuple[Relaxation, ...]) -> str:
    if not relaxations:
        return f"found no way with up to {WIDEST:g} times the budgets and the window, each and all together"
    return "it comes in with " + " or ".join(f"{r.factor:g} times the {r.what}" for r in relaxations)


def _obstacle(problem: Problem, what: Observation) -> Obstacle | None:
    """Return what keeps an observation out whatever the plan."""
    if what.utility <= 0.0:
        return Obstacle("value", f"{what.id} is worth nothing")
    if what.target not in reachable_targets(problem):
        return Obstacle("network", f"no path leads from the start to target {what.target}")
    # Those of packages first: they know more of their matter than the windows that they come to.
    rules, columns = columns_of(problem)
    found = (rule.explain(problem, what) for rule in reversed(rules))
    obstacle = next((obstacle for obstacle in found if obstacle is not None), None)
    m = problem.observations.index(what)
    if obstacle is None and columns.window[m, 1] < 0.0:
        return Obstacle("window", f"no start of {what.id} is within all the windows that it has")
    return obstacle


def _with_room_for(problem: Problem, what: Observation, held: set[ObservationId]) -> Problem:
    """Return a part of the problem that a table holds, with the plan's observations and the one asked for."""
    count = live_sets_of(problem)
    if count is not None and count <= 2_000:
        return problem
    names = set(held) | {what.id}
    for first, second in problem.precedence:
        if second in names:
            names.add(first)
    return only(problem, names)


def _smallest_relaxations(problem: Problem, what: Observation) -> tuple[Relaxation, ...]:
    """Return, least first, the smallest changes found with which the best unbranched plan makes one more.

    Each is closed in on by bisection: time, energy, and where they are limited the downlink volume and the
    observation's window, each alone; all together where none is enough alone. A plan with the factor that is
    told was made, and makes the observation.
    """
    kinds = [TIME, ENERGY]
    kinds += [VOLUME] if problem.budget.data_mbit is not None else []
    kinds += [WINDOW] if what.window_s is not None else []

    together = " and ".join(kinds)

    def tried(kind: str, factor: float) -> Relaxation | None:
        model = Model.of(_widened(problem, what, kinds if kind == together else [kind], factor))
        value, plan = _best_unbranched(model)
        held = what.id in planned_observations(plan) and _chance(model, plan, what.id) >= LEAST_CHANCE
        return Relaxation(kind, factor, value, plan) if held else None

    def valued(found: Relaxation) -> Relaxation:
        """Return it with its plan's value on fine nodes: those of the search are up to 5 % below."""
        wide = _widened(problem, what, kinds if found.what == together else [found.what], found.factor)
        return dataclasses.replace(found, value=Evaluator(Model.of(wide)).value(found.plan).value)

    alone = [found for kind in kinds if (found := _least(tried, kind)) is not None]
    if not alone and (jointly := _least(tried, together)) is not None:
        alone = [jointly]
    return tuple(sorted(map(valued, alone), key=lambda relaxation: relaxation.factor))


def _least(tried: Callable[[str, float], Relaxation | None], kind: str) -> Relaxation | None:
    """Return the smallest factor found by bisection; None if the widest does not do."""
    found = tried(kind, WIDEST)
    low = 1.0
    while found is not None and found.factor > low * CLOSE:
        middle = round(math.sqrt(low * found.factor), 3)
        nearer = tried(kind, middle)
        low, found = (middle, found) if nearer is None else (low, nearer)
    return found


def _chance(model: Model, plan: Plan, observation: ObservationId) -> float:
    """Return the share of futures in which a plan makes an observation."""
    m = model.number_of[observation]
    without = model.utility.copy()
    without[m] = 0.0
    flown = [simulate(one, plan, FEW, seed=0) for one in (model, dataclasses.replace(model, utility=without))]
    return float((flown[0].utility - flown[1].utility).mean() / model.utility[m])


def _widened(problem: Problem, what: Observation, kinds: Sequence[str], factor: float) -> Problem:
    """Return the problem with these limits so many times as wide."""
    budget = problem.budget
    if TIME in kinds:
        budget = dataclasses.replace(budget, time_s=budget.time_s * factor)
    if ENERGY in kinds:
        more = budget.usable_energy_j * (factor - 1.0)
        budget = dataclasses.replace(budget, energy_j=budget.energy_j + more)
    if VOLUME in kinds and budget.data_mbit is not None:
        budget = dataclasses.replace(budget, data_mbit=budget.data_mbit * factor)
    problem = dataclasses.replace(problem, budget=budget)
    if WINDOW not in kinds or what.window_s is None:
        return problem
    opens, closes = what.window_s
    more = (closes - opens) * (factor - 1.0) / 2.0
    wider = dataclasses.replace(what, window_s=(opens - more, closes + more))
    targets = tuple(
        dataclasses.replace(t, observations=tuple(wider if o.id == what.id else o for o in t.observations))
        for t in problem.targets
    )
    return dataclasses.replace(problem, targets=targets)
