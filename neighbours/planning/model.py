"""A planning problem as a problem of unified-planning: durative actions, whole numbers, nothing at once.

The rover does one thing at a time, so the elapsed time is a numeric fluent of its own, `elapsed_s`: budgets,
windows and the hotel load are conditions on it and on the energies drawn. That needs neither timed effects
nor products of fluents, which many engines refuse. What drives, observations and waiting come to is exact
for a problem without chances and with whole numbers.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from enum import StrEnum
from fractions import Fraction
from typing import Any

from unified_planning.environment import Environment
from unified_planning.model import (
    DurativeAction,
    EndTiming,
    Fluent,
    InstantaneousAction,
    Object,
    StartTiming,
)
from unified_planning.model import Problem as ForeignProblem
from unified_planning.model.metrics import MaximizeExpressionOnFinalState, Oversubscription

from neighbours.planning.errors import PlanningFormatError
from neighbours.planning.names import SEPARATOR, identifier
from neighbours.planning.plan_back import WAIT
from planner.amounts_of_sol import mixed
from planner.constraints.registry import columns_of
from planner.constraints.rule import MAX_BITS, Columns
from planner.problem import START, Leg, Observation, Problem, TargetId

KBIT = 1000
"""Of a megabit: volumes are whole kilobits."""
_WORTH_DIGITS = 6
"""Digits behind the point of a utility."""


class Metric(StrEnum):
    """How it is said that observations are worth something and may be left out."""

    NONE = "none"
    FINAL_STATE = "final-state"
    """A numeric fluent, to be maximised at the end: PDDL 2.1 has it."""
    OVERSUBSCRIPTION = "oversubscription"
    """Goals with gains: unified-planning has it, its writers do not."""


def foreign_problem(
    problem: Problem, goals: Collection[str] = (), metric: Metric = Metric.OVERSUBSCRIPTION
) -> ForeignProblem:
    """Return a problem in an environment of its own; what must be done, and `goals`, are its goals.

    Raises
    ------
    PlanningFormatError
        If a goal names no observation, the problem is too large, or a number is none.
    """
    for what, count in (("targets", len(problem.targets)), ("observations", len(problem.observations))):
        if count > MAX_BITS:
            raise PlanningFormatError(f"problem has {count} {what}; at most {MAX_BITS} can be written")
    known = {o.id for o in problem.observations}
    for goal in goals:
        if goal not in known:
            raise PlanningFormatError(f'goal "{goal}" names no observation of the problem')
    problem = mixed(problem)
    return _Model(problem, columns_of(problem)[1]).whole(goals, metric)


def worth(observation: Observation) -> Fraction:
    """Return what an observation is expected to earn."""
    return Fraction(str(round(observation.utility * observation.p_success, _WORTH_DIGITS)))


def _up(value: float, what: str) -> int:
    return math.ceil(_finite(value, what))


def _down(value: float, what: str) -> int:
    return math.floor(_finite(value, what))


def _finite(value: float, what: str) -> float:
    if not math.isfinite(value):
        raise PlanningFormatError(f"{what} is {value}; a finite number is needed")
    return value


@dataclass(frozen=True, slots=True)
class _Need:
    """What an action uses: whole seconds, joules of its own, joules of the hotel load meanwhile."""

    time_s: int
    energy_j: int
    hotel_j: int


class _Model:
    """Builds the fluents and actions of one problem."""

    def __init__(self, problem: Problem, columns: Columns) -> None:
        self.problem, self.columns = problem, columns
        env = Environment()
        env.credits_stream = None
        self.env, self.exp = env, env.expression_manager
        types = env.type_manager
        number, yes = types.IntType(), types.BoolType()
        place = types.UserType("place")
        self.made = ForeignProblem(
            identifier("problem", problem.name),
            env,
            initial_defaults={yes: self.exp.FALSE(), number: self.exp.Int(0)},
        )
        self.time_s = _down(problem.budget.time_s, "budget.time_s")
        self.energy_j = _down(problem.budget.usable_energy_j, "budget.energy_j")
        self.places = {
            name: Object(identifier("place", name), place, env)
            for name in (START, *(t.id for t in problem.targets))
        }
        self.made.add_objects(self.places.values())
        self.at = self._fluent("rover_at", yes, p=place)
        self.free, self.elapsed = self._fluent("free", yes)(), self._fluent("elapsed_s", number)()
        self.drawn = self._fluent("drawn_j", number)()
        self.hotel = self._fluent("hotel_j", number)()
        self.number, self.yes = number, yes
        self.done = {o.id: self._fluent(identifier("done", o.id), yes)() for o in problem.observations}
        tracked = [o.target for o, it in zip(problem.observations, columns.is_place, strict=True) if it]
        self.tracked = {t: self._fluent(identifier("tracked", t), yes)() for t in dict.fromkeys(tracked)}
        self.uses = {t: tracked.count(t) for t in self.tracked}
        self.slowed = bool(tracked) and problem.track_overhead_s_per_leg > 0.0
        if self.slowed:
            self.slow = self._fluent("slower_s", number)()
            self.slow_hotel = self._fluent("slower_hotel_j", number)()
        if math.isfinite(columns.data_limit_mbit):
            self.kept = self._fluent("data_kbit", number)()

    def whole(self, goals: Collection[str], metric: Metric) -> ForeignProblem:
        """Return the problem with its actions, start, goals and metric."""
        self.made.set_initial_value(self.free, True)
        self.made.set_initial_value(self.at(self.places[START]), True)
        for leg in self.problem.legs:
            self.drive(leg)
        for target in self.tracked:
            self.track(target)
        gained = None
        if metric is Metric.FINAL_STATE:
            real = self.env.type_manager.RealType()
            gained = self.made.add_fluent(
                Fluent("utility", real, environment=self.env), default_initial_value=0
            )()
            self.made.add_quality_metric(MaximizeExpressionOnFinalState(gained, self.env))
        for k, observation in enumerate(self.problem.observations):
            self.observe(k, observation, gained)
        waits = {self._opens(k) for k in range(len(self.problem.observations)) if not self._never(k)}
        for opens_s in sorted(waits - {0}):
            self.wait(opens_s)
        for k, o in enumerate(self.problem.observations):
            if self.columns.must_do[k] or o.id in goals:
                self.made.add_goal(self.done[o.id])
        if metric is Metric.OVERSUBSCRIPTION:
            gains = {self.done[o.id]: worth(o) for o in self.problem.observations if worth(o) > 0}
            self.made.add_quality_metric(Oversubscription(gains, self.env))
        return self.made

    def drive(self, leg: Leg) -> None:
        what = f"leg {leg.origin} -> {leg.to}"
        need = self._need(leg.time_s.mean, leg.energy_j.mean, what)
        action = self._action(identifier("drive", leg.origin, leg.to), need, slowed=self.slowed)
        action.add_condition(StartTiming(), self.at(self.places[leg.origin]))
        action.add_effect(StartTiming(), self.at(self.places[leg.origin]), False)
        action.add_effect(EndTiming(), self.at(self.places[leg.to]), True)
        self.made.add_action(action)

    def track(self, target: TargetId) -> None:
        """Add the start of a track, which is made before the rover leaves, and its stop, which is free."""
        problem, tracked = self.problem, self.tracked[target]
        need = self._need(problem.track_start_time_s, problem.track_start_energy_j, "track_start")
        action = self._action(identifier("track", target), need)
        action.add_condition(StartTiming(), self.at(self.places[START]))
        action.add_condition(StartTiming(), self.exp.Not(tracked))
        action.add_effect(EndTiming(), tracked, True)
        if self.slowed:
            for fluent, amount in self._slower().items():
                action.add_increase_effect(EndTiming(), fluent, amount)
        self.made.add_action(action)
        if self.slowed and self.uses[target] > 1:
            stop = InstantaneousAction(identifier("stop_track", target), _env=self.env)
            stop.add_precondition(self.free)
            stop.add_precondition(tracked)
            stop.add_effect(tracked, False)
            for fluent, amount in self._slower().items():
                stop.add_decrease_effect(fluent, amount)
            self.made.add_action(stop)

    def observe(self, k: int, o: Observation, gained: Any) -> None:
        if self._never(k):
            return
        need = self._need(o.time_s.mean, o.energy_j.mean, f"observation {o.id}")
        action = self._action(identifier("observe", o.id), need)
        start, end, exp = StartTiming(), EndTiming(), self.exp
        action.add_condition(start, self.at(self.places[o.target]))
        action.add_condition(start, exp.Not(self.done[o.id]))
        action.add_effect(end, self.done[o.id], True)
        for j, before in enumerate(self.problem.observations):
            if int(self.columns.predecessors[k]) >> j & 1:
                action.add_condition(start, self.done[before.id])
        if self._opens(k) > 0:
            action.add_condition(start, exp.GE(self.elapsed, self._opens(k)))
        closes_s = float(self.columns.window[k, 1])
        if math.isfinite(closes_s):
            action.add_condition(start, exp.LE(self.elapsed, math.floor(closes_s)))
        if self.columns.is_place[k]:
            self._needs_track(action, o.target)
        if math.isfinite(self.columns.data_limit_mbit):
            volume = _up(float(self.columns.data_mbit[k]) * KBIT, f"observation {o.id}: data_mbit")
            limit = _down(self.columns.data_limit_mbit * KBIT, "budget.data_mbit")
            action.add_condition(start, exp.LE(exp.Plus(self.kept, volume), limit))
            action.add_increase_effect(end, self.kept, volume)
        if gained is not None and worth(o) > 0:
            action.add_increase_effect(end, gained, worth(o))
        self.made.add_action(action)

    def wait(self, opens_s: int) -> None:
        """Add waiting until windows open that open at one time."""
        action = DurativeAction(f"{WAIT}{SEPARATOR}{opens_s}", _env=self.env)
        action.set_fixed_duration(self.exp.Minus(opens_s, self.elapsed))
        self._alone(action)
        hotel_j = _up(opens_s * self.problem.hotel_w, "hotel_w")
        action.add_condition(StartTiming(), self.exp.LT(self.elapsed, opens_s))
        action.add_condition(StartTiming(), self.exp.LE(self.exp.Plus(self.drawn, hotel_j), self.energy_j))
        action.add_effect(EndTiming(), self.elapsed, opens_s)
        action.add_effect(EndTiming(), self.hotel, hotel_j)
        self.made.add_action(action)

    def _needs_track(self, action: DurativeAction, target: TargetId) -> None:
        """Let an observation need its track, which ends with the only observation that needs it."""
        tracked = self.tracked[target]
        action.add_condition(StartTiming(), tracked)
        if self.uses[target] == 1:
            action.add_effect(EndTiming(), tracked, False)
            for fluent, amount in self._slower().items() if self.slowed else ():
                action.add_decrease_effect(EndTiming(), fluent, amount)

    def _slower(self) -> Mapping[Any, int]:
        """Return what each track that is held adds to a drive: seconds, and joules of the hotel load."""
        seconds = _up(self.problem.track_overhead_s_per_leg, "track_overhead_s_per_leg")
        return {self.slow: seconds, self.slow_hotel: _up(seconds * self.problem.hotel_w, "hotel_w")}

    def _action(self, name: str, need: _Need, *, slowed: bool = False) -> DurativeAction:
        """Return an action that fits the budgets of time and energy."""
        exp, action = self.exp, DurativeAction(name, _env=self.env)
        time_s: Any = exp.Plus(need.time_s, self.slow) if slowed else need.time_s
        hotel_j: Any = exp.Plus(need.hotel_j, self.slow_hotel) if slowed else need.hotel_j
        more = (self.slow,) if slowed else ()
        more_j = (self.slow_hotel,) if slowed else ()
        action.set_fixed_duration(time_s)
        self._alone(action)
        action.add_condition(StartTiming(), exp.LE(exp.Plus(self.elapsed, *more, need.time_s), self.time_s))
        used_j = exp.Plus(self.drawn, self.hotel, *more_j, need.energy_j + need.hotel_j)
        action.add_condition(StartTiming(), exp.LE(used_j, self.energy_j))
        action.add_increase_effect(EndTiming(), self.elapsed, time_s)
        action.add_increase_effect(EndTiming(), self.drawn, need.energy_j)
        action.add_increase_effect(EndTiming(), self.hotel, hotel_j)
        return action

    def _alone(self, action: DurativeAction) -> None:
        """Let nothing else go on meanwhile."""
        action.add_condition(StartTiming(), self.free)
        action.add_effect(StartTiming(), self.free, False)
        action.add_effect(EndTiming(), self.free, True)

    def _need(self, time_s: float, energy_j: float, what: str) -> _Need:
        seconds = _up(time_s, f"{what}: time_s")
        return _Need(
            seconds, _up(energy_j, f"{what}: energy_j"), _up(seconds * self.problem.hotel_w, "hotel_w")
        )

    def _opens(self, k: int) -> int:
        opens_s = float(self.columns.window[k, 0])
        return max(0, math.ceil(opens_s)) if math.isfinite(opens_s) else 0

    def _never(self, k: int) -> bool:
        return float(self.columns.window[k, 1]) < 0.0

    def _fluent(self, name: str, kind: Any, **parameters: Any) -> Fluent:
        made: Fluent = self.made.add_fluent(Fluent(name, kind, environment=self.env, **parameters))
        return made
