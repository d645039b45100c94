"""Where the rover must stand to observe a target: the observation point.

For a contact instrument the arm must reach the target with the tool along the surface normal, on ground the
rover can stand on. Forearm twist and wrist turn the tool to either side (`arm.Arm`), so a face need not look
at the shoulder; a stand that it looks at is worth more, because from there it is seen. For a remote
instrument the rover stands at a distance with a free line of sight.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mission.instrument import Use
from rover_iface.errors import PlacementError
from rover_iface.frames import Pose, wrap_angle
from rover_iface.mobility import Standing, belly_gap, settle
from rover_iface.placement.arm import Arm, ArmRefusal
from rover_iface.placement.room import room_to_stand
from rover_iface.profile import RoverProfile
from rover_iface.terrain.terrain import Terrain

Array = NDArray[np.floating]

MARGIN_M = 0.03
"""Ground clearance that must be left under the body."""

MOST_OVERHANG_RAD, MOST_LEAN_RAD = math.radians(110), math.radians(30)
"""From straight down the tool may be turned so far towards the rover, under an overhang, and so far away from
it, before the surface counts as looking away: from there no camera sees it."""

REACH_SHARE = 0.95
"""Share of the arm's reach that a planned pose may use; the rest is for driving errors."""


@dataclass(frozen=True, slots=True)
class ObservationPoint:
    """A pose for one observation and what it is worth: `score` 0 (poor) to 1 (ideal).

    `reach_m` is the distance from the shoulder (or, for remote instruments, the mast camera) to the target,
    `tool_tilt_rad` the angle between tool and surface normal that is left (or the angle of view off the
    normal), `clearance_m` the gap under the body.
    """

    pose: Pose
    target: str
    instrument: str
    score: float
    reach_m: float
    tool_tilt_rad: float
    slope_rad: float
    clearance_m: float


@dataclass(frozen=True, slots=True)
class _Rule:
    """One reason to refuse a candidate: where it holds, and in words, which are made when they are asked for,
    what is wrong with the best figure of all candidates.
    """

    name: str
    bad: NDArray[np.bool_]
    text: Callable[[], str]


