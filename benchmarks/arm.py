"""Speed of the arm: kinematics and ways without a touch, in processor time; how many stands it serves."""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Iterator
from functools import partial

import numpy as np

from benchmarks.common.clock import median_spent
from benchmarks.common.figure import Figure, command
from rover_iface.errors import PlacementError
from rover_iface.placement.arm import Arm, ArmRefusal
from rover_iface.placement.arm_motion import Obstacles, plan_motion
from rover_iface.placement.base_placement import place_base
from rover_iface.profile import load_profile
from rover_iface.terrain import generate_terrain

POSES = 5000
QUICK = {"rovers": ("k9",), "within_m": 7.0}
BUDGET_S = 300.0


def figures(
    seed: int = 3, rovers: tuple[str, ...] = ("k9", "mer"), within_m: float = 14.0
) -> Iterator[Figure]:
    """Yield, for each rover, the cost of inverse kinematics and of ways, and the shares that are found."""
    terrain = generate_terrain(seed, 48.0, rock_cover=0.05, inner_m=24.0, ortho=False)
    for name in rovers:
        profile = load_profile(name)
        arm = Arm(profile.arm)
        low, high = arm.limits.T
        joints = np.random.default_rng(seed).uniform(low, high, (POSES, 5))
        tips, axes = arm.forward(joints)
        inverse_us = 1e6 * median_spent(partial(arm.inverse, tips, axes), 5) / POSES
        yield Figure(f"{name}: inverse, 8 branches", inverse_us, "us")
        found: Counter[str] = Counter()
        used_s = 0.0
        for rock in terrain.rocks_near(0.0, 0.0, within_m):
            if not 0.25 < rock.diameter < 0.9:
                continue
            bearing = math.atan2(-rock.y, -rock.x)
            x = rock.x + 0.25 * rock.diameter * math.cos(bearing)
            y = rock.y + 0.25 * rock.diameter * math.sin(bearing)
            point, normal = np.array((x, y, terrain.height_at(x, y))), terrain.normal(x, y, 0.1)
            try:
                stand = place_base(terrain, profile, point.tolist(), normal, count=1)[0].pose
            except PlacementError:
                continue
            rover = stand.site_from_rover.inverse()
            at, up = np.asarray(rover.apply(point)), np.asarray(rover.rotate(normal))
            found["stands"] += 1
            found["reached"] += not isinstance(arm.solve(at, up, max_tilt_rad=0.0), ArmRefusal)
            grid = np.arange(-1.2, 1.2, 0.02)
            east, north = (g.ravel() for g in np.meshgrid(x + grid, y + grid))
            cloud = rover.apply(np.column_stack((east, north, terrain.height(east, north))))
            began = time.process_time()
            way = plan_motion(arm, Obstacles.of(profile, cloud), at, up)
            used_s += time.process_time() - began
            found["ways"] += not isinstance(way, ArmRefusal)
        stands = found["stands"]
        yield Figure(f"{name}: stands whose target is in reach", 100 * found["reached"] / stands, "%")
        yield Figure(f"{name}: stands with a way, of {stands}", 100 * found["ways"] / stands, "%")
        yield Figure(f"{name}: a way", 1000 * used_s / stands, "ms")


if __name__ == "__main__":
    command(figures, QUICK, BUDGET_S)
