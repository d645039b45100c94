"""Terrain, targets and requests become a planning problem."""

from __future__ import annotations

import dataclasses
import math
from functools import cache
from typing import Any

import numpy as np
import pytest
import shapely

from ground.day.prepare import PreparedDay, calibration_of, prepare_day, stand_for
from ground.demo.mission import bare_day, demo_mission, target_at
from ground.errors import InvalidInputError
from ground.reports.figures import ribbons
from mission import After, Day, KeepOut, Request, Sky, SunElevation, Target, Tracked, Window
from planner.path_network import TRACK_START, ActivityFit
from planner.problem import Kind, problem_from_dict, problem_to_dict
from rover_iface.errors import PlacementError
from rover_iface.profile import RoverProfile, load_profile
from rover_iface.terrain import Terrain, generate_terrain
from tests.rover_iface.worlds import bumpy
from tests.shared import shared


@cache
def _terrain() -> Terrain:
    return generate_terrain(1)


@cache
def _profile() -> RoverProfile:
    return load_profile("k9")


@cache
def _mission() -> Day:
    return demo_mission(_terrain(), _profile(), seed=1)


@cache
def _prepared() -> PreparedDay:
    return prepare_day(_terrain(), _profile(), _mission())


def _asking(
    *requests: Request, targets: tuple[Target, ...] | None = None, keep_outs: tuple[KeepOut, ...] = ()
) -> Day:
    """Return the demo's day with other requests."""
    day = _mission()
    return dataclasses.replace(
        day, requests=requests, targets=day.targets if targets is None else targets, keep_outs=keep_outs
    )


def test_demo_mission_has_ten_targets_and_fourteen_requests() -> None:
    day = _mission()
    assert (len(day.targets), len(day.requests)) == (10, 14)
    assert {r.target_id for r in day.requests} == {t.id for t in day.targets}
    assert any(r.window for r in day.requests)
    assert any(r.after for r in day.requests)


def test_demo_targets_lie_outside_the_keep_outs() -> None:
    """Seed 51739 drew a rock that the arm reached from beside a keep-out, and no day could be made of it."""
    day = demo_mission(generate_terrain(51739), _profile(), seed=51739)
    for keep_out in day.keep_outs:
        region = shapely.Polygon(keep_out.polygon_m)
        assert not [t.id for t in day.targets if shapely.contains_xy(region, *t.point_site[:2])]


def test_a_bare_day_is_the_demo_mission_before_anything_is_asked_for() -> None:
    bare = bare_day(_terrain(), _profile(), seed=1)
    assert (bare.targets, bare.requests) == ((), ())
    assert dataclasses.replace(bare, targets=_mission().targets, requests=_mission().requests) == _mission()


