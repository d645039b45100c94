"""Random problems of several sols for studies of the planner, and planning them sol by sol."""

from __future__ import annotations

import dataclasses
import itertools
import math
from typing import Any

import numpy as np

from mission.sol_timeline import Battery, PowerSegment, SolSeries, SolTimeline
from planner.problem import START, ObservationId, Problem, problem_from_dict
from planner.sols.path_problem import path_problem
from planner.sols.solve_path import PathSearch
from planner.tally import now_s, tallied

LIKELY, CHECKED = 0.5, 2_000
"""Chance from which on an observation counts as made on a sol, and futures in which it is found."""


def _amount(mean: float, share: float) -> dict[str, float]:
    return {"mean": mean, "sd": share * mean}


def several_sols(rng: np.random.Generator, *, targets: int = 30, sols: int = 5) -> tuple[Problem, SolSeries]:
    """Return a field of targets and a rover that lives on the sun.

    Drives take 190 s and 20 kJ a metre (K9, Pedersen et al. 2005) with a spread of 0.3 in time; the sun gives
    1.0 to 1.7 MJ a sol after the work, less by dust from sol to sol, nights take 0.35 to 0.55 MJ. A quarter
    of the observations has a window of the plan clock.
    """
    field_m = float(rng.uniform(15.0, 30.0))
    spots = {"start": np.zeros(2)} | {f"T{k + 1}": rng.uniform(-field_m, field_m, 2) for k in range(targets)}
    time_s = float(rng.uniform(12_000.0, 18_000.0))
    rows: list[dict[str, Any]] = []
    for k in range(targets):
        seconds = float(rng.uniform(300.0, 1200.0))
        row: dict[str, Any] = {
            "id": f"O{k + 1}",
            "kind": "image",
            "utility": float(rng.integers(2, 11)),
            "p_success": float(rng.uniform(0.8, 1.0)),
            "observe": {"time_s": _amount(seconds, 0.2), "energy_j": _amount(30.0 * seconds, 0.2)},
        }
        if rng.random() < 0.25:
            opens = float(rng.uniform(0.0, 0.5)) * time_s
            row["window_s"] = [opens, opens + 0.5 * time_s]
        rows.append(row)
    legs = []
    for a, b in itertools.permutations(spots, 2):
        if b != "start":
            metres = math.dist(spots[a], spots[b])
            legs.append(
                {
                    "from": a,
                    "to": b,
                    "time_s": _amount(60.0 + 190.0 * metres, 0.3),
                    "energy_j": _amount(4000.0 + 20_000.0 * metres, 0.2),
                }
            )
    problem = problem_from_dict(
        {
            "format": "problem/1",
            "name": "several sols",
            "budget": {"time_s": time_s, "energy_j": 1e6},
            "hotel_w": 38.0,
            "track_start": {"time_s": 0.0, "energy_j": 0.0},
            "track_overhead_s_per_leg": 0.0,
            "overrun_penalty": 1.0,
            "targets": [{"id": f"T{k + 1}", "observations": [rows[k]]} for k in range(targets)],
            "legs": legs,
        }
    )
    dust, sun_j = float(rng.uniform(0.94, 1.0)), float(rng.uniform(1.0e6, 1.7e6))
    night_j = float(rng.uniform(0.35e6, 0.55e6))
    days = tuple(
        SolTimeline(
            time_s,
            (
                PowerSegment(18_000.0, solar_w=sun_j * dust**k / 18_000.0),
                PowerSegment(88_775.0 - 18_000.0 - time_s, sleep_w=5.0, heater_w=night_j / 60_000.0 - 5.0),
            ),
        )
        for k in range(sols)
    )
    return problem, SolSeries(Battery(2.4e6, 2.0e6, 0.3e6), days)


def sol_by_sol(problem: Problem, series: SolSeries, *, limit_s: float, seed: int) -> list[ObservationId]:
    """Return the order that comes of planning each sol alone for the most that it can earn.

    A sol begins where the last observation made before stands, with the charge of the mean, and knows nothing
    of later sols but that their nights must be survived. `limit_s` are reckoned processor seconds for each.
    """
    order: list[ObservationId] = []
    place, charge = START, series.battery.charge_j
    for k, sol in enumerate(series.sols):
        left = _from(problem, place, set(order))
        battery = dataclasses.replace(series.battery, charge_j=charge)
        path = path_problem(left, SolSeries(battery, (sol,)))
        with tallied():
            search = PathSearch(path, seed + k, now_s() + limit_s)
            search.run()
            told = search.policies.carry_out(
                search.best.table, search.days, search.needs, seed=seed, futures=CHECKED
            )
        names = path.model.observation_ids
        made = [names[m] for m in search.best.table.order if told.made[0, m] >= LIKELY * CHECKED]
        order += made
        if made:
            place = next(str(o.target) for o in problem.observations if o.id == made[-1])
        charge = path.rests[0].morning_j(charge - float(told.drawn_j[:, 0].mean()))
    return order


def _from(problem: Problem, place: str, done: set[ObservationId]) -> Problem:
    """Return what is left to do of a problem with one observation a target, begun at a place."""
    targets = tuple(t for t in problem.targets if not {o.id for o in t.observations} & done)
    ends = {str(t.id) for t in targets}
    legs = tuple(leg for leg in problem.legs if leg.to in ends and leg.origin in ends)
    first = tuple(
        dataclasses.replace(leg, origin=START)
        for leg in problem.legs
        if leg.origin == place and leg.to in ends
    )
    return dataclasses.replace(problem, targets=targets, legs=first + legs)
