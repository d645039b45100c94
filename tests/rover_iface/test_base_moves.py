"""Base moves for a placement: what they use is told, what stops them is told."""

from __future__ import annotations

from collections.abc import Generator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from executive.ports import Command, CommandId
from rover_iface.behaviour import base_moves, placing, surroundings
from rover_iface.behaviour.action import Outcome, Step
from rover_iface.behaviour.base_moves import BaseMoves
from rover_iface.behaviour.driving import STUCK
from rover_iface.behaviour.hardware import Contact
from rover_iface.behaviour.placing import HandedOff, Placing
from rover_iface.errors import PlacementError
from rover_iface.frames import Pose
from rover_iface.placement.verdict import BaseMove
from rover_iface.profile import load_profile

MOVE_J, LOOK_J, MEASURE_J = 700.0, 300.0, 50.0


class Bench:
    """Hardware, sight and driving of a rover whose arm reaches its target from its stand alone."""

    def __init__(self, *, stand: Pose | None, trouble: str = "") -> None:
        self.profile = load_profile("k9")
        self.believed = Pose(0.0, 0.0)
        self.drawn_j, self.spent = 0.0, dict[str, float]()
        self.stood, self.trouble, self.keeps_products = stand, trouble, False
        self.sight = self.stands = self
        self.follower: Any = SimpleNamespace(
            targets={"T": None}, in_sight=lambda name: self.followed, forget=lambda name: None
        )
        self.followed: Any = SimpleNamespace(
            target=SimpleNamespace(id="T", normal=(0.0, 0.0, 1.0)),
            update=SimpleNamespace(position=np.array([1.0, 0.0, 0.0]), covariance=1e-6 * np.eye(3)),
        )

    def spend(self, activity: str, share: float = 1.0) -> Generator[Step, None, float]:
        used = LOOK_J * share if activity == "navigator_step" else 1.0
        self.spent[activity] = self.spent.get(activity, 0.0) + share
        self.drawn_j += used
        yield Step(1, used)
        return used

    def operate(self, instrument: object, dwell_s: float = 0.0) -> Generator[Step, None, float]:
        self.drawn_j += MEASURE_J
        yield Step(1, MEASURE_J)
        return MEASURE_J

    def instrument_delivers(self, instrument: object) -> bool:
        return True

    def at_this_stop(self, followed: Any) -> HandedOff:
        return HandedOff(followed.update, 0.0)

    def reach(self, target: str, point: object, instrument: str) -> Contact:
        if self.believed != self.stood:
            raise PlacementError(f"target {target} is out of reach")
        return Contact(True, "", np.asarray(point, dtype=float))

    def of(self, name: str) -> Pose | None:
        return self.stood

    def shift(self, pose: Pose) -> Generator[Step, None, str]:
        self.drawn_j += MOVE_J
        yield Step(1, MOVE_J)
        if not self.trouble:
            self.believed = pose
        return self.trouble

    def cost(self, *, around: bool) -> float:
        return 2.0

    def look(self, *, around: bool) -> list[object]:
        return []


def _placed(bench: Any) -> Outcome:
    places = Placing(bench, bench, bench.follower, bench, BaseMoves(bench, bench))
    action = places.place(Command(CommandId("r", "c", 1), "ipplaceinstrument", {"target": "T"}))
    try:
        while True:
            next(action)
    except StopIteration as stop:
        found: Outcome = stop.value
        return found


def test_a_placement_that_moved_the_rover_tells_what_the_move_used() -> None:
    bench = Bench(stand=Pose(0.3, 0.0))
    outcome = _placed(bench)
    assert outcome.success
    assert outcome.values["energy_j"] == pytest.approx(bench.drawn_j)
    assert bench.drawn_j >= MOVE_J + MEASURE_J


@pytest.mark.parametrize(("far_m", "moves"), [(0.3, 1), (0.8, 2), (1.1, 0)])
def test_a_stand_beyond_one_move_is_come_to_by_two(
    far_m: float, moves: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A target known to 4 mm was refused 0.8 m from its stand: the arm did not reach it."""
    bench = Bench(stand=Pose(far_m, 0.0))

    def seen(self: BaseMoves, followed: Any) -> Generator[Step, None, list[Pose]]:
        yield Step(1, 0.0)
        return [Pose(far_m, 0.0)]

    monkeypatch.setattr(BaseMoves, "_by_the_ground", seen)
    outcome = _placed(bench)
    assert outcome.success is (moves > 0)
    assert bench.drawn_j == pytest.approx(moves * MOVE_J, abs=MEASURE_J + 10.0)


def test_a_look_at_the_ground_takes_its_time_and_energy() -> None:
    bench = Bench(stand=None)
    outcome = _placed(bench)
    assert not outcome.success
    assert bench.spent["navigator_step"] == 2.0
    assert outcome.values["energy_j"] == pytest.approx(bench.drawn_j)


def test_a_wheel_that_is_stuck_ends_a_placement_and_is_told() -> None:
    bench = Bench(stand=Pose(0.3, 0.0), trouble=STUCK)
    outcome = _placed(bench)
    assert not outcome.success
    assert outcome.reason == "wheel stuck on the move for target T"
    assert outcome.values["energy_j"] == pytest.approx(bench.drawn_j)


def test_a_move_that_ends_at_a_hazard_is_tried_from() -> None:
    bench = Bench(stand=Pose(0.3, 0.0), trouble="hazard: step")
    outcome = _placed(bench)
    assert outcome.reason == "target T is out of reach"


@pytest.mark.parametrize(
    ("for_the_face", "for_any", "made"),
    [
        (Pose(0.3, 0.0), Pose(0.1, 0.1), True),
        (Pose(2.0, 0.0), Pose(0.3, 0.0), True),  # too far to go without a look
        (None, Pose(0.3, 0.0), True),
        (Pose(0.2, 0.2), Pose(0.3, 0.0), False),  # one that serves the face is gone to, and not the other
        (None, None, False),
    ],
)
def test_the_rover_goes_where_the_arm_serves_the_face_that_was_designated(
    for_the_face: Pose | None, for_any: Pose | None, made: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    def move(_cloud: object, _profile: object, point: object, normal: object) -> BaseMove | str:
        pose = for_any if normal is None else for_the_face
        return "none" if pose is None else BaseMove(pose, 0.0, 0.0, 1.0)

    class Looking(Bench):
        def look(self, *, around: bool) -> list[object]:
            return [np.zeros((1, 3))]

        def of(self, name: str) -> Pose | None:
            return None

    monkeypatch.setattr(base_moves, "base_move", move)
    monkeypatch.setattr(surroundings, "cloud_of_points", lambda points: points)
    monkeypatch.setattr(base_moves, "MOVES", 1)
    monkeypatch.setattr(placing, "MOVES", 1)
    assert _placed(Looking(stand=Pose(0.3, 0.0))).success is made
