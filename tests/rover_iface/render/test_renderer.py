"""The renderer: geometry, light, noise, and whether its pictures have the texture of Mars."""

from __future__ import annotations

import math
from dataclasses import replace
from datetime import datetime

import cv2
import numpy as np
import pytest

from mission.soltime import SOL_S, SunClock, solar_longitude_deg
from rover_iface.cameras.labels import read_product
from rover_iface.cameras.model import pinhole
from rover_iface.cameras.rig import Sensor
from rover_iface.errors import RenderError
from rover_iface.frames import Pose
from rover_iface.simulator.render.picture import AutoExposure
from rover_iface.simulator.render.renderer import Renderer, Sun
from rover_iface.simulator.render.scene import Material, Scene, SceneMesh
from studies.common.texture_statistics import RANGES, measure
from studies.texture import outside, rendered_pictures
from tests.rover_iface.render.scenes import LOOK, SUN, picture, rig, rock_renderer
from tests.shared import shared

POSE = Pose(-5.0, 0.0, 0.0)


def plate(z: float, size: float = 20.0) -> SceneMesh:
    corners = np.array([[-size, -size, z], [size, -size, z], [size, size, z], [-size, size, z]])
    return SceneMesh(
        corners, np.array([[0, 1, 2], [0, 2, 3]]), "plate", Material.PLAIN, albedo=0.5, gravel=0.0
    )


def test_ranges_and_points_are_those_of_a_plane() -> None:
    renderer = Renderer(Scene([plate(0.0)]))
    camera = pinhole(focal_px=100, width=41, height=31, center=(0, 0, 2.0), forward=(1, 0, -1))
    truth = renderer.render(camera, None, SUN).truth
    origins, rays = camera.back_project(np.stack(np.meshgrid(np.arange(41.0), np.arange(31.0)), axis=-1))
    expected = -origins[..., 2] / rays[..., 2]
    assert np.allclose(truth.range_m, expected, rtol=2e-6)
    assert np.abs(truth.point_site[..., 2]).max() < 1e-5
    assert truth.object_id(3, 3) == "plate"
    assert truth.lit.all()


def test_light_on_a_plate_follows_lunar_lambert() -> None:
    renderer = Renderer(Scene([plate(0.0)]))
    camera = pinhole(focal_px=200, width=5, height=5, center=(0, 0, 3.0), forward=(0.01, 0, -1), up=(1, 0, 0))
    sensor = Sensor(bits=16, read_noise_e=0.0, psf_sigma_px=0.0, full_well_e=1e9)
    frames = {}
    for height in (90.0, 30.0):
        sun = Sun.from_angles(0.0, math.radians(height), opacity=1e-6)
        frames[height] = renderer.render(camera, None, sun, sensor=sensor, exposure=0.5).unit.mean()
    phase = 60.0
    weight = 1 - 0.019 * phase + 2.42e-4 * phase**2 - 1.46e-6 * phase**3
    mu0 = math.sin(math.radians(30.0))
    low = weight * 2 * mu0 / (mu0 + 1) + (1 - weight) * mu0
    assert frames[90.0] == pytest.approx(0.25, rel=0.02)  # albedo 0.5, gain 0.5, overhead sun
    assert frames[30.0] / frames[90.0] == pytest.approx(low, rel=0.03)


def test_a_wall_casts_its_shadow_away_from_the_sun() -> None:
    wall = SceneMesh(
        np.array([[2.0, -5, 0], [2.0, 5, 0], [2.0, 5, 1.0], [2.0, -5, 1.0]]),
        np.array([[0, 2, 1], [0, 3, 2]]),
        "wall",
        Material.PLAIN,
    )
    renderer = Renderer(Scene([plate(0.0), wall]))
    camera = pinhole(focal_px=60, width=81, height=41, center=(3.0, 0, 6.0), forward=(0, 0, -1), up=(0, 1, 0))
    # sun in the west at 45 degrees: the shadow reaches 1 m to the east of the wall
    truth = renderer.render(camera, None, Sun.from_angles(math.radians(270), math.radians(45))).truth
    x = truth.point_site[20, :, 0]
    on_ground = truth.point_site[20, :, 2] < 0.01
    dark = on_ground & ~truth.lit[20]
    assert dark.any()
    assert np.all((x[dark] > 1.98) & (x[dark] < 3.02))
    assert truth.lit[20][on_ground & ((x < 1.95) | (x > 3.05))].all()


def test_the_same_seed_gives_the_same_image_and_another_seed_other_noise() -> None:
    one, again, other = picture(POSE), picture(POSE), picture(POSE, seed=2)
    assert np.array_equal(one.image, again.image)
    assert not np.array_equal(one.image, other.image)
    assert np.array_equal(one.truth.range_m, other.truth.range_m)


def test_a_subframe_is_cut_from_the_frame() -> None:
    camera = rig().camera("navcam_left", 0.0, -0.3).window(300, 200, 300, 240)
    renderer = rock_renderer()
    whole = renderer.render(camera, POSE, SUN, exposure=2.0)
    part = renderer.render(camera, POSE, SUN, exposure=2.0, window=(50, 40, 120, 100))
    assert np.array_equal(whole.image[40:140, 50:170], part.image)
    point = whole.truth.point_site[90, 110]
    assert np.allclose(part.camera.project(point), (60, 50), atol=1e-3)


