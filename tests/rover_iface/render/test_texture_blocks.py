"""Textures of blocks of points, and stones that are kept, give what the same point by point gives."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest

from rover_iface.cameras.model import CameraModel, pinhole
from rover_iface.errors import RenderError
from rover_iface.simulator.render import renderer as rendering
from rover_iface.simulator.render import shade
from rover_iface.simulator.render.look import SANDY, Look
from rover_iface.simulator.render.renderer import Renderer, Sun
from rover_iface.simulator.render.scene import Material, Scene, SceneMesh
from rover_iface.terrain.rocks import Rock, rock_meshes
from tests.rover_iface.render import plain_texture
from tests.rover_iface.render.scenes import ground

pytestmark = pytest.mark.xdist_group("plain texture")
"""What single points give is compiled by each process that asks for it, which takes seconds."""

RIPPLED = Look(
    soil_mottle=0.7, sand=0.4, grain=0.2, ripples=0.3, wind_rad=0.7, gravel_mottle=0.5, close_up=1.0
)
LOW, HIGH = (Sun.from_angles(2.0, math.radians(height)) for height in (9.0, 55.0))


def scene(seed: int) -> Scene:
    """Return a place with soil of every stoniness, a rock and a plain board."""
    soil = ground()
    x, y = soil.vertices[:, 0], soil.vertices[:, 1]
    stony = np.clip(0.5 + 0.6 * np.sin(1.7 * x) * np.cos(2.3 * y), 0.0, 1.0).astype(np.float32)
    rock = Rock("R", 0.2, 0.1, 0.0, diameter=1.0, height=0.7, seed=seed)
    rocks = [SceneMesh(m.vertices, m.triangles, m.id, Material.ROCK) for m in rock_meshes([rock], detail=4)]
    board = SceneMesh(
        np.array([[-1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 1.0], [-1.0, 1.0, 1.0]]),
        np.array([[0, 1, 2], [0, 2, 3]]),
        material=Material.PLAIN,
    )
    return Scene([SceneMesh(soil.vertices, soil.triangles, gravel=stony), *rocks, board], seed=seed)


def far() -> CameraModel:
    """Return a camera on a mast that sees soil, rock, board and sky."""
    return pinhole(focal_px=260, width=231, height=171, center=(-4.0, 0.3, 1.5), forward=(4.0, 0.0, -0.9))


def near(metres: float) -> CameraModel:
    """Return a camera that looks down on the edge between rock and soil."""
    return pinhole(
        focal_px=900, width=120, height=130, center=(-0.28, 0.1, 0.3 + metres), forward=(0.05, 0, -1)
    )


def in_the_open(camera: CameraModel, seed: int) -> bool:
    """Return whether a camera is neither below the ground nor in a rock."""
    try:
        scene(seed).require_above_ground(camera.C)
    except RenderError:
        return False
    return True


def both(
    monkeypatch: pytest.MonkeyPatch, look: Look, camera: CameraModel, sun: Sun, seed: int
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """Return the light of a picture by blocks, and point by point."""
    renderer = Renderer(scene(seed), look=look)
    light = renderer.gather(camera, None, sun).light
    made = shade.radiance

    def plain(*arguments: object) -> None:
        *inputs, _stones, out = arguments
        plain_texture.radiance(*inputs, out)

    monkeypatch.setattr(shade, "radiance", plain)
    expected = renderer.gather(camera, None, sun).light
    monkeypatch.setattr(shade, "radiance", made)
    return light, expected


@pytest.mark.parametrize("look", [Look(), SANDY, RIPPLED], ids=["plain", "sandy", "rippled"])
@pytest.mark.parametrize("camera", [far(), near(0.9), near(0.09)], ids=["mast", "arm", "close-up"])
@pytest.mark.parametrize("sun", [LOW, HIGH], ids=["low", "high"])
def test_a_picture_is_to_the_last_bit_that_of_single_points(
    monkeypatch: pytest.MonkeyPatch, look: Look, camera: CameraModel, sun: Sun
) -> None:
    seed = int(np.random.default_rng().integers(2**20))
    while not in_the_open(camera, seed):  # some scenes have a rock there
        seed += 1
    light, expected = both(monkeypatch, look, camera, sun, seed)
    assert np.array_equal(light, expected), seed
    assert light.min() < light.max()


def test_a_picture_does_not_depend_on_the_bands_that_it_is_painted_in(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    renderer, lights = Renderer(scene(5), look=RIPPLED), []
    for band in (1, 700, 10**6):
        monkeypatch.setattr(rendering, "BAND", band)
        taken = renderer.gather(far(), None, LOW)
        lights.append((taken.light, taken.truth.range_m, taken.truth.object_index, taken.truth.lit))
    for other in lights[1:]:
        assert all(np.array_equal(a, b) for a, b in zip(lights[0], other, strict=True))