def place_base(
    terrain: Terrain,
    profile: RoverProfile,
    point: Sequence[float],
    normal: ArrayLike | None = None,
    *,
    target: str = "target",
    instrument: str = "",
    start: Pose | None = None,
    keep_out: Sequence[ArrayLike] = (),
    count: int = 5,
) -> list[ObservationPoint]:
    """Return poses from which the instrument observes the target, best first, at least 0.25 m or 20 degrees
    apart.

    Parameters
    ----------
    point
        Target [3], site metres.
    normal
        Surface normal there [3], outward; taken from the terrain over 10 cm when absent.
    instrument
        Name in the rover profile; its use decides between arm and stand-off. The first one that the arm
        places when absent.
    start
        Where the rover comes from: poses on that side are preferred, since the target was seen from there
        and is tracked on the way. The origin when absent.
    keep_out
        Polygons [k, 2], site metres, in which the rover's origin may not stand.
    count
        How many poses at most.

    Raises
    ------
    PlacementError
        If there is none; the message gives the commonest reason with figures, `reasons` all of them.
    OutsideTerrainError
        If the target lies outside the terrain.
    """
    px, py, pz = (float(v) for v in point)
    terrain.require_inside(px, py, f"target {target}")
    instrument = instrument or profile.usual_instrument(Use.CONTACT)
    figures = profile.instrument(instrument)
    up = np.asarray(normal if normal is not None else terrain.normal(px, py, 0.10), dtype=float)
    if up.shape != (3,) or not np.linalg.norm(up) > 0:
        raise PlacementError(
            f"target {target} has the normal {up.tolist()}; three numbers, not all 0, are needed"
        )
    up = up / np.linalg.norm(up)
    origin = start if start is not None else Pose(0.0, 0.0)
    contact = figures.contact
    x, y, heading = _candidates(profile, px, py, origin, contact, figures.standoff_m)
    here = np.array([px, py, pz])
    standing = Standing(*(np.full(len(x), np.nan) for _ in fields(Standing)))
    reach, tilt = np.full(len(x), np.nan), np.full(len(x), np.nan)

    def rules_of(those: NDArray[np.intp] | slice, fit: Standing) -> tuple[Array, Array, list[_Rule]]:
        """Return reach [k], angle [k] past the normal and the rules of some candidates that stand on the
        ground like this.
        """
        there = x[those], y[those]
        if contact:
            far, off, rules = _arm_rules(profile, here, up, *there, heading[those], fit)
        else:
            far, off, rules = _view_rules(profile, here, up, fit, *there, figures.standoff_m)
        return far, off, [*_ground_rules(profile, fit, *there, keep_out), *rules]

    def most(those: NDArray[np.intp]) -> Array:
        """Return what some candidates [k] are worth as their wheels stand; below 0 where they fall out."""
        there = x[those], y[those], heading[those]
        fit = settle(terrain, profile, *there, belly=False)
        for field in fields(Standing):
            getattr(standing, field.name)[those] = getattr(fit, field.name)
        reach[those], tilt[those], rules = rules_of(those, fit)
        found = bound[those] * _score(profile, contact, fit, reach[those], tilt[those], _least(reach))
        found[_any(rules)] = -1.0
        return found

    def share(those: NDArray[np.intp]) -> Array:
        """Return the share of that worth [k] that is left by all that takes long; below 0 where they fall
        out.
        """
        there = x[those], y[those], heading[those]
        fit = _those(standing, those)
        gap = standing.belly_gap[those] = fit.belly_gap[...] = belly_gap(terrain, profile, *there, fit)
        clear = gap >= MARGIN_M
        if contact:
            tilt[those], joints = _joints_rule(profile, here, up, *there, fit, clear)
            clear &= ~joints.bad
        else:
            clear[clear] = _in_sight(terrain, profile, here, *(v[clear] for v in (*there[:2], fit.z)))
        found = _gap_share(profile, gap) * (0.3 + 0.7 * room_to_stand(terrain, profile, here, *there, fit))
        if contact:
            found *= _square_share(profile, tilt[those])
        found[~clear] = -1.0
        return found

    bound = _from_there(origin, here, contact, x, y, heading)
    # how far a remote instrument is counts against the nearest of all places, so all of them settle at once
    best = _best((x, y, heading), bound, most, share, count, FIRST_SETTLED if contact else len(x))
    if not best:
        whole = settle(terrain, profile, x, y, heading)
        *_, rules = rules_of(slice(None), whole)
        rules.append(_clearance_rule(whole))
        if contact:
            open_still = ~_any(rules)
            rules.append(_joints_rule(profile, here, up, x, y, heading, whole, open_still)[1])
        else:
            rules.append(_sight_rule(terrain, profile, here, x, y, whole))
        raise _refusal(target, instrument, rules)
    return [
        ObservationPoint(
            Pose(
                float(x[k]),
                float(y[k]),
                float(standing.z[k]),
                wrap_angle(float(heading[k])),
                float(standing.pitch[k]),
                float(standing.roll[k]),
            ),
            target,
            instrument,
            value,
            float(reach[k]),
            float(tilt[k]),
            float(standing.slope[k]),
            float(standing.belly_gap[k]),
        )
        for k, value in best
    ]


def _any(rules: Sequence[_Rule]) -> NDArray[np.bool_]:
    """Return which candidates [n] any rule refuses."""
    bad = np.zeros(len(rules[0].bad), dtype=bool)
    for rule in rules:
        bad |= rule.bad
    return bad


def _those(standing: Standing, chosen: NDArray[np.intp]) -> Standing:
    """Return how the rover stands in some of the poses, by their indices [k]."""
    return Standing(*(getattr(standing, f.name)[chosen] for f in fields(standing)))


FIRST_SETTLED = 216
"""Candidates of the arm that are set on the ground at first, a quarter: on generated ground (seed 7) half of
the targets need no others.
"""

FIRST_LOOK = 24
"""Candidates that are looked at closely at first, for it takes long; on generated ground (seed 1) the best
pose is among them for 9 of 10 targets.
"""


