"""What if: a planning problem with a few things changed, and what the plan and a new plan are worth then.

Both plans meet the same futures (common random numbers), so a difference is not noise. The new plan is
searched for among the observations that the present plan holds and those of good routes on mean values, from
the present plan on: an answer in well under a second of processor time, and a lower bound of what the full
planner finds.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ground.errors import InvalidInputError

if TYPE_CHECKING:
    from planner.evaluate.model import Floats
    from planner.evaluate.program import Program
    from planner.plan_tree import Plan
    from planner.problem import Leg, Observation, Problem

FUTURES = 20_000
STEP = 0.05
"""Share by which a budget is widened to see what more of it is worth."""
SEARCH_S = 0.35
"""Wall time for the new plan; without branches it takes about 0.3 s on the quiet machine."""
MAX_LIVE_SETS = 300
"""Largest table of the optimal policy that is filled for an answer at once."""


@dataclass(frozen=True, slots=True)
class Changes:
    """What is changed. Budgets are what may be used in all (seconds, joules); a late start costs time and
    hotel energy and moves the windows; each chance `p` to lose a track becomes `1 - (1 - p) ** loss_factor`.
    `keep_outs` are polygons (east, north) in metres that stand in the place of the mission's.
    """

    exclude: tuple[str, ...] = ()
    force: tuple[str, ...] = ()
    values: Mapping[str, float] = field(default_factory=dict)
    time_budget_s: float | None = None
    energy_budget_j: float | None = None
    start_delay_s: float = 0.0
    loss_factor: float = 1.0
    keep_outs: tuple[tuple[tuple[float, float], ...], ...] | None = None

    def as_dict(self) -> dict[str, Any]:
        """Return the changes as they are kept; what is not changed is left away."""
        found: dict[str, Any] = {}
        for member in dataclasses.fields(self):
            value = getattr(self, member.name)
            if value != getattr(UNCHANGED, member.name):
                found[member.name] = list(value) if isinstance(value, tuple) else value
        return found

    def in_words(self) -> str:
        """Return the changes as a line for people."""
        words = []
        if self.exclude:
            words.append(f"{counted(len(self.exclude), 'request')} taken away")
        if self.force:
            words.append(f"{counted(len(self.force), 'request')} demanded")
        if self.values:
            words.append(f"{counted(len(self.values), 'value')} changed")
        if self.time_budget_s is not None:
            words.append(f"time budget {self.time_budget_s / 3600:.2f} h")
        if self.energy_budget_j is not None:
            words.append(f"energy budget {self.energy_budget_j / 3600:.0f} Wh")
        if self.start_delay_s:
            words.append(f"start {self.start_delay_s / 60:.0f} min later")
        if self.loss_factor != 1.0:
            words.append(f"tracks lost {self.loss_factor:g} times as readily")
        if self.keep_outs is not None:
            words.append(f"{counted(len(self.keep_outs), 'keep-out')} in place of the mission's")
        return ", ".join(words) or "nothing changed"


UNCHANGED = Changes()


def counted(number: int, what: str) -> str:
    """Return a number with its noun."""
    return f"{number} {what}{'' if number == 1 else 's'}"


def changes_of(document: Mapping[str, Any]) -> Changes:
    """Return changes as `as_dict` wrote them."""
    members = dict(document)
    for name in ("exclude", "force"):
        if name in members:
            members[name] = tuple(members[name])
    if members.get("keep_outs") is not None:
        members["keep_outs"] = tuple(tuple((e, n) for e, n in polygon) for polygon in members["keep_outs"])
    return Changes(**members)


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came out. `present` is the plan today; `kept` the same plan in the changed day, without what was
    taken away; `found` the best plan there. `change` is found less present, `replanning` found less kept,
    each with its standard error. `reach` is the chance of each request to be begun under the found plan.
    """

    present: float
    kept: float
    found: float
    change: float
    change_error: float
    replanning: float
    replanning_error: float
    overrun: float
    branches: int
    plan: Plan
    held: frozenset[str]
    reach: Mapping[str, float]
    per_hour: float
    per_100_kj: float
    feasible: bool
    reasons: tuple[str, ...]
    compute_s: float


