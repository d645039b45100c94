"""Targets as an operator picks them in the first panorama: flat sunlit faces of rocks that the arm reaches.

All of it is known before the day: the map, the camera that the target is seen with, the course of the sun,
the rover's shape. Of every rock in sight the flattest part of the visible face is taken, where the tool has
room to all sides; for it a stand from which the hazard cameras look at the face and not along it, where the
arm holds the tool along its normal, and where neither rocks nor the rover itself keep the sun off it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise, permutations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from shapely import Point, Polygon

from ground.day.prepare import stand_for
from mission import Day, Sky, Target
from mission import Pose as Stand
from mission.soltime import SunClock
from rover_iface.cameras.rig import CameraRig, load_cameras
from rover_iface.errors import PlacementError
from rover_iface.frames import Pose, across, wrap_angle
from rover_iface.mobility import settled_pose
from rover_iface.navigation.sensor import StereoSensor
from rover_iface.placement.arm import Arm, Posture
from rover_iface.profile import RoverProfile
from rover_iface.simulator.own_shadow import OwnShadow
from rover_iface.simulator.render.scene import Material, Scene, SceneMesh
from rover_iface.terrain import Terrain
from rover_iface.terrain.rocks import Rock

Array = NDArray[np.float64]

NEAREST_M, FARTHEST_M = 4.0, 10.0
LEAST_ROCK_M, LARGEST_ROCK_M = 0.22, 0.90
APART_M = 2.5
RAY_M = 0.01
"""Distance between the rays that feel for a face."""
FACE_M = 0.055
"""Radius of what must be one face: the tool and what track and hand-off may be off."""
MOST_RELIEF_M, MOST_GAP_M = 0.012, 0.03
"""How far the face may leave its plane, and by how much a ray to its rim may miss it: beyond or short."""
DAY_H, LEAST_LIGHT = 3.0, 0.25
"""How long a target must be lit, hours, and the least cosine of the sun's angle to its normal."""
MOST_OBLIQUE_RAD, MOST_TILT_RAD = math.radians(55.0), math.radians(8.0)
"""Between the hazard camera's view and the normal, and between the tool and it."""
FOOT_M = 0.04
"""How far above the ground all of a face must lie: at its foot a rock passes into sand."""
MARGIN_PX = 100.0
"""How far within the hazard camera's frame a target must lie: at its sides the pair does not range."""
MOST_GRAZING_RAD, POINTING_RAD = math.radians(68.0), 0.004
"""Between the view from the start and the normal; and what the mast may be off, which must not take the pixel
off the face as it is seen from there, foreshortened."""
PAN_MARGIN_RAD = math.radians(5.0)
"""What the mast's foot and the camera beside it take off the pan at a few metres."""
TARGETS = 5
PAPER_M, STRAIGHT = 28.0, 0.80
"""What the paper's rover drove; the shortest straight round is that share of it. The plan goes by the odds of
tracks, not by the shortest way, and rocks lie in the way."""
STANDS, TRIES = 24, 15
ROOM_M, OBSTACLE_M = 0.30, 0.08
"""How far rocks of this height must lie from the outline of a rover on its stand, but for the target's."""
MISSED = ((0.0, 0.0, 0.0), (0.07, 0.0, 0.0), (-0.07, 0.0, 0.0), (0.0, 0.07, 0.05), (0.0, -0.07, -0.05))
"""How the rover may miss a stand: metres ahead and to the left, radians. Camera and arm must not mind."""


@dataclass(frozen=True)
class Pick:
    """A target and where the rover is to stand for it."""

    target: Target
    stand: Stand
    relief_m: float


@dataclass(frozen=True)
class _Face:
    """Part of a rock: middle (3,), outward unit normal (3,), site frame; how far it leaves its plane."""

    middle: Array
    normal: Array
    relief_m: float


