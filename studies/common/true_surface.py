"""What a tool truly meets on the triangles of a scene, and whether a placement there can be done at all.

Cast on the triangles: nothing of segmentation, plane fits or stereo, none of the rover's own decisions.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_iface.frames import Pose, across
from rover_iface.placement.arm import Arm, Posture
from rover_iface.simulator.contact import held
from rover_iface.simulator.render.scene import Scene
from rover_iface.terrain.rocks import icosphere

Array = npt.NDArray[np.float64]

ABOVE_M = 0.14
"""Where rays to the surface under a tool begin: the length of the tool (`SafetyLimits.tool_length_m`)."""
NEAR_M, SAME_M = 0.03, 0.003
"""How far off a point the rays begin that ask which body it lies on, and how far from it they may meet one:
triangles of rocks are some millimetres long."""
STEP_M = 0.004
"""Distance between places that are tried round a point: a fifth of the tool's face."""

SAFE, OUT_OF_REACH, UNSAFE = "safe and in reach", "out of reach", "unsafe"


@dataclass(frozen=True)
class TrueLimits:
    """What the instrument bears, whatever the rover believes: lengths in metres.

    `tilt_rad` is what the arm may leave between tool and normal at a place that counts as safe and in reach.
    """

    protrusion_m: float = 0.020
    depth_m: float = 0.030
    slope_rad: float = math.radians(20.0)
    rock_share: float = 0.97
    arm_error_m: float = 0.002
    tilt_rad: float = math.radians(14.0)


@dataclass(frozen=True)
class TruePatch:
    """The true surface under the tool; `wrong` names what the instrument does not bear."""

    protrusion_m: float
    depth_m: float
    slope_rad: float
    rock_share: float
    wrong: tuple[str, ...]


@dataclass(frozen=True)
class Possible:
    """Whether a placement can be done: SAFE, OUT_OF_REACH or UNSAFE, and what stands against it."""

    answer: str
    why: str = ""


def true_patch(
    scene: Scene, body: int, point: Array, normal: Array, radius_m: float, limits: TrueLimits
) -> TruePatch:
    """Return the surface that a tool of `radius_m` meets when it comes down along -normal on a point, both
    (3,) in the frame of the scene, m; `body` is the number of the rock that is meant.
    """
    first, second = across(normal)
    line = np.arange(-radius_m, radius_m + 1e-9, 0.002)
    u, v = (g.ravel() for g in np.meshgrid(line, line))
    inside = np.hypot(u, v) <= radius_m
    u, v = u[inside], v[inside]
    starts = point + u[:, None] * first + v[:, None] * second + ABOVE_M * normal
    hit = scene.cast(starts, np.broadcast_to(-normal, starts.shape))
    far = hit["tfar"].astype(np.float64)
    met = far < 1e30
    height = ABOVE_M - far
    on_rock = met & (scene.objects[np.maximum(hit["primID"], 0)] == body)
    share = float(on_rock.mean())
    if on_rock.sum() < 8:
        return TruePatch(math.inf, math.inf, math.pi / 2, share, ("missed",))
    # the tool's face rests on the upper part; what is a hand's breadth below is not a support
    close = on_rock & (height > np.quantile(height[on_rock], 0.5) - 0.05)
    design = np.column_stack((u, v, np.ones_like(u)))
    plane = np.linalg.lstsq(design[close], height[close], rcond=None)[0]
    off = np.where(met, height - design @ plane, -math.inf)
    protrusion, depth = float(off.max()), float(-off.min())
    slope = math.atan(math.hypot(plane[0], plane[1]))
    wrong = tuple(
        name
        for name, bad in (
            ("missed", share < limits.rock_share),
            ("protrusion", protrusion > limits.protrusion_m),
            ("edge", depth > limits.depth_m),
            ("slope", slope > limits.slope_rad),
        )
        if bad
    )
    return TruePatch(protrusion, depth, slope, share, wrong)