def _best(
    places: tuple[Array, Array, Array],
    bound: Array,
    most: Callable[[NDArray[np.intp]], Array],
    share: Callable[[NDArray[np.intp]], Array],
    count: int,
    settled_first: int,
) -> list[tuple[int, float]]:
    """Return the best candidates that stand apart, and what each is worth.

    A candidate is worth at most its `bound` [n], with the ground under its wheels at most what `most` says,
    and after a close look the `share` of that. What cannot be among the best is neither settled nor looked
    at. `places` are x, y and heading [n], m and rad; one below 0 is out.
    """
    x, y, heading = places
    waiting = np.argsort(-bound, kind="stable")
    upper, value = np.full(len(bound), -1.0), np.full(len(bound), -1.0)
    ready, settled, bar = waiting[:0], settled_first, -1.0
    while True:
        if len(waiting) and (not len(ready) or upper[ready[0]] < bound[waiting[0]]):
            wanted = settled if bar < 0 else max(1, int((bound[waiting] >= bar).sum()))
            new, waiting = waiting[:wanted], waiting[wanted:]
            upper[new] = most(new)
            ready = np.sort(np.concatenate((ready, new[upper[new] >= 0])))
            ready = ready[np.argsort(-upper[ready], kind="stable")]
        if len(ready):
            wanted = min(FIRST_LOOK, max(1, int((upper[ready] >= bar).sum())))
            new, ready = ready[:wanted], ready[wanted:]
            left = share(new)
            value[new] = np.where(left < 0, -1.0, upper[new] * left)
        open_still = [float(bound[waiting[0]])] if len(waiting) else []
        open_still += [float(upper[ready[0]])] if len(ready) else []
        found = _apart(x, y, heading, value, count)
        if not open_still or (len(found) == count and found[-1][1] > max(open_still)):
            return found
        bar = found[-1][1] if len(found) == count else -1.0


def _apart(x: Array, y: Array, heading: Array, value: Array, count: int) -> list[tuple[int, float]]:
    """Return the `count` candidates of most `value` [n] that stand apart from every better one."""
    found: list[tuple[int, float]] = []
    for k in np.argsort(-value, kind="stable"):
        if value[k] < 0 or len(found) == count:
            break
        close = any(
            math.hypot(x[j] - x[k], y[j] - y[k]) < 0.25
            and abs(wrap_angle(wrap_angle(float(heading[j])) - heading[k])) < math.radians(20)
            for j, _ in found
        )
        if not close:
            found.append((int(k), float(value[k])))
    return found


