"""Random problems of several sols for studies of the planner."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np

from mission.sol_timeline import Battery, PowerSegment, SolSeries, SolTimeline
from planner.problem import Problem, problem_from_dict


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