def changed_problem(problem: Problem, changes: Changes) -> Problem:
    """Return the problem of the changed day, of the same shape: what is excluded is worth nothing.

    Raises
    ------
    InvalidInputError
        If a request is not in the problem, or is both excluded and demanded.
    """
    known = {str(o.id) for o in problem.observations}
    for name, asked in (("exclude", changes.exclude), ("force", changes.force), ("values", changes.values)):
        for request in asked:
            if request not in known:
                raise InvalidInputError(
                    f"request {request} is not in the plan's problem", pointer=f"/changes/{name}"
                )
    if both := set(changes.exclude) & set(changes.force):
        raise InvalidInputError(
            f"request {min(both)} is both excluded and demanded", pointer="/changes/force"
        )
    delay = changes.start_delay_s

    def observed(o: Observation) -> Observation:
        utility = 0.0 if o.id in changes.exclude else changes.values.get(o.id, o.utility)
        window = o.window_s
        if window is not None and delay:
            window = (window[0] - delay, window[1] - delay)
        return dataclasses.replace(
            o,
            utility=utility,
            window_s=window,
            must_do=(o.must_do or o.id in changes.force) and utility > 0.0,
        )

    def driven(leg: Leg) -> Leg:
        if changes.loss_factor == 1.0:
            return leg
        lost = {t: 1.0 - (1.0 - p) ** changes.loss_factor for t, p in leg.p_lose.items()}
        return dataclasses.replace(leg, p_lose=lost)

    budget = problem.budget
    time_s = budget.time_s if changes.time_budget_s is None else changes.time_budget_s
    usable = budget.usable_energy_j if changes.energy_budget_j is None else changes.energy_budget_j
    usable = max(0.0, usable - problem.hotel_w * delay)
    return dataclasses.replace(
        problem,
        targets=tuple(
            dataclasses.replace(t, observations=tuple(map(observed, t.observations))) for t in problem.targets
        ),
        legs=tuple(map(driven, problem.legs)),
        budget=dataclasses.replace(
            budget, time_s=max(0.0, time_s - delay), energy_j=budget.energy_floor_j + usable
        ),
    )


def candidates(problem: Problem, plan: Plan) -> tuple[str, ...]:
    """Return the observations worth a thought: the plan's, then those of good routes on mean values."""
    from planner.contingency.reduction import mean_route_of
    from planner.plan_tree import planned_observations

    found: dict[str, None] = {str(o): None for o in sorted(planned_observations(plan))}
    for share in (1.0, 0.75, 1.3):
        found.update({str(o): None for o in mean_route_of(problem, share)})
    return tuple(found)


def _part(problem: Problem, wanted: Iterable[str], needed: Collection[str]) -> Problem:
    """Return as much of the problem as a small table holds: `needed` first, then `wanted` in their order."""
    from planner.contingency.reduction import live_sets_of, only
    from planner.problem import ObservationId

    before: dict[str, list[str]] = {}
    for first, second in problem.precedence:
        before.setdefault(str(second), []).append(str(first))

    def with_earlier(name: str) -> set[str]:
        found, queue = {name}, [name]
        while queue:
            for earlier in before.get(queue.pop(), ()):
                if earlier not in found:
                    found.add(earlier)
                    queue.append(earlier)
        return found

    worthless = {str(o.id) for o in problem.observations if o.utility <= 0.0}
    names: set[str] = set()
    for name in needed:
        names |= with_earlier(name)
    for name in wanted:
        more = names | with_earlier(name)
        if name in names or more & worthless:
            continue
        count = live_sets_of(only(problem, {ObservationId(n) for n in more}))
        if count is not None and count <= MAX_LIVE_SETS:
            names = more
    return only(problem, {ObservationId(n) for n in names})