def body_at(scene: Scene, point: Array) -> tuple[int, Array]:
    """Return the number of the body that a point (3,) of a surface lies on, and its outward unit normal (3,).

    Raises
    ------
    ValueError
        If no surface is there.
    """
    ways = icosphere(2)[0]
    hit = scene.cast(point + NEAR_M * ways, -ways)
    off = np.abs(hit["tfar"].astype(np.float64) - NEAR_M)
    facing = (hit["Ng"].astype(np.float64) * ways).sum(axis=1) > 0
    off = np.where(facing, off, math.inf)
    best = int(np.argmin(off))
    if not off[best] < SAME_M:
        raise ValueError(f"no surface lies at {np.round(point, 3).tolist()}")
    normal = hit["Ng"][best].astype(np.float64)
    return int(scene.objects[hit["primID"][best]]), normal / np.linalg.norm(normal)


def possible(
    scene: Scene, arm: Arm, stands: Sequence[Pose], point: Array, within_m: float, limits: TrueLimits
) -> Possible:
    """Return whether the tool can truly be put on a place within a distance of a point (3,), site frame, m,
    from one of the poses at which the rover stood.

    A place is safe by `true_patch`, the tool along the mean normal under its face. It is in reach if the arm
    holds the tool there within `TrueLimits.tilt_rad` and no link meets the ground (`contact.held`). Whether a
    camera sees it is not asked.
    """
    body, normal = body_at(scene, point)
    radius_m = arm.profile.tool_radius_m
    places, normals = _surface(scene, body, point, normal, within_m + radius_m)
    wrong: Counter[str] = Counter()
    unreached = ""
    near = np.linalg.norm(places - point, axis=1) <= within_m
    for place in places[near]:
        mean = normals[np.linalg.norm(places - place, axis=1) < radius_m].mean(axis=0)
        mean /= np.linalg.norm(mean)
        patch = true_patch(scene, body, place, mean, radius_m, limits)
        if patch.wrong:
            wrong.update(patch.wrong)
            continue
        for stand in stands:
            unreached = _unreached(scene, arm, stand, place, mean, limits)
            if not unreached:
                return Possible(SAFE)
    if unreached:
        return Possible(OUT_OF_REACH, unreached)
    return Possible(UNSAFE, ", ".join(name for name, _ in wrong.most_common()))


def _surface(scene: Scene, body: int, point: Array, normal: Array, radius_m: float) -> tuple[Array, Array]:
    """Return points and outward unit normals [n, 3] of a body round a point on it, seen along its normal."""
    first, second = across(normal)
    line = STEP_M * np.arange(-math.ceil(radius_m / STEP_M), math.ceil(radius_m / STEP_M) + 1)
    u, v = (g.ravel()[:, None] for g in np.meshgrid(line, line))
    starts = point + u * first + v * second + ABOVE_M * normal
    hit = scene.cast(starts, np.broadcast_to(-normal, starts.shape))
    mine = (hit["tfar"] < 1e30) & (scene.objects[np.maximum(hit["primID"], 0)] == body)
    found = starts[mine] - hit["tfar"][mine, None].astype(np.float64) * normal
    normals = hit["Ng"][mine].astype(np.float64)
    return found, normals / np.linalg.norm(normals, axis=1, keepdims=True)


def _unreached(scene: Scene, arm: Arm, stand: Pose, place: Array, normal: Array, limits: TrueLimits) -> str:
    """Return why the arm does not hold the tool on a place along its normal from a stand, or nothing."""
    rover = stand.site_from_rover.inverse()
    answer = arm.solve(rover.apply(place), rover.rotate(normal), max_tilt_rad=limits.tilt_rad)
    if not isinstance(answer, Posture):
        return answer.reason
    tool = held(scene, arm, stand.site_from_rover, place, normal)
    return tool if isinstance(tool, str) else ""
