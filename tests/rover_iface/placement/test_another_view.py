"""A move of the base to see a designated point from another side."""

from __future__ import annotations

import math
from collections.abc import Generator, Sequence
from functools import lru_cache, partial
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from rover_iface.behaviour.action import Step
from rover_iface.behaviour.arm_placing import ArmPlacing
from rover_iface.behaviour.attempt import Attempt
from rover_iface.behaviour.following import Followed
from rover_iface.errors import TrackerError
from rover_iface.frames import Pose, wrap_angle
from rover_iface.placement import (
    Decision,
    PlacementVerdict,
    SurfaceCloud,
    plan_placement,
    segment,
)
from rover_iface.placement.arm import Arm, Posture
from rover_iface.placement.base_adjustment import (
    ANOTHER_SIDE_RAD,
    FARTHEST_MOVE_M,
    MOST_TURN_RAD,
    mast_eye,
    view_move,
)
from rover_iface.placement.cloud import Array, cloud_of_points
from rover_iface.placement.verdict import BaseMove, Reason
from rover_iface.profile import RoverProfile, load_profile
from tests.rover_iface.domes import EYE, ROCKS, raster


@pytest.fixture(scope="module")
def k9() -> RoverProfile:
    return load_profile("k9")


def spot() -> tuple[Array, Array]:
    """A point (3,) of the first dome and the outward normal there."""
    x, y, half, height = ROCKS[0]
    way = np.array([-0.45, 0.05, 0.9])
    way /= np.linalg.norm(way / (half, half, height))
    normal = way / np.square((half, half, height))
    return np.array([x, y, 0.0]) + way, np.asarray(normal / np.linalg.norm(normal))


@lru_cache(maxsize=2)
def seen(hole_m: float) -> SurfaceCloud:
    points = raster()[0].copy()
    points[np.linalg.norm(points - spot()[0], axis=-1) < hole_m] = np.nan
    return cloud_of_points(points, sigma_m=0.002, eye=EYE)


def decided(k9: RoverProfile, hole_m: float, *, views_left: int) -> PlacementVerdict:
    cloud = seen(hole_m)
    return plan_placement(cloud, spot()[0], k9, segmentation=segment(cloud), views_left=views_left)


def test_a_point_in_a_hole_is_looked_at_from_another_side_before_a_place_beside_it(
    k9: RoverProfile,
) -> None:
    here = decided(k9, 0.03, views_left=0)
    assert here.decision is not Decision.PLACE
    assert here.base_move is None or here.distance_m > 0.0
    there = decided(k9, 0.03, views_left=2)
    assert there.decision is Decision.MOVE_BASE
    assert there.base_move is not None
    assert there.point is not None
    assert there.point.tolist() == spot()[0].tolist()
    assert [f.reason for f in there.findings] == [f.reason for f in here.findings]


def test_every_view_is_for_the_designated_point_before_a_place_beside_it(k9: RoverProfile) -> None:
    """With one view left a place beside it was taken though its surface was not known (48232)."""
    cloud = seen(0.03)
    found = segment(cloud)

    def reached(point: Array, normal: Array) -> Posture:
        return Posture(np.zeros(5), 0.0)

    decide = partial(plan_placement, cloud, spot()[0], k9, segmentation=found, arm=reached)
    for views_left in (2, 1):
        verdict = decide(views_left=views_left)
        assert verdict.decision is Decision.MOVE_BASE
        assert verdict.distance_m == 0.0
    assert decide(views_left=0).decision is Decision.PLACE_NEAR
    # from all around it was seen before
    around = [spot()[0] + np.array([math.cos(t), math.sin(t), 1.0]) for t in np.arange(0.0, math.tau, 0.4)]
    assert decide(views_left=1, seen_from=around).decision is Decision.PLACE_NEAR


def test_a_point_that_is_safe_from_here_is_taken_from_here(k9: RoverProfile) -> None:
    def reached(point: Array, normal: Array) -> Posture:
        return Posture(np.zeros(5), 0.0)

    cloud = seen(0.0)
    verdict = plan_placement(cloud, spot()[0], k9, segmentation=segment(cloud), arm=reached, views_left=2)
    assert verdict.decision is Decision.PLACE


def test_a_point_that_is_known_to_be_bad_is_worth_no_move(k9: RoverProfile) -> None:
    points = raster()[0].copy()
    away = np.linalg.norm(points - spot()[0], axis=-1)[..., None]
    points += np.where(np.isfinite(away), 0.032 * np.exp(-((away / 0.014) ** 2)), 0.0) * spot()[1]
    cloud = cloud_of_points(points, sigma_m=0.002, eye=EYE)
    found = segment(cloud)

    def reached(point: Array, normal: Array) -> Posture:
        return Posture(np.zeros(5), 0.0)

    verdict = plan_placement(cloud, spot()[0], k9, segmentation=found, arm=reached, views_left=2)
    assert verdict.decision is Decision.PLACE_NEAR


