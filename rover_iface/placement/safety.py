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
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from rover_iface.errors import PlacementError
from rover_iface.placement.arm import Arm
from rover_iface.placement.cloud import Array, SurfaceCloud
from rover_iface.placement.joint_check import JointCheck
from rover_iface.placement.narrow_looks import NarrowLook, NarrowLooks
from rover_iface.placement.patch_check import Judged, PatchCheck
from rover_iface.placement.safety_limits import SafetyLimits
from rover_iface.placement.search import ArmCheck, Search
from rover_iface.placement.second_labels import SECOND_EDGE_PX, first_label, second_labels
from rover_iface.placement.segmentation import (
    GROUND,
    Segmentation,
    SegmentationOptions,
    segment,
)
from rover_iface.placement.verdict import Decision, Finding, PlacementVerdict, Reason
from rover_iface.profile import RoverProfile


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
    narrow: NarrowLook | None = None,
    views_left: int = 0,
    seen_from: Sequence[npt.ArrayLike] = (),
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
    narrow
        Asked for what the mast's narrow pair sees of a place before the tool is put there, registered to
        `cloud`; None on a rover without one.
    views_left
        How many moves of the base to see the designated point from another side the rover may still make.
        The verdict is such a move where that point is not known well enough to be taken, and nothing that is
        known speaks against it; or where no place is found among some that are not known well enough.
    seen_from
        Places (3,), m, rover frame, of the mast's eye (`base_adjustment.mast_eye`) at stands from which the
        point was seen before: from there nothing new is to be seen.

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
    second = second if second is not None and len(second) else None
    away = min(float(one.tree.query(at)[0]) for one in (cloud, second) if one is not None)
    if away > limits.search_m:
        return _refused(Finding(Reason.OUTSIDE_CLOUD, away, limits.search_m, "m"))
    if found.ground is None and rock_only:
        return _refused(Finding(Reason.NO_GROUND, 0.0, SegmentationOptions().ground.least_share))
    label, miss = _label_at(cloud, found, at, limits, rock_only, second)
    if miss is not None:
        return _refused(miss)
    check = _checks(cloud, found, label, at, profile, limits, axis, second)
    rock = found.rocks[label] if label != GROUND else None
    ask = arm if arm is not None else Arm(profile.arm).solve
    looks = NarrowLooks(check, narrow, profile)
    eyes = [_three(eye, "place from which the point was seen") for eye in seen_from]
    return _search(Search(check, at, ask, rock, looks), profile, views_left, eyes)


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
    search: Search, profile: RoverProfile, views_left: int, seen_from: Sequence[Array]
) -> PlacementVerdict:
    """Judge the designated point, then others of the same rock, the nearest first.

    The designated point is taken if it is safe with some room, or a place that is as near to it as it is
    known. Where it is not known to be bad, it is looked at from another side while there are `views_left`.
    Else the nearest calm point that the arm reaches; without one, the nearest where it would tilt the tool;
    without one, the safe one of least strain. Where none is safe, the search is done again in finer steps,
    and then the one is taken that bears a close look best. Where there is a narrow pair it looks at each
    place before it is taken, and of places beside the designated point only those are taken that it knows.
    """
    meant = search.designated() or search.as_near_as_known()
    if meant is not None:
        return meant
    if views_left and search.hopeful and (view := search.from_another_side(profile, seen_from)) is not None:
        return view
    for coarse in (2.5, 1.0):
        verdict = search.sweep(coarse)
        if verdict is not None:
            return verdict
        if search.asked:
            break
    close = sorted(search.close, key=lambda one: one.close_strain)
    found = search.first_reached(close) or search.by_looks()
    if found is None and views_left > 0 and search.unsure and search.out_of_reach is None:
        found = search.from_another_side(profile, seen_from)
    return found or search.not_placed(profile)


def _label_at(
    cloud: SurfaceCloud,
    found: Segmentation,
    at: Array,
    limits: SafetyLimits,
    rock_only: bool,
    second: SurfaceCloud | None,
) -> tuple[int, Finding | None]:
    """Return the label of the rock that the designated point is on, or why there is none.

    In a hole of the first cloud the second tells.
    """
    from scipy.spatial import cKDTree

    away, nearest = cloud.tree.query(at)
    if away > limits.search_m and second is not None:
        label = first_label(second, at, cloud, found)
    else:
        label = int(found.labels[int(nearest)])
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
