"""A plan of one of unified-planning's engines, read back as steps of a plan of ours."""

from __future__ import annotations

import re
from collections.abc import Iterable
from decimal import Decimal
from typing import Any

from mission.codec import shown
from neighbours.planning.errors import PlanningFormatError
from neighbours.planning.names import SEPARATOR, identifier
from planner.plan_tree import Navigate, Observe, OnFail, Plan, Step, TrackStart, TrackStop
from planner.problem import Problem

WAIT = "wait_until"
"""Head of the actions that wait."""
_NUMBER = r"[0-9]{1,18}(?:\.[0-9]{1,18})?"
_LINE = re.compile(
    rf"(?:(?P<at>{_NUMBER})\s*:)?\s*\(\s*(?P<name>[A-Za-z][A-Za-z0-9_]*)\s*\)\s*(?:\[\s*{_NUMBER}\s*\])?"
)


def plan_of_text(text: str, problem: Problem) -> Plan:
    """Return the steps of a plan as planners of PDDL print it: a line `time: (action) [duration]` each.

    Time and duration may be left out of all lines; comments and empty lines are passed over.

    Raises
    ------
    PlanningFormatError
        If a line is none of a plan, or names an action that no export of this problem has.
    """
    rows: list[tuple[Decimal, str]] = []
    for number, line in enumerate(text.splitlines(), 1):
        said = line.partition(";")[0].strip()
        if not said:
            continue
        found = _LINE.fullmatch(said)
        if found is None:
            raise PlanningFormatError(f"line {number}: {shown(said)} is not a line of a plan")
        if rows and (found["at"] is None) != (rows[0][0] < 0):
            raise PlanningFormatError(f"line {number}: only some lines of the plan have a time")
        rows.append((Decimal(found["at"] or -1), found["name"].lower()))
    return plan_of_names([name for _, name in sorted(rows, key=lambda row: row[0])], problem)


def plan_of(foreign: Any, problem: Problem) -> Plan:
    """Return the steps of a time-triggered plan of unified-planning, in the order of their starts.

    Raises
    ------
    PlanningFormatError
        If it holds an action that no export of this problem has.
    """
    timed = sorted(foreign.timed_actions, key=lambda row: row[0])
    return plan_of_names([action.action.name for _, action, _ in timed], problem)


def plan_of_names(names: Iterable[str], problem: Problem) -> Plan:
    """Return the steps that these actions stand for.

    Waiting has no step: an observation waits for its window by itself. A step that cannot be carried out is
    skipped.

    Raises
    ------
    PlanningFormatError
        If one is not an action of this problem.
    """
    known = _steps(problem)
    plan: list[Step] = []
    for name in names:
        if name.startswith(WAIT + SEPARATOR):
            continue
        if name not in known:
            raise PlanningFormatError(f"action {shown(name)} is not one of the problem {problem.name}")
        plan.append(known[name])
    return tuple(plan)


def _steps(problem: Problem) -> dict[str, Step]:
    skip = OnFail.SKIP
    steps: dict[str, Step] = {}
    for leg in problem.legs:
        steps[identifier("drive", leg.origin, leg.to)] = Navigate(leg.to, False, skip)
    for target in problem.targets:
        steps[identifier("track", target.id)] = TrackStart(target.id, skip)
        steps[identifier("stop_track", target.id)] = TrackStop(target.id, skip)
        for o in target.observations:
            steps[identifier("observe", o.id)] = Observe(o.id, o.target, skip)
    return steps
