"""Small worlds for the tests of the rover room."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import pytest

from executive.ports import Result
from rover_iface.simulator.engine import SimulatedRover
from rover_iface.terrain import HeightLayer, Terrain, generate_terrain


def plane(
    slope_east: float = 0.0, slope_north: float = 0.0, *, spacing: float = 0.1, half: float = 10.0
) -> Terrain:
    """A tilted plane through the origin."""
    axis = np.arange(-half, half + spacing / 2, spacing)
    x, y = np.meshgrid(axis, axis)
    heights = (slope_east * x + slope_north * y).astype(np.float32)
    return Terrain("plane", (HeightLayer(heights, -half, -half, spacing),))


def says_what_it_drew(rover: SimulatedRover, results: Sequence[Result]) -> None:
    """Hold the energy that each of the first actions of a rover tells, one after another, against what its
    telemetry lost, hotel load left out.
    """
    before_j = total_j = 0.0
    for result in results:
        total_j = float(result.updates.get("energy-used", total_j))  # told where it has changed
        used_j = total_j - rover.hotel_w * result.t_ms / 1000.0
        told_j = float(result.values.get("energy_j", 0.0))
        assert told_j == pytest.approx(used_j - before_j, abs=1e-6), result.command.task
        before_j = used_j


def bumpy(function: Any, *, spacing: float = 0.05, half: float = 6.0) -> Terrain:
    """Heights from a function of x and y."""
    axis = np.arange(-half, half + spacing / 2, spacing)
    x, y = np.meshgrid(axis, axis)
    return Terrain("bumpy", (HeightLayer(function(x, y).astype(np.float32), -half, -half, spacing),))


@lru_cache(maxsize=4)
def generated(seed: int = 3, rock_cover: float = 0.05) -> Terrain:
    """A generated site of 48 m without its pictures, quick to make."""
    return generate_terrain(seed, 48.0, rock_cover=rock_cover, inner_m=24.0, ortho=False)


def small_problem() -> dict[str, Any]:
    """A `problem/1` with two targets, three observations and every leg."""
    amount = {"mean": 100.0, "sd": 20.0}

    def leg(a: str, b: str, lose: dict[str, float]) -> dict[str, Any]:
        return {
            "from": a,
            "to": b,
            "time_s": {"mean": 600.0, "sd": 200.0},
            "energy_j": {"mean": 50000.0, "sd": 5000.0},
            "p_lose": lose,
        }

    def observation(name: str, kind: str, p: float = 1.0) -> dict[str, Any]:
        return {
            "id": name,
            "kind": kind,
            "utility": 5.0,
            "p_success": p,
            "instrument": "mi" if kind == "place" else "scicam",
            "observe": {"time_s": amount, "energy_j": amount},
        }

    return {
        "format": "problem/1",
        "name": "small",
        "start": {"east_m": 0.0, "north_m": 0.0, "heading_rad": 0.0},
        "budget": {"time_s": 5000.0, "energy_j": 400000.0},
        "hotel_w": 38.0,
        "track_start": {"time_s": 20.0, "energy_j": 200.0},
        "track_overhead_s_per_leg": 45.0,
        "targets": [
            {
                "id": "T1",
                "point_m": [5.0, 0.0, 0.2],
                "observation_point": {"east_m": 4.2, "north_m": 0.0, "heading_rad": 0.0},
                "observations": [observation("T1-mi", "place", 0.9), observation("T1-img", "image")],
            },
            {
                "id": "T2",
                "point_m": [5.0, 4.0, 0.2],
                "observation_point": {"east_m": 5.0, "north_m": 3.2, "heading_rad": 1.57},
                "observations": [observation("T2-mi", "place", 0.9)],
            },
        ],
        "precedence": [["T1-img", "T2-mi"]],
        "legs": [
            leg("start", "T1", {"T1": 0.05, "T2": 0.3}),
            leg("start", "T2", {"T1": 0.3, "T2": 0.05}),
            leg("T1", "T2", {"T1": 0.3, "T2": 0.1}),
            leg("T2", "T1", {"T1": 0.1, "T2": 0.3}),
        ],
    }
