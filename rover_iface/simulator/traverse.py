"""A drive by the navigator alone."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

from rover_iface.navigation.navigator import Navigator, Progress
from rover_iface.navigation.sensor import GroundRaster, StereoSensor
from rover_iface.simulator.chassis import Chassis


@dataclass(frozen=True, slots=True)
class Traverse:
    """How one drive ended: `arrived` by the rover's own estimate; `error_m` is how far off it truly is.

    `update_s` is the mean CPU time of a map update of four pairs, `drift_m` how far dead reckoning was off in
    the end, `map_m` how far the place on the map was. `straight_m` is the straight line from start to goal.
    """

    arrived: bool
    collided: bool
    reason: str
    looks: int
    length_m: float
    error_m: float
    duration_s: float
    energy_j: float
    update_s: float
    worst_gap_m: float
    drift_m: float
    map_m: float
    straight_m: float
    track: tuple[tuple[float, float], ...]


def drive(
    chassis: Chassis,
    ground: GroundRaster,
    goal: tuple[float, float],
    *,
    sensor: StereoSensor | None = None,
    navigator: Navigator | None = None,
    tolerance_m: float = 0.3,
    near_m: float = 0.8,
    most_looks: int = 120,
) -> Traverse:
    """Drive a chassis to a goal by its own estimate of where it is on its map, and return how it ended.

    It has arrived within `tolerance_m`, or within `near_m` if six looks brought it no nearer: by its own
    drift the goal may lie on a rock.
    """
    profile = chassis.profile
    sensor = sensor or StereoSensor(profile)
    start = (chassis.believed.x, chassis.believed.y)
    navigator = navigator or Navigator.fresh(profile, start, goal)
    step_cost = profile.activity("navigator_step")
    duration = energy = update = length = 0.0
    worst = math.inf
    track = [(chassis.pose.x, chassis.pose.y)]
    reason = "too many looks"
    looks = 0
    arrived = collided = False
    progress = Progress(near_m)
    while looks < most_looks:
        here = navigator.where(chassis.believed)
        left = math.hypot(goal[0] - here.x, goal[1] - here.y)
        if left <= tolerance_m:
            arrived, reason = True, "arrived"
            break
        if progress.stalled(left):
            arrived = left <= near_m
            reason = "as near as the ground allows" if arrived else "no nearer"
            break
        looks += 1
        first = navigator.map.updates == 0
        clouds = sensor.look(ground, chassis.pose, chassis.rng, around=first)
        begin = time.process_time()
        navigator.look(clouds, sensor.eye, chassis.believed)
        if not first:
            update += time.process_time() - begin
        share = sensor.pairs_around / len(sensor.pans) if first else 1.0
        duration += step_cost.fixed_s * share
        energy += step_cost.fixed_j * share
        here = navigator.where(chassis.believed)
        way = navigator.choose(here, goal)
        if way is None and not navigator.given_up:
            way = navigator.look_aside(here)
        if way is None:
            reason = "no safe path"
            break
        driven = chassis.follow(way)
        duration += driven.duration_s
        energy += driven.energy_j
        length += driven.true_m
        worst = min(worst, driven.worst_gap_m)
        track += driven.track[1:]
        if driven.collision:
            collided, reason = True, f"collision: {driven.collision}"
            break
        if driven.stuck:
            reason = "stuck"
            break
    here = navigator.where(chassis.believed)
    error = math.hypot(goal[0] - chassis.pose.x, goal[1] - chassis.pose.y)
    return Traverse(
        arrived,
        collided,
        reason,
        looks,
        length,
        error,
        duration,
        energy,
        update / max(1, looks - 1),
        worst,
        math.hypot(chassis.believed.x - chassis.pose.x, chassis.believed.y - chassis.pose.y),
        math.hypot(here.x - chassis.pose.x, here.y - chassis.pose.y),
        math.hypot(goal[0] - start[0], goal[1] - start[1]),
        tuple(track),
    )
