"""What may go wrong with a plan, by its expected loss."""

from __future__ import annotations

from typing import Any

import pytest

from ground.reports.failure_modes import failure_modes
from ground.reports.sol_kind_modes import sol_kind_modes
from tests.rover_iface.worlds import small_problem

NAMES = {"T1": "Rock", "T2": "Slab"}


def tree() -> dict[str, Any]:
    rest = [{"op": "navigate", "to": "T2"}, {"op": "observe", "observation": "T2-mi"}]
    return {
        "plan": [
            {"op": "track_start", "target": "T1"},
            {"op": "track_start", "target": "T2"},
            {"op": "navigate", "to": "T1", "p_reached": 1.0},
            {"op": "observe", "observation": "T1-mi", "p_reached": 0.95},
            {
                "op": "branch",
                "options": [
                    {
                        "when": [{"var": "tracked", "target": "T2", "is": True}],
                        "p_taken": 0.6,
                        "plan": [{**step, "p_reached": 0.6} for step in rest],
                    },
                    {
                        "when": [{"var": "tracked", "target": "T2", "is": False}],
                        "p_taken": 0.4,
                        "plan": rest[:1],
                    },
                ],
            },
        ]
    }


def test_losses_are_told_with_chance_and_stake_the_dearest_first() -> None:
    found = failure_modes(tree(), small_problem(), NAMES)
    told = {mode.what: mode for mode in found}
    # by hand, from the chances of the problem: T2 lost on the first leg 0.3, on the second 0.6 * 0.1
    first = told["the track of Slab is lost between start and Rock"]
    assert (first.chance, first.at_stake) == (pytest.approx(0.3), pytest.approx(5.0))
    assert told["the track of Slab is lost between Rock and Slab"].chance == pytest.approx(0.06)
    assert told["the mi of Slab is not come to"].chance == pytest.approx(0.4)
    assert told["the mi of Rock brings nothing usable"].chance == pytest.approx(0.95 * 0.1)
    losses = [mode.expected_loss for mode in found]
    assert losses == sorted(losses, reverse=True)
    assert found[0].what == "the mi of Slab is not come to"


def test_a_track_that_is_no_longer_needed_is_nothing_to_lose() -> None:
    told = [mode.what for mode in failure_modes(tree(), small_problem(), NAMES)]
    assert "the track of Rock is lost between start and Rock" in told
    assert not [what for what in told if "the track of Rock is lost between Rock" in what]


def test_an_empty_plan_cannot_fail_and_the_list_is_cut() -> None:
    assert failure_modes({"plan": []}, small_problem(), NAMES) == []
    assert len(failure_modes(tree(), small_problem(), NAMES, most=2)) == 2


def test_a_drive_that_may_end_short_puts_at_stake_what_the_plan_holds_of_its_place() -> None:
    problem = small_problem()
    for leg in problem["legs"]:
        leg["p_fail"] = 0.2
    told = {mode.what: mode for mode in failure_modes(tree(), problem, NAMES)}
    short = told["the drive from Rock to Slab ends short"]
    # both options drive to Slab: 0.6 and 0.4 of the futures
    assert (short.chance, short.at_stake) == (pytest.approx(0.2), pytest.approx(5.0))


def test_kinds_of_sols_are_named_with_what_they_cost() -> None:
    problem = small_problem()
    problem |= {"format": "problem/2", "hotel_w": 0.0, "precedence": [], "overrun_penalty": 2.0}
    problem["budget"] = {"time_s": 2100.0, "energy_j": 4e5}
    for leg in problem["legs"]:
        leg |= {"time_s": {"mean": 600.0}, "p_lose": {}}
    problem["sol_kinds"] = [
        {"name": "slow", "p": 0.25, "drive_time_factor": 1.5},
        {"name": "quick", "p": 0.1, "drive_time_factor": 0.9},
    ]
    steps = [{"op": "visit", "observation": "T1-img", "target": "T1"}, {"op": "track_start", "target": "T2"}]
    drives = [{"op": "navigate", "to": "T2"}, {"op": "navigate", "to": "T1"}]
    document: Any = {"format": "plan-tree/2", "instance": "small", "plan": [*steps[:1], *drives]}
    (mode,) = sol_kind_modes(document, problem)  # type: ignore[arg-type]  # a document as it is read
    assert (mode.what, mode.chance) == ("the sol is slow", 0.25)
    told = failure_modes(document, problem, NAMES, beside=[mode])  # type: ignore[arg-type]
    assert mode in told
    assert sol_kind_modes(document, small_problem()) == []  # type: ignore[arg-type]