def what_if(
    problem: Problem,
    plan: Plan,
    changed: Problem,
    *,
    known: Iterable[str],
    max_branches: int,
    seed: int,
    search_s: float = SEARCH_S,
    iterations: int | None = None,
) -> Outcome:
    """Return what the plan and a new plan are worth in the changed day.

    `known` are the observations of `candidates`. With `iterations` the answer does not depend on the machine.
    """
    from planner.contingency.reduction import mean_route_of
    from planner.evaluate.model import Model
    from planner.evaluate.monte_carlo import simulate
    from planner.evaluate.program import compile_plan
    from planner.plan_edits import fitted
    from planner.plan_tree import count_branches, planned_observations
    from planner.solve import PlanStatus, solve
    from planner.threads import one_blas_thread

    began = time.monotonic()
    worthless = {str(o.id) for o in changed.observations if o.utility <= 0.0}
    must = [str(o.id) for o in changed.observations if o.must_do]
    wanted = dict.fromkeys((*known, *(str(o) for o in mean_route_of(changed, 1.0)), *must))
    part = _part(changed, wanted, must)
    kept = fitted(_without(changed, worthless), plan)
    result = solve(
        part,
        max_branches=max_branches,
        time_limit_s=search_s,
        iterations=iterations,
        seed=seed,
        warm=(fitted(part, plan),),
        quick=True,
    )
    feasible = result.status in {PlanStatus.PLANNED, PlanStatus.EMPTY}
    with one_blas_thread():
        model, today = Model.of(changed), Model.of(problem)
        one = simulate(today, plan, FUTURES, seed=seed + 1)
        two = simulate(model, kept, FUTURES, seed=seed + 1)
        best: Plan = result.tree.plan if feasible else ()
        program = compile_plan(model, best)
        three = simulate(model, program, FUTURES, seed=seed + 1, count_visits=True)
        lacking = {*must} - {str(o) for o in planned_observations(kept)}
        if three.utility.mean() < two.utility.mean() and not lacking and feasible:
            best, program = kept, compile_plan(model, kept)
            three = simulate(model, program, FUTURES, seed=seed + 1, count_visits=True)
        reach = begun(program, best, three.row_visits, FUTURES)
        per_hour, per_100_kj = _worth_of_budgets(changed, program, three.utility, seed + 1)
    change, replanning = three.utility - one.utility, three.utility - two.utility
    root = math.sqrt(FUTURES)
    return Outcome(
        present=float(one.utility.mean()),
        kept=float(two.utility.mean()),
        found=float(three.utility.mean()),
        change=float(change.mean()),
        change_error=float(change.std()) / root,
        replanning=float(replanning.mean()),
        replanning_error=float(replanning.std()) / root,
        overrun=float(three.overrun.mean()),
        branches=count_branches(best),
        plan=best,
        held=frozenset(str(o) for o in planned_observations(best)),
        reach=reach,
        per_hour=per_hour,
        per_100_kj=per_100_kj,
        feasible=feasible,
        reasons=result.reasons if not feasible or result.status is PlanStatus.EMPTY else (),
        compute_s=time.monotonic() - began,
    )


def _worth_of_budgets(problem: Problem, program: Program, earned: Floats, seed: int) -> tuple[float, float]:
    """Return what a plan would win with more time (an hour) and energy (100 kJ), by a twentieth of each more.

    The plan stays as it is and the futures are the same, so this is a lower bound of what more is worth.
    """
    from planner.evaluate.model import Model
    from planner.evaluate.monte_carlo import simulate

    budget = problem.budget
    hours, lots = STEP * budget.time_s / 3600.0, STEP * budget.usable_energy_j / 1e5
    longer = dataclasses.replace(budget, time_s=budget.time_s * (1.0 + STEP))
    fuller = dataclasses.replace(budget, energy_j=budget.energy_j + STEP * budget.usable_energy_j)
    found = []
    for wider, units in ((longer, hours), (fuller, lots)):
        if units <= 0.0:
            found.append(0.0)
            continue
        model = Model.of(dataclasses.replace(problem, budget=wider))
        more = simulate(model, program, FUTURES, seed=seed).utility
        found.append(float((more - earned).mean()) / units)
    return found[0], found[1]


def _without(problem: Problem, names: Collection[str]) -> Problem:
    """Return the problem without some observations, and without targets that have none left."""
    from planner.contingency.reduction import only

    return only(problem, {o.id for o in problem.observations if str(o.id) not in names})


def begun(program: Program, plan: Plan, visits: Any, futures: int) -> dict[str, float]:
    """Return the chance that each observation of a plan is begun, from how often futures came by."""
    from planner.plan_tree import Observe, Visit, walk

    chance: dict[str, float] = {}
    for path, step in walk(plan):
        if isinstance(step, Observe | Visit) and path in program.step_row:
            name = str(step.observation)
            share = float(visits[program.step_row[path]]) / futures
            chance[name] = round(min(1.0, chance.get(name, 0.0) + share), 6)
    return chance
