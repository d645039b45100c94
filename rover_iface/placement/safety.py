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
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from rover_iface.errors import PlacementError
from rover_iface.placement.arm import Arm, ArmRefusal, Posture
from rover_iface.placement.arm_motion import Motion
from rover_iface.placement.base_adjustment import base_move
from rover_iface.placement.cloud import Array, SurfaceCloud
from rover_iface.placement.joint_check import JointCheck
from rover_iface.placement.patch_check import Judged, PatchCheck
from rover_iface.placement.safety_limits import SafetyLimits
from rover_iface.placement.second_labels import SECOND_EDGE_PX, second_labels
from rover_iface.placement.segmentation import (
    GROUND,
    RockSegment,
    Segmentation,
    SegmentationOptions,
    segment,
)
from rover_iface.placement.verdict import Decision, Finding, PlacementVerdict, Reason
from rover_iface.profile import RoverProfile

ArmCheck = Callable[[Array, Array], Posture | Motion | ArmRefusal]
"""Asked for a surface point (3,) and its outward unit normal (3,), rover frame. `arm.solve` is one; so is a
call of `plan_motion` with its obstacles, whose refusal on collision counts like any other."""


MOST_ASKED = 200
"""How many safe points the arm is asked for before the rover is said to be in the wrong place."""


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
    second: SurfaceCloud | None = None,
) -> PlacementVerdict:
    """Return whether and where the tool may be put on the rock that holds `designated_point`.

    Parameters
    ----------
    cloud
        What the hazard cameras see, rover frame, metres.
    designated_point
        (3,), m, rover frame: where the scientist wants the tool, as the hand-off left it.
    limits
        Defaults: those of a microscopic imager with a recessed lens.
    segmentation
        Of the cloud, if it was made before.
    arm
        Asked last, for points that are safe otherwise. The profile's kinematics when None; give a call of
        `plan_motion` to count collisions too.
    approach_axis
        (3,), rover frame, the direction out of the surface along which the tool must come; when None it comes
        along the normal, as near as the arm can.
    rock_only
        Whether a point on the ground is refused.
    second
        What another pair sees of the same place, registered to `cloud` (`cloud_alignment.align`).

    Raises
    ------
    PlacementError
        If the point or the axis is not three finite numbers, or a segmentation is of another cloud.
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
    check = _checks(cloud, found, label, at, profile, limits, axis, second)
    rock = found.rocks[label] if label != GROUND else None
    ask = arm if arm is not None else Arm(profile.arm).solve
    return _search(check, at, ask, rock, profile)


def _checks(
    cloud: SurfaceCloud,
    found: Segmentation,
    label: int,
    at: Array,
    profile: RoverProfile,
    limits: SafetyLimits,
    axis: Array | None,
    second: SurfaceCloud | None,
) -> JointCheck:
    """Return the check of the rock that holds `at` (3,), by both clouds if there are two."""
    checks = [PatchCheck(cloud, found.labels, label, profile, limits, axis)]
    if second is not None and len(second):
        labels = second_labels(second, at, cloud, found, label)
        near = replace(limits, edge_px=SECOND_EDGE_PX)
        checks.append(PatchCheck(second, labels, label, profile, near, axis))
    return JointCheck(checks)


def _search(
    check: JointCheck,
    at: Array,
    ask: ArmCheck,
    rock: RockSegment | None,
    profile: RoverProfile,
) -> PlacementVerdict:
    """Judge the designated point, then others of the same rock, the nearest first.

    The designated point is taken if it is safe with some room. Else the nearest calm point that the arm
    reaches; without one, the nearest where it would tilt the tool; without one, the safe one of least strain.
    Where none is safe, the search is done again in finer steps, and then the one is taken that bears a close
    look best.
    """
    search = _Search(check, at, ask, rock)
    meant = search.designated()
    if meant is not None:
        return meant
    for coarse in (2.5, 1.0):
        verdict = search.sweep(coarse)
        if verdict is not None:
            return verdict
        if search.asked:
            break
    close = sorted(search.close, key=lambda one: one.close_strain)
    return search.first_reached(close) or search.not_placed(profile)


class _Search:
    """What was tried for one designated point (3,)."""

    def __init__(self, check: JointCheck, at: Array, ask: ArmCheck, rock: RockSegment | None) -> None:
        self.check, self.at, self.ask, self.rock = check, at, ask, rock
        self.first: Judged | None = None
        self.out_of_reach: Judged | None = None
        self.crease: Finding | None = None
        self.left: Finding | None = None
        """Why the designated point was left though nothing is wrong with the surface there."""
        self.close: list[Judged] = []
        """Points that only a close look would take."""
        self.tried = self.asked = 0

    def designated(self) -> PlacementVerdict | None:
        """Judge the designated point; None if it is not to be taken before others are looked at.

        It is what was asked for, so it need not be calm; but it must keep the limits, or bear a close look,
        with room.
        """
        judged = self.judge(self.at)
        if judged.normal is None:
            return None
        if not (self.roomy(judged) or judged.close_strain <= 1.0):
            return None
        posture = self.reached(judged)
        if posture is not None:
            return self.taken(judged, posture)
        if judged.findings:
            self.asked = 0  # what only a close look takes does not end the search for what is safe
        return None

    def roomy(self, judged: Judged) -> bool:
        """Return whether a surface keeps every limit, and with room where it is not calm."""
        room = judged.restless is None or judged.strain <= self.check.limits.most_strain
        return not judged.findings and room

    def sweep(self, coarse: float) -> PlacementVerdict | None:
        """Judge the points of a grid, the nearest first; None if none can be taken."""
        limits = self.check.limits
        safe: list[Judged] = []
        tilted: list[tuple[Judged, Posture | Motion]] = []
        for point in self.check.candidates(self.at, coarse=coarse):
            if self.asked == MOST_ASKED:
                break
            judged = self.judge(point)
            if judged.normal is None:
                continue
            if not self.roomy(judged):
                if judged.close_strain <= 1.0:
                    self.close.append(judged)
            elif judged.restless is not None:
                safe.append(judged)
            elif (posture := self.reached(judged)) is not None:
                slope = self.slope(judged, posture)
                if slope <= limits.calm_slope_rad:
                    return self.taken(judged, posture)
                self.leave(judged, Finding(Reason.SLOPE, slope, limits.calm_slope_rad, "rad"))
                tilted.append((judged, posture))
        if tilted:
            return self.taken(*tilted[0])
        return self.first_reached(sorted(safe, key=lambda one: one.strain))

    def first_reached(self, ordered: Sequence[Judged]) -> PlacementVerdict | None:
        """Return the verdict for the first of some points that the arm reaches; None if it reaches none."""
        for judged in ordered:
            if (posture := self.reached(judged)) is not None:
                return self.taken(judged, posture)
        return None

    def judge(self, point: Array) -> Judged:
        """Judge one more point, the designated one once."""
        if self.first is not None and point is self.at:
            return self.first
        judged = self.check.judge(point, brief=self.first is not None)
        self.tried += 1
        self.first = self.first or judged
        return judged

    def reached(self, judged: Judged) -> Posture | Motion | None:
        """Return the arm's answer for a safe point; None when it does not reach or would tilt the tool, or
        the point is not on the rock of the designated one.
        """
        if self.asked == MOST_ASKED:
            return None
        self.asked += 1
        assert judged.normal is not None
        answer = self.ask(judged.point, judged.normal)
        if isinstance(answer, ArmRefusal):
            why = Finding(Reason.ARM, math.nan, math.nan, "", f"{answer.limit}: {answer.reason}")
        else:
            limits = self.check.limits
            slope = self.slope(judged, answer)
            if slope <= limits.most_slope_rad:
                depth = self.check.crease_m(self.at, judged.point)
                if depth <= limits.most_crease_m:
                    return answer
                crease = Finding(Reason.CREASE, depth, limits.most_crease_m, "m")
                self.crease = self.crease or crease
                self.leave(judged, crease)
                return None
            why = Finding(Reason.SLOPE, slope, limits.most_slope_rad, "rad")
        refused = judged.with_finding(why)
        if self.first is judged:
            self.first = refused
        self.out_of_reach = self.out_of_reach or refused
        return None

    def leave(self, judged: Judged, why: Finding) -> None:
        """Take down why a point was left; only that of the designated one is told."""
        if judged is self.first:
            self.left = self.left or why

    def slope(self, judged: Judged, posture: Posture | Motion) -> float:
        """Return the angle between tool and surface normal, the normal's uncertainty added."""
        assert judged.measures is not None
        return posture.tool_tilt_rad + self.check.limits.sigmas * judged.measures.normal_sigma_rad

    def taken(self, judged: Judged, posture: Posture | Motion) -> PlacementVerdict:
        """Return the verdict for a safe point that the arm reaches."""
        assert self.first is not None
        designated = judged is self.first
        return PlacementVerdict(
            Decision.PLACE if designated else Decision.PLACE_NEAR,
            judged.point,
            judged.normal,
            float(np.linalg.norm(judged.point - self.at)),
            judged.measures,
            () if designated else self.first.findings or self._why_left(self.first),
            self.rock,
            self.tried,
            posture=posture,
        )

    def _why_left(self, first: Judged) -> tuple[Finding, ...]:
        return tuple(why for why in (first.restless, self.left) if why is not None)

    def not_placed(self, profile: RoverProfile) -> PlacementVerdict:
        """Return the refusal, or the move that would bring a safe point into reach."""
        assert self.first is not None
        away = self.out_of_reach
        if away is None:
            return PlacementVerdict(
                Decision.REFUSE,
                measures=self.first.measures,
                findings=self.first.findings if self.crease is None else (*self.first.findings, self.crease),
                rock=self.rock,
                tried=self.tried,
            )
        assert away.normal is not None
        move = base_move(self.check.cloud, profile, away.point, away.normal)
        if isinstance(move, str):
            return PlacementVerdict(
                Decision.REFUSE,
                measures=away.measures,
                findings=(*away.findings, Finding(Reason.NO_BASE, math.nan, math.nan, "", move)),
                rock=self.rock,
                tried=self.tried,
            )
        return PlacementVerdict(
            Decision.MOVE_BASE,
            away.point,
            away.normal,
            float(np.linalg.norm(away.point - self.at)),
            away.measures,
            away.findings,
            self.rock,
            self.tried,
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


def safety_map(
    cloud: SurfaceCloud,
    segmentation: Segmentation,
    label: int,
    profile: RoverProfile,
    *,
    limits: SafetyLimits | None = None,
    near: npt.ArrayLike | None = None,
    second: SurfaceCloud | None = None,
) -> list[Judged]:
    """Return one judgement for each cell of `grid_m` of a rock, within `search_m` of `near` (its centroid).

    `near` [3] is in the rover frame, m; `second` as in `plan_placement`.

    Raises
    ------
    PlacementError
        If the segmentation has no such rock.
    """
    limits = limits or SafetyLimits()
    if not 0 <= label < len(segmentation.rocks):
        raise PlacementError(f"rock {label} of {len(segmentation.rocks)} is asked for")
    at = segmentation.rocks[label].centroid if near is None else _three(near, "middle of the map")
    check = _checks(cloud, segmentation, label, at, profile, limits, None, second)
    return [check.judge(point) for point in check.candidates(at)[1:]]


def _refused(finding: Finding) -> PlacementVerdict:
    return PlacementVerdict(Decision.REFUSE, findings=(finding,))


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
