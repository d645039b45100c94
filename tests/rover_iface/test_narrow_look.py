"""The mast's narrow pair on a place before the tool is put there."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache, partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rover_iface.behaviour.close_look import NARROW, SCALE, aim, carried
from rover_iface.cameras.rig import CameraRig, load_cameras
from rover_iface.errors import CameraError
from rover_iface.placement import Decision, PlacementVerdict, Reason, SurfaceCloud, plan_placement, segment
from rover_iface.placement.arm import Posture
from rover_iface.placement.cloud import Array, cloud_of_points
from rover_iface.placement.fused_check import FusedOptions, FusedSurface, fuse
from rover_iface.placement.joint_check import JointCheck
from rover_iface.placement.narrow_looks import MOST_LOOKS, NarrowLook, NarrowLooks, Opinion, Sight
from rover_iface.placement.patch_check import Judged, PatchCheck
from rover_iface.placement.safety_limits import SafetyLimits
from rover_iface.placement.search import SPOT_KNOWN_M, Search
from rover_iface.placement.segmentation import Segmentation
from rover_iface.placement.verdict import Finding
from rover_iface.profile import RoverProfile, load_profile
from tests.rover_iface.domes import EYE, MAST, ROCKS, raster

PITCH_M = 0.002
AT = np.array([1.0, 0.0, 0.2])


@pytest.fixture(scope="module")
def k9() -> RoverProfile:
    return load_profile("k9")


def sheet(pitch_m: float, height: Array | float = 0.0, *, half_m: float = 0.1, seed: int = 0) -> Array:
    """A flat sheet of points (n, n, 3) round `AT`, seen from above, with half a millimetre of noise."""
    line = np.arange(-half_m, half_m, pitch_m)
    x, y = np.meshgrid(line, line)
    noise = np.random.default_rng(seed).normal(0.0, 0.0005, x.shape)
    return np.asarray(AT + np.stack((x, y, height + noise), axis=-1))


def check(points: Array, k9: RoverProfile, sigma_m: float = 0.001) -> PatchCheck:
    cloud = cloud_of_points(points, sigma_m=sigma_m, eye=AT + np.array([0.0, 0.0, 1.3]))
    return PatchCheck(cloud, np.zeros(len(cloud), np.int64), 0, k9, SafetyLimits(edge_px=2))


def surface(narrow: Array, wide: Array, k9: RoverProfile) -> FusedSurface:
    found = fuse([check(narrow, k9), check(wide, k9, 0.003)], AT, FusedOptions())
    assert found is not None
    return found


def round_(points: Array, x: float, y: float, radius_m: float) -> Array:
    return np.asarray(np.hypot(points[..., 0] - AT[0] - x, points[..., 1] - AT[1] - y) < radius_m)


# ---- the fused surface


def test_a_spike_between_the_points_of_the_wide_pair_is_seen(k9: RoverProfile) -> None:
    narrow, wide = sheet(PITCH_M), sheet(0.005)
    narrow[..., 2] += np.where(round_(narrow, 0.012, 0.004, 0.0035), 0.022, 0.0)
    # a height that 2 in 100 are above does not tell of it
    assert round_(narrow, 0.012, 0.004, 0.0035).sum() < 0.02 * round_(narrow, 0.0, 0.0, 0.034).sum()
    assert surface(narrow, wide, k9).protrusion_m > 0.018
    assert surface(sheet(PITCH_M), wide, k9).protrusion_m < 0.003


def test_a_lone_wrong_match_is_no_spike(k9: RoverProfile) -> None:
    narrow = sheet(PITCH_M)
    middle = len(narrow) // 2
    narrow[middle + 3, middle, 2] += 0.03
    assert surface(narrow, sheet(0.005), k9).protrusion_m < 0.003


def test_the_plane_is_that_of_all_the_tool_stands_on(k9: RoverProfile) -> None:
    # a third of the surface is a step of 16 mm: a plane that leaves it out leans less than the tool would
    narrow = sheet(PITCH_M)
    narrow[..., 2] += np.where(narrow[..., 0] > AT[0] + 0.01, 0.016, 0.0)
    found = surface(narrow, sheet(0.005), k9)
    lean = np.degrees(np.arccos(found.normal[2]))
    inner = narrow[round_(narrow, 0.0, 0.0, k9.arm.tool_radius_m)]
    design = np.column_stack((inner[:, :2], np.ones(len(inner))))
    slope = np.linalg.lstsq(design, inner[:, 2], rcond=None)[0]
    assert lean == pytest.approx(np.degrees(np.arctan(np.hypot(*slope[:2]))), abs=1.5)
    assert lean > 10.0


def test_the_wide_pair_stands_in_where_the_narrow_one_has_a_hole(k9: RoverProfile) -> None:
    narrow, wide = sheet(PITCH_M), sheet(0.004)
    narrow[round_(narrow, 0.01, 0.0, 0.012)] = np.nan
    assert surface(narrow, wide, k9).hole_m < FusedOptions().most_hole_m
    wide[round_(wide, 0.01, 0.0, 0.012)] = np.nan
    assert surface(narrow, wide, k9).hole_m > 0.02


def test_a_small_hole_in_a_flat_surface_is_bridged_and_one_at_a_drop_is_not(k9: RoverProfile) -> None:
    gap = 0.009
    flat, wide = sheet(PITCH_M), sheet(0.004)
    for points in (flat, wide):
        points[round_(points, 0.0, 0.0, gap)] = np.nan
    assert surface(flat, wide, k9).hole_m < 0.01
    drop = flat.copy()
    drop[..., 2] -= np.where(drop[..., 1] > AT[1] + 0.004, 0.02, 0.0)
    assert surface(drop, drop, k9).hole_m > 0.016


def test_a_hole_at_the_rim_that_ends_in_a_drop_counts(k9: RoverProfile) -> None:
    narrow, wide = sheet(PITCH_M), sheet(0.004)
    for points in (narrow, wide):
        points[..., 2] -= np.where(points[..., 1] > AT[1] + 0.036, 0.05, 0.0)
        points[(points[..., 1] > AT[1] + 0.024) & (points[..., 1] < AT[1] + 0.042)] = np.nan
    assert surface(narrow, wide, k9).hole_m > FusedOptions().most_hole_m


def test_a_narrow_look_asks_for_as_much_of_the_rock_as_the_other_clouds() -> None:
    assert FusedOptions().least_rock_share >= SafetyLimits().least_rock_share


def test_few_points_tell_nothing(k9: RoverProfile) -> None:
    some = sheet(0.03)
    assert fuse([check(some, k9), check(some, k9)], AT, FusedOptions()) is None


# ---- in the search


@lru_cache(maxsize=1)
def hazcam() -> tuple[SurfaceCloud, Segmentation]:
    cloud = cloud_of_points(raster()[0], sigma_m=0.002, eye=EYE)
    return cloud, segment(cloud)


def on_top() -> Array:
    """The first dome's point half way between the two eyes."""
    x, y, half, height = ROCKS[0]
    way = np.array([-0.45, 0.05, 0.9])
    way /= np.linalg.norm(way / (half, half, height))
    return np.asarray(np.array([x, y, 0.0]) + way)


