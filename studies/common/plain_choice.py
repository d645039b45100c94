"""Targets by a plain rule: any rock of at least 20 cm in sight of the start, as the seed draws them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import islice

import numpy as np

from ground.demo.mission import target_at
from mission import Day, Target
from rover_iface.mobility import settled_pose
from rover_iface.navigation.kernels import cast_ranges
from rover_iface.navigation.sensor import GroundRaster, StereoSensor
from rover_iface.profile import RoverProfile
from rover_iface.terrain import Terrain
from studies.common.operator_choice import is_kept_out

LEAST_M, NEAREST_M, FARTHEST_M = 0.20, 3.0, 10.0


def plain_targets(terrain: Terrain, profile: RoverProfile, mission: Day, seed: int) -> Iterator[Target]:
    """Yield targets on rocks in sight of the start, in the order that the seed draws.

    Where the line of sight to the middle of the rock meets it. Neither its face nor the arm's reach nor room
    to stand is asked for: what cannot be done is for the planner and the rover to say.
    """
    stand = mission.start
    start = settled_pose(terrain, profile, stand.east_m, stand.north_m, stand.heading_rad)
    ground = GroundRaster.of(terrain, 20.0)
    eye = start.site_from_rover.apply(StereoSensor(profile).eye)
    rocks = sorted(terrain.rocks_near(start.x, start.y, FARTHEST_M), key=lambda rock: rock.id)
    rng = np.random.default_rng([seed, 0x9A1])
    number = 0
    for k in rng.permutation(len(rocks)):
        rock = rocks[k]
        if rock.diameter < LEAST_M or math.hypot(rock.x - start.x, rock.y - start.y) < NEAREST_M:
            continue
        way = np.array([rock.x, rock.y, rock.z + 0.5 * rock.height]) - eye
        way /= np.linalg.norm(way)
        away = cast_ranges(ground.heights, ground.west, ground.south, ground.spacing, eye, way[None], 15.0)
        point = eye + float(away[0]) * way
        if not math.hypot(rock.x - point[0], rock.y - point[1]) < 0.5 * rock.diameter:
            continue
        if is_kept_out(mission, float(point[0]), float(point[1])):
            continue
        number += 1
        yield target_at(terrain, f"T{number}", rock.id, float(point[0]), float(point[1]))


def visible_targets(
    terrain: Terrain, profile: RoverProfile, mission: Day, count: int, seed: int
) -> tuple[Target, ...]:
    """Return the first `count` targets of the plain rule, fewer where fewer are in sight."""
    return tuple(islice(plain_targets(terrain, profile, mission, seed), count))
