"""Stereo against the truth of rendered pairs and against exact geometry."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_iface.cameras import kernels
from rover_iface.cameras.linear import FAR_M, warp, warp_coordinates
from rover_iface.cameras.model import CameraModel, pinhole
from rover_iface.cameras.rig import load_cameras
from rover_iface.cameras.stereo import PointStereo, dense_stereo, point_stereo, triangulate
from rover_iface.errors import CameraError
from rover_iface.frames import Pose
from rover_iface.simulator.render.picture import Frame
from tests.rover_iface.render.scenes import SUN, picture, rig, rock_renderer


@given(
    preset=st.sampled_from(["mer", "k9"]),
    pair=st.sampled_from(["navcam", "pancam", "hazcam"]),
    u=st.floats(0.3, 0.7),
    v=st.floats(0.3, 0.7),
    distance=st.floats(0.8, 15.0),
)
@settings(max_examples=80, deadline=None)
def test_triangulation_undoes_projection(preset: str, pair: str, u: float, v: float, distance: float) -> None:
    cameras = load_cameras(preset)
    left, right = cameras[f"{pair}_left"].model, cameras[f"{pair}_right"].model
    origin, ray = left.back_project((u * left.width, v * left.height))
    point = origin + distance * ray
    points, covariance = triangulate(left, right, left.project(point)[None], right.project(point)[None])
    assert np.allclose(points[0], point, atol=1e-6 * distance)
    assert (np.linalg.eigvalsh(covariance[0]) > 0).all()


def test_range_error_grows_as_the_square_of_the_range() -> None:
    cameras = load_cameras("marsyard")
    left, right = cameras["navcam_left"].model, cameras["navcam_right"].model
    rng = np.random.default_rng(1)
    for distance in (2.0, 10.0):
        point = left.C + distance * left.A
        a = np.tile(left.project(point), (3000, 1))
        b = right.project(point) + np.column_stack((rng.normal(0, 1 / 3, 3000), np.zeros(3000)))
        spread = 3 * float(np.std(triangulate(left, right, a, b)[0] @ left.A))
        assert spread == pytest.approx(distance**2 / (left.hs * 0.2), rel=0.06)  # Kim et al. 2009, eq. 1


def test_covariance_of_a_triangulated_point_is_that_of_drawn_errors() -> None:
    cameras = load_cameras("mer")
    left, right = cameras["navcam_left"].model, cameras["navcam_right"].model
    origin, ray = left.back_project((600.0, 400.0))
    point = origin + 5.0 * ray
    rng = np.random.default_rng(2)
    a = left.project(point) + rng.normal(0, 0.5, (4000, 2))
    b = right.project(point) + rng.normal(0, 0.5, (4000, 2))
    points, covariances = triangulate(left, right, a, b, sigma_px=0.5)
    drawn = np.cov(points.T)
    told = triangulate(left, right, left.project(point)[None], right.project(point)[None], sigma_px=0.5)[1][0]
    assert np.trace(drawn) == pytest.approx(np.trace(told), rel=0.1)
    assert np.isfinite(covariances).all()


@pytest.mark.parametrize("distance", [9.0, 5.0, 2.6])
def test_a_point_on_a_rendered_rock_is_ranged(distance: float) -> None:
    pose = Pose(-distance, 0.0, 0.0)
    left = picture(pose, half=90)
    right = picture(pose, "navcam_right", half=90, exposure=left.exposure, seed=2)
    pixel = np.array([90.0, 90.0])
    truth = left.truth.point_site[90, 90]
    match = point_stereo(left.unit, right.unit, left.camera, right.camera, pixel)
    assert match is not None
    assert match.score > 0.9
    assert np.abs(match.right_px - right.camera.project(truth)).max() < 0.35
    off = match.point - truth
    assert off @ np.linalg.solve(match.covariance, off) < 16.0
    if distance < 6:
        normal = left.truth.normal_site[80:101, 80:101].reshape(-1, 3).mean(axis=0)
        assert match.normal @ normal / np.linalg.norm(normal) > np.cos(np.radians(20.0))


def test_an_expected_range_narrows_the_search() -> None:
    pose = Pose(-5.0, 0.0, 0.0)
    left = picture(pose, half=90)
    right = picture(pose, "navcam_right", half=90, exposure=left.exposure, seed=2)
    true_range = float(left.truth.range_m[90, 90])
    near = point_stereo(
        left.unit,
        right.unit,
        left.camera,
        right.camera,
        (90, 90),
        expected_range_m=true_range,
        range_spread=0.2,
    )
    assert near is not None
    assert np.linalg.norm(near.point - left.camera.C) == pytest.approx(true_range, rel=0.03)
    far_only = PointStereo(nearest_m=30.0)
    nothing = point_stereo(left.unit, right.unit, left.camera, right.camera, (90, 90), options=far_only)
    assert nothing is None or nothing.score < 0.7


@pytest.mark.parametrize("range_m", [2.0, FAR_M])
def test_linear_cameras_are_warped_as_any_others_are(range_m: float) -> None:
    """The reference goes through the models pixel by pixel."""
    rng = np.random.default_rng(5)
    image = rng.random((90, 120)).astype(np.float32)
    ahead, aside = np.array([1.0, 0.1, -0.2]), np.array([0.1, -0.3, 0.05])
    source = pinhole(focal_px=150.0, width=120, height=90, center=np.zeros(3), forward=ahead)
    for mirrored in (False, True):
        to = pinhole(focal_px=170.0, width=110, height=80, center=aside, forward=ahead + aside)
        if mirrored:
            to = replace(to, H=2.0 * to.hc * to.A - to.H)
        at = warp_coordinates(to, source, range_m=range_m)
        expected = np.empty((80, 110), np.float32)
        kernels.sample_bilinear(image, at, np.float32(-1.0), expected)
        assert 0.2 < (expected >= 0.0).mean() < 1.0
        assert np.abs(warp(image, source, to, range_m=range_m, fill=-1.0) - expected).max() < 1e-5


def test_a_range_whose_error_is_not_asked_for_is_the_same_range() -> None:
    pose = Pose(-5.0, 0.0, 0.0)
    left = picture(pose, half=90)
    right = picture(pose, "navcam_right", half=90, exposure=left.exposure, seed=2)
    images = left.unit, right.unit, left.camera, right.camera
    told = point_stereo(*images, (90, 90))
    plain = point_stereo(*images, (90, 90), options=PointStereo(told=False))
    assert told is not None
    assert plain is not None
    assert (told.point == plain.point).all()
    assert told.score == plain.score
    assert np.isfinite(told.surface_covariance).all()
    assert not np.isfinite(plain.surface_covariance).any()


def test_without_a_partner_there_is_no_point() -> None:
    pose = Pose(-5.0, 0.0, 0.0)
    left = picture(pose, half=60)
    right = picture(pose, "navcam_right", half=60, exposure=left.exposure, seed=2)
    noise = np.random.default_rng(3).random(right.unit.shape).astype(np.float32)
    match = point_stereo(left.unit, noise, left.camera, right.camera, (60, 60))
    assert match is None or match.score < 0.7
    assert point_stereo(left.unit, right.unit, left.camera, right.camera, (3, 3)) is None
    with pytest.raises(CameraError, match="odd"):
        PointStereo(template_px=20)


@pytest.mark.parametrize(("preset", "pair", "nearest"), [("k9", "navcam", 2.0), ("mer", "hazcam", 0.3)])
def test_a_dense_cloud_lies_on_the_ground_and_the_rock(preset: str, pair: str, nearest: float) -> None:
    cameras = rig(preset)
    pose = Pose(-4.0 if pair == "navcam" else -2.2, 0.0, 0.0)
    frames: list[Frame] = []
    models: list[CameraModel] = []
    for side in ("left", "right"):
        camera = cameras.camera(f"{pair}_{side}", 0.0, -0.35)
        camera = camera.window(0, 0, camera.width, camera.height)
        frames.append(
            rock_renderer().render(
                camera,
                pose,
                SUN,
                sensor=cameras.mounted(f"{pair}_{side}").sensor,
                exposure=frames[0].exposure if frames else None,
                seed=len(frames),
            )
        )
        models.append(frames[-1].camera)
    cloud = dense_stereo(frames[0].unit, frames[1].unit, models[0], models[1], nearest_m=nearest, step=3)
    assert len(cloud.points) > 5000
    rays = cloud.points - models[0].C
    distance = np.linalg.norm(rays, axis=1)
    true = rock_renderer().scene.ranges(models[0].C, rays / distance[:, None])
    near = distance < 6.0
    error = np.abs(true - distance)[near]
    expected = distance[near] ** 2 / (cloud.camera.hs * cloud.baseline_m)
    assert np.median(error / expected) < 0.5  # half a pixel of disparity
    assert np.mean(error / expected < 2.0) > 0.9
    spread = cloud.covariances()[near]
    along = np.einsum(
        "ni,nij,nj->n", rays[near] / distance[near, None], spread, rays[near] / distance[near, None]
    )
    assert np.median(np.sqrt(along) / expected) == pytest.approx(0.5, abs=0.25)


def test_subframes_cut_round_the_same_thing_give_a_cloud_of_their_whole_frame() -> None:
    cameras = rig("k9")
    pose = Pose(-4.0, 0.0, 0.0)
    frames: list[Frame] = []
    models: list[CameraModel] = []
    for side, corner in (("left", 520), ("right", 440)):
        camera = cameras.camera(f"navcam_{side}", 0.0, -0.35)
        frames.append(
            rock_renderer().render(
                camera,
                pose,
                SUN,
                window=(corner, 380, 240, 200),
                sensor=cameras.mounted(f"navcam_{side}").sensor,
                exposure=frames[0].exposure if frames else None,
                seed=len(frames),
            )
        )
        models.append(frames[-1].camera)
    cloud = dense_stereo(frames[0].unit, frames[1].unit, models[0], models[1], nearest_m=2.0)
    columns = models[0].project(cloud.points)[:, 0]
    quarters = np.histogram(columns, bins=4, range=(0, 240))[0]
    assert quarters.min() > 0.5 * quarters.max()
    rays = cloud.points - models[0].C
    distance = np.linalg.norm(rays, axis=1)
    true = rock_renderer().scene.ranges(models[0].C, rays / distance[:, None])
    expected = distance**2 / (cloud.camera.hs * cloud.baseline_m)
    assert np.median(np.abs(true - distance) / expected) < 0.5