@pytest.mark.parametrize("everywhere", [False, True])
def test_the_rover_starts_where_it_can_turn(everywhere: bool) -> None:
    """On 923451792 it stood between two rocks of 30 cm, and its day ended there: no safe path."""

    def rocks(x: np.ndarray[Any, Any], y: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        near = (abs(x) < 1.5) & (abs(y) < 1.5) | everywhere
        return np.where(near & (np.hypot(x % 0.8 - 0.4, y % 0.8 - 0.4) < 0.15), 0.3, 0.0)

    start = bare_day(bumpy(rocks), _profile(), seed=1).start
    assert (max(abs(start.east_m), abs(start.north_m)) > 1.5) is not everywhere


def test_demo_mission_depends_on_its_seed_alone() -> None:
    again = demo_mission(_terrain(), _profile(), seed=1)
    assert again == _mission()
    assert demo_mission(_terrain(), _profile(), seed=2) != _mission()


def test_a_day_becomes_a_problem_the_planner_reads() -> None:
    problem = _prepared().problem
    assert len(problem.observations) == 14 - len(_prepared().refused)
    assert len(problem.targets) == 10
    assert {leg.origin for leg in problem.legs} >= {"start", "T1"}


def test_a_normal_of_any_length_becomes_a_direction_of_the_problem() -> None:
    """A day's file of which a normal was no unit vector was refused, which nobody had asked it to be."""
    day = _mission()
    longer = dataclasses.replace(day.targets[0], normal_site=(0.0, 0.3, 4.0))
    asking = [request for request in day.requests if request.target_id == longer.id]
    found = prepare_day(_terrain(), _profile(), _asking(*asking, targets=(longer,)))
    assert found.problem.targets[0].normal == pytest.approx((0.0, 0.07479, 0.9972), abs=1e-5)


def test_requests_travel_through_the_problem_by_their_ids() -> None:
    for observation in _prepared().problem.observations:
        assert observation.refs["request"] == observation.id


def test_a_remote_observation_that_asks_for_its_track_is_planned_with_it() -> None:
    day = _asking(
        Request("R1", "T1", "scicam", 5.0, (Tracked(),)),
        Request("R2", "T2", "scicam", 5.0),
        Request("R3", "T3", "mi", 5.0, (Tracked(),)),
    )
    prepared = prepare_day(_terrain(), _profile(), day)
    found = {o.id: o for o in prepared.problem.observations}
    assert {name: (o.kind.value, o.needs_track) for name, o in found.items()} == {
        "R1": ("image", True),
        "R2": ("image", False),
        "R3": ("place", True),
    }
    lost = [leg.p_lose for leg in prepared.problem.legs]
    assert any("T1" in table for table in lost)


def test_a_request_after_one_that_is_refused_is_refused_too() -> None:
    never = SunElevation(math.radians(89.5))
    day = _asking(
        Request("R1", "T1", "scicam", 5.0, (never,)),
        Request("R2", "T2", "scicam", 5.0, (After("R1"),)),
        Request("R3", "T3", "scicam", 5.0, (After("R2"),)),
        Request("R4", "T3", "scicam", 5.0),
    )
    prepared = prepare_day(_terrain(), _profile(), dataclasses.replace(day, sky=Sky(latitude_deg=60.0)))
    assert [str(o.id) for o in prepared.problem.observations] == ["R4"]
    told = {r.request_id: r.reason for r in prepared.refused}
    assert told["R2"] == "comes after observation request R1, which cannot be made"
    assert told["R3"] == "comes after observation request R2, which cannot be made"


def test_routes_keep_out_of_keep_outs() -> None:
    from shapely.geometry import LineString, Polygon

    rings = [Polygon(k.polygon_m) for k in _mission().keep_outs]
    for leg in _prepared().problem.legs:
        way = LineString(leg.route) if len(leg.route) > 1 else None
        assert way is None or not any(way.crosses(ring) or way.within(ring) for ring in rings)


def test_arm_reaches_every_target_of_a_placement_from_its_observation_point() -> None:
    day = _mission()
    points = {t.id: t.point_site for t in day.targets}
    for request in day.requests:
        if request.instrument != "mi":
            continue
        stand = _prepared().observation_points[request.target_id]
        east, north, _ = points[request.target_id]
        shoulder_x, _, _ = _profile().arm.shoulder_m
        x = stand.east_m + shoulder_x * math.cos(stand.heading_rad)
        y = stand.north_m + shoulder_x * math.sin(stand.heading_rad)
        assert math.hypot(east - x, north - y) <= _profile().arm.reach_m


def test_observation_point_set_by_hand_is_kept() -> None:
    day = _mission()
    pose = stand_for(_terrain(), _profile(), day.start, day.targets[0], "scicam", count=3)[-1]
    request = Request("R1", "T1", "scicam", 5.0, observation_point=pose)
    prepared = prepare_day(_terrain(), _profile(), _asking(request, targets=day.targets[:1]))
    assert prepared.observation_points == {"T1": pose}


def test_request_without_reachable_observation_point_is_refused_with_the_reason() -> None:
    day = _mission()
    start = day.start
    target = target_at(_terrain(), "T1", "walled in", start.east_m + 6.0, start.north_m)
    ring = tuple(
        (target.point_site[0] + 4.0 * math.cos(a), target.point_site[1] + 4.0 * math.sin(a))
        for a in (k * math.pi / 4 for k in range(8))
    )
    request = Request("R1", "T1", "mi", 5.0, (Tracked(),))
    day = _asking(request, targets=(target,), keep_outs=(KeepOut("wall", ring),))
    prepared = prepare_day(_terrain(), _profile(), day)
    assert [r.request_id for r in prepared.refused] == ["R1"]
    assert "walled in" in prepared.refused[0].reason
    assert "keep-out" in prepared.refused[0].reason
    assert prepared.problem.targets == ()


def test_target_under_an_overhang_of_its_own_normal_is_refused_with_figures() -> None:
    day = _mission()
    down = dataclasses.replace(day.targets[0], normal_site=(0.0, 0.0, -1.0))
    with pytest.raises(PlacementError, match="no observation point for mi"):
        stand_for(_terrain(), _profile(), day.start, down, "mi")


@pytest.mark.parametrize(
    ("request_", "message"),
    [
        (
            Request("R9", "T1", "laser", 1.0, (Tracked(),)),
            'R9: rover "k9" has no instrument "laser"; it carries microscopic_imager, science_camera',
        ),
        (Request("R9", "T1", "mi", 1.0), "R9: mi is placed by the arm, so its target must be tracked"),
    ],
)
def test_a_request_that_the_rover_cannot_serve_is_refused(request_: Request, message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        prepare_day(_terrain(), _profile(), _asking(request_))


def test_a_constraint_on_the_sun_becomes_a_window_of_the_problem() -> None:
    low = SunElevation(at_most_rad=math.radians(20))
    day = _asking(
        Request("R1", "T1", "scicam", 5.0, (SunElevation(math.radians(40)),)),
        Request("R2", "T2", "scicam", 5.0, (Window(0.0, 60.0), low)),
    )
    prepared = prepare_day(_terrain(), _profile(), dataclasses.replace(day, sky=Sky(start_lmst_h=10.5)))
    (observation,) = prepared.problem.observations
    assert observation.window_s is not None
    clock = Sky(start_lmst_h=10.5).clock()
    for t_s in observation.window_s:
        assert clock.elevation_rad(t_s) >= math.radians(39.9)
    assert [(r.request_id, "20 degrees at no time" in r.reason) for r in prepared.refused] == [("R2", True)]


def test_heights_of_the_network_are_those_of_the_terrain() -> None:
    from ground.day.prepare import network_heights

    grid = network_heights(_terrain(), [(0.0, 0.0), (4.0, 9.0)])
    for row, column in ((0, 0), (3, 40), (grid.heights_m.shape[0] - 1, 5)):
        east = grid.origin_east_m + column * grid.spacing_m
        north = grid.origin_north_m - row * grid.spacing_m
        assert grid.heights_m[row, column] == pytest.approx(float(_terrain().height(east, north)), abs=1e-6)


def test_ribbons_follow_the_routes_and_know_their_branch() -> None:
    leg = {"from": "start", "to": "T1", "route": [[0, 0], [1, 0]]}
    other = {"from": "T1", "to": "T2", "route": [[1, 0], [1, 2]]}
    tree = {
        "plan": [
            {"op": "navigate", "to": "T1", "p_reached": 1.0},
            {
                "op": "branch",
                "options": [{"when": [], "plan": [{"op": "visit", "target": "T2", "p_reached": 0.25}]}],
            },
        ]
    }
    drawn = list(ribbons({"legs": [leg, other]}, tree))
    assert [(r.points_m[-1], r.probability, r.branch) for r in drawn] == [
        ((1.0, 0.0), 1.0, False),
        ((1.0, 2.0), 0.25, True),
    ]


def test_murray_buttes_holds_a_day() -> None:
    from rover_iface.terrain import load_terrain

    terrain = load_terrain(shared("data/terrain/msl_onsight/murray_buttes"))
    prepared = prepare_day(terrain, _profile(), demo_mission(terrain, _profile(), seed=1))
    assert prepared.refused == ()
    assert len(prepared.problem.legs) == 100


def test_successes_that_go_together_stand_in_the_problem_of_the_instruments_asked_for() -> None:
    plain = _prepared().problem
    placed = ActivityFit("mi", 0.9, 504.0, 120.0, 15_400.0, 2000.0, tried=40, succeeded=36, p_se=0.06)
    together = dataclasses.replace(placed, intraday_correlation=0.2, intraday_correlation_se=0.1, days=12)
    unasked = dataclasses.replace(together, name="no instrument")
    found = {
        which: prepare_day(
            _terrain(),
            _profile(),
            _mission(),
            calibration=dataclasses.replace(calibration_of(_profile()), activities=activities),
        ).problem
        for which, activities in {"alone": (placed,), "together": (together, unasked)}.items()
    }
    assert "intraday_correlation" not in problem_to_dict(plain)
    assert found["alone"].intraday_correlation == {}
    assert set(found["together"].intraday_correlation) == {"mi"}
    assert 0.2 < found["together"].intraday_correlation["mi"] < 0.25
    assert problem_from_dict(problem_to_dict(found["together"])) == found["together"]
    alone = dataclasses.replace(found["together"], intraday_correlation={})
    assert alone.digest() == found["alone"].digest()  # nothing else of the problem differs


def test_what_runs_taught_of_activities_is_planned_with() -> None:
    plain = _prepared().problem
    learned = dataclasses.replace(
        calibration_of(_profile()),
        track_s=120.0,
        activities=(
            ActivityFit("mi", 0.6, 900.0, 300.0, 20_000.0, 4000.0, tried=40, succeeded=24, p_se=0.07),
            ActivityFit(TRACK_START, 0.9, 33.0, 2.0, 400.0, 10.0, tried=40, succeeded=36, p_se=0.05),
        ),
    )
    found = prepare_day(_terrain(), _profile(), _mission(), calibration=learned).problem
    placed = [o for o in found.observations if o.kind is Kind.PLACE]
    assert {(o.p_success, o.time_s.mean, o.energy_j.sd) for o in placed} == {(0.6, 900.0, 4000.0)}
    others = [o for o in plain.observations if o.kind is Kind.IMAGE]
    assert [o for o in found.observations if o.kind is Kind.IMAGE] == others
    assert (found.track_start_time_s, found.track_start_energy_j) == (33.0, 400.0)
    assert found.track_overhead_s_per_leg == 120.0
    before = {(leg.origin, leg.to): leg.p_lose for leg in plain.legs}
    for leg in found.legs:
        for target, p in before[leg.origin, leg.to].items():
            # a track that does not begin is lost on the way from the start, and on no other
            kept = (1.0 - p) * (0.9 if leg.origin == "start" else 1.0)
            assert leg.p_lose[target] == pytest.approx(1.0 - kept, abs=2e-6)
