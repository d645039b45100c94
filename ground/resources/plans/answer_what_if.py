"""Answer a what-if on a plan at once: what the plan and a new plan are worth in a changed day."""

from __future__ import annotations

import threading
import time
from collections import OrderedDict, deque
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from sqlalchemy import select

from ground.errors import InvalidInputError, JobFailedError
from ground.gdr.repository import Repository
from ground.records.actor import Actor
from ground.records.show import value_of
from ground.resources.missions.row import MissionRow
from ground.resources.observation_requests.row import ObservationRequestRow
from ground.resources.plans.read_plan import computed_plan, tree_of
from ground.resources.plans.row import PlanRow
from ground.resources.plans.study_value import WhatIfAnswer
from ground.resources.problems.inputs_digest import inputs_digest
from ground.resources.problems.mission_day import choose_sol, mission_day, worksite
from ground.resources.problems.row import ProblemRow
from mission import KeepOut, Pose
from planner.changes import Changes, changed_problem, counted

if TYPE_CHECKING:
    from planner.evaluate.model import Floats
    from planner.plan_tree import Plan
    from planner.problem import Problem
    from planner.what_if import Outcome

KEPT = 16
_plans: OrderedDict[str, _Known] = OrderedDict()
_rebuilt: OrderedDict[tuple[Any, ...], Problem] = OrderedDict()
_lock = threading.Lock()
_hands = threading.BoundedSemaphore(2)
"""Answers worked on at one time: more would only make all of them slow."""


@dataclass(frozen=True, eq=False)
class _Known:
    """A plan as it is asked about again and again."""

    problem: Problem
    plan: Plan
    candidates: tuple[str, ...]
    today: Floats
    """What it earns in each future of its day."""
    answers: deque[tuple[Problem, int | None, Outcome]] = field(default_factory=lambda: deque(maxlen=KEPT))
    """The newest answers: a keep-out that is dragged over ground that no drive needs changes nothing."""

    def answered(self, changed: Problem, iterations: int | None) -> Outcome | None:
        """Return what was found for the same day before, None where it was not asked about lately."""
        found = (outcome for day, work, outcome in list(self.answers) if (day, work) == (changed, iterations))
        return next(found, None)


def answer_what_if(
    repo: Repository, actor: Actor, plan_id: str, changes: Changes, *, iterations: int | None = None
) -> WhatIfAnswer:
    """Return what changes of the day are worth: to the plan as it is, and to one made for them.

    Raises
    ------
    InvalidInputError
        If a request is not in the plan's problem, or is both excluded and demanded, or a keep-out is
        impossible.
    StateError
        If the plan is not computed.
    """
    from planner.errors import ChangeError, PlannerError
    from planner.what_if import what_if

    began = time.monotonic()
    with repo.database.read() as session:
        row = computed_plan(session, actor, plan_id)
        key = f"{row.id} {row.crl_sha256}"
        seed, branches = row.seed, row.max_branches
        problem_row = session.get_one(ProblemRow, row.problem_id)
        document, tree = problem_row.document, tree_of(row)
    known = _known(key, document, tree, seed)
    try:
        base = known.problem if changes.keep_outs is None else _with_keep_outs(repo, plan_id, known, changes)
        changed = changed_problem(base, changes)
        outcome = known.answered(changed, iterations)
        if outcome is None:
            with _hands:
                outcome = what_if(
                    known.problem,
                    known.plan,
                    changed,
                    known=known.candidates,
                    today=known.today,
                    max_branches=branches,
                    seed=seed,
                    iterations=iterations,
                )
            known.answers.append((changed, iterations, outcome))
    except ChangeError as err:
        raise InvalidInputError(str(err), pointer=f"/changes/{err.member}") from err
    except PlannerError as err:
        raise InvalidInputError(str(err), pointer="/changes") from err
    return _value(plan_id, known, changed, changes, outcome, time.monotonic() - began)


def _known(key: str, document: Any, tree: Any, seed: int) -> _Known:
    from planner.plan_tree import plan_tree_from_dict
    from planner.problem import problem_from_dict
    from planner.what_if import candidates, worth_today

    with _lock:
        if key in _plans:
            _plans.move_to_end(key)
            return _plans[key]
    problem = problem_from_dict(document)
    plan = plan_tree_from_dict(tree, problem).plan
    known = _Known(problem, plan, candidates(problem, plan), worth_today(problem, plan, seed=seed))
    with _lock:
        _plans[key] = known
        while len(_plans) > KEPT:
            _plans.popitem(last=False)
    return known