def check_observation_point(
    terrain: Terrain,
    profile: RoverProfile,
    pose: Pose,
    point: Sequence[float],
    normal: ArrayLike | None = None,
    *,
    target: str = "target",
    instrument: str = "",
    keep_out: Sequence[ArrayLike] = (),
) -> ObservationPoint:
    """Return what a given pose is worth for a target.

    `point` (x, y, z), m, and `normal` [3], of any length, are in the site frame; without a normal it is that
    of the terrain. Each of `keep_out` [n, 2] is a polygon of the site frame, m.

    Raises
    ------
    PlacementError
        If the target cannot be observed from there; the message gives the figures.
    """
    px, py, pz = (float(v) for v in point)
    terrain.require_inside(px, py, f"target {target}")
    terrain.require_inside(pose.x, pose.y, f"observation point of target {target}")
    instrument = instrument or profile.usual_instrument(Use.CONTACT)
    figures = profile.instrument(instrument)
    up = np.asarray(normal if normal is not None else terrain.normal(px, py, 0.10), dtype=float)
    up = up / np.linalg.norm(up)
    x, y, heading = np.array([pose.x]), np.array([pose.y]), np.array([pose.heading])
    standing = settle(terrain, profile, x, y, heading)
    here = np.array([px, py, pz])
    if figures.contact:
        reach, squint, rules = _arm_rules(profile, here, up, x, y, heading, standing, share=1.0)
        tilt, joints = _joints_rule(profile, here, up, x, y, heading, standing, ~_any(rules))
        rules.append(joints)
    else:
        reach, tilt, rules = _view_rules(profile, here, up, standing, x, y, figures.standoff_m)
        squint = tilt
        rules.append(_sight_rule(terrain, profile, here, x, y, standing))
    off_terrain, *others = _ground_rules(profile, standing, x, y, keep_out)
    # Without a stand there are no figures for the others.
    rules = [off_terrain, *rules, *others, _clearance_rule(standing)]
    for rule in rules:
        if bool(rule.bad[0]):
            raise PlacementError(
                f"observation point ({pose.x:.2f}, {pose.y:.2f}) for target {target}: {rule.text()}",
                {rule.name: 1},
            )
    behind = Pose(pose.x - math.cos(pose.heading), pose.y - math.sin(pose.heading))
    score = _from_there(behind, here, figures.contact, x, y, heading)
    score *= _score(profile, figures.contact, standing, reach, squint, _least(reach))
    score *= _gap_share(profile, standing.belly_gap)
    score *= 0.3 + 0.7 * room_to_stand(terrain, profile, here, x, y, heading, standing)
    if figures.contact:
        score *= _square_share(profile, tilt)
    settled = Pose(
        pose.x,
        pose.y,
        float(standing.z[0]),
        pose.heading,
        float(standing.pitch[0]),
        float(standing.roll[0]),
    )
    return ObservationPoint(
        settled,
        target,
        instrument,
        float(score[0]),
        float(reach[0]),
        float(tilt[0]),
        float(standing.slope[0]),
        float(standing.belly_gap[0]),
    )


def _candidates(
    profile: RoverProfile, px: float, py: float, origin: Pose, contact: bool, standoff_m: float
) -> tuple[Array, Array, Array]:
    """Return x, y, heading [n] round the target; the first direction is the one the rover comes from."""
    come = math.atan2(origin.y - py, origin.x - px) if (origin.x, origin.y) != (px, py) else math.pi
    around = come + np.linspace(0, 2 * math.pi, 36, endpoint=False)
    if contact:
        shoulder = profile.arm.shoulder_m[0]
        distance = shoulder + np.linspace(profile.arm.min_reach_m, profile.arm.reach_m * REACH_SHARE, 8)
        aside = np.radians([-25.0, 0.0, 25.0])
    else:
        near = max(standoff_m, profile.body.radius_m + 0.3)
        distance = near * np.array([1.0, 1.25, 1.5, 0.8])
        aside = np.array([0.0])
    x = px + np.cos(around)[:, None] * distance
    y = py + np.sin(around)[:, None] * distance
    heading = (around + math.pi)[:, None] + aside
    each = len(aside)
    return x.ravel().repeat(each), y.ravel().repeat(each), heading.repeat(len(distance), axis=0).ravel()


def _ground_rules(
    profile: RoverProfile, standing: Standing, x: Array, y: Array, keep_out: Sequence[ArrayLike]
) -> list[_Rule]:
    mobility = profile.mobility
    unknown = ~np.isfinite(standing.z)
    slope, tilt, step = (np.where(unknown, 0.0, v) for v in (standing.slope, standing.tilt, standing.step))
    inside = np.zeros(len(x), dtype=bool)
    for polygon in keep_out:
        inside |= inside_polygon(x, y, polygon)
    return [
        _Rule("terrain", unknown, lambda: "the rover would stand off the terrain"),
        _Rule("keep-out", inside, lambda: "it lies in a keep-out region"),
        _Rule(
            "slope",
            (slope > mobility.max_slope_rad) | (tilt > mobility.max_tilt_rad),
            lambda: (
                f"the ground slopes by {math.degrees(slope.min()):.0f} degrees or more; "
                f"the rover stands on {math.degrees(mobility.max_slope_rad):.0f}"
            ),
        ),
        _Rule(
            "step",
            step > mobility.max_step_m,
            lambda: (
                f"wheels stand on steps of {100 * step.min():.0f} cm or more; "
                f"the rover takes {100 * mobility.max_step_m:.0f} cm"
            ),
        ),
    ]


