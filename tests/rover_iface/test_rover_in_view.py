"""The rover in its own pictures: where its parts are, the truth that names them, ground as it was."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rover_iface.cameras.rig import rig_of
from rover_iface.frames import Pose
from rover_iface.profile import load_profile
from rover_iface.simulator.own_shadow import OwnShadow, ShadowedScene
from rover_iface.simulator.render.renderer import Renderer, Sun
from rover_iface.simulator.render.scene import Material, Scene, SceneMesh
from rover_iface.simulator.rover_in_view import RoverInView, rover_parts

SUN = Sun.from_angles(math.radians(200.0), math.radians(40.0))
CORNERS = np.array([[-20.0, -20, 0], [20, -20, 0], [20, 20, 0], [-20, 20, 0]])
POSE = Pose(3.0, 1.0, heading=0.4)


def ground() -> Scene:
    return Scene([SceneMesh(CORNERS, np.array([[0, 1, 2], [0, 2, 3]]), material=Material.PLAIN)])


@pytest.mark.parametrize("name", ["k9", "mer"])
def test_parts_are_closed_where_the_shadow_has_its_boxes(name: str) -> None:
    profile = load_profile(name)
    parts = rover_parts(profile)
    assert [part.id for part in parts].count("rover wheel") == 2 * len(profile.wheels.axle_x_m)
    for part in parts:
        edges = np.sort(np.asarray(part.triangles)[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2))
        counts = np.unique(edges, axis=0, return_counts=True)[1]
        assert (counts == 2).all() or part.id == "rover deck"  # whose cells lie on it
        v, t = np.asarray(part.vertices), np.asarray(part.triangles)
        a, b, c = (v[t[:, k]] for k in range(3))
        assert np.einsum("ni,ni->n", a - v.mean(axis=0), np.cross(b - a, c - a)).sum() > 0
    wheels = [np.asarray(p.vertices) for p in parts if p.id == "rover wheel"]
    assert {round(float(w[:, 2].min()), 3) for w in wheels} == {0.0}
    widest = max(float(np.abs(w[:, 1]).max()) for w in wheels)
    assert widest == pytest.approx(profile.wheels.track_m / 2 + profile.wheels.width_m / 2)


def test_the_front_hazcam_sees_its_wheels_at_their_distance() -> None:
    profile = load_profile("mer")
    scene = RoverInView(ground(), profile, POSE.site_from_rover)
    camera = rig_of(profile).camera("hazcam_left", 0.0, 0.0)
    truth = Renderer(scene).render(camera, POSE, SUN).truth
    wheel = np.isin(truth.object_index, [k for k, name in enumerate(truth.ids) if name == "rover wheel"])
    # on the left and on the right, below the middle; the ground between is free
    assert wheel[512:, :300].sum() > 5000
    assert wheel[512:, -300:].sum() > 5000
    assert not wheel[:, 450:550].any()
    points = POSE.site_from_rover.inverse().apply(truth.point_site[wheel])
    assert np.abs(points[:, 1]).min() > profile.wheels.track_m / 2 - profile.wheels.width_m / 2 - 0.01
    assert -0.01 < points[:, 2].min() <= points[:, 2].max() < 2 * profile.wheels.radius_m + 0.01
    assert "rover deck" not in {truth.ids[k] for k in np.unique(truth.object_index[truth.object_index >= 0])}


def test_the_mast_sees_the_deck_behind_it_and_no_rover_before_it() -> None:
    profile = load_profile("mer")
    scene = RoverInView(ground(), profile, POSE.site_from_rover)
    shares = []
    for pan in (0.0, math.radians(150.0)):
        camera = rig_of(profile).camera("navcam_left", pan, math.radians(-35.0))
        truth = Renderer(scene).render(camera, POSE, SUN, window=(0, 512, 1024, 512)).truth
        shares.append(float(np.mean(truth.object_index == truth.ids.index("rover deck"))))
    assert shares[0] == 0.0
    assert shares[1] > 0.2


def test_ground_that_the_rover_does_not_hide_is_as_with_its_shadow_alone() -> None:
    profile = load_profile("k9")
    alone = ShadowedScene(ground(), OwnShadow(profile, lambda: POSE.site_from_rover))
    seen = RoverInView(ground(), profile, POSE.site_from_rover)
    camera = rig_of(profile).camera("hazcam_left", 0.0, 0.0)
    one, two = (Renderer(scene).render(camera, POSE, SUN).truth for scene in (alone, seen))
    bare = two.object_index == 0
    assert 0.3 < bare.mean() < 1.0
    assert np.array_equal(one.range_m[bare], two.range_m[bare])
    assert (two.range_m[~bare & (two.object_index > 0)] < one.range_m[~bare & (two.object_index > 0)]).all()


def test_a_wheel_in_the_sun_is_not_in_its_own_shadow() -> None:
    scene = RoverInView(ground(), load_profile("k9"), POSE.site_from_rover)
    aside = POSE.site_from_rover.rotate(np.array([0.0, 1.0, 0.3]))
    east, north, up = (float(v) for v in aside / np.linalg.norm(aside))
    sun = Sun((east, north, up))
    eye = POSE.site_from_rover.apply(np.array([0.0, 3.0, 0.5]))
    profile = load_profile("k9")
    hub = POSE.site_from_rover.apply(np.array([0.39, 0.5 * profile.wheels.track_m, profile.wheels.radius_m]))
    way = (hub - eye) / np.linalg.norm(hub - eye)
    hit = scene.cast(eye[None], way[None])
    assert scene.ids[scene.objects[hit["primID"][0]]] == "rover wheel"
    start = (eye + (hit["tfar"][0] - 2e-3) * way - scene.origin).astype(np.float32)[None]
    assert not scene.occluded_local(start, np.array([sun.direction], np.float32))[0]
    assert scene.occluded_local(start, np.array([way], np.float32))[0]
