"""Drives that people take out or draw themselves."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner.errors import NetworkError
from planner.path_network import (
    START,
    DriveRule,
    KeepOut,
    NetworkOptions,
    NetworkRequest,
    ObservationPoint,
    Pose,
    Target,
    build_network,
)
from tests.planner.path_network.worlds import random_world

ROCK = KeepOut("K1", [(4.0, -1.0), (6.0, -1.0), (6.0, 1.0), (4.0, 1.0)])


def yard(*rules: DriveRule, keep_outs: tuple[KeepOut, ...] = ()) -> NetworkRequest:
    """Return two targets ten metres apart, east of the start, with nothing between them."""
    return NetworkRequest(
        Pose(0.0, 0.0),
        (Target("A", 0.0, 5.0), Target("B", 10.0, 0.5)),
        (
            ObservationPoint("A.1", "A", Pose(0.0, 4.2, math.pi / 2)),
            ObservationPoint("B.1", "B", Pose(10.0, 0.0, math.pi / 2)),
            ObservationPoint("B.2", "B", Pose(9.0, 0.0, 0.0)),
        ),
        keep_outs,
        options=NetworkOptions(stretch=0.0, maximum_loss=1.0),
        drive_rules=rules,
    )


def test_a_forbidden_drive_is_gone_both_ways_from_every_stand_and_nothing_else_is() -> None:
    free, ruled = build_network(yard()), build_network(yard(DriveRule("A", "B")))
    gone = {(r.origin, r.destination) for r in free.routes} - {
        (r.origin, r.destination) for r in ruled.routes
    }
    assert gone == {("A.1", "B.1"), ("B.1", "A.1"), ("A.1", "B.2"), ("B.2", "A.1")}
    assert {m.reason for m in ruled.missing} == {"the drive was taken out by hand"}
    for route in ruled.routes:
        assert route == replace(
            free.route(route.origin, route.destination) or route, segments=route.segments
        ), "what was not forbidden is as it was"


def test_a_target_without_any_drive_from_the_start_says_that_a_hand_took_it_out() -> None:
    network = build_network(yard(DriveRule(START, "A"), DriveRule("A", "B")))
    assert [(u.target, u.reason) for u in network.unreachable] == [("A", "the drive was taken out by hand")]


def test_a_drawn_way_is_driven_as_drawn_and_back_the_same_way() -> None:
    via = ((3.0, -3.0), (7.0, -3.0))
    network = build_network(yard(DriveRule(START, "B", via), keep_outs=(ROCK,)))
    there, back = network.route(START, "B.1"), network.route("B.1", START)
    assert there is not None
    assert back is not None
    assert there.points == ((0.0, 0.0), *via, (10.0, 0.0))
    assert back.points == there.points[::-1]
    assert there.length_m == pytest.approx(math.hypot(3, 3) + 4.0 + math.hypot(3, 3))


def test_a_way_drawn_from_the_far_end_is_the_same_way() -> None:
    via = ((3.0, -3.0), (7.0, -3.0))
    forward = build_network(yard(DriveRule(START, "B", via))).route(START, "B.1")
    backward = build_network(yard(DriveRule("B", START, via[::-1]))).route(START, "B.1")
    assert forward is not None
    assert backward is not None
    assert forward.points == backward.points
    assert dict(forward.p_lose) == pytest.approx(dict(backward.p_lose))


@pytest.mark.parametrize("via", [(), ((3.0, 1.2), (7.0, 1.2))], ids=["across", "within the clearance"])
def test_a_drawn_way_too_near_to_something_is_never_driven(
    via: tuple[tuple[float, float], ...],
) -> None:
    network = build_network(yard(DriveRule(START, "B", via), keep_outs=(ROCK,)))
    assert network.route(START, "B.1") is None
    reasons = {m.reason for m in network.missing if m.origin == START}
    assert reasons == {"the path drawn by hand comes too near to keep-out K1"}


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 10_000))
def test_rules_change_no_other_route(seed: int) -> None:
    request = random_world(seed, targets=5)
    free = build_network(request)
    ruled = build_network(replace(request, drive_rules=(DriveRule("T0", "T1"), DriveRule(START, "T2", ()))))
    touched = {frozenset(("OT0", "OT1")), frozenset((START, "OT2"))}
    for route in free.routes:
        if frozenset((route.origin, route.destination)) not in touched:
            same = ruled.route(route.origin, route.destination)
            assert same is not None
            assert same.points == route.points


@pytest.mark.parametrize(
    ("rules", "message"),
    [
        ((DriveRule("A", "C"),), "target 'C' is not given"),
        ((DriveRule("A", "A"),), "both ends are the same"),
        ((DriveRule("A", "B"), DriveRule("B", "A", ())), "another one for the same drive"),
        ((DriveRule("A", "B", ((math.nan, 0.0),)),), "not a finite number"),
    ],
)
def test_a_wrong_rule_is_named(rules: tuple[DriveRule, ...], message: str) -> None:
    with pytest.raises(NetworkError, match=message):
        build_network(yard(*rules))
