"""Registration of surfaces: it finds the motion, or it says that it did not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from rover_iface.errors import TrackerError
from rover_iface.frames import Transform
from rover_iface.vision import shape_kernels
from rover_iface.vision.shape import Registration, register
from rover_iface.vision.shape_tracker import CombinedTracker
from rover_iface.vision.sift import SiftOptions
from rover_iface.vision.surface import ShapeOptions, Surface
from rover_iface.vision.tracker import TrackState
from tests.rover_iface.vision.test_sift import view

Array = npt.NDArray[np.float64]
TARGET = np.array([0.05, 0.1, 0.28])


def height(x: Array, y: Array, *, bumpy: bool = True) -> Array:
    """Return ground with an angular rock 0.6 m wide."""
    rock = 0.3 - 0.9 * np.maximum(np.abs(x + 0.2 * y), np.abs(1.3 * y - 0.1 * x))
    ground = 0.02 * np.sin(5 * x) * np.cos(4 * y)
    return np.maximum(rock, ground) if bumpy else 0.0 * x


def seen(eye: tuple[float, float, float], *, bumpy: bool = True, noise_m: float = 0.002) -> Surface:
    """Return what stereo at `eye` would give: facets that look towards it, a little noise along the ray."""
    axis = np.linspace(-1.4, 1.4, 187)
    x, y = np.meshgrid(axis, axis)
    points = np.stack((x, y, height(x, y, bumpy=bumpy)), axis=-1).reshape(-1, 3)
    index = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (p.ravel() for p in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]))
    triangles = np.concatenate((np.stack((a, b, c), 1), np.stack((a, c, d), 1)))
    normal = np.cross(
        points[triangles[:, 1]] - points[triangles[:, 0]], points[triangles[:, 2]] - points[triangles[:, 0]]
    )
    ray = np.array(eye) - points[triangles[:, 0]]
    facing = (normal * ray).sum(axis=1) > 0.15 * np.linalg.norm(normal, axis=1) * np.linalg.norm(ray, axis=1)
    triangles = triangles[facing]
    used = np.unique(triangles)
    number = np.full(len(points), -1)
    number[used] = np.arange(len(used))
    rng = np.random.default_rng(len(used))
    toward = points[used] - np.array(eye)
    toward /= np.linalg.norm(toward, axis=1)[:, None]
    noisy = points[used] + rng.normal(0, noise_m, len(used))[:, None] * toward
    return Surface(noisy, number[triangles].astype(np.int32), np.array(eye))


def wrong_by(shift: tuple[float, float, float], degrees: float) -> Transform:
    turn = Transform.from_rpy(*np.radians([0.4 * degrees, -0.3 * degrees, 0.85 * degrees]))
    return Transform(turn.rotation, TARGET - turn.rotation @ TARGET + np.array(shift))


MODEL, SCENE = seen((-2.5, 0.3, 1.4)), seen((-1.3, -0.2, 1.2))


def test_the_sensor_renders_the_depth_of_a_slanted_plane() -> None:
    corners = np.array([[-4.0, -4.0, 2.0], [4.0, -4.0, 2.0], [4.0, 4.0, 4.0], [-4.0, 4.0, 4.0]])
    depth = np.empty((33, 33))
    shape_kernels.z_buffer(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), 30.0, depth)
    v = (np.arange(33) - 16.0) / 30.0
    expected = 3.0 / (1.0 - 0.25 * v)  # z = 3 + y / 4 and y = v z
    assert np.allclose(depth, expected[:, None], atol=1e-9)


@pytest.mark.parametrize(
    "start", [((0.3, 0.0, 0.05), 0.0), ((-0.1, -0.2, 0.1), 10.0), ((0.0, 0.25, 0.0), -10.0)]
)
def test_half_a_rock_and_ten_degrees_are_found(start: tuple[tuple[float, float, float], float]) -> None:
    found = register(MODEL, SCENE, wrong_by(*start), TARGET)
    assert found.accepted, found.reasons
    assert np.linalg.norm(found.scene_from_model.apply(TARGET) - TARGET) < 0.006


def test_the_published_engine_finds_small_errors() -> None:
    options = ShapeOptions(engine="nelder-mead", most_spread_m=0.02)
    found = register(MODEL, SCENE, wrong_by((0.1, -0.06, 0.05), 3.0), TARGET, options)
    assert np.linalg.norm(found.scene_from_model.apply(TARGET) - TARGET) < 0.015
    assert found.overlap > 0.5


def test_what_cannot_be_registered_is_refused() -> None:
    flat = register(seen((-2.5, 0.3, 1.4), bumpy=False), SCENE, wrong_by((0.1, 0.0, 0.0), 0.0), TARGET)
    assert not flat.accepted
    apart = register(MODEL, SCENE, wrong_by((3.0, 0.0, 0.0), 0.0), TARGET)
    assert not apart.accepted
    other = seen((-2.5, 0.3, 1.4))
    turned = replace(other, points=other.points * np.array([1.0, -1.0, 1.0]) + np.array([0.0, 0.0, 0.2]))
    mirrored = register(turned, SCENE, wrong_by((0.0, 0.0, -0.2), 0.0), TARGET)
    error = np.linalg.norm(mirrored.scene_from_model.apply(TARGET) - TARGET)
    assert not mirrored.accepted or error < 0.3
    with pytest.raises(TrackerError, match="sensor 4 px"):
        ShapeOptions(sensor_px=4)


def test_a_registration_that_leaves_the_target_open_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    tracker = CombinedTracker(SiftOptions(lost_updates=0))
    tracker.start("A", None, view(-4.86), pixel=(150.0, 150.0))
    now = view(-3.5)
    tracker.update("A", replace(now, left=np.zeros_like(now.left)))
    loose = Registration(Transform.identity(), 1.0, 0.0, 0.05, 0.0, ())
    monkeypatch.setattr("rover_iface.vision.shape_tracker.register_views", lambda *_: loose)
    refused, found = tracker.settle("A", now)
    assert found is None
    assert refused.state is TrackState.FAILED
    assert "5.0 cm open; 1 cm is the limit" in " ".join(refused.reasons)


def test_a_target_that_the_features_lost_is_found_by_its_shape() -> None:
    tracker = CombinedTracker(SiftOptions(lost_updates=0))
    tracker.start("A", None, view(-4.86), pixel=(150.0, 150.0))
    truth = tracker.predicted("A")
    now = view(-3.5, Transform.from_rpy(0.0, 0.0, 0.02, (0.06, -0.05, 0.02)))
    lost = tracker.update("A", replace(now, left=np.zeros_like(now.left)))
    assert lost.state is TrackState.FAILED
    settled, found = tracker.settle("A", now)
    assert found is not None, settled.reasons
    assert settled.state is TrackState.TRACKED
    expected = Transform.from_rpy(0.0, 0.0, 0.02, (0.06, -0.05, 0.02)).apply(truth)
    assert np.linalg.norm(settled.position - expected) < 0.02
    blank = replace(now, left=np.zeros_like(now.left))
    refused, found = tracker.settle("A", blank)
    assert found is None
    assert refused.state is TrackState.FAILED
    with pytest.raises(TrackerError, match="not followed"):
        tracker.settle("B", now)
