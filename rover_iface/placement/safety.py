"""Whether the tool may be put on a point, and where else if not.

`plan_placement(cloud, designated_point, profile, ...) -> PlacementVerdict` is the entry; its signature is
stable.

Pedersen, Smith, Deans and others 2005, section 7: within the radius of the tool all points must lie near a
plane ("to prevent protrusions from scratching the microscope lens"), enough of the surface must have valid
stereo and no hole may be too large, and the surface must not be seen too obliquely; if the point that the
scientist chose is unsafe, the nearest safe one on the rock is taken. Added here: every limit is held with
the stereo's own error counted against the placement, the tool may not overhang the rock's edge or meet
anything beside it, and the arm is asked.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_iface.errors import PlacementError
from rover_iface.placement.arm import Arm, ArmRefusal, Posture
from rover_iface.placement.arm_motion import Motion
from rover_iface.placement.base_adjustment import base_move
from rover_iface.placement.cloud import Array, SurfaceCloud
from rover_iface.placement.segmentation import (
    GROUND,
    RockSegment,
    Segmentation,
    SegmentationOptions,
    segment,
)
from rover_iface.placement.verdict import Decision, Finding, PatchMeasures, PlacementVerdict, Reason
from rover_iface.profile import RoverProfile
from rover_iface.terrain.terrain import Terrain

ArmCheck = Callable[[Array, Array], Posture | Motion | ArmRefusal]
"""Asked for a surface point (3,) and its outward unit normal (3,), rover frame. `arm.solve` is one; so is a
call of `plan_motion` with its obstacles, whose refusal on collision counts like any other."""


MOST_ASKED = 60
"""How many safe points the arm is asked for before the rover is said to be in the wrong place."""


@dataclass(frozen=True, slots=True)
class SafetyLimits:
    """What a placement must keep.

    Attributes
    ----------
    tool_radius_m
        Of the circle round the contact face; the profile's when None.
    margin_m
        Added to the radius: the tool may come down this far from where it was meant to.
    most_protrusion_m, most_depth_m
        How far the surface under the tool may stand over the plane, and fall below it.
    most_rms_m
        Root mean square deviation from the plane, above what stereo errs.
    sigmas
        How many standard deviations of stereo's error are counted against the placement.
    most_normal_rad
        Uncertainty of the normal, that many standard deviations.
    least_share, most_hole_m
        Share of the area with valid stereo, diameter of the largest hole.
    edge_px, edge_jump_m
        Points within so many pixels of a step of this size behind them are not counted as seen: block
        matching draws the foreground over its edge.
    most_view_rad
        Angle between line of sight and normal.
    least_rock_share
        Share of the points under the tool that belong to the same rock.
    most_slope_rad
        Angle between normal and approach axis, or between normal and tool as the arm can hold it; the
        normal's uncertainty is added.
    tool_length_m
        Up to this height over the surface nothing may stand beside the tool.
    search_m
        How far from the designated point another may be taken.
    grid_m
        Distance between the points that are tried.
    """

    tool_radius_m: float | None = None
    margin_m: float = 0.008
    most_protrusion_m: float = 0.020
    most_depth_m: float = 0.020
    most_rms_m: float = 0.006
    sigmas: float = 2.0
    most_normal_rad: float = math.radians(12.0)
    least_share: float = 0.90
    most_hole_m: float = 0.014
    edge_px: int = 3
    edge_jump_m: float = 0.035
    most_view_rad: float = math.radians(70.0)
    least_rock_share: float = 0.95
    most_slope_rad: float = math.radians(14.0)
    tool_length_m: float = 0.14
    search_m: float = 0.15
    grid_m: float = 0.008

    def __post_init__(self) -> None:
        if self.tool_radius_m is not None and not self.tool_radius_m > 0:
            raise PlacementError(f"tool radius is {self.tool_radius_m} m; it must be positive")
        for name in ("margin_m", "search_m"):
            if getattr(self, name) < 0:
                raise PlacementError(f"{name} is {getattr(self, name)} m; it must not be negative")
        for name in ("most_protrusion_m", "most_depth_m", "most_rms_m", "most_hole_m", "grid_m"):
            if not getattr(self, name) > 0:
                raise PlacementError(f"{name} is {getattr(self, name)} m; it must be positive")
        if not 0 < self.least_share <= 1 or not 0 <= self.least_rock_share <= 1:
            raise PlacementError(
                f"shares of valid stereo {self.least_share} and of rock {self.least_rock_share} "
                "must lie between 0 and 1"
            )


def plan_placement(
    cloud: SurfaceCloud,
    designated_point: npt.ArrayLike,
    profile: RoverProfile,
    *,
    limits: SafetyLimits | None = None,
    segmentation: Segmentation | None = None,
    arm: ArmCheck | None = None,
    approach_axis: npt.ArrayLike | None = None,
    rock_only: bool = True,
    terrain: Terrain | None = None,
) -> PlacementVerdict:
    """Return whether and where the tool may be put on the rock that holds `designated_point`.

    Parameters
    ----------
    cloud
        What the hazard cameras see, rover frame, metres.
    designated_point
        (3,), rover frame: where the scientist wants the tool, as the hand-off left it.
    limits
        Defaults: those of a microscopic imager with a recessed lens.
    segmentation
        Of the cloud, if it was made before.
    arm
        Asked last, for points that are safe otherwise. The profile's kinematics when None; give a call of
        `plan_motion` to count collisions too.
    approach_axis
        (3,), the direction out of the surface along which the tool must come; when None it comes along the
        normal, as near as the arm can.
    rock_only
        Whether a point on the ground is refused.
    terrain
        Ground in the rover frame for the base adjustment; made of the cloud when None.

    Raises
    ------
    PlacementError
        If the point or the axis is no three finite numbers, or a segmentation is of another cloud.
    """
    limits = limits or SafetyLimits()
    at = _three(designated_point, "designated point")
    axis = None if approach_axis is None else _unit(approach_axis)
    if len(cloud) == 0:
        return _refused(Finding(Reason.NO_POINTS, 0.0, 1.0))
    found = segmentation if segmentation is not None else segment(cloud, SegmentationOptions())
    if len(found.labels) != len(cloud):
        raise PlacementError(f"the segmentation has {len(found.labels)} labels for {len(cloud)} points")
    away = float(cloud.tree.query(at)[0])
    if away > limits.search_m:
        return _refused(Finding(Reason.OUTSIDE_CLOUD, away, limits.search_m, "m"))
    if found.ground is None and rock_only:
        return _refused(Finding(Reason.NO_GROUND, 0.0, SegmentationOptions().ground.least_share))
    label, miss = _label_at(cloud, found, at, limits, rock_only)
    if miss is not None:
        return _refused(miss)
    check = PatchCheck(cloud, found.labels, label, profile, limits, axis)
    rock = found.rocks[label] if label != GROUND else None
    ask = arm if arm is not None else Arm(profile.arm).solve
    return _search(check, at, ask, rock, profile, terrain)


def _search(
    check: PatchCheck,
    at: Array,
    ask: ArmCheck,
    rock: RockSegment | None,
    profile: RoverProfile,
    terrain: Terrain | None,
) -> PlacementVerdict:
    """Judge the designated point, then others of the same rock, the nearest first."""
    first: Judged | None = None
    out_of_reach: Judged | None = None
    tried = asked = 0
    for point in check.candidates(at):
        judged = check.judge(point)
        tried += 1
        first = first or judged
        if judged.findings or judged.normal is None:
            continue
        if asked == MOST_ASKED:
            break
        asked += 1
        answer = ask(judged.point, judged.normal)
        if isinstance(answer, ArmRefusal):
            refusal = Finding(Reason.ARM, math.nan, math.nan, "", f"{answer.limit}: {answer.reason}")
            judged = judged.with_finding(refusal)
            if first.point is judged.point:
                first = judged
            out_of_reach = out_of_reach or judged
            continue
        assert judged.measures is not None
        tilt = answer.tool_tilt_rad + check.limits.sigmas * judged.measures.normal_sigma_rad
        most = check.limits.most_slope_rad
        if tilt > most:
            judged = judged.with_finding(Finding(Reason.SLOPE, tilt, most, "rad"))
            out_of_reach = out_of_reach or judged
            continue
        near = tried == 1
        return PlacementVerdict(
            Decision.PLACE if near else Decision.PLACE_NEAR,
            judged.point,
            judged.normal,
            float(np.linalg.norm(judged.point - at)),
            judged.measures,
            () if near else first.findings,
            rock,
            tried,
            posture=answer,
        )
    assert first is not None
    if out_of_reach is None:
        return PlacementVerdict(
            Decision.REFUSE, measures=first.measures, findings=first.findings, rock=rock, tried=tried
        )
    distance = float(np.linalg.norm(out_of_reach.point - at))
    move = base_move(check.cloud, profile, out_of_reach.point, out_of_reach.normal, terrain)
    if isinstance(move, str):
        return PlacementVerdict(
            Decision.REFUSE,
            measures=out_of_reach.measures,
            findings=(*out_of_reach.findings, Finding(Reason.NO_BASE, math.nan, math.nan, "", move)),
            rock=rock,
            tried=tried,
        )
    return PlacementVerdict(
        Decision.MOVE_BASE,
        out_of_reach.point,
        out_of_reach.normal,
        distance,
        out_of_reach.measures,
        out_of_reach.findings,
        rock,
        tried,
        base_move=move,
    )


def _label_at(
    cloud: SurfaceCloud, found: Segmentation, at: Array, limits: SafetyLimits, rock_only: bool
) -> tuple[int, Finding | None]:
    """Return the label of the rock that the designated point is on, or why there is none."""
    from scipy.spatial import cKDTree

    label = int(found.labels[int(cloud.tree.query(at)[1])])
    if label != GROUND or not rock_only:
        return label, None
    on_rock = np.flatnonzero(found.labels != GROUND)
    if not len(on_rock):
        return GROUND, Finding(Reason.NO_ROCK, math.inf, limits.search_m, "m")
    away, nearest = cKDTree(cloud.points[on_rock]).query(at)
    if away > limits.search_m:
        return GROUND, Finding(Reason.NO_ROCK, float(away), limits.search_m, "m")
    return int(found.labels[on_rock[int(nearest)]]), None


@dataclass(frozen=True, eq=False)
class Judged:
    """A point, the surface under the tool there, and what is wrong with it."""

    point: Array
    normal: Array | None
    measures: PatchMeasures | None
    findings: tuple[Finding, ...]

    def with_finding(self, finding: Finding) -> Judged:
        """Return the same with one more finding."""
        return Judged(self.point, self.normal, self.measures, (*self.findings, finding))


class PatchCheck:
    """Judges points of one rock (or of the ground) of a cloud.

    Parameters
    ----------
    labels, label
        (n,) of the cloud's points, and the one that the tool must stand on.
    axis
        (3,), approach axis, or None.
    """

    def __init__(
        self,
        cloud: SurfaceCloud,
        labels: npt.NDArray[np.int64],
        label: int,
        profile: RoverProfile,
        limits: SafetyLimits,
        axis: Array | None = None,
    ) -> None:
        self.cloud, self.labels, self.label, self.limits, self.axis = cloud, labels, label, limits, axis
        self.radius_m = limits.tool_radius_m or profile.arm.tool_radius_m
        self.trusted = away_from_edges(cloud, limits.edge_px, limits.edge_jump_m)

    def candidates(self, at: Array) -> list[Array]:
        """Return the points to be tried: the surface at the designated one, then one for each cell of
        `grid_m` of the same rock, by distance."""
        cloud = self.cloud
        near = np.asarray(
            cloud.tree.query_ball_point(at, max(self.limits.search_m, self.limits.grid_m)), dtype=np.int64
        )
        near = near[self.labels[near] == self.label]
        # fine round the designated point, coarser further off
        away = np.linalg.norm(cloud.points[near] - at, axis=1)
        coarse = np.where(away < self.limits.search_m / 4.0, 1.0, 2.5)
        cells = np.floor(cloud.points[near] / (self.limits.grid_m * coarse)[:, None]).astype(np.int64)
        near = near[np.unique(np.column_stack((cells, coarse)), axis=0, return_index=True)[1]]
        order = near[np.argsort(np.linalg.norm(cloud.points[near] - at, axis=1))]
        return [at, *cloud.points[order]]

    def judge(self, point: Array) -> Judged:
        """Return what the tool would stand on at a point (3,) near the surface, and every limit that it
        breaks.

        The point returned is the one on the fitted plane.
        """
        limits, cloud = self.limits, self.cloud
        reach = self.radius_m + limits.margin_m
        ball = np.asarray(cloud.tree.query_ball_point(point, 3.0 * reach), dtype=np.int64)
        inner = ball[np.linalg.norm(cloud.points[ball] - point, axis=1) < reach]
        own = inner[(self.labels[inner] == self.label) & self.trusted[inner]]
        if len(own) < 8:
            few = Finding(Reason.FEW_POINTS, float(len(own)), 8.0)
            return Judged(point, None, None, (few,))
        eye = cloud.eye
        outward = np.asarray(cloud.up) if eye is None else (eye - point) / np.linalg.norm(eye - point)
        middle, normal = _plane(cloud, own, outward)
        on_plane = point - ((point - middle) @ normal) * normal
        away = cloud.points[ball] - on_plane
        height = away @ normal
        across = np.linalg.norm(away - height[:, None] * normal, axis=1)
        # what lies in the cylinder under the tool, however deep
        under = (across < reach) & (height < limits.tool_length_m)
        surface = ball[under]
        measures = self._measure(on_plane, normal, outward, ball, height, across, surface)
        return Judged(on_plane, normal, measures, self._findings(measures))

    def _measure(
        self,
        at: Array,
        normal: Array,
        outward: Array,
        ball: npt.NDArray[np.int64],
        height: Array,
        across: Array,
        surface: npt.NDArray[np.int64],
    ) -> PatchMeasures:
        cloud, limits = self.cloud, self.limits
        reach = self.radius_m + limits.margin_m
        part = cloud.subset(surface)
        over = (part.points - at) @ normal
        sigma = float(np.median(part.sigma_along(normal)))
        share, hole = coverage(cloud.subset(surface[self.trusted[surface]]), at, normal, reach)
        slope = 0.0 if self.axis is None else _angle(normal, self.axis)
        beside = (across >= reach) & (across < reach + limits.margin_m) & (height < limits.tool_length_m)
        return PatchMeasures(
            points=len(surface),
            valid_share=share,
            hole_m=hole,
            protrusion_m=float(np.quantile(over, 0.98)),
            depth_m=float(-np.quantile(over, 0.005)),
            rms_m=float(np.sqrt(np.mean(over**2))),
            sigma_m=sigma,
            normal_sigma_rad=self._normal_sigma(part, at, normal, sigma),
            view_angle_rad=_angle(normal, outward) if cloud.eye is not None else 0.0,
            rock_share=float((self.labels[surface] == self.label).mean()),
            beside_m=float(np.quantile(height[beside], 0.98)) if beside.any() else 0.0,
            slope_rad=slope,
        )

    def _normal_sigma(self, part: SurfaceCloud, at: Array, normal: Array, sigma: float) -> float:
        """Return the normal's uncertainty: errors are shared by patches of 5 x 5 pixels."""
        away = part.points - at
        across = away - (away @ normal)[:, None] * normal
        lever2 = float(np.linalg.eigvalsh(np.cov(across.T))[1])
        patches = max(3.0, len(part) / 25.0)
        return float(math.atan(sigma / math.sqrt(max(lever2 * patches, 1e-12))))

    def _findings(self, m: PatchMeasures) -> tuple[Finding, ...]:
        limits = self.limits
        sure = limits.sigmas * m.sigma_m / math.sqrt(max(1.0, m.points / 25.0))
        rms = math.sqrt(max(0.0, m.rms_m**2 - m.sigma_m**2))
        pairs = (
            (Reason.STEREO_SHARE, m.valid_share, limits.least_share, ""),
            (Reason.STEREO_HOLE, m.hole_m, limits.most_hole_m, "m"),
            (Reason.VIEW_ANGLE, m.view_angle_rad, limits.most_view_rad, "rad"),
            (Reason.OFF_ROCK, m.rock_share, limits.least_rock_share, ""),
            (Reason.EDGE, m.depth_m + sure, limits.most_depth_m, "m"),
            (Reason.PROTRUSION, m.protrusion_m + sure, limits.most_protrusion_m, "m"),
            (Reason.ROUGHNESS, rms, limits.most_rms_m, "m"),
            (Reason.CLEARANCE, m.beside_m, limits.most_protrusion_m, "m"),
            (Reason.NORMAL, limits.sigmas * m.normal_sigma_rad, limits.most_normal_rad, "rad"),
            (Reason.SLOPE, m.slope_rad + limits.sigmas * m.normal_sigma_rad, limits.most_slope_rad, "rad"),
        )
        least = (Reason.STEREO_SHARE, Reason.OFF_ROCK)
        return tuple(
            Finding(reason, value, limit, unit)
            for reason, value, limit, unit in pairs
            if (value < limit if reason in least else not value <= limit)
        )