def narrow_sheet(
    at: Array, rise_m: float = 0.0, width_m: float = 0.004, beside_m: float = 0.012
) -> SurfaceCloud:
    """What a narrow pair ranges of the first dome within 6 cm of a point; something stands up beside it."""
    x, y, half, height = ROCKS[0]
    line = np.arange(-0.06, 0.06, PITCH_M)
    away = np.stack(np.meshgrid(line, line), axis=-1)
    ray = at - MAST
    ray /= np.linalg.norm(ray)
    side = np.cross(ray, (0.0, 0.0, 1.0))
    side /= np.linalg.norm(side)
    aim_at = at + away[..., :1] * side + away[..., 1:] * np.cross(ray, side)
    scale = np.array([half, half, height])
    start, way = (MAST - (x, y, 0.0)) / scale, (aim_at - MAST) / scale
    a, b = (way**2).sum(axis=-1), (way * start).sum(axis=-1)
    with np.errstate(invalid="ignore"):
        far = (-b - np.sqrt(b * b - a * ((start**2).sum() - 1.0))) / a
    points = MAST + far[..., None] * (aim_at - MAST)
    near = np.linalg.norm(points - at - beside_m * side, axis=-1) < width_m
    points = points - np.where(near, rise_m, 0.0)[..., None] * ray
    cloud = cloud_of_points(points, sigma_m=0.001, eye=MAST)
    return cloud.subset(cloud.points[:, 2] > 0.0)