def choose(start: Stand, seen: Sequence[Pick]) -> tuple[Pick, ...]:
    """Return five of the targets in sight, renamed: four for a day as long as the paper's, one in reserve.

    Whichever of the five is lost, the shortest straight round from the start through the stands of the other
    four is to be `STRAIGHT` of the paper's way; the least sum of squares of what the five rounds are off.
    """
    if len(seen) < TARGETS:
        raise SystemExit(f"only {len(seen)} of {TARGETS} targets can be placed on; try another --seed")
    places = [(start.east_m, start.north_m), *((p.stand.east_m, p.stand.north_m) for p in seen)]
    away = [[math.dist(a, b) for b in places] for a in places]

    def round_m(few: tuple[int, ...]) -> float:
        return min(
            away[0][order[0]] + sum(away[a][b] for a, b in pairwise(order)) for order in permutations(few)
        )

    rounds = {few: round_m(few) for few in combinations(range(1, len(places)), TARGETS - 1)}

    def off(five: tuple[int, ...]) -> float:
        return sum((rounds[few] - STRAIGHT * PAPER_M) ** 2 for few in combinations(five, TARGETS - 1))

    best = min(combinations(range(1, len(places)), TARGETS), key=off)
    return tuple(
        replace(seen[k - 1], target=replace(seen[k - 1].target, id=f"T{n}"))
        for n, k in enumerate(best, start=1)
    )


def is_kept_out(mission: Day, east_m: float, north_m: float) -> bool:
    """Return whether a place lies in a keep-out of the mission: a target there has no drive to it."""
    place = Point(east_m, north_m)
    return any(Polygon(keep_out.polygon_m).intersects(place) for keep_out in mission.keep_outs)