def away_from_edges(cloud: SurfaceCloud, edge_px: int, jump_m: float) -> npt.NDArray[np.bool_]:
    """Return which points (n,) have nothing `jump_m` farther away within `edge_px` pixels.

    A gap counts as far as the farther of its two ends along the row. Clouds without order have no edges.
    """
    from scipy.ndimage import maximum_filter

    if cloud.pixels is None or cloud.eye is None or edge_px < 1 or len(cloud) == 0:
        return np.ones(len(cloud), bool)
    x, y = (cloud.pixels - cloud.pixels.min(axis=0)).T
    far = np.linalg.norm(cloud.points - cloud.eye, axis=1)
    raster = np.full((int(y.max()) + 1, int(x.max()) + 1), np.nan)
    raster[y, x] = far
    ends = np.fmax(_carried(raster), _carried(raster[:, ::-1])[:, ::-1])
    filled = np.where(np.isnan(raster), np.nan_to_num(ends, nan=0.0), raster)
    behind = maximum_filter(filled, size=2 * edge_px + 1)
    return np.asarray(behind[y, x] < far + jump_m)


def _carried(raster: Array) -> Array:
    """Return the raster with each gap filled by the last known value to its left."""
    known = ~np.isnan(raster)
    last = np.maximum.accumulate(np.where(known, np.arange(raster.shape[1]), 0), axis=1)
    return np.take_along_axis(raster, last, axis=1)


