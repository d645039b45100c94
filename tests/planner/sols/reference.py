"""What the best policy over several sols earns where all amounts are constant: every choice is tried.

Written from the statement of the problem; shares nothing with the planner but the values.
"""

from __future__ import annotations

from functools import cache

from mission.sol_timeline import SolSeries
from planner.problem import Problem

FULL = 1e-9


def after_rest(series: SolSeries, sol: int, charge_j: float) -> float | None:
    """Return the charge in the next morning; None where the battery falls below its floor on the way."""
    for segment in series.sols[sol].rest:
        net_w = segment.solar_w - segment.sleep_w - segment.heater_w
        charge_j = min(series.battery.capacity_j, charge_j + segment.duration_s * net_w)
        if charge_j < series.battery.floor_j - FULL:
            return None
    return charge_j


def survives(series: SolSeries, sol: int, charge_j: float) -> bool:
    """Return whether all nights from a sol's on are survived without work."""
    if charge_j < series.battery.floor_j - FULL:
        return False
    for k in range(sol, len(series.sols)):
        after = after_rest(series, k, charge_j)
        if after is None:
            return False
        charge_j = after
    return True


def best_of_all(problem: Problem, series: SolSeries) -> float:
    """Return the value of the best policy."""
    observations = {o.id: o for o in problem.observations}
    legs = {(leg.origin, leg.to): leg for leg in problem.legs}

    @cache
    def value(sol: int, place: str, done: frozenset[str], t: float, charge: float) -> float:
        if sol == len(series.sols):
            return 0.0
        morning = after_rest(series, sol, charge)
        assert morning is not None  # the work leaves what the nights need
        best = value(sol + 1, place, done, 0.0, morning)

        def ends(start: float, seconds: float, joules: float) -> tuple[float, float] | None:
            end = start + seconds
            left = charge - joules - problem.hotel_w * (end - t)
            over = end > series.sols[sol].time_s or not survives(series, sol, left)
            return None if over else (end, left)

        for o in observations.values():
            allowed = [w for w in series.windows if w.observation == o.id]
            if o.id in done or (allowed and all(w.sol != sol + 1 for w in allowed)):
                continue
            if o.target == place:
                opens, closes = o.window_s or (0.0, float("inf"))
                if t <= closes and (end := ends(max(t, opens), o.time_s.mean, o.energy_j.mean)):
                    worth = o.utility * o.p_success
                    best = max(best, worth + value(sol, place, done | {o.id}, *end))
            elif (leg := legs.get((place, o.target))) and (
                end := ends(t, leg.time_s.mean, leg.energy_j.mean)
            ):
                best = max(best, value(sol, o.target, done, *end))
        return best

    return value(0, "start", frozenset(), 0.0, series.battery.charge_j)
