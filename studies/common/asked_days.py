"""Whole days as a user would ask for them on a fresh site, planned with branches and flown on `subframe`.

Rocks of at least 20 cm in sight of the start, as the seed draws them (`plain_choice`): each gets a placed
instrument, two a remote image too. Values are drawn from the ranges of the demo; the world has rocks that the
map lacks and softer soil. The time limit binds on some days, so that the plan has something to choose.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from executive.crl import canonical_text
from ground.day.prepare import PreparedDay, prepare_day
from ground.demo.mission import bare_day
from ground.uplink.flight import Flight, fly
from mission import Day, Request, Tracked
from planner.emit_crl import emit
from planner.path_network import Calibration
from planner.plan_result import PlanResult
from planner.problem import problem_to_dict
from planner.solve import solve
from rover_iface.profile import load_profile
from rover_iface.simulator.subframe_rover import make_rover
from rover_iface.simulator.terrain_rover import TerrainRover
from rover_iface.terrain import Terrain, generate_terrain
from studies.common.plain_choice import visible_targets
from studies.common.plain_day import write_day

PROFILE = load_profile("k9")
CONTACT, REMOTE = "mi", "scicam"
IMAGES = 2
"""Remote images a day: the demo asks for half as many as placements on the same targets, too."""
TIME_S, ENERGY_J = 3600.0, 600_000.0
"""Time and energy for each target: about what one takes (day 211 took 4.2 h for five), so that the time binds
on long days."""
BRANCHES, LEAST_TAKEN, PLAN_S = 6, 0.02, 30.0
"""As the demo plans: `ground.demo.day`."""


@dataclass(frozen=True, eq=False)
class PlannedDay:
    """A day made ready, with its plan."""

    seed: int
    terrain: Terrain
    asked: Day
    prepared: PreparedDay
    plan: PlanResult


def asked_day(terrain: Terrain, seed: int, targets: int) -> Day:
    """Return what is asked for on a site.

    Raises
    ------
    InvalidInputError
        If the site has no place for the rover to start.
    """
    rng = np.random.default_rng([seed, 0xDA7])
    mission = bare_day(terrain, PROFILE, seed=seed)
    chosen = visible_targets(terrain, PROFILE, mission, targets, seed)
    requests = [
        Request(f"R{t.id.removeprefix('T')}", t.id, CONTACT, float(rng.integers(8, 25)), (Tracked(),))
        for t in chosen
    ]
    seen = rng.permutation(len(chosen))[:IMAGES]
    requests += [
        Request(f"I{chosen[k].id.removeprefix('T')}", chosen[k].id, REMOTE, float(rng.integers(2, 7)))
        for k in sorted(int(k) for k in seen)
    ]
    limits = replace(mission.limits, time_s=targets * TIME_S, energy_j=targets * ENERGY_J)
    return replace(mission, limits=limits, targets=chosen, requests=tuple(requests))


def planned_day(seed: int, targets: int, calibration: Calibration | None, *, quick: bool) -> PlannedDay:
    """Return a day with its plan; without a calibration by the rover profile's numbers.

    `quick` plans in a second, for days that are flown to learn from.
    """
    terrain = generate_terrain(seed)
    asked = asked_day(terrain, seed, targets)
    prepared = prepare_day(terrain, PROFILE, asked, calibration=calibration)
    plan = solve(
        prepared.problem,
        max_branches=BRANCHES,
        least_taken=LEAST_TAKEN,
        time_limit_s=PLAN_S,
        seed=seed,
        quick=quick,
        plan_only=True,
    )
    return PlannedDay(seed, terrain, asked, prepared, plan)


def flown(day: PlannedDay, out: Path) -> tuple[Flight, TerrainRover]:
    """Return the flight of a day, and the rover with its truth; the run's folder is `out`."""
    problem = day.prepared.problem
    crl = canonical_text(emit(problem, day.plan.tree, plan_id="day"))
    world = write_day(out, day.asked.name, crl, problem_to_dict(problem))
    rover = make_rover(world, terrain=day.terrain, seed=day.seed, out=out)
    about = {"rover": "subframe", "seed": day.seed}
    return fly(crl, rover, out, run_id=str(day.seed), about=about, sync=False), rover
