"""Rendered drives: paths that fit together, errors drawn in rows, figures that see a wrong covariance."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from rover_iface.frames import Transform, wrap_angle
from rover_iface.localization.bundle_adjustment import small_motion
from rover_iface.localization.visual_odometry import Step, StepState
from rover_iface.terrain.generate import generate_terrain
from studies.common.domain_split import Purpose
from studies.common.localization_drive import TiedLeg, flown_draw, kilometre, modelled_draw
from studies.common.odometry_drives import (
    BEND_M,
    PART_M,
    SPOT_RAD,
    STEP_M,
    Drive,
    Flown,
    FlownStep,
    parts_of,
    path_of,
    stops_of,
)
from studies.common.odometry_figures import (
    adjusted_run,
    agreement,
    flown_kilometre,
    kilometre_table,
    steps_told,
)
from tests.seeds import drawn_seed

SIGMA = np.array([1e-3, 1e-3, 1e-3, 4e-3, 4e-3, 4e-3])


def steps(count: int, seed: int, *, told: float = 1.0, scale: float = 0.0) -> list[FlownStep]:
    """Return straight steps with normal errors of `SIGMA`, told as `told` times that."""
    rng = np.random.default_rng(seed)
    true = Transform(np.eye(3), np.array([STEP_M, 0.0, 0.0]))
    out = []
    for _ in range(count):
        off = rng.normal(0.0, SIGMA)
        off[3] += scale * STEP_M
        found = true * Transform.from_rpy(float(off[0]), float(off[1]), float(off[2]), off[3:])
        out.append(
            FlownStep(true, Step(found, np.diag((told * SIGMA) ** 2), StepState.GOOD, 0.0, 90), "straight")
        )
    return out


def drive_of(count: int, seed: int, run: int = 1, *, told: float = 1.0) -> Flown:
    return Flown(Drive(seed, run, "own", STEP_M * count, Purpose.TUNING), steps(count, seed + run, told=told))


def leg(length: float) -> TiedLeg:
    return TiedLeg(np.array([length, 0.0, 0.0]), [], [], False, 0)


def test_two_runs_of_one_ground_share_both_ends_and_no_other_stop() -> None:
    seed = drawn_seed()
    terrain = generate_terrain(3, 64.0, inner_m=8.0, crater=False, outcrop=False, ortho=False)
    one, two = (
        [s.pose for s in stops_of(terrain, Drive(seed, run, "own", 20.0, Purpose.TUNING))] for run in (1, 2)
    )
    assert one[0] == two[0]
    assert one[-1].x == pytest.approx(two[-1].x)
    assert one[-1].y == pytest.approx(two[-1].y)
    assert one[-1].heading == pytest.approx(two[-1].heading)
    assert not {(p.x, p.y) for p in one[1:-1]} & {(p.x, p.y) for p in two[1:-1]}


def test_steps_are_no_longer_than_a_pair_of_pictures_can_tell() -> None:
    terrain = generate_terrain(3, 96.0, inner_m=8.0, crater=False, outcrop=False, ortho=False)
    stops = stops_of(terrain, Drive(drawn_seed(), 1, "own", 60.0, Purpose.TUNING))
    for before, after in itertools.pairwise(stops):
        way = math.hypot(after.pose.x - before.pose.x, after.pose.y - before.pose.y)
        turned = abs(wrap_angle(after.pose.heading - before.pose.heading))
        # 1.5 is what rounding leaves of a short piece; offsets and turns of both stops, at 4 deviations
        assert way < 1.5 * STEP_M + 4 * 0.05 * 2
        assert turned < 1.5 * SPOT_RAD + 4 * math.radians(1.5) * 1.5


def test_a_path_is_as_long_as_asked_for() -> None:
    for length in (8.0, 20.0, 200.0):
        pieces = path_of(drawn_seed(), length)
        gone = sum(abs(a) * (BEND_M if kind == "bend" else 1.0) for kind, a in pieces if kind != "spot")
        assert gone == pytest.approx(length, abs=1e-6)


def test_parts_share_their_ends_and_leave_no_step_out() -> None:
    terrain = generate_terrain(3, 96.0, inner_m=8.0, crater=False, outcrop=False, ortho=False)
    stops = stops_of(terrain, Drive(drawn_seed(), 1, "own", 50.0, Purpose.TUNING))
    parts = parts_of(stops)
    assert [k for part in parts for k in part[1:]] == list(range(1, len(stops)))
    for part in parts:
        ends = stops[part[0]].pose, stops[part[-1]].pose
        assert math.hypot(ends[1].x - ends[0].x, ends[1].y - ends[0].y) < PART_M + STEP_M


def test_the_band_holds_an_honest_covariance_and_not_one_that_is_a_fifth_off() -> None:
    seed = drawn_seed()
    honest, proud = (steps_told(steps(600, seed, told=told)) for told in (1.0, 0.8))
    # four deviations of the mean of 600 steps: a chance of 1 in 16,000
    assert abs(honest["nees"] - 6.0) < 4 * math.sqrt(12 / 600)
    assert proud["nees"] > proud["band"][1]
    assert honest["band"][0] < 6.0 < honest["band"][1]


def test_rows_of_consecutive_steps_are_drawn_as_they_are() -> None:
    drives = [[(s.true, s.step) for s in steps(20, k)] for k in range(3)]
    errors = np.array([[small_motion(true, step.old_from_new) for true, step in drive] for drive in drives])
    drawn, told = flown_draw(drives)(30, np.random.default_rng(drawn_seed()))
    one = int(np.argmin(np.abs(errors - drawn[0]).sum(axis=2).min(axis=1)))
    first = int(np.argmin(np.abs(errors[one] - drawn[0]).sum(axis=1)))
    assert drawn == pytest.approx(errors[one][(first + np.arange(30)) % 20])
    assert told.shape == (30, 6, 6)


def test_a_scale_that_all_steps_share_survives_the_draw_and_not_the_modelled_one() -> None:
    drives = [[(s.true, s.step) for s in steps(40, k, scale=0.02)] for k in range(4)]
    legs = [leg(25.0)] * 10
    rows = kilometre(legs, 1, flown_draw(drives), length_m=240.0, sightings=0)
    alone = kilometre(legs, 1, modelled_draw([one for drive in drives for one in drive]), length_m=240.0)
    along = [(run.odometry[-1] - run.true[-1]) @ run.true[-1] / run.length_m**2 for run in (rows, alone)]
    assert along[0] - along[1] > 0.01


def test_without_the_sun_the_heading_is_what_steps_leave_of_it() -> None:
    drives = [[(s.true, s.step) for s in steps(40, k)] for k in range(4)]
    sun, none = (kilometre([leg(25.0)] * 40, 3, flown_draw(drives), sightings=k) for k in (1, 0))
    spread = [run.adjustment.poses[len(run.true) - 1].covariance[2, 2] ** 0.5 for run in (sun, none)]
    # forty legs: a degree over the square root of sites within reach of the steps' own drift
    assert spread[0] < math.radians(0.6)
    assert spread[1] > 0.8e-3 * math.sqrt(1000 / STEP_M)


def test_two_runs_agree_within_what_they_tell_and_not_when_they_boast() -> None:
    seed = drawn_seed()
    nees: dict[float, list[float]] = {1.0: [], 0.2: []}
    for told, found in nees.items():
        for k in range(8):
            pair = [drive_of(80, seed + 10 * k, run, told=told) for run in (1, 2)]
            runs = [adjusted_run(one, Transform.identity(), sun=False) for one in pair]
            found.append(agreement(*runs)["nees_apart"])
    assert np.mean(nees[1.0]) < 7.0  # 3 expected; 24 degrees of freedom in all
    assert np.mean(nees[0.2]) > 10.0


def test_the_kilometre_tells_of_a_sun_sighted_twice_at_each_site() -> None:
    told = flown_kilometre([drive_of(12, 1)], [leg(25.0)] * 40, 6)
    # the sun's share of the error goes by the root of two, that of steps and scale stays
    assert told["twice_adjusted"]["mean"] < told["sun_adjusted"]["mean"]
    row = next(r for r in kilometre_table(told).splitlines() if "sighted twice" in r)
    assert f"{told['twice_adjusted']['mean']:.2f} %" in row
