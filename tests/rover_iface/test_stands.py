"""A rover that finds its stand closed by what the map did not show stands elsewhere."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from executive.ports import Command, CommandId
from rover_iface.behaviour.action import Action, Outcome, Step
from rover_iface.behaviour.driving import ARRIVED_M, Driving
from rover_iface.behaviour.hardware import Drive
from rover_iface.frames import Pose
from rover_iface.navigation.navigator import Way, end_of
from rover_iface.navigation.sensor import GroundRaster, StereoSensor
from rover_iface.profile import load_profile
from rover_iface.telemetry import TrackState
from tests.rover_iface.worlds import bumpy

K9 = load_profile("k9")
TARGET = np.array([4.0, 0.0, 0.3])
PLANNED = Pose(3.15, 0.0, heading=0.0)
COMMAND = Command(CommandId("run", "navigate-T1", 1), "navigate", {"target": "T1", "mode": "avoid"}, {})


class Ground:
    """A rover without pictures that goes where it is told, and sees the ground as its stereo cameras do."""

    def __init__(self, rise: Callable[[Any, Any], Any]) -> None:
        self.profile = K9
        self.raster = GroundRaster.of(bumpy(rise), 9.0)
        self.sensor, self.rng = StereoSensor(K9), np.random.default_rng(1)
        self.believed, self.eye = Pose(0.0, 0.0), self.sensor.eye
        self.drawn_j, self.travelled_m, self.keeps_products = 0.0, 0.0, False
        self.report = self.write_product = self.write_log = lambda *_: None
        target = SimpleNamespace(
            id="T1", point=tuple(TARGET), normal=(-0.6, 0.0, 0.8), observation_point=PLANNED, kind="rock"
        )
        self.follower: Any = SimpleNamespace(
            targets={"T1": target},
            alive=list,
            followed={},
            position=lambda _name: TARGET,
            state=lambda _name: TrackState.TRACKED,
            leave_refused=self.report,
            set_ranges=self.report,
            write_views=self.report,
            came=self.report,
            update_all=lambda: iter(()),
        )

    def spend(self, _activity: str, _share: float = 1.0) -> Generator[Step, None, float]:
        yield Step(1, 0.0)
        return 0.0

    def drive(self, way: Way) -> Generator[Step, None, Drive]:
        yield Step(1, 0.0)
        x, y, heading = end_of(self.believed, way.turn_rad, way.curvature_1_m, way.length_m)
        self.believed = Pose(x, y, heading=heading)
        self.travelled_m += abs(way.length_m)
        return Drive()

    def cost(self, *, around: bool) -> float:
        return 1.0

    def look(self, *, around: bool) -> Any:
        return self.sensor.look(self.raster, self.believed, self.rng, around=around)

    def ahead(self) -> None:
        return None


def rock(x: float, y: float, at: tuple[float, float], radius_m: float) -> Any:
    return np.where(np.hypot(x - at[0], y - at[1]) < radius_m, 0.3, 0.0)


def on_the_stand(x: Any, y: Any) -> Any:
    return np.maximum(rock(x, y, (4.0, 0.0), 0.2), rock(x, y, (2.7, 0.0), 0.6))


def driven(ground: Ground) -> tuple[Outcome, Driving]:
    hardware: Any = ground
    driving = Driving(hardware, hardware, ground.follower)
    return ended(driving.navigate(COMMAND)), driving


def ended(action: Action) -> Outcome:
    """Return what an action comes to."""
    while True:
        try:
            next(action)
        except StopIteration as stop:
            outcome: Outcome = stop.value
            return outcome


def test_a_stand_on_a_rock_that_no_map_showed_is_exchanged_for_another() -> None:
    ground = Ground(on_the_stand)
    outcome, driving = driven(ground)
    assert outcome.success, outcome.reason
    stand, here = driving.stands.of("T1"), ground.believed
    assert stand is not None
    assert math.hypot(stand.x - PLANNED.x, stand.y - PLANNED.y) > 0.3
    assert math.hypot(stand.x - here.x, stand.y - here.y) <= ARRIVED_M
    ahead = math.atan2(TARGET[1] - here.y, TARGET[0] - here.x)
    assert abs(math.remainder(ahead - here.heading, math.tau)) < math.radians(40)


def test_a_stand_that_is_free_is_kept() -> None:
    outcome, driving = driven(Ground(lambda x, y: rock(x, y, (4.0, 0.0), 0.2)))
    assert outcome.success, outcome.reason
    assert driving.stands.of("T1") == PLANNED


def test_a_stand_that_no_way_round_a_ledge_leads_to_is_exchanged_for_one_before_the_ledge() -> None:
    """It is open ground; the rover goes along the ledge until it has lost patience, far from its target."""
    ground = Ground(lambda x, y: np.where(np.abs(x - TARGET[0]) < 0.15, 0.3, 0.0))
    behind = Pose(5.0, 0.0, heading=math.pi)
    target = ground.follower.targets["T1"]
    target.observation_point, target.normal = behind, (0.0, 0.0, 1.0)
    outcome, driving = driven(ground)
    assert outcome.success, outcome.reason
    assert ground.believed.x < TARGET[0]
    assert driving.stands.of("T1") != behind


class Wedged(Ground):
    """A rover that touches a rock whenever it turns on its stand, and whenever it backs off there."""

    def drive(self, way: Way) -> Generator[Step, None, Drive]:
        on_it = math.hypot(PLANNED.x - self.believed.x, PLANNED.y - self.believed.y) <= ARRIVED_M
        if on_it and (way.length_m < 0.0 or (way.length_m == 0.0 and abs(way.turn_rad) > 0.2)):
            yield Step(1, 0.0)
            return Drive(hazard="belly")
        return (yield from super().drive(way))


def _wedged(turned_rad: float) -> Ground:
    ground = Wedged(lambda x, y: rock(x, y, (4.0, 0.0), 0.2))
    target = ground.follower.targets["T1"]
    target.observation_point = Pose(PLANNED.x, PLANNED.y, heading=turned_rad)
    return ground


def test_a_touch_in_the_last_turn_to_a_target_leaves_the_rest_to_the_arm() -> None:
    """One ended 0.6 m from its goal, and no move for the arm was looked for."""
    outcome, _ = driven(_wedged(0.6))
    assert outcome.success, outcome.reason


def test_after_a_touch_in_the_last_turn_the_targets_are_looked_at() -> None:
    """The rover has turned a part of it, or backed off."""
    ground, looks = _wedged(0.6), []

    def look() -> Generator[Step, None, None]:
        looks.append(ground.believed)
        yield Step(1, 0.0)

    ground.believed, ground.follower.update_all = PLANNED, look
    hardware: Any = ground
    turn = Driving(hardware, hardware, ground.follower)._turn_to(0.6, "T1", looks_at_targets=True)
    assert list(turn)
    assert looks == [PLANNED]


def test_a_touch_in_the_last_turn_of_a_drive_to_a_place_fails_it() -> None:
    ground = _wedged(0.6)
    hardware: Any = ground
    place = {"x": PLANNED.x, "y": PLANNED.y, "heading": 0.6, "mode": "avoid"}
    command = Command(CommandId("run", "navigate", 1), "navigate", place, {})
    assert ended(Driving(hardware, hardware, ground.follower).navigate(command)).reason == "hazard: belly"


def test_without_another_stand_the_drive_says_how_near_it_came(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rover_iface.behaviour.stands.stands_near", lambda *_: [])
    outcome, _ = driven(Ground(on_the_stand))
    assert not outcome.success
    assert outcome.reason.startswith("no nearer than")