def placed(
    k9: RoverProfile, look: NarrowLook | None, cloud: SurfaceCloud | None = None, search_m: float = 0.06
) -> PlacementVerdict:
    first, found = hazcam()
    if cloud is not None:
        first, found = cloud, segment(cloud)
    limits = SafetyLimits(search_m=search_m)
    return plan_placement(first, on_top(), k9, limits=limits, segmentation=found, narrow=look)


def test_the_narrow_pair_looks_once_at_a_point_that_is_good(k9: RoverProfile) -> None:
    asked: list[Array] = []

    def look(at: Array) -> SurfaceCloud:
        asked.append(at)
        return narrow_sheet(at)

    verdict = placed(k9, look)
    assert verdict.decision is Decision.PLACE
    assert len(asked) == 1
    assert verdict.point is not None
    assert np.linalg.norm(verdict.point - on_top()) < 0.006


def test_what_only_the_narrow_pair_sees_refuses_the_place(k9: RoverProfile) -> None:
    assert placed(k9, None).decision is Decision.PLACE
    spiked = narrow_sheet(on_top(), rise_m=0.03)
    verdict = placed(k9, lambda _: spiked)
    assert verdict.decision is not Decision.PLACE
    assert verdict.findings[-1].reason is Reason.PROTRUSION
    assert placed(k9, lambda _: spiked, search_m=0.005).decision is Decision.REFUSE
    if verdict.point is not None:
        assert np.linalg.norm(verdict.point - on_top()) > 0.01


def test_what_the_hazcams_do_not_show_the_narrow_pair_may(k9: RoverProfile) -> None:
    first = hazcam()[0]
    holed = first.subset(np.linalg.norm(first.points - on_top(), axis=1) > 0.015)
    assert placed(k9, None, holed, search_m=0.02).decision is Decision.REFUSE
    assert placed(k9, narrow_sheet, holed, search_m=0.02).decision is Decision.PLACE


def test_a_slope_that_is_all_uncertainty_does_not_keep_the_narrow_pair_away(k9: RoverProfile) -> None:
    # 46012: the other clouds knew the normal to 20 degrees, and said so as a slope
    first, found = hazcam()
    coarse = replace(first, covariances=1600.0 * first.covariances)
    limits = SafetyLimits(search_m=0.01)

    def tried(narrow: NarrowLook | None) -> PlacementVerdict:
        return plan_placement(coarse, on_top(), k9, limits=limits, segmentation=found, narrow=narrow)

    assert Reason.SLOPE in [finding.reason for finding in tried(None).findings]
    assert tried(narrow_sheet).decision is Decision.PLACE


def test_a_look_that_brings_nothing_leaves_the_other_clouds_to_judge(k9: RoverProfile) -> None:
    with_none, without = placed(k9, lambda _: None), placed(k9, None)
    assert with_none.decision is without.decision is Decision.PLACE
    assert with_none.point is not None
    assert without.point is not None
    assert np.array_equal(with_none.point, without.point)


