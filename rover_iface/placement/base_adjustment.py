"""How far and where the rover must move when the arm does not reach a safe point."""

from __future__ import annotations

import math

import numpy as np

from rover_iface.errors import OutsideTerrainError, PlacementError
from rover_iface.frames import Pose, wrap_angle
from rover_iface.placement.base_placement import place_base
from rover_iface.placement.cloud import Array, SurfaceCloud
from rover_iface.placement.ground_plane import fit_ground_plane
from rover_iface.placement.verdict import BaseMove
from rover_iface.profile import RoverProfile
from rover_iface.terrain.grid import HeightLayer
from rover_iface.terrain.terrain import Terrain

POST_M, HALF_M = 0.05, 4.0


def base_move(
    cloud: SurfaceCloud,
    profile: RoverProfile,
    point: Array,
    normal: Array | None,
) -> BaseMove | str:
    """Return the shortest move after which the arm reaches `point`, or why there is none.

    All in the rover frame. The ground round the rover is made of the cloud; the ground plane goes on where
    the cloud has no points.

    `point` [3], m, lies on the surface; `normal` [3] is its outward unit normal.
    """
    ground = terrain_of(cloud)
    if ground is None:
        return "the ground round the rover is not known"
    here = Pose(0.0, 0.0)
    try:
        poses = place_base(ground, profile, point.tolist(), normal, start=here, count=24)
    except (PlacementError, OutsideTerrainError) as err:
        return str(err)
    # a turn costs like half a metre a radian
    best = min(poses, key=lambda p: math.hypot(p.pose.x, p.pose.y) + 0.5 * abs(wrap_angle(p.pose.heading)))
    return BaseMove(
        best.pose,
        math.hypot(best.pose.x, best.pose.y),
        wrap_angle(best.pose.heading),
        best.score,
    )


def terrain_of(cloud: SurfaceCloud) -> Terrain | None:
    """Return the ground within 4 m as a raster: the highest point of each cell, elsewhere the ground plane.

    None when the cloud has no ground plane. Single points that stand alone over their cell are left out.
    """
    plane = fit_ground_plane(cloud)
    if plane is None:
        return None
    posts = np.arange(-HALF_M, HALF_M + POST_M / 2, POST_M)
    x, y = np.meshgrid(posts, posts)
    n, o = plane.normal, plane.origin
    heights = o[2] - (n[0] * (x - o[0]) + n[1] * (y - o[1])) / n[2]
    cells = np.round((cloud.points[:, :2] + HALF_M) / POST_M).astype(np.int64)
    inside = ((cells >= 0) & (cells < len(posts))).all(axis=1)
    flat = cells[inside, 1] * len(posts) + cells[inside, 0]
    z = cloud.points[inside, 2]
    order = np.lexsort((z, flat))
    used, first, count = np.unique(flat[order], return_index=True, return_counts=True)
    high = z[order][first + np.floor(0.9 * (count - 1)).astype(np.int64)]
    grid = heights.ravel()
    grid[used[count >= 3]] = high[count >= 3]
    return Terrain(
        "cloud", (HeightLayer(grid.reshape(heights.shape).astype(np.float32), -HALF_M, -HALF_M, POST_M),)
    )