def coverage(part: SurfaceCloud, at: Array, normal: Array, radius_m: float) -> tuple[float, float]:
    """Return the share of a disc that lies within a pixel of a point, and the diameter of the largest hole.

    The points are looked at along the disc's normal; a pixel on an oblique surface is as long as its slant
    makes it, at most three times its width.
    """
    from scipy.spatial import cKDTree

    first = np.cross(normal, np.eye(3)[int(np.abs(normal).argmin())])
    first /= np.linalg.norm(first)
    axes = np.vstack((first, np.cross(normal, first)))
    step = max(radius_m / 12.0, 0.0015)
    line = np.arange(-radius_m, radius_m + step / 2, step)
    disc = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    disc = disc[np.linalg.norm(disc, axis=1) <= radius_m]
    if not len(part):
        return 0.0, 2.0 * radius_m
    away = np.asarray(cKDTree((part.points - at) @ axes.T).query(disc)[0])
    pixel = float(np.median(part.spacing_m))
    if part.eye is not None:
        sight = part.eye - at
        slant = abs(float(sight @ normal)) / float(np.linalg.norm(sight))
        pixel /= max(slant, 1.0 / 3.0)
    within = away <= max(1.0 * pixel, 0.5 * step)
    return float(within.mean()), 2.0 * float(np.max(away))