def test_the_stand_shows_another_side_within_a_short_move_and_the_arm_holds_the_tool_there(
    k9: RoverProfile,
) -> None:
    at, normal = spot()
    move = view_move(seen(0.03), k9, at, normal)
    assert not isinstance(move, str)
    assert move.distance_m <= FARTHEST_MOVE_M
    assert abs(move.turn_rad) <= MOST_TURN_RAD
    mast = np.array((*k9.mast.base_m[:2], k9.mast.height_m))
    before, after = mast - at, move.pose.site_from_rover.apply(mast) - at
    turned = wrap_angle(math.atan2(after[1], after[0]) - math.atan2(before[1], before[0]))
    assert abs(turned) >= ANOTHER_SIDE_RAD
    rover = move.pose.site_from_rover.inverse()
    assert isinstance(Arm(k9.arm).solve(rover.apply(at), rover.rotate(normal)), Posture)


def test_a_second_move_does_not_go_back_to_a_side_that_was_seen(k9: RoverProfile) -> None:
    at, normal = spot()
    first = view_move(seen(0.03), k9, at, normal)
    assert not isinstance(first, str)
    there = np.asarray(first.pose.site_from_rover.apply(mast_eye(k9)), dtype=np.float64)
    second = view_move(seen(0.03), k9, at, normal, [there])
    assert not isinstance(second, str)
    eyes = [mast_eye(k9), there, second.pose.site_from_rover.apply(mast_eye(k9))]
    ways = [math.atan2(*(eye - at)[1::-1]) for eye in eyes]
    assert min(abs(wrap_angle(ways[2] - way)) for way in ways[:2]) >= ANOTHER_SIDE_RAD


def test_without_ground_to_stand_on_the_reason_is_told(k9: RoverProfile) -> None:
    at, normal = spot()
    few = cloud_of_points(np.random.default_rng(0).normal(0.0, 1.0, (40, 3)), eye=EYE)
    assert isinstance(view_move(few, k9, at, normal), str)


# ---- as the rover carries it out

REFUSED, BLIND = "refused", "blind"
MOVE = BaseMove(Pose(0.3, 0.0), 0.3, 0.0, 1.0)


class Bench(ArmPlacing):
    """A rover whose safety check asks for the moves of a list, one at each attempt; REFUSED: the hand-off is
    refused there, BLIND: the cloud does not hold the target.
    """

    def __init__(self, asked: list[bool | str], *, goes: bool) -> None:
        self.asked, self.goes = asked, goes
        self.views: list[int] = []
        self.driving: Any = SimpleNamespace(stands=SimpleNamespace(of=lambda name: None))
        self.hardware: Any = SimpleNamespace(believed=Pose(0.0, 0.0), profile=load_profile("k9"))
        self.seen: list[int] = []
        self.moves: Any = SimpleNamespace(to=self._to)

    def _to(self, followed: object, pose: Pose) -> Generator[Step, None, bool]:
        yield Step(1, 1.0)
        return self.goes

    def _nearer(self, attempt: Attempt) -> BaseMove | None:
        return None

    def _attempt(
        self, followed: Followed, views_left: int, seen_from: Sequence[Array]
    ) -> Generator[Step, None, Attempt]:
        yield Step(1, 1.0)
        self.views.append(views_left)
        self.seen.append(len(seen_from))
        asked = self.asked.pop(0)
        if asked == REFUSED:
            raise TrackerError(f"{REFUSED} with {views_left} left")
        reason = Reason.OUTSIDE_CLOUD if asked == BLIND else Reason.EDGE
        move = MOVE if asked is True else None
        return cast("Attempt", SimpleNamespace(verdict=SimpleNamespace(base_move=move, reason=reason)))

    def _another_side(self, followed: Followed, seen_from: Sequence[Array]) -> BaseMove | None:
        return MOVE

    def tried(self) -> list[int]:
        """Return for each attempt how many moves to another view were left."""
        followed: Any = SimpleNamespace(target=SimpleNamespace(id="T"))
        for _ in self._attempt_moving(followed):
            pass
        return self.views


def test_each_move_leaves_one_view_less() -> None:
    assert Bench([True, False], goes=True).tried() == [2, 1]
    assert Bench([True, True, True], goes=True).tried() == [2, 1, 0]


def test_each_stand_is_told_from_where_the_target_was_seen_before() -> None:
    far = Bench([True, True, False], goes=True)
    far.tried()
    assert far.seen == [0, 1, 2]
    stuck = Bench([True, False], goes=False)
    stuck.tried()
    assert stuck.seen == [0, 0]


def test_where_the_rover_cannot_go_it_decides_by_what_it_sees_from_here() -> None:
    assert Bench([True, False], goes=False).tried() == [2, 0]
    assert Bench([True, True], goes=False).tried() == [2, 0]


@pytest.mark.parametrize("unseen", [REFUSED, BLIND])
def test_a_target_that_is_not_seen_from_here_is_looked_at_from_another_side(unseen: str) -> None:
    """It was refused at once: it lay at the end of what the hazcams range (day 921031712, T4)."""
    assert Bench([unseen, False], goes=True).tried() == [2, 1]
    assert Bench([unseen, unseen, False], goes=True).tried() == [2, 1, 0]


def test_a_hand_off_that_is_refused_from_all_sides_tells_its_first_reason() -> None:
    bench = Bench([REFUSED, REFUSED, REFUSED], goes=True)
    with pytest.raises(TrackerError, match="refused with 2 left"):
        bench.tried()
    assert bench.views == [2, 1, 0]
    stuck = Bench([REFUSED], goes=False)
    with pytest.raises(TrackerError, match="refused with 2 left"):
        stuck.tried()
    assert stuck.views == [2]
