"""A day of tracked targets by the plain rule: planned, emitted as CRL, and flown on a rover of its choice.

The rover's world has rocks that the map lacks (0.01 per square metre) and soil that slips 20 % more.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

from executive.crl import canonical_text
from ground.day.prepare import PreparedDay, prepare_day
from ground.demo.mission import bare_day
from ground.uplink.flight import Flight, fly
from mission import Request, Target, Tracked
from planner.emit_crl import emit
from planner.problem import problem_to_dict
from planner.solve import solve
from rover_iface.profile import load_profile
from rover_iface.registry import find_rover
from rover_iface.simulator.terrain_rover import TerrainRover
from rover_iface.terrain import Terrain
from studies.common.plain_choice import visible_targets

TARGETS = 5
WORLD_ERROR = {"unmapped_rocks_per_m2": 0.01, "softer": 1.2}
BATTERY_J = 4_000_000
ENERGY_J, TIME_S = 3_000_000.0, 8 * 3600.0
"""Energy and time are no limit to five targets: what is missed is missed by the rover."""


class Stages:
    """What each stage of a day takes: seconds of the wall clock and of the processor, by name."""

    def __init__(self) -> None:
        self.spent: dict[str, tuple[float, float]] = {}

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        """Time what is done inside."""
        wall, cpu = time.perf_counter(), time.process_time()
        yield
        self.spent[name] = (time.perf_counter() - wall, time.process_time() - cpu)


@dataclass(frozen=True, eq=False)
class FlownDay:
    """A day that was flown, with the rover as it stands in the end."""

    targets: tuple[Target, ...]
    prepared: PreparedDay
    rover: TerrainRover
    flight: Flight
    triangles: int
    spent: Mapping[str, tuple[float, float]]

    @property
    def driven_m(self) -> float:
        """Return how far the rover truly drove."""
        return travelled(self.rover)[-1][1]


def fly_plain_day(
    rover: str, seed: int, out: Path, ground: Callable[[], Terrain], targets: int = TARGETS
) -> FlownDay:
    """Return the day of a seed on a `ground`, flown by the rover of a name; the run's folder is `out`."""
    stage = Stages()
    with stage("terrain"):
        terrain = ground()
    profile = load_profile("k9")
    with stage("targets, observation points, paths"):
        mission = bare_day(terrain, profile, seed=seed)
        chosen = visible_targets(terrain, profile, mission, targets, seed)
        requests = tuple(Request(f"R{k + 1}", t.id, "mi", 20.0, (Tracked(),)) for k, t in enumerate(chosen))
        limits = replace(mission.limits, time_s=TIME_S, energy_j=ENERGY_J)
        day = prepare_day(
            terrain, profile, replace(mission, limits=limits, targets=chosen, requests=requests)
        )
    with stage("plan and CRL"):
        plan = solve(day.problem, max_branches=0, time_limit_s=20.0, seed=seed)
        crl = canonical_text(emit(day.problem, plan.tree, plan_id="day"))
    world = write_day(out, mission.name, crl, problem_to_dict(day.problem))
    with stage("world of the rover: unmapped rocks, scene"):
        driven: TerrainRover = find_rover(rover)(world, terrain=terrain, seed=seed, out=out)
        triangles = driven.body.renderer.scene.triangle_count
    with stage("the day under the executive"):
        flight = fly(crl, driven, out, run_id="day", about={"rover": rover, "seed": seed}, sync=False)
    return FlownDay(chosen, day, driven, flight, triangles, stage.spent)


def write_day(
    out: Path, name: str, crl: str, problem: Mapping[str, Any], faults: Sequence[Mapping[str, Any]] = ()
) -> dict[str, Any]:
    """Write plan and world of a day into the run's folder, and return the world."""
    world = {
        "format": "world/1",
        "name": name,
        "problem": problem,
        "map_error": WORLD_ERROR,
        "battery_j": BATTERY_J,
        "faults": list(faults),
    }
    out.mkdir(parents=True, exist_ok=True)
    (out / "plan.crl").write_text(crl, encoding="utf-8")
    (out / "world.json").write_text(json.dumps(world, indent=1) + "\n", encoding="utf-8")
    return world


def travelled(rover: TerrainRover) -> list[tuple[float, float]]:
    """Return how far a rover had truly driven, m, at each time of its odometry, s."""
    rows = rover.truth.odometry
    way_m, found = 0.0, [(rows[0][0], 0.0)]
    for (_, a, _), (t_s, b, _) in pairwise(rows):
        way_m += math.hypot(b.x - a.x, b.y - a.y)
        found.append((t_s, way_m))
    return found


def processor_s(spent: Mapping[str, Sequence[float]]) -> float:
    """Return what a day took of a processor, s, terrain and planning included."""
    return float(sum(cpu for _, cpu in spent.values()))