class Operator:
    """Looks at a map and the first panorama."""

    def __init__(self, terrain: Terrain, profile: RoverProfile, mission: Day) -> None:
        self.terrain, self.profile, self.mission = terrain, profile, mission
        stand = mission.start
        self.start = settled_pose(terrain, profile, stand.east_m, stand.north_m, stand.heading_rad)
        self.eye = np.asarray(self.start.site_from_rover.apply(StereoSensor(profile).eye), dtype=np.float64)
        x, y = stand.east_m, stand.north_m
        half = FARTHEST_M + 2.0
        ground = terrain.mesh((x - half, y - half, x + half, y + half), 0.1)
        rocks = terrain.rock_meshes(x, y, half)
        self.scene = Scene(
            [
                SceneMesh(ground.vertices, ground.triangles),
                *(SceneMesh(m.vertices, m.triangles, m.id, Material.ROCK) for m in rocks),
            ]
        )
        light = Sky()
        clock = SunClock.at(light.ls_deg, light.latitude_deg, light.start_lmst_h)
        self.suns = [np.array(clock.direction(3600.0 * h)) for h in np.linspace(0.0, DAY_H, 4)]
        mast = profile.mast
        self.rig = CameraRig(
            load_cameras(profile.name),
            (mast.base_m[0], mast.base_m[1], mast.height_m),
            mast.pan_limit_rad,
            mast.tilt_limits_rad,
        )
        self.arm = Arm(profile.arm)

    def picks(self) -> Iterator[Pick]:
        """Yield what could be placed on, `APART_M` apart, the highest rocks first."""
        rocks = self.terrain.rocks_near(self.start.x, self.start.y, FARTHEST_M)
        chosen: list[Rock] = []
        for rock in sorted(rocks, key=lambda r: -r.height):
            away = math.hypot(rock.x - self.start.x, rock.y - self.start.y)
            if not (LEAST_ROCK_M <= rock.diameter <= LARGEST_ROCK_M and away >= NEAREST_M):
                continue
            if not self._before_the_mast(rock):
                continue
            if any(math.hypot(rock.x - r.x, rock.y - r.y) < APART_M for r in chosen):
                continue
            pick = self._pick(rock, f"T{len(chosen) + 1}")
            if pick is not None:
                chosen.append(rock)
                yield pick

    def _pick(self, rock: Rock, name: str) -> Pick | None:
        for face in self._faces(rock)[:TRIES]:
            if not self._sunlit(face.middle, face.normal):
                continue
            x, y, z = (float(v) for v in face.middle)
            if is_kept_out(self.mission, x, y):
                continue
            nx, ny, nz = (float(v) for v in face.normal)
            target = Target(name, rock.id, (x, y, z), (nx, ny, nz))
            stand = self._stand(target)
            if stand is not None:
                return Pick(target, stand, face.relief_m)
        return None

    def _faces(self, rock: Rock) -> list[_Face]:
        """Return faces of a rock as seen from the start, the flattest first, 2 cm or more apart."""
        points, outward = self._seen(rock)
        if len(points) < 30:
            return []
        tree = cKDTree(points)
        found: list[_Face] = []
        for k in range(0, len(points), 3):
            near = points[tree.query_ball_point(points[k], FACE_M)]
            if len(near) < 12:
                continue
            middle = near.mean(axis=0)
            _, _, axes = np.linalg.svd(near - middle, full_matrices=False)
            normal = axes[2] * np.sign(axes[2] @ outward[k])
            relief = float(np.abs((near - middle) @ normal).max())
            away = float(np.linalg.norm(self.eye - points[k]))
            steep = float(normal @ (self.eye - points[k])) / away
            if steep < max(math.cos(MOST_GRAZING_RAD), POINTING_RAD * away / FACE_M):
                continue
            if relief > MOST_RELIEF_M or not self._off_the_ground(points[k], normal):
                continue
            if self._whole(points[k], normal, self.eye):
                found.append(_Face(points[k], normal, relief))
        found.sort(key=lambda face: face.relief_m)
        apart: list[_Face] = []
        for face in found:
            if all(np.linalg.norm(face.middle - f.middle) > 0.02 for f in apart):
                apart.append(face)
        return apart

    def _whole(self, point: Array, normal: Array, eye: Array) -> bool:
        """Return whether all of the face is seen from an eye (3,): no rim within it, nothing before it."""
        rays = point + _circle(normal) - eye
        far = np.linalg.norm(rays, axis=1)
        away = self.scene.ranges(eye, rays / far[:, None])
        return bool((np.abs(away - far) < MOST_GAP_M).all())

    def _off_the_ground(self, point: Array, normal: Array) -> bool:
        """Return whether the lowest part of a face lies clear of the ground."""
        rim = point + _circle(normal)
        ground = self.terrain.height(rim[:, 0], rim[:, 1], ground=True)
        return bool((rim[:, 2] - ground > FOOT_M).all())

    def _seen(self, rock: Rock) -> tuple[Array, Array]:
        """Return what is seen of a rock from the start: points and outward normals [n, 3]."""
        middle = np.array([rock.x, rock.y, rock.z + 0.5 * rock.height])
        way = middle - self.eye
        side = np.array([-way[1], way[0], 0.0]) / math.hypot(way[0], way[1])
        up = np.cross(way, side)
        up /= np.linalg.norm(up)
        across = np.arange(-0.6 * rock.diameter, 0.6 * rock.diameter, RAY_M)
        above = np.arange(-0.8 * rock.height, 0.8 * rock.height, RAY_M)
        u, v = (g.ravel()[:, None] for g in np.meshgrid(across, above))
        rays = way + u * side + v * np.sign(up[2]) * up
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        hit = self.scene.cast(np.broadcast_to(self.eye, rays.shape), rays)
        number = self.scene.ids.index(rock.id) if rock.id in self.scene.ids else -1
        mine = (hit["primID"] >= 0) & (self.scene.objects[np.maximum(hit["primID"], 0)] == number)
        points = self.eye + hit["tfar"][mine, None].astype(float) * rays[mine]
        return points, -rays[mine]

    def _stand(self, target: Target) -> Stand | None:
        """Return the best stand for the whole day, None where there is none."""
        try:
            stands = stand_for(
                self.terrain,
                self.profile,
                self.mission.start,
                target,
                "mi",
                keep_outs=self.mission.keep_outs,
                count=STANDS,
            )
        except PlacementError:
            return None
        return next((s for s in stands if self._has_room(target, s) and self._good(target, s)), None)

    def _has_room(self, target: Target, stand: Stand) -> bool:
        """Return whether the navigator, which keeps off rocks, will let the rover onto a stand."""
        body = self.profile.body
        c, s = math.cos(stand.heading_rad), math.sin(stand.heading_rad)
        for rock in self.terrain.rocks_near(stand.east_m, stand.north_m, body.radius_m + ROOM_M):
            if rock.id == target.name or rock.height < OBSTACLE_M:
                continue
            east, north = rock.x - stand.east_m, rock.y - stand.north_m
            ahead = max(0.0, abs(c * east + s * north) - body.length_m / 2)
            aside = max(0.0, abs(c * north - s * east) - body.width_m / 2)
            if math.hypot(ahead, aside) < ROOM_M + rock.diameter / 2:
                return False
        return True

    def _good(self, target: Target, stand: Stand) -> bool:
        """Return whether camera, arm and sun get at the target from a stand that is missed a little."""
        point, normal = np.array(target.point_site), np.array(target.normal_site)
        c, s = math.cos(stand.heading_rad), math.sin(stand.heading_rad)
        for ahead, left, turn in MISSED:
            x, y = stand.east_m + c * ahead - s * left, stand.north_m + s * ahead + c * left
            pose = settled_pose(self.terrain, self.profile, x, y, stand.heading_rad + turn)
            if math.isnan(pose.z) or not self._in_reach(point, normal, pose):
                return False
        here = settled_pose(self.terrain, self.profile, stand.east_m, stand.north_m, stand.heading_rad)
        return self._sunlit(point, normal, here)

    def _in_reach(self, point: Array, normal: Array, pose: Pose) -> bool:
        """Return whether the hazard camera looks at a face, and the arm holds the tool along its normal."""
        camera = self.rig.camera(self.profile.cameras.hazard).transformed(pose.site_from_rover)
        view = (camera.C - point) / np.linalg.norm(camera.C - point)
        if not bool(camera.sees(point, MARGIN_PX)) or float(view @ normal) < math.cos(MOST_OBLIQUE_RAD):
            return False
        if not self._whole(point, normal, camera.C):
            return False
        rover_from_site = pose.site_from_rover.inverse()
        posture = self.arm.solve(rover_from_site.apply(point), rover_from_site.rotate(normal))
        return isinstance(posture, Posture) and posture.tool_tilt_rad <= MOST_TILT_RAD

    def _sunlit(self, point: Array, normal: Array, stand: Pose | None = None) -> bool:
        """Return whether the sun reaches the face from the start to `DAY_H` hours after it."""
        if any(float(normal @ sun) < LEAST_LIGHT for sun in self.suns):
            return False
        disc = point + 0.02 * normal + np.vstack((np.zeros(3), _circle(normal)))
        places = (disc - self.scene.origin).astype(np.float32)
        shadow = None if stand is None else OwnShadow(self.profile, lambda: stand.site_from_rover)
        for sun in self.suns:
            rays = np.ascontiguousarray(np.broadcast_to(sun, places.shape), dtype=np.float32)
            if self.scene.occluded_local(places, rays).any():
                return False
            if shadow is not None and shadow.hides(places, self.scene.origin, sun).any():
                return False
        return True

    def _before_the_mast(self, rock: Rock) -> bool:
        """Return whether the mast can turn to a rock from the start: not to what lies behind it."""
        pan = wrap_angle(math.atan2(rock.y - self.start.y, rock.x - self.start.x) - self.start.heading)
        return abs(pan) < self.profile.mast.pan_limit_rad - PAN_MARGIN_RAD


def _circle(normal: Array) -> Array:
    """Return the rim (12, 3) of a face round the origin with a unit normal (3,)."""
    first, second = across(normal)
    turn = np.linspace(0.0, math.tau, 12, endpoint=False)[:, None]
    return np.asarray(FACE_M * (np.cos(turn) * first + np.sin(turn) * second))
