"""The limits that may be widened for an observation, and a problem with wider ones."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection

from planner.problem import Observation, Problem

OF_TIME, OF_ENERGY, VOLUME, WINDOW = "time budget", "energy budget", "downlink volume", "window"


def widened(problem: Problem, what: Observation, kinds: Collection[str], factor: float) -> Problem:
    """Return the problem with these limits so many times as wide."""
    budget = problem.budget
    if OF_TIME in kinds:
        budget = dataclasses.replace(budget, time_s=budget.time_s * factor)
    if OF_ENERGY in kinds:
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
        if t.id == what.target
        else t
        for t in problem.targets
    )
    return dataclasses.replace(problem, targets=targets)