def safety_map(
    cloud: SurfaceCloud,
    segmentation: Segmentation,
    label: int,
    profile: RoverProfile,
    *,
    limits: SafetyLimits | None = None,
    near: npt.ArrayLike | None = None,
) -> list[Judged]:
    """Return one judgement for each cell of `grid_m` of a rock, within `search_m` of `near` (its
    centroid)."""
    limits = limits or SafetyLimits()
    if not 0 <= label < len(segmentation.rocks):
        raise PlacementError(f"rock {label} of {len(segmentation.rocks)} is asked for")
    check = PatchCheck(cloud, segmentation.labels, label, profile, limits)
    at = segmentation.rocks[label].centroid if near is None else _three(near, "middle of the map")
    return [check.judge(point) for point in check.candidates(at)[1:]]


def _plane(cloud: SurfaceCloud, own: npt.NDArray[np.int64], outward: Array) -> tuple[Array, Array]:
    """Return a point and the outward unit normal of the plane through points, wrong matches left out."""
    points = cloud.points[own]
    weight = 1.0 / np.maximum(np.trace(cloud.covariances[own], axis1=1, axis2=2), 1e-12)
    use = np.ones(len(points), bool)
    middle, normal = points.mean(axis=0), outward
    for _ in range(3):
        w = weight * use
        middle = np.asarray((w[:, None] * points).sum(axis=0) / w.sum())
        away = points - middle
        normal = np.linalg.eigh((w[:, None] * away).T @ away)[1][:, 0]
        off = np.abs(away @ normal)
        limit = 3.0 * 1.4826 * float(np.median(off)) + 1e-6
        use = off < limit
        if use.sum() < 6:
            break
    return middle, np.asarray(normal if normal @ outward >= 0 else -normal)


def _refused(finding: Finding) -> PlacementVerdict:
    return PlacementVerdict(Decision.REFUSE, findings=(finding,))


def _angle(a: Array, b: Array) -> float:
    return math.acos(float(np.clip(a @ b, -1.0, 1.0)))


def _three(values: npt.ArrayLike, what: str) -> Array:
    array = np.asarray(values, dtype=np.float64)
    if array.shape != (3,) or not np.isfinite(array).all():
        raise PlacementError(f"{what} is {array.tolist()}; three finite numbers are needed")
    return array


def _unit(values: npt.ArrayLike) -> Array:
    array = _three(values, "approach axis")
    length = float(np.linalg.norm(array))
    if not length > 0:
        raise PlacementError("the approach axis is (0, 0, 0); it has no direction")
    return np.asarray(array / length)