def test_noise_has_the_variance_of_shot_and_read_noise() -> None:
    renderer = Renderer(Scene([plate(0.0)]))
    camera = pinhole(
        focal_px=4000, width=200, height=200, center=(0, 0, 3.0), forward=(0.01, 0, -1), up=(1, 0, 0)
    )
    sensor = Sensor(bits=12, full_well_e=40000.0, read_noise_e=60.0, psf_sigma_px=0.0)
    image = renderer.render(camera, None, SUN, sensor=sensor, exposure=0.8).image.astype(float)
    electrons = image.mean() / 4095 * 40000
    expected = math.sqrt(electrons + 60.0**2) / 40000 * 4095
    assert image.std() == pytest.approx(expected, rel=0.05)


def test_auto_exposure_keeps_the_share_above_the_cut() -> None:
    rule = AutoExposure(cut=0.6, percent=5.0)
    sensor = Sensor(bits=12, read_noise_e=0.0)
    renderer = rock_renderer()
    down = rig().camera("navcam_left", 0.0, -0.6)
    frame = renderer.render(down, POSE, SUN, sensor=sensor, exposure=rule)
    assert (frame.unit > 0.6).mean() == pytest.approx(0.05, abs=0.01)
    dim = replace(SUN, strength=0.3)
    again = renderer.render(down, POSE, dim, sensor=sensor, exposure=rule)
    assert again.exposure > 1.5 * frame.exposure
    assert (again.unit > 0.6).mean() == pytest.approx(0.05, abs=0.01)


def test_what_cannot_be_rendered_is_refused() -> None:
    renderer = rock_renderer()
    with pytest.raises(RenderError, match="below the surface"):
        renderer.render(pinhole(focal_px=50, width=9, height=9, center=(3, 3, -0.5)), None, SUN)
    with pytest.raises(RenderError, match="does not lie in the frame"):
        renderer.render(
            pinhole(focal_px=50, width=9, height=9, center=(3, 3, 1)), None, SUN, window=(5, 5, 9, 9)
        )
    with pytest.raises(RenderError, match="at least one mesh"):
        Scene([])
    with pytest.raises(RenderError, match="not finite"):
        Scene([replace(plate(0.0), vertices=np.full((4, 3), np.nan))])
    with pytest.raises(RenderError, match="triangle index 7"):
        Scene([replace(plate(0.0), triangles=np.array([[0, 1, 7]]))])
    with pytest.raises(RenderError, match="unit vector"):
        Sun((1.0, 1.0, 1.0))


def test_statistics_do_not_depend_on_what_the_mask_leaves_out() -> None:
    rng = np.random.default_rng(5)
    image = cv2.GaussianBlur(rng.normal(0.5, 0.2, (128, 128)).astype(np.float32), (5, 5), 1.0)
    alone = measure(image)
    framed = np.full((512, 512), 9.0, np.float32)
    mask = np.zeros(framed.shape, bool)
    framed[128:256, 192:320], mask[128:256, 192:320] = image, True
    among = measure(framed, mask)
    assert among.rms_contrast == pytest.approx(alone.rms_contrast, rel=1e-4)
    assert among.spectrum_slope == pytest.approx(alone.spectrum_slope, rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("site", [7, 8])
def test_rendered_ground_and_rock_have_the_texture_of_the_flight_frames(site: int) -> None:
    for shown in rendered_pictures(site):
        found = measure(shown.image, shown.mask)
        assert not outside(found), (shown.kind, found)


def test_the_statistics_of_a_flight_frame_lie_in_the_published_ranges() -> None:
    product = read_product(shared("data/imagery/mer/2n292280938effb100p0703l0m1.img.gz"))
    assert product.image is not None
    found = measure(product.image[400:])
    for name, (low, high) in RANGES.items():
        assert low <= getattr(found, name) <= high, (name, found)


def test_the_sun_stands_where_a_flight_label_says() -> None:
    product = read_product(shared("data/imagery/mer/2n292280938effb100p0703l0m1.img.gz"))
    utc = datetime.fromisoformat(str(product.label["START_TIME"]).rstrip("Z") + "+00:00")
    assert solar_longitude_deg(utc) == pytest.approx(product.label["SOLAR_LONGITUDE"], abs=0.01)
    clock = SunClock(utc, -14.57, 175.47)
    derived = product.label["SITE_DERIVED_GEOMETRY_PARMS"]
    east, north, _ = clock.direction(0.0)
    assert math.degrees(clock.elevation_rad(0.0)) == pytest.approx(abs(derived["SOLAR_ELEVATION"]), abs=0.5)
    assert math.degrees(math.atan2(east, north)) == pytest.approx(derived["SOLAR_AZIMUTH"], abs=2.5)
    assert abs(clock.lmst_h(SOL_S) - clock.lmst_h(0.0)) < 0.001


def test_the_sun_crosses_the_sky_from_east_to_west() -> None:
    clock = SunClock.at(ls_deg=90.0, latitude_deg=-4.6, lmst_h=8.0)
    hour = SOL_S / 24
    directions = np.array([clock.direction(h * hour) for h in range(9)])
    assert (np.diff(directions[:, 0]) < 0).all()
    assert directions[0, 0] > 0.5 > -0.5 > directions[-1, 0]
    assert 3 <= int(np.argmax(directions[:, 2])) <= 5


def test_the_look_point_is_in_the_middle_of_a_pointed_subframe() -> None:
    frame = picture(POSE)
    assert np.abs(frame.camera.project(LOOK) - 80).max() < 1.0