def _clearance_rule(standing: Standing) -> _Rule:
    """Return what the ground under the body refuses."""
    gap = np.where(np.isnan(standing.belly_gap), 0.0, standing.belly_gap)
    return _Rule(
        "clearance",
        gap < MARGIN_M,
        lambda: (
            f"the ground comes within {100 * max(0.0, gap.max()):.0f} cm of the body; "
            f"{100 * MARGIN_M:.0f} cm must be left"
        ),
    )


def _in_sight(
    terrain: Terrain, profile: RoverProfile, point: Array, x: Array, y: Array, z: Array
) -> NDArray[np.bool_]:
    """Return from which places [n] on known ground at height `z` [n] the mast sees the point."""
    eye = np.stack([x, y, z + profile.mast.height_m], axis=-1)
    return terrain.line_of_sight(eye, np.broadcast_to(point, eye.shape))


def _sight_rule(
    terrain: Terrain, profile: RoverProfile, point: Array, x: Array, y: Array, standing: Standing
) -> _Rule:
    """Return what the ground between mast and target refuses."""
    hidden = np.isfinite(standing.z)
    hidden[hidden] = ~_in_sight(terrain, profile, point, x[hidden], y[hidden], standing.z[hidden])
    return _Rule("sight", hidden, lambda: "the ground hides the target from the mast")


def _least(values: Array) -> float:
    """Return the least known value, infinity if none is known (no candidate stands on the terrain)."""
    return float(np.min(values, where=np.isfinite(values), initial=np.inf))


def _arm_rules(
    profile: RoverProfile,
    point: Array,
    up: Array,
    x: Array,
    y: Array,
    heading: Array,
    standing: Standing,
    share: float = REACH_SHARE,
) -> tuple[Array, Array, list[_Rule]]:
    """Return reach [n], the angle by which the surface looks past the shoulder [n], and the rules of the arm
    but what its joints hold.
    """
    arm = profile.arm
    place, normal = _from_rover(point, up, x, y, heading, standing)
    local = place - np.array(arm.shoulder_m)
    reach = np.linalg.norm(local, axis=-1)
    height = place[:, 2]
    azimuth = np.arctan2(local[:, 1], local[:, 0])
    # Normal of the arm's plane: horizontal in the rover frame, across the direction to the target.
    across = np.stack([-np.sin(azimuth), np.cos(azimuth), np.zeros_like(azimuth)], axis=-1)
    aside = np.arcsin(np.clip(np.abs(np.einsum("ni,ni->n", across, normal)), 0.0, 1.0))
    forward = np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros_like(azimuth)], axis=-1)
    ahead = np.einsum("ni,ni->n", forward, normal)
    pitch = np.arctan2(-ahead, normal[:, 2])
    turned = np.maximum(0.0, np.maximum(pitch - MOST_OVERHANG_RAD, -pitch - MOST_LEAN_RAD))
    squint = np.arccos(np.clip(np.cos(aside) * np.cos(turned), -1.0, 1.0))
    away = np.arccos(np.clip(np.cos(aside) ** 2 * np.cos(turned) + np.sin(aside) ** 2, -1.0, 1.0))
    safe = np.where(np.isnan(reach), np.inf, reach)
    low, high = arm.workspace_height_m
    nearest = float(safe.min())
    rules = [
        _Rule(
            "reach",
            safe > arm.reach_m * share,
            lambda: (
                f"the target is {nearest:.2f} m from the arm's shoulder; the arm reaches {arm.reach_m:.2f} m"
            ),
        ),
        _Rule(
            "too close",
            safe < arm.min_reach_m,
            lambda: (
                f"the target is {nearest:.2f} m from the arm's shoulder; "
                f"the arm works from {arm.min_reach_m:.2f} m"
            ),
        ),
        _Rule(
            "azimuth",
            np.abs(azimuth) > arm.azimuth_limit_rad,
            lambda: (
                f"the target is {math.degrees(float(np.abs(azimuth).min())):.0f} degrees off the arm's "
                f"middle; the arm turns {math.degrees(arm.azimuth_limit_rad):.0f}"
            ),
        ),
        _Rule(
            "height",
            ~((height >= low) & (height <= high)),
            lambda: (
                f"the target is {float(height[np.argmin(safe)]):.2f} m above the wheels; "
                f"the arm works from {low:.2f} to {high:.2f} m"
            ),
        ),
        _Rule(
            "normal",
            away > arm.max_tool_tilt_rad,
            lambda: (
                f"the tool would stand {math.degrees(_least(away)):.0f} degrees or more off the surface "
                "normal, which looks away from the rover; "
                f"{math.degrees(arm.max_tool_tilt_rad):.0f} are allowed"
            ),
        ),
    ]
    return reach, squint, rules


