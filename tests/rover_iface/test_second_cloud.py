"""A second cloud beside the hazard cameras': laid on it, labelled by it, judged with it."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from rover_iface.errors import PlacementError
from rover_iface.frames import Transform
from rover_iface.placement import SafetyLimits, SurfaceCloud, cloud_of_points, plan_placement
from rover_iface.placement.cloud import Array
from rover_iface.placement.cloud_alignment import align
from rover_iface.placement.joint_check import JointCheck, crease
from rover_iface.placement.patch_check import PatchCheck
from rover_iface.placement.second_labels import second_labels
from rover_iface.placement.segmentation import GROUND, Segmentation, segment
from rover_iface.placement.verdict import Decision, Reason
from rover_iface.profile import RoverProfile, load_profile
from rover_iface.vision.sift_motion import small_rotation
from tests.rover_iface.domes import EYE, MAST, ROCKS, raster


@lru_cache(maxsize=1)
def hazcam() -> tuple[SurfaceCloud, Segmentation]:
    cloud = cloud_of_points(raster()[0], sigma_m=0.002, eye=EYE)
    return cloud, segment(cloud)


@lru_cache(maxsize=1)
def mast() -> SurfaceCloud:
    return cloud_of_points(raster(mast=True, seed=9)[0], sigma_m=0.002, eye=MAST)


@pytest.fixture(scope="module")
def k9() -> RoverProfile:
    return load_profile("k9")


def on_top() -> Array:
    """The first dome's point half way between the two eyes."""
    x, y, half, height = ROCKS[0]
    way = np.array([-0.45, 0.05, 0.9])
    way /= np.linalg.norm(way / (half, half, height))
    return np.asarray(np.array([x, y, 0.0]) + way)


def checks(
    k9: RoverProfile, first: SurfaceCloud, second: SurfaceCloud, limits: SafetyLimits | None = None
) -> JointCheck:
    _, found = hazcam()
    label = int(found.labels[int(hazcam()[0].tree.query(on_top())[1])])
    labels = second_labels(second, on_top(), first, segment(first), label)
    limits = limits or SafetyLimits()
    own = segment(first).labels
    here = int(own[int(first.tree.query(on_top() + np.array([0.0, 0.05, 0.0]))[1])])
    return JointCheck(
        [
            PatchCheck(first, np.where(own == here, label, GROUND), label, k9, limits),
            PatchCheck(second, labels, label, k9, limits),
        ]
    )


def without(cloud: SurfaceCloud, at: Array, radius_m: float) -> SurfaceCloud:
    return cloud.subset(np.linalg.norm(cloud.points - at, axis=1) > radius_m)


# ---- alignment


def test_a_turned_and_stretched_cloud_is_laid_back_on_the_first() -> None:
    second = mast()
    motion = Transform(small_rotation(np.array([0.004, -0.018, 0.015])), np.zeros(3))
    around = Transform(np.eye(3), MAST) * motion * Transform(np.eye(3), -MAST)
    way = second.points - MAST
    stretched = MAST + way * (1.0 + 0.008 * np.linalg.norm(way, axis=1))[:, None]
    wrong = replace(second, points=stretched).moved(around)
    assert np.linalg.norm(wrong.points - second.points, axis=1).mean() > 0.02
    laid = align(wrong, hazcam()[0])
    assert laid is not None
    assert laid.believed()
    off = np.linalg.norm(laid.cloud.points - second.points, axis=1)
    assert np.median(off) < 0.003
    assert np.quantile(off, 0.99) < 0.006
    assert laid.stretch_per_m == pytest.approx(-0.008, abs=0.004)


def test_clouds_of_different_ground_are_not_believed() -> None:
    elsewhere = mast().moved(Transform(small_rotation(np.array([0.0, 0.25, 0.0])), np.array([0.0, 0.0, 0.1])))
    laid = align(elsewhere, hazcam()[0])
    assert laid is None or not laid.believed()


def test_a_cloud_without_eye_cannot_be_laid() -> None:
    with pytest.raises(PlacementError, match="no eye"):
        align(replace(mast(), eye=None), hazcam()[0])


# ---- labels


def test_the_second_cloud_has_the_same_rock() -> None:
    first, found = hazcam()
    label = int(found.labels[int(first.tree.query(on_top())[1])])
    labels = second_labels(mast(), on_top(), first, found, label)
    truth = raster(mast=True, seed=9)[1].ravel() == 0
    mine = labels == label
    assert (mine & truth).sum() / (mine | truth).sum() > 0.85


def test_without_ground_in_the_frame_the_first_clouds_labels_are_carried_over() -> None:
    first, found = hazcam()
    label = int(found.labels[int(first.tree.query(on_top())[1])])
    near = np.linalg.norm(mast().points - on_top(), axis=1) < 0.07
    part = mast().subset(near)
    labels = second_labels(part, on_top(), first, found, label)
    assert (labels == label).mean() > 0.9


# ---- judging


def test_what_one_cloud_does_not_show_the_other_vouches_for(k9: RoverProfile) -> None:
    first = without(hazcam()[0], on_top(), 0.015)
    alone = plan_placement(first, on_top(), k9, limits=SafetyLimits(search_m=0.02))
    assert alone.decision is Decision.REFUSE
    both = checks(k9, first, mast()).judge(on_top())
    assert both.findings == ()
    assert plan_placement(
        first, on_top(), k9, limits=SafetyLimits(search_m=0.02), second=mast()
    ).decision in (Decision.PLACE, Decision.MOVE_BASE)


