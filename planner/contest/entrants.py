"""Planners that take part: this one, three baselines, and any program that writes a plan for an instance."""

from __future__ import annotations

import json
import os
import resource
import shlex
import subprocess
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, cast

from mission.codec import Document
from planner.contest.instance import Instance, read_instance
from planner.errors import PlannerError, PlanTreeError
from planner.plan_tree import plan_tree_to_dict
from planner.problem import problem_from_dict
from planner.solve import solve

GRACE_S = 30.0
"""A program is ended this long after the limit that it was told, and has no plan then."""


@dataclass(frozen=True, slots=True)
class Answer:
    """What an entrant gave: its plan, the processor seconds it took, and its own bound if it proves one."""

    plan: Document
    cpu_s: float
    upper: float | None


Entrant = Callable[[Document, int, float], tuple[Document, float | None]]
"""Takes an instance, the most branches and seconds; returns a plan and an upper bound on every policy."""


def _solved(
    document: Document, strategy: str, branches: int, limit_s: float
) -> tuple[Document, float | None]:
    problem = problem_from_dict(document)
    found = solve(problem, strategy=strategy, max_branches=branches, time_limit_s=limit_s)
    return plan_tree_to_dict(found.tree, problem), found.upper


def outcrop(
    document: Mapping[str, object], branches: int, limit_s: float
) -> tuple[Mapping[str, object], float | None]:
    """Plan with gain-driven branches and a bound."""
    return _solved(document, "optimal", branches, limit_s)


def straight(
    document: Mapping[str, object], _branches: int, limit_s: float
) -> tuple[Mapping[str, object], float | None]:
    """Plan the best order without branches; a step that fails is passed over."""
    return _solved(document, "optimal", 0, limit_s)[0], None


def pico2005(
    document: Mapping[str, object], branches: int, limit_s: float
) -> tuple[Mapping[str, object], float | None]:
    """Plan as PICo did: a seed on mean values, then branches where they gain most (Pedersen et al. 2005)."""
    return _solved(document, "pico2005", branches, limit_s)[0], None


def greedy(
    document: Mapping[str, object], _branches: int, _limit_s: float
) -> tuple[Mapping[str, object], float | None]:
    """Go on to what earns most for its mean time until the means are used up; tracks all that it touches."""
    instance = read_instance(document)
    order = _greedy_order(instance)
    tracked = [name for name in order if instance.goals[name].place]
    plan: list[dict[str, str]] = [{"op": "track_start", "target": name} for name in tracked]
    plan += [{"op": "visit", "target": name, "on_fail": "skip"} for name in order]
    return {"format": "plan-tree/1", "instance": instance.name, "method": "greedy", "plan": plan}, None


def _greedy_order(instance: Instance) -> list[str]:
    place, order = "start", list[str]()
    time_s = energy_j = 0.0
    while True:
        best: tuple[float, str, float, float] | None = None
        for name, goal in instance.goals.items():
            leg = instance.legs.get((place, name))
            if name in order or leg is None:
                continue
            tracks = sum(instance.goals[other].place for other in (*order, name))
            start_s, start_j = instance.track_start if goal.place else (0.0, 0.0)
            arrives = time_s + leg.time_s[0] + instance.track_overhead_s * tracks
            if arrives > goal.window_s[1]:
                continue
            ends = max(arrives, goal.window_s[0]) + goal.time_s[0] + start_s
            used = energy_j + leg.energy_j[0] + goal.energy_j[0] + start_j
            if ends > instance.budget_s or used + instance.hotel_w * ends > instance.budget_j:
                continue
            rate = goal.utility * goal.p_success / (ends - time_s)
            if best is None or rate > best[0]:
                best = rate, name, ends, used
        if best is None:
            return order
        _, place, time_s, energy_j = best
        order.append(place)


ENTRANTS: Mapping[str, Entrant] = {
    "outcrop": outcrop,
    "straight": straight,
    "pico2005": pico2005,
    "greedy": greedy,
}


def ask(entrant: str, document: Mapping[str, object], branches: int, limit_s: float) -> Answer:
    """Return the answer of an entrant by its name, or of a program, to an instance.

    A program reads the instance on its standard input, finds the limits in `OUTCROP_BRANCHES` and
    `OUTCROP_SECONDS`, and writes its plan as JSON.

    Raises
    ------
    PlannerError
        If the planner refuses, or the program fails, is not there, takes too long or writes no JSON.
    """
    if entrant in ENTRANTS:
        began = time.process_time()
        plan, upper = ENTRANTS[entrant](document, branches, limit_s)
        return Answer(plan, time.process_time() - began, upper)
    before = _children_s()
    try:
        done = subprocess.run(
            shlex.split(entrant),
            input=json.dumps(document),
            capture_output=True,
            text=True,
            timeout=limit_s + GRACE_S,
            check=False,
            env=_limits(branches, limit_s),
        )
    except subprocess.TimeoutExpired:
        raise PlannerError(f"{entrant!r} was ended after {limit_s + GRACE_S:g} s without a plan") from None
    except (OSError, ValueError) as err:
        raise PlannerError(
            f"{entrant!r} is not a planner here ({', '.join(ENTRANTS)}) and cannot run: {err}"
        ) from err
    if done.returncode:
        last = (done.stderr.strip().splitlines() or ["it said nothing"])[-1]
        raise PlannerError(f"{entrant!r} ended with status {done.returncode}: {last[:200]}")
    try:
        found: Any = json.loads(done.stdout)
    except (ValueError, RecursionError) as err:
        raise PlanTreeError(f"{entrant!r} wrote no JSON: {err}") from err
    if not isinstance(found, dict):
        raise PlanTreeError(f"{entrant!r} wrote {type(found).__name__}, not a JSON object")
    return Answer(cast("Document", found), _children_s() - before, None)


def _limits(branches: int, limit_s: float) -> dict[str, str]:
    return {**os.environ, "OUTCROP_BRANCHES": str(branches), "OUTCROP_SECONDS": f"{limit_s:g}"}


def _children_s() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
