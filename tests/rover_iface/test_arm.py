"""Kinematics of the arm, its ways round what it must not touch, contact, and the microscopic imager."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_iface.cameras.focus import merge_stack
from rover_iface.cameras.rig import load_cameras
from rover_iface.errors import CameraError, PlacementError
from rover_iface.frames import Transform
from rover_iface.placement.arm import Arm, ArmLimit, ArmRefusal, Posture
from rover_iface.placement.arm_motion import Motion, Obstacles, clearances, plan_motion
from rover_iface.profile import load_profile
from rover_iface.simulator.contact import held, place_tool
from rover_iface.simulator.microscope import close_up
from rover_iface.simulator.render.renderer import Renderer, Sun
from rover_iface.simulator.render.scene import Material, Scene, SceneMesh

PROFILE = load_profile("k9")
ARM = Arm(PROFILE.arm)
LOW, HIGH = ARM.limits.T
EMPTY = np.empty((0, 3))


@st.composite
def postures(draw: st.DrawFn) -> np.ndarray:
    return np.array([draw(st.floats(float(low), float(high))) for low, high in ARM.limits])


def ground(height: float, half: float = 1.2) -> np.ndarray:
    axis = np.arange(-half, half, 0.02)
    x, y = (g.ravel() for g in np.meshgrid(axis + 0.8, axis))
    return np.column_stack((x, y, np.full(len(x), height)))


def slab(height: float) -> Scene:
    vertices = np.array([[-3.0, -3, height], [4, -3, height], [4, 3, height], [-3, 3, height]])
    return Scene([SceneMesh(vertices, np.array([[0, 1, 2], [0, 2, 3]]), material=Material.ROCK)])


@settings(max_examples=200, deadline=None)
@given(postures())
def test_every_branch_of_the_inverse_puts_the_tool_where_it_was_asked(joints: np.ndarray) -> None:
    tip, axis = ARM.forward(joints)
    found = ARM.inverse(tip, axis)
    tips, axes = ARM.forward(found.joints[np.isfinite(found.joints).all(axis=-1)])
    assert len(tips)
    assert np.abs(tips - tip).max() < 1e-6
    assert np.abs(axes - axis).max() < 1e-6
    assert found.allowed.any()
    turned = np.exp(1j * found.joints) - np.exp(1j * joints)
    straight = abs(math.sin(joints[4])) < 1e-3
    if not straight and abs(math.sin(joints[2])) > 1e-3:
        assert np.abs(turned).max(axis=-1).min() < 1e-4


@settings(max_examples=50, deadline=None)
@given(postures())
def test_links_keep_their_lengths_and_the_tool_frame_its_axis(joints: np.ndarray) -> None:
    places = ARM.joint_places(joints)
    assert np.linalg.norm(np.diff(places, axis=0), axis=1) == pytest.approx(PROFILE.arm.links_m)
    pose = ARM.tool_pose(joints)
    assert pose.translation == pytest.approx(places[3])
    assert pose.apply((-PROFILE.arm.links_m[2], 0, 0)) == pytest.approx(places[2])


def test_signs_are_those_of_the_rover_frame() -> None:
    assert ARM.forward(np.zeros(5))[0] == pytest.approx((0.40 + 0.79, 0, 0.42))
    down = ARM.forward([0, math.pi / 2, 0, 0, 0])[0]
    assert down == pytest.approx((0.40, 0, 0.42 - 0.79))
    left = ARM.forward([math.pi / 2, 0, 0, 0, 0])[0]
    assert left == pytest.approx((0.40, 0.79, 0.42))
    aside = ARM.tool_axis([0, 0, 0, math.pi / 2, math.pi / 2])
    assert aside == pytest.approx((0, 1, 0), abs=1e-12)


def test_many_poses_at_once_are_the_same_as_one_by_one() -> None:
    rng = np.random.default_rng(5)
    joints = rng.uniform(LOW, HIGH, (6, 5))
    tips, axes = ARM.forward(joints)
    together = ARM.inverse(tips, axes)
    for k in range(6):
        alone = ARM.inverse(tips[k], axes[k])
        np.testing.assert_allclose(together.joints[k], alone.joints, atol=1e-12)


def test_the_posture_nearest_to_where_the_arm_is_is_taken() -> None:
    point, normal = (0.85, 0.05, 0.15), (-0.5, 0.1, 0.8)
    found = ARM.solve(point, normal)
    assert isinstance(found, Posture)
    tip, axis = ARM.forward(found.joints)
    assert tip == pytest.approx(point)
    assert axis == pytest.approx(-np.array(normal) / np.linalg.norm(normal))
    assert found.tool_tilt_rad == 0.0
    others = ARM.inverse(tip, axis)
    for joints in others.joints[others.allowed]:
        again = ARM.solve(point, normal, near=joints)
        assert isinstance(again, Posture)
        assert again.joints == pytest.approx(joints)


def test_a_normal_out_of_reach_is_met_with_the_least_tilt() -> None:
    point, normal = np.array((1.12, 0.0, 0.35)), np.array((0.0, 0.0, 1.0))
    assert isinstance(ARM.solve(point, normal, max_tilt_rad=0.0), ArmRefusal)
    found = ARM.solve(point, normal, max_tilt_rad=1.2)
    assert isinstance(found, Posture)
    assert 0 < found.tool_tilt_rad <= 1.2
    angle = math.acos(float(-ARM.tool_axis(found.joints) @ normal))
    assert angle == pytest.approx(found.tool_tilt_rad, abs=1e-9)


@pytest.mark.parametrize(
    ("point", "normal", "limit", "words"),
    [
        ((1.6, 0.0, 0.2), (0, 0, 1), ArmLimit.REACH, "it reaches 0.65 m"),
        ((0.40, 0.0, 0.28), (0, 0, 1), ArmLimit.TOO_CLOSE, "no nearer than 0.03 m"),
        ((-0.2, 0.0, 0.3), (0, 0, 1), ArmLimit.JOINT, "the shoulder would stand at 160 degrees"),
        ((0.85, 0.06, 0.58), (0.8, -0.5, 0.2), ArmLimit.TOOL_ANGLE, "the wrist would stand at"),
    ],
)
def test_a_refusal_says_what_limits(
    point: tuple[float, ...], normal: tuple[float, ...], limit: ArmLimit, words: str
) -> None:
    found = ARM.solve(point, normal, max_tilt_rad=0.0)
    assert isinstance(found, ArmRefusal)
    assert found.limit is limit
    assert words in found.reason


def test_nonsense_is_refused_by_name() -> None:
    with pytest.raises(PlacementError, match="normal is"):
        ARM.solve((0.8, 0, 0.1), (0, 0, 0))
    with pytest.raises(PlacementError, match="three numbers"):
        ARM.solve((0.8, 0), (0, 0, 1))


@pytest.mark.parametrize("name", ["k9", "mer"])
def test_the_stowed_arm_touches_nothing(name: str) -> None:
    profile = load_profile(name)
    cloud = ground(0.0)
    gaps, what = clearances(Arm(profile.arm), Obstacles.of(profile, cloud), profile.arm.stow_rad)
    assert gaps[0] > 0.03, what


def test_the_way_ends_along_the_normal_and_keeps_off_everything() -> None:
    cloud = ground(0.1)
    point, normal = np.array((0.9, 0.05, 0.1)), np.array((0.0, 0.0, 1.0))
    obstacles = Obstacles.of(PROFILE, cloud)
    way = plan_motion(ARM, obstacles, point, normal)
    assert isinstance(way, Motion)
    assert np.abs(np.diff(way.joints, axis=0)).max() < 0.6
    gaps, what = clearances(ARM, obstacles, way.joints[1 : way.approach])
    assert gaps.min() >= 0, what[int(gaps.argmin())]
    tips, axes = ARM.forward(way.joints[way.approach :])
    assert tips[-1] == pytest.approx(point)
    assert axes == pytest.approx(np.tile(-normal, (len(axes), 1)))
    assert (np.diff(tips[:, 2]) < 0).all()
    assert tips[0] == pytest.approx(point + PROFILE.arm.standoff_m * normal)
    assert way.duration_s > PROFILE.arm.standoff_m / PROFILE.arm.approach_m_s


def test_a_wall_before_the_target_is_named() -> None:
    y, z = (g.ravel() for g in np.meshgrid(np.arange(-0.8, 0.8, 0.02), np.arange(0.0, 1.4, 0.02)))
    wall = np.column_stack((np.full(len(y), 0.72), y, z))
    cloud = np.vstack((ground(0.0), wall))
    found = plan_motion(ARM, Obstacles.of(PROFILE, cloud), (0.95, 0.0, 0.0), (0, 0, 1))
    assert isinstance(found, ArmRefusal)
    assert found.limit is ArmLimit.COLLISION
    assert "and the ground would come" in found.reason


def test_the_rover_itself_is_in_the_way() -> None:
    obstacles = Obstacles.of(PROFILE, EMPTY)
    folded = np.array([0.0, 0.3, 2.75, 0.0, 0.0])
    gaps, what = clearances(ARM, obstacles, folded)
    assert gaps[0] < 0
    assert "body" in what[0]


def test_contact_is_within_the_accuracy_of_the_arm() -> None:
    height = 0.1
    point, normal = np.array((0.9, 0.05, height)), np.array((0.0, 0.0, 1.0))
    way = plan_motion(ARM, Obstacles.of(PROFILE, ground(height)), point, normal)
    assert isinstance(way, Motion)
    scene, here = slab(height), Transform.identity()
    rng = np.random.default_rng(1)
    touches = [place_tool(scene, ARM, here, way, rng=rng) for _ in range(40)]
    assert all(t.made for t in touches)
    off = np.array([t.point - point for t in touches])
    assert np.abs(off).max() <= PROFILE.arm.accuracy_m + 1e-6
    assert off[:, :2].std() > 0.0002
    assert max(abs(t.beyond_m) for t in touches) <= PROFILE.arm.accuracy_m + 1e-6


@pytest.mark.parametrize(
    ("height", "words"),
    [(0.05, "no contact within 20 mm beyond"), (0.135, "contact 3"), (0.60, "touched the ground on the way")],
)
def test_a_surface_that_is_not_where_it_was_thought_stops_the_tool(height: float, words: str) -> None:
    point, normal = np.array((0.9, 0.05, 0.1)), np.array((0.0, 0.0, 1.0))
    way = plan_motion(ARM, Obstacles.of(PROFILE, ground(0.1)), point, normal)
    assert isinstance(way, Motion)
    touch = place_tool(slab(height), ARM, Transform.identity(), way, rng=np.random.default_rng(0))
    assert not touch.made
    assert words in touch.reason


def body(low: tuple[float, float, float], high: tuple[float, float, float]) -> Scene:
    """Return a box between two corners, m."""
    vertices = np.array(list(itertools.product(*zip(low, high, strict=True))))
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = np.array([t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))])
    return Scene([SceneMesh(vertices, triangles, material=Material.ROCK)])


def test_the_tool_is_held_along_the_normal_of_a_face_that_looks_aside() -> None:
    point, normal = np.array((0.95, 0.0, 0.25)), np.array((0.0, 1.0, 0.0))
    tool = held(body((0.85, -1.0, -1.0), (2.0, 0.0, 0.35)), ARM, Transform.identity(), point, normal)
    assert isinstance(tool, Transform)
    assert tool.rotation[:, 0] == pytest.approx(-normal)
    assert tool.translation == pytest.approx(point + PROFILE.arm.standoff_m * normal)


def test_a_tool_is_not_held_where_a_link_would_meet_the_ground() -> None:
    point, normal = np.array((0.62, 0.0, 0.35)), np.array((1.0, 0.0, 0.0))
    low_wall = body((0.58, -1.0, -1.0), (0.62, 1.0, 0.37))
    assert isinstance(held(low_wall, ARM, Transform.identity(), point, normal), Transform)
    refused = held(body((0.58, -1.0, -1.0), (0.62, 1.0, 1.5)), ARM, Transform.identity(), point, normal)
    assert isinstance(refused, str)
    assert "touched the ground" in refused


def test_what_the_joints_do_not_reach_is_not_held() -> None:
    refused = held(slab(0.0), ARM, Transform.identity(), np.array((1.6, 0.0, 0.2)), np.array((0.0, 0.0, 1.0)))
    assert isinstance(refused, str)
    assert "it reaches 0.65 m" in refused


@settings(max_examples=40, deadline=None)
@given(
    st.floats(0.3, 0.85),
    st.floats(-1.2, 1.2),
    st.floats(-0.1, 0.6),
    st.floats(0.0, 1.5),
    st.floats(-3.1, 3.1),
)
def test_the_least_tilt_of_many_places_is_that_of_each(
    away: float, turn: float, height: float, slope: float, face: float
) -> None:
    points = ARM.shoulder + np.array(
        [[away * math.cos(turn), away * math.sin(turn), height - 0.42], [0.5, 0.0, 0.0]]
    )
    normals = np.array(
        [[math.sin(slope) * math.cos(face), math.sin(slope) * math.sin(face), math.cos(slope)]] * 2
    )
    for point, normal, tilt in zip(points, normals, ARM.least_tilt(points, normals), strict=True):
        found = ARM.solve(point, normal)
        assert (found.tool_tilt_rad if isinstance(found, Posture) else math.inf) == tilt


def test_the_imager_shows_fifty_micron_and_merges_what_lies_in_different_planes() -> None:
    axis = np.linspace(-0.03, 0.03, 25)
    x, y = np.meshgrid(axis, axis)
    z = 0.5 * x
    index = np.arange(25 * 25).reshape(25, 25)
    a, b, c, d = (g.ravel() for g in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]))
    triangles = np.concatenate((np.stack((a, b, c), 1), np.stack((a, c, d), 1)))
    vertices = np.column_stack((x.ravel(), y.ravel(), z.ravel()))
    floor = np.array([[-1.0, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1]])
    scene = Scene(
        [
            SceneMesh(vertices, triangles, material=Material.ROCK),
            SceneMesh(floor, np.array([[0, 1, 2], [0, 2, 3]])),
        ]
    )
    camera = load_cameras("k9")["mi"].model
    down = Transform(np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]]), np.zeros(3))
    found = close_up(Renderer(scene), camera.transformed(down), Sun.from_angles(1.0, 0.8))
    assert found.pixel_m == pytest.approx(50e-6, rel=0.02)
    assert found.sharp > 0.8

    def energy(image: np.ndarray) -> float:
        return float(
            (np.diff(image, axis=0)[:, :80] ** 2).mean() + (np.diff(image, axis=0)[:, -80:] ** 2).mean()
        )

    merged = merge_stack(found.stack)[0]
    assert energy(merged) > 1.2 * max(energy(image) for image in found.stack)


def test_a_stack_of_nothing_is_refused() -> None:
    with pytest.raises(CameraError, match="images of one size"):
        merge_stack([])