def test_a_point_in_a_wide_hole_of_the_first_cloud_is_on_the_rock_that_the_second_shows_there(
    k9: RoverProfile,
) -> None:
    # the full rover takes no place 15 mm off, and refused what lay so far from the hazcams' cloud
    limits = SafetyLimits(search_m=0.015)
    first = without(hazcam()[0], on_top(), 0.03)
    alone = plan_placement(first, on_top(), k9, limits=limits)
    assert alone.reason is Reason.OUTSIDE_CLOUD
    both = plan_placement(first, on_top(), k9, limits=limits, second=mast())
    assert both.decision in (Decision.PLACE, Decision.MOVE_BASE)
    assert both.rock is not None
    assert np.linalg.norm(both.rock.centroid[:2] - ROCKS[0][:2]) < 0.1
    neither = plan_placement(first, on_top(), k9, limits=limits, second=without(mast(), on_top(), 0.03))
    assert neither.reason is Reason.OUTSIDE_CLOUD


def test_a_point_in_a_hole_of_the_first_cloud_where_the_second_shows_ground_is_on_no_rock(
    k9: RoverProfile,
) -> None:
    on_ground = np.array([0.75, 0.3, 0.0])
    first = without(hazcam()[0], on_ground, 0.03)
    verdict = plan_placement(first, on_ground, k9, limits=SafetyLimits(search_m=0.015), second=mast())
    assert verdict.reason is Reason.NO_ROCK


def test_what_stands_up_in_one_cloud_alone_is_against_the_place(k9: RoverProfile) -> None:
    at = on_top()
    near = np.linalg.norm(mast().points - at, axis=1) < 0.012
    raised = replace(mast(), points=mast().points + np.where(near, 0.03, 0.0)[:, None] * (0.0, 0.0, 1.0))
    assert checks(k9, hazcam()[0], mast()).judge(at).findings == ()
    reasons = {finding.reason for finding in checks(k9, hazcam()[0], raised).judge(at).findings}
    assert reasons & {Reason.PROTRUSION, Reason.ROUGHNESS}


def test_a_way_hidden_from_one_eye_may_be_seen_free_by_the_other(k9: RoverProfile) -> None:
    joint = checks(k9, hazcam()[0], mast())
    at, normal = on_top(), np.array([-0.3, 0.0, 0.95])
    normal /= np.linalg.norm(normal)
    # to the hazard cameras something stands 6 cm before the tool's path
    ray = at + 0.1 * normal - EYE
    away = hazcam()[0].points - EYE
    far = np.linalg.norm(away, axis=1)
    beside = np.degrees(np.arccos(np.clip(away @ ray / (far * np.linalg.norm(ray)), -1.0, 1.0))) < 2.0
    nearer = np.where(beside, (np.linalg.norm(ray) - 0.06) / far, 1.0)
    hiding = replace(hazcam()[0], points=EYE + nearer[:, None] * away)
    alone = PatchCheck(hiding, np.zeros(len(hiding), np.int64), 0, k9, SafetyLimits())
    assert JointCheck([alone]).hidden_share(at, normal) > 0.04
    assert JointCheck([alone, joint.checks[1]]).hidden_share(at, normal) < 0.04


def test_a_close_look_leaves_out_what_lies_beside_a_step(k9: RoverProfile) -> None:
    joint = checks(k9, hazcam()[0], mast())
    calm = joint.judge(on_top())
    assert calm.close_strain < 1.0
    beyond = on_top() + np.array([0.0, 0.145, -0.09])
    assert joint.judge(beyond).close_strain == math.inf


def test_a_crease_lies_between_two_rocks_and_not_on_one() -> None:
    cloud, found = hazcam()
    own = found.labels != GROUND
    x, y, _, height = ROCKS[0]
    across = [np.array([x - 0.1, y + side * 0.05, 0.7 * height]) for side in (-1.0, 1.0)]
    on_one = crease(cloud, own, *across)
    assert on_one is not None
    assert on_one < 0.01
    other = np.array([ROCKS[2][0] - 0.05, ROCKS[2][1], 0.9 * ROCKS[2][3]])
    between = crease(cloud, own, across[1], other)
    assert between is not None
    assert between > 0.05


def test_a_point_in_the_crease_is_told_by_what_lies_beyond_it() -> None:
    # two low roofs side by side, seen from above; the point lies in the valley between them
    y, x = np.meshgrid(np.linspace(-0.02, 0.02, 21), np.linspace(-0.1, 0.1, 101))
    points = np.column_stack((x.ravel(), y.ravel(), 0.4 * np.abs(x.ravel())))
    cloud = cloud_of_points(points, eye=(0.0, 0.0, 2.0))
    valley, top = np.zeros(3), np.array([0.1, 0.0, 0.04])
    one = crease(cloud, points[:, 0] >= 0.0, valley, top)
    both = crease(cloud, np.ones(len(points), bool), valley, top)
    assert one is not None
    assert both is not None
    assert one < 0.005
    assert both > 0.02
