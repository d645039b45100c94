"""Drives to random goals through rocks, and counts of how they end."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from rover_iface.frames import Pose
from rover_iface.mobility import settle
from rover_iface.navigation.sensor import GroundRaster
from rover_iface.profile import RoverProfile
from rover_iface.simulator.chassis import Chassis
from rover_iface.simulator.traverse import Traverse, drive
from rover_iface.simulator.world import Soil
from rover_iface.terrain import generate_terrain
from rover_iface.terrain.landscape import Recipe
from rover_iface.terrain.terrain import Terrain

SITE_HALF_M = 20.0
SOFTER = 1.2


@dataclass(frozen=True, slots=True)
class Study:
    """Counts of a study. Updates are CPU milliseconds of four pairs, drift and place on the map metres."""

    runs: int
    arrived: int
    collided: int
    reasons: dict[str, int]
    update_ms_median: float
    update_ms_worst: float
    looks_median: float
    length_ratio_median: float
    error_share_median: float
    drift_m_median: float
    map_m_median: float


def study_terrain(seed: int, rock_cover: float, size_m: float = 50.0) -> Terrain:
    """Return the ground of the study: fractal, rocky, without crater and slabs."""
    return generate_terrain(
        recipe=Recipe(
            seed=seed,
            size_m=size_m,
            inner_m=size_m,
            spacing_m=0.05,
            inner_spacing_m=0.05,
            rock_cover=rock_cover,
            crater=False,
            outcrop=False,
            ripples=False,
            ortho=False,
            clear_start_m=0.0,
            relief_m=1.06,
            rough=1.5,
        )
    )


def random_traverses(
    profile: RoverProfile,
    *,
    runs: int = 500,
    length_m: float = 20.0,
    covers: tuple[float, float] = (0.05, 0.10),
    seed: int = 0,
    drives_per_terrain: int = 10,
    soil: Soil | None = None,
) -> Iterator[Traverse]:
    """Yield drives to random goals `length_m` away, at rock covers between two limits; the same by one seed.

    Start and goal are places where the rover can stand with some room; everything else is left to the
    navigator.
    """
    for number in range(math.ceil(runs / drives_per_terrain)):
        rng = np.random.default_rng([seed, number])
        cover = float(rng.uniform(*covers))
        ground = GroundRaster.of(study_terrain(seed * 100_003 + number, cover), 25.0)
        for _ in range(min(drives_per_terrain, runs - number * drives_per_terrain)):
            pose, goal = _ends(ground, profile, length_m, rng)
            yield drive(Chassis(ground, profile, pose, soil=soil or Soil(), rng=rng), ground, goal)


def site_traverses(
    profile: RoverProfile, *, runs: int, seed: int, drives_per_site: int = 6
) -> Iterator[Traverse]:
    """Yield drives of 7 to 13 m over sites as the demo has them; the same by one seed.

    The sites have a crater, ripples and bedrock with ledges that cross them from side to side, and their soil
    is as soft as that of a day's rover on terrain (`studies.subframe_day`).
    """
    for number in range(math.ceil(runs / drives_per_site)):
        rng = np.random.default_rng([seed, number, 7])
        ground = GroundRaster.of(generate_terrain(seed + number), SITE_HALF_M)
        for _ in range(min(drives_per_site, runs - number * drives_per_site)):
            pose, goal = _ends(ground, profile, float(rng.uniform(7.0, 13.0)), rng)
            chassis = Chassis(ground, profile, pose, softer=SOFTER, rng=rng)
            yield drive(chassis, ground, goal, tolerance_m=0.25, near_m=0.5)


def counted(found: Sequence[Traverse], length_m: float = 20.0) -> Study:
    """Return counts and medians of drives; `length_m` is the straight line of each, 0 that they tell it."""
    reasons: dict[str, int] = {}
    for run in found:
        reasons[run.reason] = reasons.get(run.reason, 0) + 1
    updates = np.array([run.update_s for run in found]) * 1000.0
    went = [run for run in found if run.arrived]

    def median(values: list[float]) -> float:
        return float(np.median(values)) if values else math.nan

    return Study(
        runs=len(found),
        arrived=len(went),
        collided=sum(run.collided for run in found),
        reasons=reasons,
        update_ms_median=float(np.median(updates)),
        update_ms_worst=float(updates.max()),
        looks_median=median([run.looks for run in found]),
        length_ratio_median=median([run.length_m / (length_m or run.straight_m) for run in went]),
        error_share_median=median([run.error_m / (length_m or run.straight_m) for run in went]),
        drift_m_median=median([run.drift_m for run in found]),
        map_m_median=median([run.map_m for run in found]),
    )


def traverse_study(
    profile: RoverProfile,
    *,
    runs: int = 500,
    length_m: float = 20.0,
    seed: int = 0,
    drives_per_terrain: int = 10,
) -> tuple[Study, list[Traverse]]:
    """Return counts and drives of `random_traverses`."""
    found = list(
        random_traverses(
            profile, runs=runs, length_m=length_m, seed=seed, drives_per_terrain=drives_per_terrain
        )
    )
    return counted(found, length_m), found


def _ends(
    ground: GroundRaster, profile: RoverProfile, length_m: float, rng: np.random.Generator
) -> tuple[Pose, tuple[float, float]]:
    """Return a start pose and a goal `length_m` away, both on ground where the rover can stand and turn."""
    reach = -ground.west - 6.0
    for _ in range(2000):
        x, y = rng.uniform(-reach, reach, 2)
        heading = float(rng.uniform(-math.pi, math.pi))
        gx, gy = x + length_m * math.cos(heading), y + length_m * math.sin(heading)
        if max(abs(gx), abs(gy)) > reach:
            continue
        if _roomy(ground, profile, x, y) and _roomy(ground, profile, gx, gy):
            aside = float(rng.uniform(-0.6, 0.6))
            return Pose(float(x), float(y), 0.0, heading + aside), (gx, gy)
    raise AssertionError("no room for a traverse")


def _roomy(ground: GroundRaster, profile: RoverProfile, x: float, y: float) -> bool:
    headings = np.linspace(0, 2 * math.pi, 12, endpoint=False)
    standing = settle(ground, profile, np.full(12, x), np.full(12, y), headings)
    mobility = profile.mobility
    return bool(
        (standing.belly_gap > 0.06).all()
        and (standing.step < 0.6 * mobility.max_step_m).all()
        and (standing.tilt < 0.6 * mobility.max_slope_rad).all()
    )
