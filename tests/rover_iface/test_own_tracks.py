"""A rover that sees no safe path goes back in its own tracks before it gives up."""

from __future__ import annotations

import math
from collections.abc import Generator
from types import SimpleNamespace
from typing import Any

import pytest

from executive.ports import Command, CommandId
from rover_iface.behaviour.action import Outcome, Step
from rover_iface.behaviour.driving import RETRACE_M, RETRACES, Driving
from rover_iface.behaviour.hardware import Drive
from rover_iface.frames import Pose
from rover_iface.navigation.navigator import Way
from rover_iface.profile import load_profile

GOAL = Command(CommandId("run", "navigate-T1", 1), "navigate", {"x": 3.0, "y": 0.0}, {})


def nothing(*_: object) -> None:
    """Stand for what these drives do not need."""


class Ground:
    """A rover on flat ground that goes where it is told, but not onto a stretch of x that is `blocked`."""

    def __init__(self, blocked: tuple[float, float] | None = None) -> None:
        self.profile = load_profile("k9")
        self.believed = Pose(0.0, 0.0)
        self.drawn_j, self.travelled_m, self.keeps_products = 0.0, 0.0, False
        self.blocked = blocked
        self.xs = [0.0]
        self.report = self.write_product = self.write_log = nothing
        self.follower: Any = SimpleNamespace(
            targets={}, alive=list, leave_refused=nothing, set_ranges=nothing, write_views=nothing,
            update_all=lambda: iter(()),
        )  # fmt: skip

    def drive(self, way: Way) -> Generator[Step, None, Drive]:
        yield Step(1, 0.0)
        here, heading = self.believed, self.believed.heading + way.turn_rad
        x = here.x + way.length_m * math.cos(heading)
        if self.blocked and self.blocked[0] < x < self.blocked[1]:
            return Drive(hazard="wheel")
        self.believed = Pose(x, here.y + way.length_m * math.sin(heading), heading=heading)
        self.travelled_m += abs(way.length_m)
        self.xs.append(x)
        return Drive()


def flown(ground: Ground, looks: Any, monkeypatch: pytest.MonkeyPatch) -> Outcome:
    """Return what a drive to the goal comes to where looks show the way that `looks` gives for a place."""

    def look(self: Driving, goal: tuple[float, float], name: str) -> Generator[Step, None, Way | None]:
        yield Step(1, 0.0)
        way: Way | None = looks(ground.believed)
        return way

    monkeypatch.setattr(Driving, "_look_and_choose", look)
    sight: Any = SimpleNamespace()
    hardware: Any = ground
    driving = Driving(hardware, sight, ground.follower)
    action = driving.navigate(GOAL)
    while True:
        try:
            next(action)
        except StopIteration as stop:
            outcome: Outcome = stop.value
            return outcome


def test_it_goes_on_from_where_it_sees_a_way_again(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[float] = []

    def looks(here: Pose) -> Way | None:
        seen.append(here.x)
        if len(seen) > 5:
            return Way(-here.heading, 0.0, 3.0 - here.x)
        return Way(0.0, 0.0, 0.4) if len(seen) < 4 else None

    ground = Ground()
    outcome = flown(ground, looks, monkeypatch)
    assert outcome.success
    # three steps of 0.4 m, no way there; two steps back are half a metre, no way there either; then on
    assert seen == pytest.approx([0.0, 0.4, 0.8, 1.2, 0.4, 0.0])
    assert ground.xs[-1] == pytest.approx(3.0)


def test_it_gives_up_when_its_tracks_are_used_up(monkeypatch: pytest.MonkeyPatch) -> None:
    steps = iter(range(6))
    ground = Ground()
    outcome = flown(
        ground, lambda _: Way(0.0, 0.0, 0.4) if next(steps, None) is not None else None, monkeypatch
    )
    assert not outcome.success
    assert outcome.reason == "no safe path"
    back_m = max(ground.xs) - ground.xs[-1]
    assert RETRACES * RETRACE_M <= back_m <= RETRACES * RETRACE_M + 1.2
    fresh = Ground()
    assert flown(fresh, lambda _: None, monkeypatch).reason == "no safe path"
    assert fresh.travelled_m == 0.0


def test_what_stands_in_its_tracks_ends_the_way_back(monkeypatch: pytest.MonkeyPatch) -> None:
    ground = Ground()
    seen: list[float] = []

    def looks(here: Pose) -> Way | None:
        seen.append(here.x)
        if len(seen) < 4:
            return Way(0.0, 0.0, 0.4)
        ground.blocked = (-1.0, 0.7)
        return None

    outcome = flown(ground, looks, monkeypatch)
    assert outcome.reason == "no safe path"
    assert seen[3:] == pytest.approx([1.2, 0.8])
