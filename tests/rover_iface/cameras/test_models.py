"""Camera models against published vectors, a published linearisation, finite differences and themselves."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_iface.cameras.linear import aligned_pair, linearised
from rover_iface.cameras.model import LINEARITY_OF_TYPE, CameraModel, ModelKind, pinhole
from rover_iface.cameras.rig import CameraRig, load_cameras, preset_names
from rover_iface.errors import CameraError
from rover_iface.frames import Transform
from tests.shared import shared


def from_vectors(model: dict[str, Any]) -> CameraModel:
    linearity = LINEARITY_OF_TYPE.get(model.get("mtype", 1), model.get("mparm", 1.0))
    return CameraModel(
        ModelKind(model["type"]),
        *model["dimensions"],
        **{letter: np.array(model[letter]) for letter in model["type"]},
        linearity=linearity,
    )


def all_presets() -> list[tuple[str, CameraModel]]:
    return [(f"{s}/{n}", c.model) for s in preset_names() for n, c in load_cameras(s).items()]


PRESETS = dict(all_presets())


def test_real_models_reproduce_the_reference_vectors_to_a_ten_thousandth_of_a_pixel() -> None:
    cameras = json.loads(shared("data/imagery/camera_models/cahvor_vectors.json").read_text())["cameras"]
    assert len(cameras) == 11
    for name, entry in cameras.items():
        camera = from_vectors(entry["model"])
        for vector in entry["vectors"]:
            pixels = camera.project(vector["points"])
            assert np.abs(pixels - vector["pixel"]).max() < 1e-4, name
            origin, direction = camera.back_project(vector["pixel"])
            assert np.abs(origin - vector["ray_origin"]).max() < 1e-9, name
            assert np.abs(direction - vector["ray_dir"]).max() < 1e-9, name


def test_linearising_a_hazcam_gives_the_published_camera() -> None:
    cameras = json.loads(shared("data/imagery/camera_models/cahvor_vectors.json").read_text())["cameras"]
    model = cameras["mer_front_hazcam_vw_test"]["model"]
    published = model["published_linearisation"]
    made = linearised(from_vectors(model))
    for letter in "CAHV":
        assert np.abs(getattr(made, letter) - published[letter]).max() < published["tolerance"][letter]


@given(
    name=st.sampled_from(sorted(PRESETS)),
    u=st.floats(0, 1),
    v=st.floats(0, 1),
    log_range=st.floats(-0.5, 2.0),
)
@settings(max_examples=400, deadline=None)
def test_projecting_a_back_projected_pixel_gives_it_again(
    name: str, u: float, v: float, log_range: float
) -> None:
    camera = PRESETS[name]
    pixel = np.array([u * (camera.width - 1), v * (camera.height - 1)])
    origin, direction = camera.back_project(pixel)
    assert abs(np.linalg.norm(direction) - 1) < 1e-4
    assert np.abs(camera.project(origin + 10**log_range * direction) - pixel).max() < 1e-6


@given(name=st.sampled_from(sorted(PRESETS)), u=st.floats(0.02, 0.98), v=st.floats(0.02, 0.98))
@settings(max_examples=100, deadline=None)
def test_jacobian_agrees_with_finite_differences(name: str, u: float, v: float) -> None:
    camera = PRESETS[name]
    origin, direction = camera.back_project((u * (camera.width - 1), v * (camera.height - 1)))
    point = origin + 3.0 * direction
    step = 1e-5
    numeric = np.stack(
        [(camera.project(point + d) - camera.project(point - d)) / (2 * step) for d in step * np.eye(3)], -1
    )
    assert np.allclose(camera.jacobian(point), numeric, atol=2e-3)


@given(
    name=st.sampled_from(sorted(PRESETS)),
    angles=st.tuples(*[st.floats(-1.5, 1.5)] * 3),
    shift=st.tuples(*[st.floats(-20, 20)] * 3),
)
@settings(max_examples=60, deadline=None)
def test_a_moved_camera_sees_the_moved_point_at_the_same_pixel(
    name: str, angles: tuple[float, float, float], shift: tuple[float, float, float]
) -> None:
    camera = PRESETS[name]
    site_from_rover = Transform.from_rpy(*angles, shift)
    origin, direction = camera.back_project((0.3 * camera.width, 0.7 * camera.height))
    point = origin + 4.0 * direction
    there = camera.transformed(site_from_rover)
    assert np.allclose(there.project(site_from_rover.apply(point)), camera.project(point), atol=1e-6)
    assert there.hs == pytest.approx(camera.hs, rel=1e-9)


def test_a_hazcam_ray_does_not_start_at_the_centre() -> None:
    camera = PRESETS["mer/hazcam_left"]
    origins, _ = camera.back_project(np.array([[0.0, 0.0], [511.0, 511.0]]))
    assert np.linalg.norm(origins[0] - camera.C) > 1e-3
    assert np.linalg.norm(origins[1] - camera.C) < 1e-5


def test_window_and_scale_move_pixels_as_images_do() -> None:
    camera = PRESETS["mer/navcam_left"]
    point = camera.C + 5 * camera.back_project((400.0, 300.0))[1]
    assert np.allclose(camera.window(320, 220, 161, 161).project(point), (80.0, 80.0), atol=1e-9)
    half = camera.scaled(0.5)
    assert half.size == (512, 512)
    assert np.allclose(half.project(point), (199.75, 149.75), atol=1e-9)


def test_points_behind_a_camera_have_no_pixel() -> None:
    for name, camera in PRESETS.items():
        ahead = camera.back_project(((camera.width - 1) / 2, (camera.height - 1) / 2))[1]
        assert np.isnan(camera.project(camera.C - 5 * ahead)).all(), name
        assert not camera.sees(camera.C - 5 * ahead), name
        assert np.isnan(camera.jacobian(camera.C - 5 * ahead)).all(), name


@pytest.mark.parametrize(
    ("preset", "left", "right"),
    [("mer", "navcam_left", "navcam_right"), ("k9", "hazcam_left", "hazcam_right")],
)
def test_an_aligned_pair_sees_a_point_on_one_line(preset: str, left: str, right: str) -> None:
    cameras = load_cameras(preset)
    one, two = aligned_pair(cameras[left].model, cameras[right].model)
    origins, directions = one.back_project(np.array([[100.0, 80.0], [300.0, 240.0], [500.0, 400.0]]))
    points = origins + 3.0 * directions
    a, b = one.project(points), two.project(points)
    assert np.allclose(a[:, 1], b[:, 1], atol=1e-9)
    depth = (points - one.C) @ one.A
    baseline = np.linalg.norm(two.C - one.C)
    assert np.allclose(a[:, 0] - b[:, 0], one.hs * baseline / depth, atol=1e-6)


def test_pancam_field_of_view_is_the_data_sheets() -> None:
    pancam = PRESETS["mer/pancam_left"]
    corners = pancam.back_project(np.array([[-0.5, 511.5], [1023.5, 511.5]]))[1]
    assert np.degrees(np.arccos(corners[0] @ corners[1])) == pytest.approx(16.3, abs=0.15)
    k9 = PRESETS["k9/navcam_left"]
    edges = k9.back_project(np.array([[-0.5, 383.5], [1023.5, 383.5], [511.5, -0.5], [511.5, 767.5]]))[1]
    assert np.degrees(np.arccos(edges[0] @ edges[1])) == pytest.approx(49.0, abs=0.1)
    assert np.degrees(np.arccos(edges[2] @ edges[3])) == pytest.approx(37.7, abs=0.2)


@given(
    x=st.floats(1.5, 15),
    bearing=st.floats(-2.5, 2.5),
    z=st.floats(-0.5, 1.0),
    name=st.sampled_from(["navcam_left", "navcam_right", "pancam_left"]),
)
@settings(max_examples=60, deadline=None)
def test_a_pointed_mast_puts_the_target_on_the_middle_pixel(
    x: float, bearing: float, z: float, name: str
) -> None:
    rig = CameraRig(load_cameras("mer"), (0.55, 0.15, 1.4))
    target = np.array([0.55 + x * np.cos(bearing), 0.15 + x * np.sin(bearing), z])
    pan, tilt = rig.point_at(target, name)
    assert np.allclose(rig.camera(name, pan, tilt).project(target), (511.5, 511.5), atol=1e-5)


def test_bad_cameras_are_refused_with_the_vector_and_the_limit() -> None:
    good = PRESETS["mer/navcam_left"]
    with pytest.raises(CameraError, match="axis A has length 2"):
        replace(good, A=2 * good.A)
    with pytest.raises(CameraError, match="one plane"):
        replace(good, V=good.H)
    with pytest.raises(CameraError, match="vector H"):
        replace(good, H=np.array([np.nan, 0, 0]))
    with pytest.raises(CameraError, match="orthogonal"):
        good.moved(2 * np.eye(3), np.zeros(3))
    with pytest.raises(CameraError, match="along its own up"):
        pinhole(focal_px=100, width=10, height=10, forward=(0, 0, 1))
    rig = CameraRig(load_cameras("mer"), (0.55, 0.15, 1.4), pan_limit_rad=1.0)
    with pytest.raises(CameraError, match="needs pan"):
        rig.point_at((-5.0, 0.0, 0.0))
    with pytest.raises(CameraError, match="fixed to the body"):
        rig.point_at((5.0, 0.0, 0.0), "hazcam_left")
    with pytest.raises(CameraError, match='no camera "nose"'):
        rig.camera("nose")
    with pytest.raises(CameraError, match="unknown camera set"):
        load_cameras("viking")


@pytest.mark.parametrize(("row", "column", "limit"), [(0, 0, 1.1e-5), (1, 2, 1e-6)])
def test_a_camera_is_turned_by_rotations_alone(row: int, column: int, limit: float) -> None:
    camera = pinhole(focal_px=500, width=64, height=48)
    for share, refused in ((0.4, False), (2.0, True)):
        rotation = np.eye(3)
        rotation[row, column] += share * limit * (0.5 if row == column else 1.0)
        if refused:
            with pytest.raises(CameraError, match="orthogonal"):
                camera.moved(rotation, np.zeros(3))
        else:
            camera.moved(rotation, np.zeros(3))
    rotation = np.eye(3)
    rotation[row, column] = np.nan
    with pytest.raises(CameraError, match="orthogonal"):
        camera.moved(rotation, np.zeros(3))


def test_a_vector_that_is_no_number_makes_no_camera() -> None:
    for bad in (math.nan, math.inf):
        with pytest.raises(CameraError, match="camera vector C"):
            pinhole(focal_px=500, width=64, height=48, center=(0.0, bad, 0.0))