def test_a_place_beside_is_left_where_the_narrow_pair_does_not_know_it(k9: RoverProfile) -> None:
    # of 156 fresh accepts 2 were unsafe where a hazcam alone knew a place beside the designated point
    spiked = narrow_sheet(on_top(), rise_m=0.03)
    spiked = spiked.subset(np.linalg.norm(spiked.points - on_top(), axis=1) < 0.045)

    def look(at: Array, *, hole_m: float) -> SurfaceCloud:
        if np.linalg.norm(at - on_top()) < 0.001:
            return spiked
        cloud = narrow_sheet(at)
        return cloud.subset(np.linalg.norm(cloud.points - at, axis=1) > hole_m)

    assert placed(k9, partial(look, hole_m=0.0)).decision in (Decision.PLACE_NEAR, Decision.MOVE_BASE)
    assert placed(k9, partial(look, hole_m=0.05)).decision is Decision.REFUSE


def test_a_narrow_pair_that_brings_nothing_leaves_no_place_beside_to_the_other_clouds(
    k9: RoverProfile,
) -> None:
    first = hazcam()[0]
    holed = first.subset(np.linalg.norm(first.points - on_top(), axis=1) > 0.015)
    assert placed(k9, None, holed).accepted
    assert placed(k9, lambda _: None, holed).decision is Decision.REFUSE


def test_a_slope_near_its_limit_is_judged_by_how_well_the_narrow_pair_knows_the_normal(
    k9: RoverProfile,
) -> None:
    tilt = np.radians(11.7)

    def reached(_: Array, __: Array) -> Posture:
        return Posture(np.zeros(5), float(tilt))

    def look(at: Array, *, ridges_m: float) -> SurfaceCloud:
        cloud = narrow_sheet(at)
        toward = (MAST - at) / np.linalg.norm(MAST - at)
        high = ridges_m * np.sin(2.0 * np.pi * (cloud.points - at)[:, 1] / 0.05)
        return replace(cloud, points=cloud.points + high[:, None] * toward)

    first, found = hazcam()

    def tried(ridges_m: float) -> PlacementVerdict:
        return plan_placement(
            first,
            on_top(),
            k9,
            limits=SafetyLimits(search_m=0.005),
            segmentation=found,
            arm=reached,
            narrow=partial(look, ridges_m=ridges_m),
        )

    smooth, wavy = tried(0.0), tried(0.007)
    assert smooth.decision is Decision.PLACE
    assert smooth.measures is not None
    assert np.degrees(smooth.measures.normal_sigma_rad) < 1.5
    assert not wavy.accepted
    assert Reason.SLOPE in [finding.reason for finding in wavy.findings]


@pytest.mark.parametrize(
    ("sigma_deg", "tilt_deg", "designated", "beside"),
    [(1.0, 16.5, True, True), (1.0, 17.5, True, False), (3.9, 1.0, True, True), (4.1, 1.0, True, False)],
)
def test_a_place_beside_asks_for_more_certainty_of_its_slope_than_the_designated_point(
    sigma_deg: float, tilt_deg: float, designated: bool, beside: bool
) -> None:
    limits = SafetyLimits(most_slope_rad=math.radians(20.0))
    posture: Any = SimpleNamespace(tool_tilt_rad=math.radians(tilt_deg))
    check: Any = SimpleNamespace(limits=limits, crease_m=lambda *_places: 0.0)
    measures: Any = SimpleNamespace(normal_sigma_rad=math.radians(sigma_deg))
    judged = Judged(np.zeros(3), np.array([0.0, 0.0, 1.0]), measures, (), 0.0)
    nothing: Any = None
    search = Search(check, np.zeros(3), lambda *_asked: posture, nothing, nothing)
    assert (search.reached(judged) is not None) == designated
    assert (search.reached(judged, limits.beside_sigmas) is not None) == beside


def test_a_drop_just_beside_the_tool_is_told(k9: RoverProfile) -> None:
    # 16040: the tool's rim hung over a step that began 5 mm farther out than the clouds had it
    narrow, wide = sheet(PITCH_M), sheet(0.004)
    for points in (narrow, wide):
        notch = (points[..., 1] > AT[1] + 0.0345) & (np.abs(points[..., 0] - AT[0]) < 0.005)
        points[..., 2] -= np.where(notch, 0.032, 0.0)
    found = surface(narrow, wide, k9)
    assert found.depth_m < FusedOptions().most_depth_m
    assert found.rim_depth_m > FusedOptions().most_rim_depth_m
    assert found.wide_depth_m >= found.rim_depth_m


