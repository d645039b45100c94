"""How far and where the rover must move when the arm does not reach a safe point."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from rover_iface.errors import OutsideTerrainError, PlacementError
from rover_iface.frames import Pose, wrap_angle
from rover_iface.placement.arm import Arm, Posture
from rover_iface.placement.base_placement import ObservationPoint, place_base
from rover_iface.placement.cloud import Array, SurfaceCloud
from rover_iface.placement.ground_plane import fit_ground_plane
from rover_iface.placement.verdict import BaseMove
from rover_iface.profile import RoverProfile
from rover_iface.terrain.grid import HeightLayer
from rover_iface.terrain.terrain import Terrain

POST_M, HALF_M = 0.05, 4.0

FARTHEST_MOVE_M, MOST_TURN_RAD = 0.5, 0.8
"""How far, and with how much of a turn, the rover moves for the arm without a look at the ground."""

ANOTHER_SIDE_RAD = math.radians(15.0)
"""From a stand whose direction from a place differs by less, the mast sees the same faces of a rock: it turns
about its own axis and stands 0.75 m from what the arm reaches."""

SPARE_TILT_RAD = math.radians(8.0)
"""What a stand may leave between tool and normal: of the 14 degrees that are borne 6 are left for three
deviations of the normal and for where the move ends."""


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
    stands = _stands(cloud, profile, point, normal)
    return stands if isinstance(stands, str) else _move(min(stands, key=_cost))


def stands_near(cloud: SurfaceCloud, profile: RoverProfile, point: Array, normal: Array | None) -> list[Pose]:
    """Return the stands from which the arm reaches `point`, the nearest by the way to it first.

    All as for `base_move`: `point` [3], m, with its outward unit normal [3] or None where that is not known,
    in the rover frame.
    """
    stands = _stands(cloud, profile, point, normal)
    return [] if isinstance(stands, str) else [stand.pose for stand in sorted(stands, key=_cost)]


def mast_eye(profile: RoverProfile) -> Array:
    """Return where (3,), m, rover frame, the mast's cameras look from."""
    return np.array((*profile.mast.base_m[:2], profile.mast.height_m))


def view_move(
    cloud: SurfaceCloud, profile: RoverProfile, point: Array, normal: Array, seen_from: Sequence[Array] = ()
) -> BaseMove | str:
    """Return the move to a stand from which the mast sees `point` from another side and the arm reaches it,
    or why there is none: of those within a short move the one that faces the surface most.

    Where the arm holds the tool along that normal from nowhere, it may be the normal that is wrong: then the
    ground's own shape tells where to stand.

    All in the rover frame; `point` (3,), m, lies on the surface and `normal` (3,) is its outward unit normal,
    as far as it is known. `seen_from` are the places (3,), m, of the mast's eye (`mast_eye`) at stands from
    which it was seen before: they count as the present one does.
    """
    why = ""
    for face in (normal, None):
        stands = _stands(cloud, profile, point, face)
        if isinstance(stands, str):
            why = why or stands
            continue
        facing = _facing(stands, profile, point, normal, seen_from)
        if facing:
            return _move(max(facing, key=lambda one: one[0])[1])
    return why or "no stand within a short move shows the place from another side"


def _facing(
    stands: list[ObservationPoint],
    profile: RoverProfile,
    point: Array,
    normal: Array,
    seen_from: Sequence[Array],
) -> list[tuple[float, ObservationPoint]]:
    """Return the stands within a short move from which the mast sees a point (3,) from another side than from
    here and from the places `seen_from` (3,), each after the cosine between the line of sight and the normal
    (3,).
    """
    mast = mast_eye(profile)
    before = [_bearing(eye - point) for eye in (mast, *seen_from)]
    facing = []
    for stand in stands:
        move = _move(stand)
        there = np.asarray(stand.pose.site_from_rover.apply(mast)) - point
        turned = min(abs(wrap_angle(_bearing(there) - one)) for one in before)
        if move.distance_m > FARTHEST_MOVE_M or abs(move.turn_rad) > MOST_TURN_RAD:
            continue
        if turned >= ANOTHER_SIDE_RAD:
            facing.append((float(there @ normal) / float(np.linalg.norm(there)), stand))
    return facing


def _bearing(way: Array) -> float:
    return math.atan2(way[1], way[0])


def _stands(
    cloud: SurfaceCloud, profile: RoverProfile, point: Array, normal: Array | None
) -> list[ObservationPoint] | str:
    """Return stands from which the arm reaches a point (3,), or why there are none; those where its joints
    hold the tool along the normal, if that is known and there are any.
    """
    ground = terrain_of(cloud)
    if ground is None:
        return "the ground round the rover is not known"
    here = Pose(0.0, 0.0)
    try:
        stands = place_base(ground, profile, point.tolist(), normal, start=here, count=24)
    except (PlacementError, OutsideTerrainError) as err:
        return str(err)
    if normal is None:
        return stands
    arm = Arm(profile.arm)
    held = []
    for stand in stands:
        rover = stand.pose.site_from_rover.inverse()
        answer = arm.solve(rover.apply(point), rover.rotate(normal))
        if isinstance(answer, Posture) and answer.tool_tilt_rad <= SPARE_TILT_RAD:
            held.append(stand)
    return held or stands


def _move(stand: ObservationPoint) -> BaseMove:
    pose = stand.pose
    return BaseMove(pose, math.hypot(pose.x, pose.y), wrap_angle(pose.heading), stand.score)


def _cost(stand: ObservationPoint) -> float:
    """Return the length of the way to a stand, m; a turn costs like half a metre a radian."""
    return math.hypot(stand.pose.x, stand.pose.y) + 0.5 * abs(wrap_angle(stand.pose.heading))


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
