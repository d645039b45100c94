"""The demo mission: targets and observation requests picked on any terrain, the same for the same seed.

A person picks rocks that stand out and can be reached. So does this: candidates are the tops of mapped rocks,
else the places that rise most above their surroundings; each is kept only where the ground was seen and the
arm reaches.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import shapely

from ground.day.prepare import stand_for
from ground.errors import InvalidInputError
from mission import After, Day, KeepOut, Limits, Pose, Request, Target, Tracked, Use, Window
from rover_iface.errors import PlacementError

if TYPE_CHECKING:
    from rover_iface.profile import RoverProfile
    from rover_iface.terrain import Terrain

NAMES = (
    "Adirondack", "Bonneville", "Clovis", "Dolomieu", "Endeavour", "Fuzzy Wuzzy", "Gusev", "Humphrey", "Inca",
    "Jotun",
)  # fmt: skip
TARGETS = 10
CONTACT_ONLY, BOTH = 3, 4
"""Of ten targets three get a placed instrument, four get both kinds, three a remote image: 14 requests."""

NEAREST_M, FARTHEST_M, APART_M = 3.0, 13.0, 1.8
ROOM_M, SPACING_M = 0.2, 0.05
"""Room round the circle in which the rover turns, by hand, and how far apart the ground there is looked at: a
third of the step that the rover climbs."""


def demo_mission(terrain: Terrain, profile: RoverProfile, *, seed: int) -> Day:
    """Return a day of ten targets with 14 observation requests on `terrain`.

    Raises
    ------
    InvalidInputError
        If the terrain has no place for the rover to start, or fewer than ten targets that the arm reaches.
    """
    rng = np.random.default_rng([seed, 1])
    day = _bare_day(terrain, profile, rng)
    kept_out = [shapely.Polygon(k.polygon_m) for k in day.keep_outs]
    targets: list[Target] = []
    for east, north in _candidates(terrain, day.start, rng):
        if len(targets) == TARGETS:
            break
        if any(math.hypot(east - t.point_site[0], north - t.point_site[1]) < APART_M for t in targets):
            continue
        if any(shapely.contains_xy(region, east, north) for region in kept_out):
            continue
        target = target_at(terrain, f"T{len(targets) + 1}", NAMES[len(targets)], east, north)
        if _reachable(terrain, profile, day.start, target, day.keep_outs):
            targets.append(target)
    if len(targets) < TARGETS:
        raise InvalidInputError(
            f"terrain {terrain.name}: only {len(targets)} of {TARGETS} targets with a reachable observation "
            f"point were found between {NEAREST_M:g} and {FARTHEST_M:g} m of the start"
        )
    return replace(day, targets=tuple(targets), requests=_requests(targets, profile, rng))


def bare_day(terrain: Terrain, profile: RoverProfile, *, seed: int) -> Day:
    """Return the demo mission of a seed before anything is asked for: start, keep-outs and limits.

    Raises
    ------
    InvalidInputError
        If the terrain has no place for the rover to start.
    """
    return _bare_day(terrain, profile, np.random.default_rng([seed, 1]))


def _bare_day(terrain: Terrain, profile: RoverProfile, rng: np.random.Generator) -> Day:
    start = _start(terrain, profile, rng)
    return Day(
        name=f"{terrain.name} sol 1",
        start=start,
        limits=Limits(time_s=3.5 * 3600.0, energy_j=1_050_000.0, overrun_penalty=60.0),
        keep_outs=_keep_outs(terrain, start, rng),
        refs={"terrain": terrain.name},
    )


def target_at(terrain: Terrain, identifier: str, name: str, east_m: float, north_m: float) -> Target:
    """Return a target on the full-resolution terrain."""
    normal = np.asarray(terrain.normal(east_m, north_m), dtype=float).reshape(3)
    return Target(
        id=identifier,
        name=name,
        point_site=(east_m, north_m, terrain.height_at(east_m, north_m, f"target {name}")),
        normal_site=(float(normal[0]), float(normal[1]), float(normal[2])),
    )


def _start(terrain: Terrain, profile: RoverProfile, rng: np.random.Generator) -> Pose:
    """Return a pose near the middle of the terrain on ground flat enough to stand on and to turn on."""
    flattest = _flattest(terrain, rng)
    if flattest is None:
        raise InvalidInputError(
            f"terrain {terrain.name}: no place with known heights near its middle to start from"
        )
    if _can_turn(terrain, profile, flattest):
        return flattest
    # nine points miss a rock between them; where every place has one the flattest stays
    return _flattest(terrain, rng, lambda pose: _can_turn(terrain, profile, pose)) or flattest


def _can_turn(terrain: Terrain, profile: RoverProfile, pose: Pose) -> bool:
    """Return whether nothing round the rover is higher above its ground than it climbs."""
    radius = math.hypot(profile.body.length_m, profile.body.width_m) / 2 + ROOM_M
    line = np.arange(-radius, radius + SPACING_M, SPACING_M)
    x, y = (part.ravel() for part in np.meshgrid(line, line))
    inside = np.hypot(x, y) <= radius
    x, y = x[inside], y[inside]
    heights = np.asarray(terrain.height(pose.east_m + x, pose.north_m + y))
    if not np.all(np.isfinite(heights)):
        return False
    plane = np.column_stack((x, y, np.ones_like(x)))
    above = heights - plane @ np.linalg.lstsq(plane, heights, rcond=None)[0]
    return bool(above.max() <= profile.mobility.max_step_m)


def _flattest(
    terrain: Terrain, rng: np.random.Generator, admitted: Callable[[Pose], bool] = lambda _pose: True
) -> Pose | None:
    """Return the flattest of the poses that are drawn and admitted; None where there is none."""
    west, south, east, north = terrain.bounds
    middle = ((west + east) / 2, (south + north) / 2) if not _inside(terrain, 0.0, 0.0) else (0.0, 0.0)
    best: tuple[float, Pose] | None = None
    for _ in range(400):
        radius, angle = 4.0 * math.sqrt(rng.random()), rng.uniform(0, 2 * math.pi)
        x, y = middle[0] + radius * math.cos(angle), middle[1] + radius * math.sin(angle)
        if not _inside(terrain, x, y):
            continue
        around = [(x + dx, y + dy) for dx in (-0.8, 0.0, 0.8) for dy in (-0.8, 0.0, 0.8)]
        xs, ys = np.array([p[0] for p in around]), np.array([p[1] for p in around])
        heights = np.asarray(terrain.height(xs, ys))
        if not np.all(np.isfinite(heights)):
            continue
        unevenness = float(np.ptp(heights)) + 0.02 * radius
        if best is None or unevenness < best[0]:
            pose = Pose(round(x, 2), round(y, 2), round(float(rng.uniform(-math.pi, math.pi)), 3))
            if admitted(pose):
                best = unevenness, pose
    return None if best is None else best[1]


def _inside(terrain: Terrain, x: float, y: float) -> bool:
    return bool(np.all(terrain.inside(x, y)))


def _candidates(terrain: Terrain, start: Pose, rng: np.random.Generator) -> Iterator[tuple[float, float]]:
    """Yield places that stand out: mapped rocks of 12 to 60 cm, then the highest local rises of ground."""
    rocks = [
        r for r in terrain.rocks_near(start.east_m, start.north_m, FARTHEST_M) if 0.12 <= r.diameter <= 0.6
    ]
    order = rng.permutation(len(rocks))
    for k in order:
        x, y = float(rocks[k].x), float(rocks[k].y)
        if _eligible(terrain, start, x, y):
            yield x, y
    angle = rng.uniform(0, 2 * math.pi, 6000)
    radius = np.sqrt(rng.uniform(NEAREST_M**2, FARTHEST_M**2, 6000))
    xs, ys = start.east_m + radius * np.cos(angle), start.north_m + radius * np.sin(angle)
    ok = np.asarray(terrain.inside(xs, ys)) & np.asarray(terrain.observed(xs, ys))
    xs, ys = xs[ok], ys[ok]
    around = np.stack(
        [terrain.height(xs + 0.5 * math.cos(a), ys + 0.5 * math.sin(a)) for a in np.arange(8) * math.pi / 4]
    )
    rise = np.asarray(terrain.height(xs, ys)) - around.mean(axis=0)
    for k in np.argsort(np.where(np.isfinite(rise), -rise, np.inf), kind="stable"):
        if np.isfinite(rise[k]) and _eligible(terrain, start, float(xs[k]), float(ys[k])):
            yield float(xs[k]), float(ys[k])


def _eligible(terrain: Terrain, start: Pose, x: float, y: float) -> bool:
    distance = math.hypot(x - start.east_m, y - start.north_m)
    return (
        NEAREST_M <= distance <= FARTHEST_M
        and _inside(terrain, x, y)
        and bool(np.all(terrain.observed(x, y)))
        and bool(np.isfinite(terrain.height(x, y)).all())
    )


def _keep_outs(terrain: Terrain, start: Pose, rng: np.random.Generator) -> tuple[KeepOut, ...]:
    """Return two regions that a cautious planner would draw: round the steepest ground near the start."""
    rings: list[KeepOut] = []
    angle, radius = rng.uniform(0, 2 * math.pi, 400), rng.uniform(4.0, 11.0, 400)
    xs, ys = start.east_m + radius * np.cos(angle), start.north_m + radius * np.sin(angle)
    inside = np.asarray(terrain.inside(xs, ys))
    xs, ys = xs[inside], ys[inside]
    slope = np.nan_to_num(np.asarray(terrain.slope(xs, ys)))
    for k in np.argsort(-slope, kind="stable"):
        x, y = float(xs[k]), float(ys[k])
        if len(rings) == 2:
            break
        if any(math.hypot(x - r.polygon_m[0][0], y - r.polygon_m[0][1]) < 4.0 for r in rings):
            continue
        turn = float(rng.uniform(0, math.pi))
        ring = tuple(
            (round(x + a * math.cos(turn + b), 2), round(y + a * math.sin(turn + b), 2))
            for a, b in ((0.9, 0.2), (0.7, 1.4), (1.0, 2.6), (0.8, 3.9), (0.6, 5.1))
        )
        rings.append(KeepOut(f"K{len(rings) + 1}", ring))
    return tuple(rings)


def _reachable(
    terrain: Terrain,
    profile: RoverProfile,
    start: Pose,
    target: Target,
    keep_outs: tuple[KeepOut, ...],
) -> bool:
    """Return whether the arm reaches the target from somewhere."""
    try:
        contact = profile.usual_instrument(Use.CONTACT)
        return bool(stand_for(terrain, profile, start, target, contact, keep_outs=keep_outs, count=1))
    except PlacementError:
        return False


def _requests(targets: list[Target], profile: RoverProfile, rng: np.random.Generator) -> tuple[Request, ...]:
    """Return 14 requests: seven placements, seven remote images; one window, one precedence."""
    arm, eye = profile.usual_instrument(Use.CONTACT), profile.usual_instrument(Use.REMOTE)
    order = [int(k) for k in rng.permutation(len(targets))]
    contact = order[: CONTACT_ONLY + BOTH]
    remote = order[CONTACT_ONLY:]
    requests: list[Request] = []
    for k in sorted(set(contact) | set(remote)):
        target = targets[k].id
        if k in remote:
            value = float(rng.integers(2, 7))
            # One image wants the low sun of the first two hours.
            first = all(r.instrument != eye for r in requests)
            window = (Window(0.0, 7200.0),) if first else ()
            requests.append(Request(f"R{len(requests) + 1}", target, eye, value, window))
        if k in contact:
            value = float(rng.integers(8, 25))
            # Only one placement must follow its image.
            follows = k in remote and not any(r.after for r in requests)
            after = (After(requests[-1].id),) if follows else ()
            requests.append(Request(f"R{len(requests) + 1}", target, arm, value, (*after, Tracked())))
    return tuple(requests)