def test_what_falls_away_farther_out_counts_at_the_rim_alone(k9: RoverProfile) -> None:
    # 48178: 29 mm deep 8 mm beside the tool, and told so of what lies under it
    narrow, wide = sheet(PITCH_M), sheet(0.004)
    for points in (narrow, wide):
        points[..., 2] -= np.where(round_(points, 0.0, 0.0, 0.0355), 0.0, 0.05)
    found = surface(narrow, wide, k9)
    assert found.depth_m < 0.005
    assert found.rim_depth_m > 0.045


def opinion(k9: RoverProfile, hole_m: float) -> Opinion:
    """What a look says of a sheet with a hole so wide beside the tool."""
    narrow, wide = sheet(PITCH_M), sheet(0.004)
    for points in (narrow, wide):
        points[round_(points, 0.045, 0.0, 0.5 * hole_m)] = np.nan
    looks = NarrowLooks(JointCheck([check(wide, k9, 0.003)]), lambda _: check(narrow, k9).cloud, k9)
    return looks.opinion(AT, anew=True)


def test_the_designated_point_bears_a_wider_hole_beside_the_tool_than_a_place_beside_it(
    k9: RoverProfile,
) -> None:
    # 48232: a hole of 23 mm; the tool was put 3 mm beside the point, and touched 5.7 mm off
    near, wide = opinion(k9, 0.025), opinion(k9, 0.036)
    assert near.sight is Sight.GOOD
    assert near.judged is not None
    assert near.judged.strain > 1.0
    assert wide.sight is Sight.UNKNOWN


def test_a_surface_that_ends_unseen_beside_the_tool_is_told(k9: RoverProfile) -> None:
    # 44032: both pairs drew the rock a centimetre over the edge behind which neither saw anything
    narrow, wide = sheet(PITCH_M), sheet(0.004)
    for points in (narrow, wide):
        points[points[..., 1] > AT[1] + 0.0375] = np.nan
    found = surface(narrow, wide, k9)
    assert found.hole_m < FusedOptions().most_hole_m
    assert found.ending_m > FusedOptions().most_hole_m
    assert surface(sheet(PITCH_M), sheet(0.004), k9).ending_m < 0.01


def test_a_spike_at_the_rim_is_left_behind_by_no_more_than_the_point_itself_is_known(
    k9: RoverProfile,
) -> None:
    # 48235: the point was left for a place 26 mm beside it, for a protrusion 4 mm beside the tool
    spiked = narrow_sheet(on_top(), 0.026, 0.006, k9.arm.tool_radius_m + 0.006)
    verdict = placed(k9, lambda _: spiked)
    assert verdict.decision is Decision.PLACE_NEAR
    assert verdict.findings[-1].reason is Reason.PROTRUSION
    assert 0.0 < verdict.distance_m < max(SPOT_KNOWN_M) + 0.002
    inside = narrow_sheet(on_top(), 0.026, 0.006, k9.arm.tool_radius_m - 0.010)
    assert placed(k9, lambda _: inside).distance_m > max(SPOT_KNOWN_M) + 0.002


def test_a_calm_place_is_taken_before_a_nearer_one_that_the_narrow_pair_shows_less_calm(
    k9: RoverProfile,
) -> None:
    spiked = narrow_sheet(on_top(), rise_m=0.03)
    verdict = placed(k9, lambda at: spiked if np.linalg.norm(at - on_top()) < 0.001 else narrow_sheet(at))
    assert verdict.measures is not None
    assert verdict.measures.protrusion_m < SafetyLimits().calm * FusedOptions().most_protrusion_m


