"""Speed of the arm: kinematics and ways without a touch, in CPU time; how many planned stands it serves.

.venv/bin/python -m benchmarks.arm [--seed 3]
"""

from __future__ import annotations

import argparse
import math
import time
from collections import Counter

import numpy as np

from rover_iface.errors import PlacementError
from rover_iface.placement.arm import Arm, ArmRefusal
from rover_iface.placement.arm_motion import Obstacles, plan_motion
from rover_iface.placement.base_placement import place_base
from rover_iface.profile import load_profile
from rover_iface.terrain import generate_terrain


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seed", type=int, default=3)
    seed = parser.parse_args().seed
    terrain = generate_terrain(seed, 48.0, rock_cover=0.05, inner_m=24.0, ortho=False)
    print("| rover | inverse, 8 branches, us | stand and normal in reach | way found | CPU ms a way |")
    print("| --- | --- | --- | --- | --- |")
    for name in ("k9", "mer"):
        profile = load_profile(name)
        arm = Arm(profile.arm)
        low, high = arm.limits.T
        joints = np.random.default_rng(seed).uniform(low, high, (5000, 5))
        tips, axes = arm.forward(joints)
        spent = time.process_time()
        for _ in range(5):
            arm.inverse(tips, axes)
        inverse_us = (time.process_time() - spent) / (5 * len(joints)) * 1e6
        found: Counter[str] = Counter()
        spent = 0.0
        for rock in terrain.rocks_near(0.0, 0.0, 14.0):
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
            begin = time.process_time()
            way = plan_motion(arm, Obstacles.of(profile, cloud), at, up)
            spent += time.process_time() - begin
            found["ways"] += not isinstance(way, ArmRefusal)
        stands = found["stands"]
        print(
            f"| {name} | {inverse_us:.1f} | {found['reached']} of {stands} | {found['ways']} of {stands} "
            f"| {1000 * spent / stands:.0f} |"
        )


if __name__ == "__main__":
    main()
