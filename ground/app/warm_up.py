"""Get the planner ready before anybody asks: libraries loaded, kernels compiled or read from their cache."""

from __future__ import annotations

import logging
import time
from collections.abc import Mapping
from importlib import import_module
from typing import Any

logger = logging.getLogger(__name__)

PLACES = {"A": (3.0, 1.0), "B": (4.0, -3.0), "C": (-2.0, 2.5)}
"""Observation points of the small day, metres from the start."""

NEEDED = (
    "rasterio",
    "scipy.ndimage",
    "shapely",
    "planner.path_network.build",
    "rover_iface.placement.base_placement",
    "rover_iface.terrain",
    "executive.crl",
    "planner.emit_crl",
    "ground.resources.plans.work",
)
"""What a plan and a moved keep-out load when they are first asked for; 0.7 s of a processor in all."""


def small_day() -> Mapping[str, object]:
    """Return a problem (`contingency/1`) of three targets, two of them tracked."""

    def spread(mean: float) -> dict[str, float]:
        return {"mean": mean, "sd": 0.2 * mean}

    def leg(start: str, end: str) -> dict[str, Any]:
        ax, ay = PLACES.get(start, (0.0, 0.0))
        bx, by = PLACES[end]
        length = ((ax - bx) ** 2 + (ay - by) ** 2) ** 0.5
        return {
            "from": start,
            "to": end,
            "length_m": length,
            "time_s": spread(200.0 * length),
            "energy_j": spread(9000.0 * length),
            "p_lose": {"A": 0.05, "B": 0.1},
        }

    return {
        "format": "contingency/1",
        "name": "warm-up",
        "overrun_penalty": 0.0,
        "budget": {"time_s": 4000.0, "energy_j": 300_000.0},
        "hotel_w": 30.0,
        "track_start": {"time_s": 20.0, "energy_j": 200.0},
        "track_overhead_s_per_leg": 45.0,
        "targets": [
            {
                "id": name,
                "kind": "image" if name == "C" else "place",
                "utility": 5.0 + k,
                "p_success": 0.9,
                "target_m": [place[0] + 0.6, place[1]],
                "observation_point_m": list(place),
                "observe": {"time_s": spread(400.0), "energy_j": spread(12_000.0)},
            }
            for k, (name, place) in enumerate(PLACES.items())
        ],
        "legs": [leg(a, b) for a in ("start", *PLACES) for b in PLACES if a != b],
    }


def warm_up() -> float:
    """Plan the small day and ask what-if about it; return the processor seconds that this took.

    It is for a thread or a process with nothing else to do: nothing is kept but what Python and numba keep.
    """
    from planner.changes import Changes, changed_problem
    from planner.problem import problem_from_dict
    from planner.solve import solve
    from planner.what_if import candidates, what_if

    began = time.thread_time()
    for needed in NEEDED:
        import_module(needed)
    problem = problem_from_dict(small_day())
    tree = solve(problem, max_branches=2, iterations=1, seed=1).tree
    known = candidates(problem, tree.plan)
    changed = changed_problem(problem, Changes(time_budget_s=3000.0, loss_factor=2.0))
    what_if(problem, tree.plan, changed, known=known, max_branches=2, seed=1, iterations=1)
    return time.thread_time() - began


def warm_up_quietly() -> None:
    """Warm up and say so in the log; what goes wrong here must not keep the server from serving."""
    try:
        took_s = warm_up()
    except Exception:
        logger.exception("the planner could not be warmed up")
    else:
        logger.info("planner ready", extra={"processor_s": round(took_s, 2)})