def _from_rover(
    point: Array, up: Array, x: Array, y: Array, heading: Array, standing: Standing
) -> tuple[Array, Array]:
    """Return a point (3,) and a normal (3,) as rovers that stand in these poses have them, (n, 3)."""
    rotation = _rotations(standing.roll, standing.pitch, heading)
    away = point - np.stack([x, y, standing.z], axis=-1)
    return np.einsum("nji,nj->ni", rotation, away), np.einsum("nji,j->ni", rotation, up)


def _joints_rule(
    profile: RoverProfile,
    point: Array,
    up: Array,
    x: Array,
    y: Array,
    heading: Array,
    standing: Standing,
    asked: NDArray[np.bool_],
) -> tuple[Array, _Rule]:
    """Return the angle that the arm leaves between tool and normal [n], and what its joints refuse of the
    candidates that are `asked` about [n].
    """
    place, normal = _from_rover(point, up, x, y, heading, standing)
    arm = Arm(profile.arm)
    asked = asked & np.isfinite(place).all(axis=-1)
    tilt = np.full(len(place), np.inf)
    tilt[asked] = arm.least_tilt(place[asked], normal[asked])
    refused = asked & np.isinf(tilt)

    def why() -> str:
        nearest = int(np.argmin(np.where(refused, np.linalg.norm(place - arm.shoulder, axis=-1), np.inf)))
        answer = arm.solve(place[nearest], normal[nearest])
        return answer.reason if isinstance(answer, ArmRefusal) else ""

    return tilt, _Rule("joints", refused, why)


def _view_rules(
    profile: RoverProfile,
    point: Array,
    up: Array,
    standing: Standing,
    x: Array,
    y: Array,
    standoff_m: float,
) -> tuple[Array, Array, list[_Rule]]:
    """Return range [n], angle of view off the normal [n], and the rules of a remote observation but sight."""
    eye = np.stack([x, y, standing.z + profile.mast.height_m], axis=-1)
    view = eye - point
    distance = np.linalg.norm(view, axis=-1)
    angle = np.arccos(np.clip(view @ up / distance, -1.0, 1.0))
    limit = max(2.5 * standoff_m, standoff_m + 1.5)
    return (
        distance,
        angle,
        [
            _Rule(
                "range",
                ~(distance <= limit),
                lambda: f"the target is {_least(distance):.2f} m away; {limit:.2f} m is the limit",
            ),
            _Rule(
                "angle",
                angle > math.radians(85),
                lambda: (
                    f"the surface is seen {math.degrees(_least(angle)):.0f} degrees off its normal "
                    "or more; 85 are allowed"
                ),
            ),
        ],
    )


def _rotations(roll: Array, pitch: Array, heading: Array) -> Array:
    """Return site_from_rover rotations [n, 3, 3]."""
    cr, sr, cp, sp = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch)
    cy, sy = np.cos(heading), np.sin(heading)
    return np.stack(
        [
            np.stack([cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr], axis=-1),
            np.stack([sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr], axis=-1),
            np.stack([-sp, cp * sr, cp * cr], axis=-1),
        ],
        axis=-2,
    )


