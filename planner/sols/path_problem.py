"""The problem of a sol path: one planning problem on several sols that share its battery and its targets.

What is stated, and what the bound holds for:

1. On sol k the rover begins where it ended the sol before, with what the rest of that sol left in the battery
   (`mission.sol_timeline`). The work ends after `time_s`, or earlier, whenever the policy likes.
2. The work may draw the battery down to the reserve: the least charge from which this night and all later
   ones are survived without work. An action that ends over the time or the reserve ends the sol's work, earns
   nothing and costs `overrun_penalty`. It draws its whole energy, at most what was left above the reserve,
   and the rover stands in the next morning where it stood when the action began.
3. An observation is made at most once over all sols. One that ended over a budget was not made: it is carried
   over. Windows are seconds of the plan clock of each sol.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mission.sol_timeline import Battery, PowerSegment, Rest, SolSeries, SolTimeline, rest_of
from planner.errors import ProblemError
from planner.evaluate.model import Floats, Model, Truths
from planner.problem import START, Problem

MAX_OBSERVATIONS = 60
"""What the arrays of `Model` hold."""


@dataclass(frozen=True, eq=False)
class PathProblem:
    """A sol path to be found, as arrays: K sols, m observations.

    `window` (K, m, 2) holds when an observation may begin on each sol, `allowed` (K, m) whether it
    may at all; `reserve_j` (K,) what the work must leave, `rests` what follows it.
    """

    problem: Problem
    series: SolSeries
    model: Model
    time_s: Floats
    reserve_j: Floats
    rests: tuple[Rest, ...]
    window: Floats
    allowed: Truths

    @property
    def sols(self) -> int:
        return len(self.rests)

    @property
    def charge_j(self) -> float:
        """The charge in the first morning."""
        return self.series.battery.charge_j

    def most_j(self, sol: int) -> float:
        """Return the largest charge that a morning can have."""
        return self.charge_j if sol == 0 else self.rests[sol - 1].ceiling_j


def path_problem(problem: Problem, series: SolSeries) -> PathProblem:
    """Return the problem of a sol path; `problem`'s own budgets of time and energy are not looked at.

    Raises
    ------
    ProblemError
        If the problem asks for what sol paths do not know, a window names what is not there, or the battery
        does not survive a night.
    """
    _require_known(problem)
    rests = tuple(rest_of(sol, series.battery) for sol in series.sols)
    reserve = _reserves(series, rests)
    model = Model.of(problem)
    _require_legs(model)
    sols = len(rests)
    window = np.repeat(model.window[None], sols, axis=0)
    allowed = np.ones((sols, model.m), np.bool_)
    for name in dict.fromkeys(w.observation for w in series.windows):
        if name not in model.number_of:
            raise ProblemError(f"a window names the unknown observation {name}")
        allowed[:, model.number_of[name]] = False
    for w in series.windows:
        if w.sol > sols:
            raise ProblemError(
                f"the window of observation {w.observation} is on sol {w.sol}; the last sol is {sols}"
            )
        m = model.number_of[w.observation]
        if allowed[w.sol - 1, m]:
            raise ProblemError(f"observation {w.observation} has two windows on sol {w.sol}")
        allowed[w.sol - 1, m] = True
        if w.window_s is not None:
            opens, closes = w.window_s
            window[w.sol - 1, m] = max(opens, window[w.sol - 1, m, 0]), min(closes, window[w.sol - 1, m, 1])
    time_s = np.array([sol.time_s for sol in series.sols])
    allowed &= (window[:, :, 0] <= window[:, :, 1]) & (window[:, :, 0] < time_s[:, None])
    return PathProblem(problem, series, model, time_s, reserve, rests, window, allowed)


def _require_known(problem: Problem) -> None:
    observations = problem.observations
    if len(observations) > MAX_OBSERVATIONS:
        raise ProblemError(
            f"the problem has {len(observations)} observations; a sol path takes {MAX_OBSERVATIONS}"
        )
    unknown = (
        (next((f"observation {o.id} needs its track" for o in observations if o.needs_track), "")),
        (next((f"observation {o.id} must be done" for o in observations if o.must_do), "")),
        (next((f"observation {b} comes after {a}" for a, b in problem.precedence), "")),
        (
            next(
                (
                    f"target {t.id} has fading value"
                    for t in problem.targets
                    if t.diminishing < 1.0 and len(t.observations) > 1
                ),
                "",
            )
        ),
        (next((f"sol kind {kind.name} is stated" for kind in problem.sol_kinds), "")),
        "the downlink volume is limited" if problem.budget.data_mbit is not None else "",
        "the chance of an overrun is limited" if problem.max_overrun_probability is not None else "",
    )
    for what in filter(None, unknown):
        raise ProblemError(f"{what}; sol paths do not plan with that, only single sols do")


def _require_legs(model: Model) -> None:
    """Refuse a problem in which a way leads somewhere, but no leg: paths drive to observations alone."""
    names = (START, *model.target_ids)
    for to in range(1, model.n + 1):
        if not model.target_bits[to]:
            continue
        for origin in range(model.n + 1):
            hops = () if origin == to or model.has_leg[origin, to] else model.hops(origin, to)
            if hops:
                raise ProblemError(
                    f"no leg leads from {names[origin]} to {names[to]}, only a way through "
                    f"{', '.join(names[via] for via in hops[:-1])}; sol paths do not plan with that, only "
                    "single sols do"
                )


def _reserves(series: SolSeries, rests: tuple[Rest, ...]) -> Floats:
    """Return the least charge after the work of each sol, (K,), from which all nights are survived."""
    need = series.battery.floor_j
    reserve = np.zeros(len(rests))
    for k in range(len(rests) - 1, -1, -1):
        rest = rests[k]
        if math.isinf(rest.need_j):
            raise ProblemError(
                f"the battery does not survive the night after sol {k + 1}: even full, with "
                f"{series.battery.capacity_j:g} J, it falls below its floor of {series.battery.floor_j:g} J"
            )
        if rest.ceiling_j < need:
            raise ProblemError(
                f"the battery does not survive the nights after sol {k + 1}: it has {rest.ceiling_j:g} J at "
                f"most in the morning of sol {k + 2}, which needs {need:g} J"
            )
        reserve[k] = need = max(rest.need_j, need - rest.gain_j)
        if need > series.battery.capacity_j:
            raise ProblemError(
                f"the battery does not survive the nights after sol {k + 1}: they need {need:g} J, it holds "
                f"{series.battery.capacity_j:g} J"
            )
    if series.battery.charge_j < reserve[0]:
        raise ProblemError(
            f"the battery does not survive the nights: its charge of {series.battery.charge_j:g} J on sol 1 "
            f"is below the {reserve[0]:g} J that they need"
        )
    return reserve


def same_budgets(problem: Problem, sols: int) -> SolSeries:
    """Return a series in which each sol has the problem's own budgets anew: the night fills the battery.

    Raises
    ------
    ProblemError
        If the problem has no time or no energy.
    """
    budget = problem.budget
    if budget.time_s <= 0.0 or budget.energy_j <= 0.0:
        raise ProblemError("a sol path needs a time budget and an energy budget above 0")
    battery = Battery(budget.energy_j, budget.energy_j, budget.energy_floor_j)
    night = PowerSegment(1.0, solar_w=budget.energy_j)
    return SolSeries(battery, (SolTimeline(budget.time_s, (night,)),)).repeated(sols)