def test_looks_are_few_and_a_place_that_is_not_calm_is_not_taken_unseen(k9: RoverProfile) -> None:
    first, found = hazcam()
    ridges = 0.009 * np.sin(2.0 * np.pi * first.points[:, 1] / 0.03)
    rough = replace(first, points=first.points + ridges[:, None] * np.array([-0.5, 0.0, 0.8]))
    limits = SafetyLimits(most_rms_m=0.012, edge_px=0, search_m=0.15)
    asked: list[Array] = []

    def look(at: Array) -> SurfaceCloud:
        asked.append(at)
        return narrow_sheet(at, rise_m=0.03, width_m=0.008)

    def tried(narrow: NarrowLook | None) -> PlacementVerdict:
        return plan_placement(rough, on_top(), k9, limits=limits, segmentation=found, narrow=narrow)

    assert tried(None).accepted
    refused = tried(look)
    assert 1 < len(asked) <= MOST_LOOKS
    if refused.point is not None:
        assert min(float(np.linalg.norm(refused.point - at)) for at in asked) < 0.03


def test_all_places_that_a_look_tells_of_are_asked_for(k9: RoverProfile) -> None:
    # 44231: of the places round a look only those of the coarse grid were, and none of them was good
    at, coarse, fine = np.zeros(3), np.array([0.05, 0.0, 0.0]), np.array([0.058, 0.0, 0.0])
    up = np.array([0.0, 0.0, 1.0])
    hole = Finding(Reason.STEREO_HOLE, 0.03, 0.012, "m")
    measures: Any = SimpleNamespace(normal_sigma_rad=0.01)
    good = Judged(fine, up, measures, (), 0.5)
    asked: list[Array] = []

    def opinion(point: Array, *, anew: bool = False) -> Any:
        if anew:
            asked.append(point)
        seen = any(np.linalg.norm(point - one) < 0.02 for one in asked)
        return SimpleNamespace(judged=good if seen and point is fine else None, sight=Sight.UNKNOWN)

    check: Any = SimpleNamespace(
        limits=SafetyLimits(),
        crease_m=lambda *_places: 0.0,
        candidates=lambda _at, coarse: [at, fine] if coarse == 1.0 else [at],
        judge=lambda point, brief=False: Judged(point, None, None, (hole,)),
    )
    looks: Any = SimpleNamespace(left=6, opinion=opinion, told=lambda _point: False, blind=False)
    posture: Any = SimpleNamespace(tool_tilt_rad=0.0)
    search = Search(check, at, lambda *_asked: posture, None, looks)
    search.judge(at)
    search.unsure = [search.judge(coarse)]
    verdict = search.by_looks()
    assert verdict is not None
    assert verdict.point is fine


# ---- pointing


def test_both_narrow_cameras_hold_the_place_with_the_tool_round_it() -> None:
    rig = CameraRig(load_cameras("k9"), (0.15, 0.0, 1.45))
    at = np.array([1.0, 0.1, 0.15])
    pan, tilt, windows = aim(rig, at)
    ring = at + 0.037 * np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
    for name, window in zip(NARROW, windows, strict=True):
        camera = rig.camera(name, pan, tilt).scaled(SCALE).window(*window)
        assert camera.sees(ring).all()
    # one of them alone in the middle leaves the other without it
    other = rig.camera(NARROW[1], *rig.point_at(at, NARROW[0])).scaled(SCALE)
    assert not bool(other.sees(at))


def test_a_rover_with_one_narrow_camera_has_no_narrow_pair() -> None:
    cameras = dict(load_cameras("k9"))
    assert carried(CameraRig(cameras, (0.15, 0.0, 1.45)))
    del cameras[NARROW[1]]
    assert not carried(CameraRig(cameras, (0.15, 0.0, 1.45)))


def test_a_place_too_near_for_both_cameras_is_not_looked_at() -> None:
    rig = CameraRig(load_cameras("k9"), (0.15, 0.0, 1.45))
    with pytest.raises(CameraError, match="does not hold"):
        aim(rig, np.array([0.45, 0.0, 1.0]))