def _from_there(origin: Pose, point: Array, contact: bool, x: Array, y: Array, heading: Array) -> Array:
    """Return what the side of the target on which a candidate [n] stands is worth, 1 on that of the origin;
    for an instrument of the arm it counts a little too that the target is straight ahead.
    """
    come = math.atan2(origin.y - point[1], origin.x - point[0])
    side = np.arctan2(y - point[1], x - point[0]) - come
    off = np.abs(np.arctan2(np.sin(side), np.cos(side)))
    approach: Array = 0.35 + 0.65 * np.cos(off / 2) ** 2
    if contact:
        approach *= 0.9 + 0.1 * np.cos(np.arctan2(point[1] - y, point[0] - x) - heading)
    return approach


def _score(
    profile: RoverProfile,
    contact: bool,
    standing: Standing,
    reach: Array,
    squint: Array,
    nearest_m: float,
) -> Array:
    """Return how well each candidate stands for its instrument, 0 to 1: a product of terms that are 1 when
    ideal.

    `squint` [n] is the angle, rad, by which the surface looks past it. `nearest_m` is the least reach of all
    candidates, also of those that are not asked about.
    """
    mobility = profile.mobility
    level = 1.0 - 0.6 * np.clip(standing.slope / mobility.max_slope_rad, 0, 1) ** 2
    flat = 1.0 - 0.4 * np.clip(standing.step / mobility.max_step_m, 0, 1)
    if contact:
        arm = profile.arm
        middle = (arm.min_reach_m + arm.reach_m) / 2
        fit = 1.0 - 0.5 * np.clip(np.abs(reach - middle) / ((arm.reach_m - arm.min_reach_m) / 2), 0, 1) ** 2
        tool = _square_share(profile, squint)
    else:
        fit = 1.0 - 0.2 * np.clip(reach / max(1e-6, nearest_m) - 1.0, 0, 1)
        tool = 0.4 + 0.6 * np.cos(np.clip(squint, 0, math.pi / 2))
    score: Array = level * flat * fit * tool
    score[np.isnan(score)] = 0.0
    return score


def _square_share(profile: RoverProfile, off_rad: Array) -> Array:
    """Return the share of its worth [n] that an angle off the normal leaves: a half at the largest tilt."""
    return np.asarray(0.5 ** ((off_rad / profile.arm.max_tool_tilt_rad) ** 2))


def _gap_share(profile: RoverProfile, gap_m: Array) -> Array:
    """Return the share of its worth [n] that the gap under the body leaves to a candidate, from a half."""
    return np.asarray(0.5 + 0.5 * np.clip((gap_m - MARGIN_M) / (0.5 * profile.body.clearance_m), 0, 1))


def _refusal(target: str, instrument: str, rules: Sequence[_Rule]) -> PlacementError:
    """Return the error that names the rule which alone, or most often, stands in the way."""
    counts = {rule.name: int(rule.bad.sum()) for rule in rules if rule.bad.any()}
    total = len(rules[0].bad)

    def saved(rule: _Rule) -> int:
        others = np.zeros(total, dtype=bool)
        for other in rules:
            if other is not rule:
                others |= other.bad
        return int((rule.bad & ~others).sum())

    decisive = max(rules, key=lambda rule: (bool(rule.bad.all()), saved(rule), counts.get(rule.name, 0)))
    listing = ", ".join(f"{name} {n}" for name, n in sorted(counts.items(), key=lambda item: -item[1]))
    return PlacementError(
        f"target {target} has no observation point for {instrument}: {decisive.text()} "
        f"(of {total} poses fall out for {listing})",
        counts,
    )


def inside_polygon(x: Array, y: Array, polygon: ArrayLike) -> NDArray[np.bool_]:
    """Return which points x, y [n] lie in a polygon [k, 2], all in one frame, by the even-odd rule."""
    corners = np.asarray(polygon, dtype=float)
    if corners.ndim != 2 or corners.shape[1] != 2 or len(corners) < 3:
        raise PlacementError(f"a keep-out region needs at least three corners [k, 2], found {corners.shape}")
    inside = np.zeros(np.shape(x), dtype=bool)
    for (ax, ay), (bx, by) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if ay == by:
            continue
        crosses = (ay > y) != (by > y)
        inside ^= crosses & (x < (bx - ax) * (y - ay) / (by - ay) + ax)
    return inside
