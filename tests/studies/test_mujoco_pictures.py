"""What MuJoCo's renderer is given is the scene's geometry and the camera's view; no picture is drawn here."""

from __future__ import annotations

import numpy as np
import pytest

from rover_iface.cameras.model import pinhole
from rover_iface.cameras.rig import load_cameras
from rover_iface.errors import CameraError
from rover_iface.frames import Transform
from rover_iface.simulator.render.renderer import Renderer, Sun
from rover_iface.simulator.render.scene import Material, Scene, SceneMesh
from studies.common.mujoco_pictures import (
    LIMITS_M,
    TEXTURE_MEAN,
    TILE,
    baked,
    cast_truth,
    frustum,
    model_of,
)

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")


def scene() -> Scene:
    """Return a slope with a pyramid on it, far from the origin of the site."""
    ground = np.array([(96.0, 47.0, 0.0), (104.0, 47.0, 0.8), (104.0, 53.0, 0.8), (96.0, 53.0, 0.0)])
    base = [(99.5, 49.5, 0.2), (100.5, 49.5, 0.2), (100.5, 50.5, 0.2), (99.5, 50.5, 0.2)]
    corners = np.array([*base, (100.0, 50.0, 1.1)])
    sides = np.array([(0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)])
    return Scene(
        [
            SceneMesh(ground, np.array([(0, 1, 2), (0, 2, 3)])),
            SceneMesh(corners, sides, "rock", Material.ROCK, albedo=0.2, smooth=False),
        ]
    )


def test_the_model_has_every_triangle_of_the_scene_at_its_place() -> None:
    import mujoco

    given = scene()
    model = model_of(given, np.full((8, 8), 107, np.uint8), 64, 48).compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    found = []
    for geom in range(model.ngeom):
        mesh = int(model.geom_dataid[geom])
        first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
        points = model.mesh_vert[first : first + count] @ data.geom_xmat[geom].reshape(3, 3).T
        first, count = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
        found.append((points + data.geom_xpos[geom])[model.mesh_face[first : first + count]])
    expected = given.vertices[given.triangles] + given.origin
    middles = np.concatenate(found).mean(axis=1)
    assert len(middles) == len(expected)
    for middle in expected.mean(axis=1):
        assert np.linalg.norm(middles - middle, axis=1).min() < 1e-5


def test_a_frustum_sees_a_point_where_the_camera_has_it() -> None:
    camera = load_cameras("k9")["navcam_left"].model.window(37, 190, 361, 301)
    camera = camera.transformed(Transform.from_rpy(0.1, 0.3, -2.0, (5.0, 6.0, 7.0)))
    centre, half, bottom, top, up = frustum(camera)
    right = np.cross(camera.A, up)
    for pixel in ((0.0, 0.0), (360.0, 0.0), (120.0, 299.0)):
        _, ray = camera.back_project(np.array(pixel))
        at = ray * LIMITS_M[0] / float(ray @ camera.A)
        # the picture is 361 by 301 pixels, whose first centre lies half a pixel inside
        x = (float(at @ right) - centre + half) / (2 * half) * 361 - 0.5
        y = (top - float(at @ up)) / (top - bottom) * 301 - 0.5
        assert (x, y) == pytest.approx(pixel, abs=1e-6)


def test_a_camera_that_distorts_is_refused() -> None:
    with pytest.raises(CameraError, match="distorts"):
        frustum(load_cameras("k9")["hazcam_left"].model)


def test_the_texture_repeats_without_a_seam_and_keeps_its_mean() -> None:
    rng = np.random.default_rng(5)
    grain = np.asarray(1.0 + 0.2 * np.cumsum(rng.normal(0, 0.1, (300, 700)), axis=1), dtype=np.float32)
    grain /= grain.mean()
    texture = baked(grain, 0.004, rng.uniform(0, 300, (2, 2))).astype(float)
    assert texture.shape == (TILE, TILE)
    assert texture.mean() == pytest.approx(255 * TEXTURE_MEAN, rel=0.1)
    inside = np.abs(np.diff(texture, axis=1)).mean()
    assert np.abs(texture[:, 0] - texture[:, -1]).mean() < 4 * inside
    assert np.abs(texture[0] - texture[-1]).mean() < 4 * np.abs(np.diff(texture, axis=0)).mean()


def test_the_cast_truth_is_that_of_the_renderer() -> None:
    given, sun = scene(), Sun.from_angles(2.0, 0.6)
    camera = pinhole(focal_px=60.0, width=81, height=61, center=(96.5, 50.2, 1.5), forward=(1.0, 0.0, -0.3))
    cast = cast_truth(given, camera, sun)
    rendered = Renderer(given).gather(camera, None, sun).truth
    assert np.array_equal(cast.object_index, rendered.object_index)
    hit = np.isfinite(cast.range_m)
    assert np.allclose(cast.range_m[hit], rendered.range_m[hit], atol=1e-4)
    assert np.mean(cast.lit == rendered.lit) > 0.99
    assert {0, 1} <= set(cast.object_index.ravel().tolist())
    assert not cast.lit[cast.object_index == 0].all()