def _with_keep_outs(repo: Repository, plan_id: str, known: _Known, changes: Changes) -> Problem:
    """Return the plan's problem on a path network made anew round other keep-outs, budgets as they were.

    The rover goes to the observation points of the plan, except where a new keep-out covers one.
    """
    with repo.database.read() as session:
        plan = session.get_one(PlanRow, plan_id)
        key = (plan_id, inputs_digest(session, plan.mission_id), changes.keep_outs)
        with _lock:
            if key in _rebuilt:
                return _rebuilt[key]
        mission = session.get_one(MissionRow, plan.mission_id)
        sol = choose_sol(session, plan.mission_id, plan.sol_id)
        rows = ObservationRequestRow
        there = set(session.scalars(select(rows.id).where(rows.mission_id == plan.mission_id)))
        asked = [str(o.id) for o in known.problem.observations if str(o.id) in there]
        site, day = worksite(repo, session, mission), mission_day(repo, session, mission, sol, asked)
    stands = {
        str(t.id): Pose(p.east_m, p.north_m, p.heading_rad)
        for t in known.problem.targets
        if (p := t.observation_point) is not None
        and not any(_inside(p.east_m, p.north_m, polygon) for polygon in changes.keep_outs or ())
    }
    requests = tuple(
        replace(r, observation_point=r.observation_point or stands.get(r.target_id)) for r in day.requests
    )
    try:
        prepared = site.prepare(
            replace(day, requests=requests, keep_outs=keep_outs_of(changes)), lambda _share, _what: None
        )
    except JobFailedError as err:
        raise InvalidInputError(err.message, pointer="/changes/keep_outs") from err
    problem = replace(
        prepared.problem,
        budget=known.problem.budget,
        max_overrun_probability=known.problem.max_overrun_probability,
    )
    with _lock:
        _rebuilt[key] = problem
        while len(_rebuilt) > KEPT:
            _rebuilt.popitem(last=False)
    return problem


def keep_outs_of(changes: Changes) -> tuple[KeepOut, ...]:
    """Return the keep-outs of the changes as values of the day."""
    return tuple(KeepOut(f"what-if-{k + 1}", ring) for k, ring in enumerate(changes.keep_outs or ()))


def _inside(x: float, y: float, polygon: tuple[tuple[float, float], ...]) -> bool:
    """Return whether a point lies in a polygon (even-odd rule)."""
    inside = False
    for (ax, ay), (bx, by) in zip(polygon, polygon[1:] + polygon[:1], strict=True):
        if (ay > y) != (by > y) and x < ax + (y - ay) / (by - ay) * (bx - ax):
            inside = not inside
    return inside


def _value(
    plan_id: str,
    known: _Known,
    changed: Problem,
    changes: Changes,
    outcome: Outcome,
    elapsed_s: float,
) -> WhatIfAnswer:
    from planner.plan_tree import planned_observations

    before = {str(o) for o in planned_observations(known.plan)}
    gained, lost = sorted(outcome.held - before), sorted(before - outcome.held)
    return value_of(
        WhatIfAnswer,
        outcome,
        plan_id=plan_id,
        value_present=outcome.present,
        value_kept=outcome.kept,
        value_found=outcome.found,
        gained=gained,
        lost=lost,
        reach=dict(outcome.reach),
        why=_why(changed, changes, outcome, lost),
        changes=changes.in_words(),
        time_budget_s=changed.budget.time_s,
        energy_budget_j=changed.budget.usable_energy_j,
        elapsed_s=elapsed_s,
    )


def _why(changed: Problem, changes: Changes, outcome: Outcome, lost: list[str]) -> list[str]:
    """Return sentences on what limits the answer."""
    if not outcome.feasible:
        return list(outcome.reasons) or ["no plan found holds all that is demanded"]
    words = list(outcome.reasons)
    there = {str(o.id) for o in changed.observations}
    gone = [r for r in lost if r not in there]
    given_up = [r for r in lost if r in there and r not in changes.exclude]
    if gone:
        words.append(f"{counted(len(gone), 'request')} can no longer be reached")
    if given_up:
        words.append(
            f"{counted(len(given_up), 'request')} left out: the rest is worth more within the budgets"
        )
    # An hour or 100 kJ that is worth less than a hundredth of the plan is not a limit.
    scale = 1e-2 * max(1.0, outcome.found)
    if outcome.per_hour > scale:
        words.append(f"time limits the plan: an hour more is worth {outcome.per_hour:.2f}")
    if outcome.per_100_kj > scale:
        words.append(f"energy limits the plan: 100 kJ more are worth {outcome.per_100_kj:.2f}")
    if outcome.overrun > 0.05:
        words.append(f"{outcome.overrun:.0%} of the futures end over a budget")
    if not changes.as_dict():
        return words
    if abs(outcome.change) <= 2.0 * outcome.change_error:
        words.append("the change makes no difference that these futures show")
    elif outcome.replanning > 2.0 * outcome.replanning_error and outcome.replanning > scale:
        words.append(f"keeping the plan as it is would cost {outcome.replanning:.2f} of that")
    return words
